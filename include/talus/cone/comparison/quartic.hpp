// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/judge.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>

namespace talus {

/// Closed form for cones of size 3 (2-D flows). With the notation of SecularSolver, both sides of
/// |D λ_T| = μ |n| times (e_1 + α)(e_2 + α) are polynomials in α for both laws,
/// \f[ p_1 = (a_1 W_{NN} − b_N c_1 − κ α a_1)(e_2 + α) + c_2 (c_1 a_2 − c_2 a_1), \f]
/// p_2 likewise,
/// \f[ q = c_1 a_1 (e_2 + α) + c_2 a_2 (e_1 + α) − b_N (e_1 + α)(e_2 + α), \f]
/// and p_1² + p_2² = μ² q² is a quartic. Its roots by Ferrari's formulas, each polished
/// by one step of Newton's method; of those with α > 0 and λ_N > 0 the one of the least residual.
///
/// Closed forms lose digits where roots are close or of very different sizes: it then misses, and
/// says so (see HybridSolver). Cost: an eigendecomposition of size 2 to prepare; some trigonometry
/// and up to five evaluations to solve. For comparison with the paper; SecularSolver does not miss.
class QuarticSolver {
 public:
  struct Params {
    double tolerance = 1e-10; ///< for the residual of judge()
  };

  template <class Law, int N, class Scalar = double>
  struct Prepared {
    static_assert(N == 3, "QuarticSolver solves cones of size 3 only");
    ScaledCone<Law, N, Scalar> cone;
    Mat<2, Scalar> basis = Mat<2, Scalar>::Identity(); ///< Q, eigenvectors of W_TT
    Vec<2, Scalar> eigenvalues = Vec<2, Scalar>::Ones(), coupling = Vec<2, Scalar>::Zero();
  };

  QuarticSolver() = default;
  /// Throws std::invalid_argument if the tolerance is out of range.
  explicit QuarticSolver(const Params& params) : params_(params) {
    require_positive("solver.local.tolerance", params_.tolerance);
  }

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    Prepared<Law, N, Scalar> p;
    p.cone = {w, friction};
    if (!(p.cone.scale > 0))
      return p;
    // Jacobi's rotation
    const Scalar a = p.cone.w(1, 1), b = p.cone.w(2, 1), d = p.cone.w(2, 2);
    const Scalar angle = std::atan2(2 * b, a - d) / 2, c = std::cos(angle), s = std::sin(angle);
    p.basis << c, -s, s, c;
    const Mat<2, Scalar> turned =
        p.basis.transpose() * p.cone.w.template bottomRightCorner<2, 2>() * p.basis;
    p.eigenvalues = turned.diagonal().cwiseMax(Scalar(0));
    p.coupling = p.basis.transpose() * p.cone.w.template bottomLeftCorner<2, 1>();
    return p;
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const Prepared<Law, N, Scalar>& p, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    constexpr bool associated = std::is_same_v<Law, AssociatedLaw>;
    const Scalar size = b.cwiseAbs().maxCoeff(), mu = p.cone.friction;
    if (!(size > 0) || !(p.cone.scale > 0)) {
      lambda.setZero();
      return {};
    }
    const Vec<3, Scalar> b_scaled = b / size;
    const Vec<2, Scalar> a = p.basis.transpose() * b_scaled.template tail<2>();
    const Scalar b_n = b_scaled[0], w_n = p.cone.w(0, 0);
    if (associated ? mu * a.norm() <= b_n : b_n >= 0) {
      lambda.setZero();
      return {};
    }
    const Scalar kappa = associated ? mu * mu : Scalar(0);
    const Scalar e1 = p.eigenvalues[0], e2 = p.eigenvalues[1];
    const Scalar c1 = p.coupling[0], c2 = p.coupling[1];

    LocalReport report{LocalStatus::not_converged, 0, std::numeric_limits<double>::infinity()};
    Vec<3, Scalar> solution = Vec<3, Scalar>::Zero();
    auto offer = [&](Scalar normal, const Vec<2, Scalar>& tangent) {
      Vec<3, Scalar> x;
      x << normal, p.basis * tangent;
      const LocalReport r = judge<Law, 3, Scalar>(p.cone, b_scaled, x, params_.tolerance, 0);
      if (r.residual < report.residual) {
        report = r;
        solution = x;
      }
    };

