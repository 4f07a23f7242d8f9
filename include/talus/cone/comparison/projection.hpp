// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/judge.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <limits>
#include <type_traits>

namespace talus {

/// Projected fixed point for any size of cone:
/// \f[ λ ← P_{K_μ}(λ − ρ \tilde γ), \quad ρ = 1/‖W‖, \f]
/// with γ̃ = W λ + b (+ μ |γ_T| e_N for Coulomb's law). Converges linearly, in about cond(W)
/// iterations for the associated law; for Coulomb's it need not converge for large μ. Reports a
/// miss when the iterations run out. Cost: one product with W and one norm an iteration. For
/// comparison only.
class ProjectionSolver {
 public:
  struct Params {
    double tolerance = 1e-10; ///< for the residual of judge()
    int max_iterations = 1000;
  };

  template <class Law, int N, class Scalar = double>
  using Prepared = ScaledCone<Law, N, Scalar>;

  ProjectionSolver() = default;
  /// Throws std::invalid_argument if a parameter is out of range.
  explicit ProjectionSolver(const Params& params) : params_(params) {
    require_positive("solver.local.tolerance", params_.tolerance);
    if (params_.max_iterations < 1)
      throw_invalid("solver.local.max_iterations", params_.max_iterations, "an integer >= 1");
  }

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    return {w, friction};
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const ScaledCone<Law, N, Scalar>& cone, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    const Scalar size = b.cwiseAbs().maxCoeff(), mu = cone.friction;
    if (!(size > 0) || !(cone.scale > 0)) {
      lambda.setZero();
      return {};
    }
    const Vec<N, Scalar> b_scaled = b / size;
    // Gershgorin's bound of the largest eigenvalue
    const Scalar rho = 1 / cone.w.cwiseAbs().colwise().sum().maxCoeff();
    Vec<N, Scalar> x = lambda / size * cone.scale;
    if (!(x.cwiseAbs().maxCoeff() < 1 / std::numeric_limits<Scalar>::epsilon()))
      x.setZero(); // not a start in these units
    x = project_on_cone<N, Scalar>(x, mu);
    for (int k = 1;; ++k) {
      Vec<N, Scalar> gamma = cone.w * x + b_scaled;
      if constexpr (std::is_same_v<Law, CoulombLaw>)
        gamma[0] += mu * gamma.template tail<N - 1>().norm();
      const Vec<N, Scalar> next = project_on_cone<N, Scalar>(x - rho * gamma, mu);
      const bool settled =
          (next - x).norm() <= params_.tolerance * static_cast<double>(rho) / 4 * (x.norm() + 1);
      x = next;
      if (settled || k == params_.max_iterations) {
        lambda = x * (size / cone.scale);
        return judge<Law, N, Scalar>(cone, b_scaled, x, params_.tolerance, k);
      }
    }
  }

 private:
  Params params_{};
};

} // namespace talus
