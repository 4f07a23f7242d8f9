// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

/// \file
/// Coulomb's law in R^N and the functions that tell how far a pair (γ, λ) is from it. Vectors are
/// (normal, tangent); K_μ = { |τ_T| ≤ μ τ_N }.

namespace talus {

/// Flow without dilatancy:
/// \f[ 0 ≤ λ_N ⊥ γ_N ≥ 0, \quad |λ_T| ≤ μ λ_N, \quad
///     λ_T = −μ λ_N γ_T / |γ_T| \ \text{where}\ γ_T ≠ 0. \f]
struct CoulombLaw {};

/// The convex law that Coulomb's is made of:
/// \f[ K_μ ∋ λ ⊥ \tilde γ ∈ K_{1/μ}, \quad \tilde γ = γ + s\, e_N, \quad s = μ |γ_T|; \f]
/// with this s it is Coulomb's law (de Saxcé); with s frozen it is convex. Callers put s into b_N.
struct AssociatedLaw {};

/// |x_T|, without overflow on the way. x: N.
template <int N, class Scalar>
Scalar tangential_norm(const Vec<N, Scalar>& x) {
  using std::abs, std::sqrt;
  Scalar largest(0), sum(0);
  for (int k = 1; k < N; ++k)
    if (!(abs(x[k]) <= largest)) // a NaN is kept
      largest = abs(x[k]);
  if (largest == 0)
    return largest;
  for (int k = 1; k < N; ++k) {
    const Scalar part = x[k] / largest;
    sum += part * part;
  }
  return largest * sqrt(sum);
}

/// x with 0 in place of x_N.
template <int N, class Scalar>
Vec<N, Scalar> tangential(const Vec<N, Scalar>& x) {
  Vec<N, Scalar> t = x;
  t[0] = 0;
  return t;
}

/// The Fischer–Burmeister function on the Jordan algebra of K_1:
/// \f[ f(x, y) = x + y − (x∘x + y∘y)^{1/2}, \f]
/// zero if and only if K_1 ∋ x ⊥ y ∈ K_1 (Fukushima, Luo & Tseng 2002). x, y: N, not both zero, and
/// such that the fourth powers of their entries neither overflow nor vanish together.
template <int N, class Scalar>
Vec<N, Scalar> fischer_burmeister_unscaled(const Vec<N, Scalar>& x, const Vec<N, Scalar>& y) {
  using std::max, std::sqrt;
  const Scalar a = x[0], b = y[0];
  const Vec<N, Scalar> p = tangential(x), q = tangential(y);
  const Scalar pp = p.squaredNorm(), qq = q.squaredNorm(), pq = p.dot(q);
  // With z = x∘x + y∘y: z_0² − |z_T|² as a sum of squares, since the difference itself would lose
  // half of the digits where z is near the edge of the cone.
  const Scalar x_norm = sqrt(pp), y_norm = sqrt(qq);
  const Scalar x_det = (a - x_norm) * (a + x_norm), y_det = (b - y_norm) * (b + y_norm);
  const Scalar cross = a * b - pq, gram = max(Scalar(0), pp * qq - pq * pq);
  const Vec<N, Scalar> mixed = a * q - b * p;
  const Scalar det =
      x_det * x_det + y_det * y_det + 2 * (cross * cross + gram + mixed.squaredNorm());
  const Scalar s0 = sqrt((a * a + b * b + pp + qq + sqrt(det)) / 2);
  Vec<N, Scalar> f;
  f[0] = a + b - s0;
  for (int k = 1; k < N; ++k)
    f[k] = p[k] + q[k] - (a * p[k] + b * q[k]) / s0;
  return f;
}

/// The same for any x and y.
template <int N, class Scalar>
Vec<N, Scalar> fischer_burmeister(const Vec<N, Scalar>& x, const Vec<N, Scalar>& y) {
  const Scalar scale = std::max(x.cwiseAbs().maxCoeff(), y.cwiseAbs().maxCoeff());
  if (!(scale > 0))
    return scale == 0 ? Vec<N, Scalar>(Vec<N, Scalar>::Zero()) : Vec<N, Scalar>(x + y);
  return scale * fischer_burmeister_unscaled<N, Scalar>(x / scale, y / scale);
}

/// The residual of the associated law, the Fischer–Burmeister function of a pair scaled to K_1:
/// \f[ f_{MFB}(\tilde γ, λ) = f(\hat γ, \hat λ), \quad
///     \hat γ = (\tilde γ_N, μ \tilde γ_T), \quad \hat λ = (μ λ_N, λ_T). \f]
/// γ̃ and λ: N, in one unit. For μ = 0, where that does not see λ_N: (f(γ̃_N, λ_N), λ_T).
template <int N, class Scalar>
Vec<N, Scalar> law_residual(AssociatedLaw, const Vec<N, Scalar>& gamma,
                            const Vec<N, Scalar>& lambda, Scalar friction) {
  if (!(friction > 0)) {
    Vec<N, Scalar> f = lambda;
    const Scalar larger = std::max(gamma[0], lambda[0]), smaller = std::min(gamma[0], lambda[0]);
    const Scalar sum = larger + smaller, size = std::hypot(gamma[0], lambda[0]);
    // a + b − sqrt(a² + b²) = 2ab / (a + b + sqrt(...)), whichever has no difference of like
    // numbers
    f[0] = sum > 0 ? 2 * smaller * (larger / (sum + size)) : sum - size;
    return f;
  }
  Vec<N, Scalar> x = gamma, y = lambda;
  x.template tail<N - 1>() *= friction;
  y[0] *= friction;
  return fischer_burmeister<N, Scalar>(x, y);
}

/// f_MFB of Coulomb's law: the same for γ̃ = γ + μ |γ_T| e_N.
template <int N, class Scalar>
Vec<N, Scalar> law_residual(CoulombLaw, const Vec<N, Scalar>& gamma, const Vec<N, Scalar>& lambda,
                            Scalar friction) {
  Vec<N, Scalar> shifted = gamma;
  shifted[0] += friction * tangential_norm<N, Scalar>(gamma);
  return law_residual(AssociatedLaw{}, shifted, lambda, friction);
}

/// The point of K_μ nearest to x. μ ≥ 0.
template <int N, class Scalar>
Vec<N, Scalar> project_on_cone(const Vec<N, Scalar>& x, Scalar friction) {
  const Scalar tangent = tangential_norm<N, Scalar>(x);
  if (friction * tangent <= -x[0])
    return Vec<N, Scalar>::Zero();
  if (tangent <= friction * x[0])
    return x;
  const Scalar normal = (x[0] + friction * tangent) / (1 + friction * friction);
  Vec<N, Scalar> nearest;
  nearest[0] = normal;
  nearest.template tail<N - 1>() = x.template tail<N - 1>() * (friction * normal / tangent);
  return nearest;
}

/// A check that shares nothing with the solvers:
/// \f[ λ − P_{K_μ}(λ − ρ \tilde γ), \f]
/// zero if and only if the law holds; ρ > 0 brings γ into the unit of λ.
template <int N, class Scalar>
Vec<N, Scalar> natural_residual(AssociatedLaw, const Vec<N, Scalar>& gamma,
                                const Vec<N, Scalar>& lambda, Scalar friction, Scalar rho) {
  return lambda - project_on_cone<N, Scalar>(lambda - rho * gamma, friction);
}
template <int N, class Scalar>
Vec<N, Scalar> natural_residual(CoulombLaw, const Vec<N, Scalar>& gamma,
                                const Vec<N, Scalar>& lambda, Scalar friction, Scalar rho) {
  Vec<N, Scalar> shifted = gamma;
  shifted[0] += friction * tangential_norm<N, Scalar>(gamma);
  return natural_residual(AssociatedLaw{}, shifted, lambda, friction, rho);
}

} // namespace talus
