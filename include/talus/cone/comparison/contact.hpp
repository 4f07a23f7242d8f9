// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/judge.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <type_traits>

namespace talus {

/// Closed form for an isotropic W = w I, any size of cone: the contact of a mass with a wall.
/// Coulomb: λ_N = max(0, −b_N/w), λ_T = −b_T/w shortened to μ λ_N. Associated: λ = P_K(−b/w).
/// Cost: one norm. Use it where W is known to be isotropic; for any other W it misses, and says so.
class ContactSolver {
 public:
  struct Params {
    double tolerance = 1e-10; ///< for the residual of judge()
  };

  template <class Law, int N, class Scalar = double>
  using Prepared = ScaledCone<Law, N, Scalar>;

  ContactSolver() = default;
  /// Throws std::invalid_argument if the tolerance is out of range.
  explicit ContactSolver(const Params& params) : params_(params) {
    require_positive("solver.local.tolerance", params_.tolerance);
  }

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    return {w, friction};
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const ScaledCone<Law, N, Scalar>& cone, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    const Scalar size = b.cwiseAbs().maxCoeff();
    if (!(size > 0) || !(cone.scale > 0)) {
      lambda.setZero();
      return {};
    }
    const Vec<N, Scalar> stop = -b / size;
    Vec<N, Scalar> x;
    if constexpr (std::is_same_v<Law, AssociatedLaw>) {
      x = project_on_cone<N, Scalar>(stop, cone.friction);
    } else {
      x = stop;
      x[0] = std::max(Scalar(0), stop[0]);
      const Scalar tangent = stop.template tail<N - 1>().norm(), largest = cone.friction * x[0];
      if (tangent > largest)
        x.template tail<N - 1>() *= largest / tangent;
    }
    lambda = x * (size / cone.scale);
    return judge<Law, N, Scalar>(cone, -stop, x, params_.tolerance, 0);
  }

 private:
  Params params_{};
};

} // namespace talus