    // Stick: −W⁻¹ b, by Cramer's rule on the Schur complement.
    const Scalar schur = w_n * e1 * e2 - c1 * c1 * e2 - c2 * c2 * e1;
    const Scalar stick = (c1 * a[0] * e2 + c2 * a[1] * e1 - b_n * e1 * e2) / schur;
    if (mu == 0) {
      offer(std::max(Scalar(0), -b_n / w_n), Vec<2, Scalar>::Zero());
    } else {
      if (schur > 0 && stick > 0) {
        const Vec<2, Scalar> t(-(a[0] + c1 * stick) / e1, -(a[1] + c2 * stick) / e2);
        if (t.norm() <= mu * stick)
          offer(stick, t);
      }
      if (report.status == LocalStatus::not_converged) {
        const Scalar x = c1 * a[1] - c2 * a[0];
        const Poly<Scalar> p1 =
                               times<Scalar>({a[0] * w_n - b_n * c1, -kappa * a[0], 0}, {e2, 1, 0}),
                           p2 =
                               times<Scalar>({a[1] * w_n - b_n * c2, -kappa * a[1], 0}, {e1, 1, 0});
        const Poly<Scalar> f1{p1[0] + c2 * x, p1[1], p1[2]}, f2{p2[0] - c1 * x, p2[1], p2[2]};
        const Poly<Scalar> q{c1 * a[0] * e2 + c2 * a[1] * e1 - b_n * e1 * e2,
                             c1 * a[0] + c2 * a[1] - b_n * (e1 + e2), -b_n};
        std::array<Scalar, 5> quartic{};
        for (std::size_t i = 0; i < 3; ++i)
          for (std::size_t j = 0; j < 3; ++j)
            quartic[i + j] += f1[i] * f1[j] + f2[i] * f2[j] - mu * mu * q[i] * q[j];
        std::array<Scalar, 4> roots{};
        const int count = solve_quartic(quartic, roots);
        for (int k = 0; k < count; ++k) {
          const Scalar alpha = polish(quartic, roots[static_cast<std::size_t>(k)]);
          if (!(alpha > 0) || !std::isfinite(alpha))
            continue;
          const Scalar r1 = 1 / (e1 + alpha), r2 = 1 / (e2 + alpha);
          const Scalar d = w_n - kappa * alpha - c1 * c1 * r1 - c2 * c2 * r2;
          const Scalar normal = (c1 * a[0] * r1 + c2 * a[1] * r2 - b_n) / d;
          if (normal > 0)
            offer(normal, {-r1 * (a[0] + c1 * normal), -r2 * (a[1] + c2 * normal)});
        }
      }
    }
    lambda = solution * (size / p.cone.scale);
    return report;
  }

 private:
  template <class Scalar>
  using Poly = std::array<Scalar, 3>; ///< coefficients, lowest power first

  /// The product of two polynomials of degree 1.
  template <class Scalar>
  static Poly<Scalar> times(const Poly<Scalar>& x, const Poly<Scalar>& y) {
    return {x[0] * y[0], x[0] * y[1] + x[1] * y[0], x[1] * y[1]};
  }

  /// One step of Newton's method.
  template <class Scalar>
  static Scalar polish(const std::array<Scalar, 5>& f, Scalar x) {
    Scalar value = f[4], slope = 0;
    for (int k = 3; k >= 0; --k) {
      slope = slope * x + value;
      value = value * x + f[static_cast<std::size_t>(k)];
    }
    const Scalar next = x - value / slope;
    return std::isfinite(next) ? next : x;
  }

  /// The real roots of f_0 + f_1 x + … + f_4 x⁴; returns how many (double roots twice).
  template <class Scalar>
  static int solve_quartic(const std::array<Scalar, 5>& f, std::array<Scalar, 4>& roots) {
    using std::sqrt;
    if (f[4] == 0)
      return 0;
    const Scalar a = f[3] / f[4], b = f[2] / f[4], c = f[1] / f[4], d = f[0] / f[4];
    // x = y − a/4: y⁴ + p y² + q y + r = 0
    const Scalar aa = a * a, p = b - Scalar(0.375) * aa, q = c - a * b / 2 + aa * a / 8,
                 r = d - a * c / 4 + aa * b / 16 - 3 * aa * aa / 256;
    // (y² + p/2 + m)² = 2 m y² − q y + (m² + m p + p²/4 − r) is a square on both sides if
    // 8 m³ + 8 p m² + (2 p² − 8 r) m − q² = 0, which has a root m ≥ 0.
    const Scalar m = std::max(Scalar(0), largest_root(p, p * p / 4 - r, -q * q / 8));
    const Scalar s = sqrt(2 * m);
    int count = 0;
    for (const Scalar sign : {Scalar(1), Scalar(-1)}) {
      const Scalar shift =
          s > 0 ? -sign * q / (2 * s) : sign * sqrt(std::max(Scalar(0), p * p / 4 - r));
      // y² − sign s y + p/2 + m − shift = 0
      const Scalar constant = p / 2 + m - shift, disc = s * s / 4 - constant;
      if (!(disc >= 0))
        continue;
      const Scalar root = sqrt(disc), far = sign * (s / 2 + root);
      roots[static_cast<std::size_t>(count++)] = far - a / 4;
      roots[static_cast<std::size_t>(count++)] = (far == 0 ? Scalar(0) : constant / far) - a / 4;
    }
    return count;
  }

  /// The largest real root of x³ + a x² + b x + c.
  template <class Scalar>
  static Scalar largest_root(Scalar a, Scalar b, Scalar c) {
    using std::sqrt;
    const Scalar q = (a * a - 3 * b) / 9, r = (2 * a * a * a - 9 * a * b + 27 * c) / 54;
    Scalar x;
    if (r * r < q * q * q) {
      const Scalar root = sqrt(q);
      const Scalar angle = std::acos(std::clamp(r / (q * root), Scalar(-1), Scalar(1)));
      x = -2 * root * std::cos((angle + 2 * std::numbers::pi_v<Scalar>) / 3);
    } else {
      const Scalar u = -std::copysign(std::cbrt(std::abs(r) + sqrt(r * r - q * q * q)), r);
      x = u == 0 ? Scalar(0) : u + q / u;
    }
    return x - a / 3;
  }

  Params params_{};
};

} // namespace talus
