// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

/// \file
/// The Jordan algebra of the cone K_1 = { |x_T| ≤ x_N } and its Nesterov–Todd scaling, for vectors
/// (normal, tangent) of n numbers, n ≤ 6, anywhere in memory. See Alizadeh & Goldfarb 2003,
/// "Second- order cone programming"; Nesterov & Todd 1997.

namespace talus::jordan {

inline constexpr int largest_size = 6;

inline double dot(const double* x, const double* y, int n) {
  double sum = 0;
  for (int k = 0; k < n; ++k)
    sum += x[k] * y[k];
  return sum;
}
inline double tangent_norm(const double* x, int n) {
  return std::sqrt(dot(x + 1, x + 1, n - 1));
}

/// x_N² − |x_T|².
inline double determinant(const double* x, int n) {
  const double tangent = tangent_norm(x, n);
  return (x[0] - tangent) * (x[0] + tangent);
}
/// The same for a point inside the cone, where rounding may have left nothing of it.
inline double inner_determinant(const double* x, int n) {
  return std::max(determinant(x, n), 1e-15 * x[0] * x[0]);
}

/// x ∘ y = (x·y, x_N y_T + y_N x_T).
inline void product(const double* x, const double* y, int n, double* result) {
  const double normal = dot(x, y, n);
  for (int k = 1; k < n; ++k)
    result[k] = x[0] * y[k] + y[0] * x[k];
  result[0] = normal;
}

/// The q with v ∘ q = r; v inside the cone.
inline void divide(const double* r, const double* v, int n, double* q) {
  const double normal = (v[0] * r[0] - dot(v + 1, r + 1, n - 1)) / inner_determinant(v, n);
  for (int k = 1; k < n; ++k)
    q[k] = (r[k] - normal * v[k]) / v[0];
  q[0] = normal;
}

/// The largest t for which x + t d is in the cone; x is inside.
inline double step_to_boundary(const double* x, const double* d, int n) {
  const double a = determinant(d, n), c = inner_determinant(x, n);
  const double b = 2 * (x[0] * d[0] - dot(x + 1, d + 1, n - 1));
  double t = d[0] < 0 ? -x[0] / d[0] : std::numeric_limits<double>::infinity();
  const double discriminant = b * b - 4 * a * c;
  if (!(discriminant >= 0))
    return t;
  const double q = -0.5 * (b + (b >= 0 ? 1 : -1) * std::sqrt(discriminant));
  for (const double root : {q / a, c / q})
    if (root > 0)
      t = std::min(t, root);
  return t;
}

/// The symmetric W with W z = W⁻¹ x, for x and z inside the cone: W² = η (2 w wᵀ − J),
/// J = diag(1, −1, ...), w_N² − |w_T|² = 1.
struct Scaling {
  double w[largest_size];
  double eta = 1;

  Scaling() = default;
  Scaling(const double* x, const double* z, int n) {
    const double of_x = std::sqrt(inner_determinant(x, n)),
                 of_z = std::sqrt(inner_determinant(z, n));
    const double half = std::sqrt(2 * (1 + dot(x, z, n) / (of_x * of_z)));
    for (int k = 0; k < n; ++k)
      w[k] = (x[k] / of_x + (k == 0 ? 1 : -1) * z[k] / of_z) / half;
    eta = of_x / of_z;
  }

  /// W² v.
  void squared(const double* v, int n, double* result) const {
    const double along = 2 * dot(w, v, n);
    for (int k = 0; k < n; ++k)
      result[k] = eta * (along * w[k] + (k == 0 ? -1 : 1) * v[k]);
  }
  /// W v, or W⁻¹ v.
  void apply(const double* v, int n, bool inverse, double* result) const {
    const double sign = inverse ? -1 : 1, tangents = sign * dot(w + 1, v + 1, n - 1);
    const double size = inverse ? 1 / std::sqrt(eta) : std::sqrt(eta);
    const double along = tangents / (1 + w[0]) + v[0], normal = w[0] * v[0] + tangents;
    for (int k = 1; k < n; ++k)
      result[k] = size * (v[k] + sign * along * w[k]);
    result[0] = size * normal;
  }
};

} // namespace talus::jordan
