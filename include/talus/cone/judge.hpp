// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/types.hpp"

namespace talus {

/// A cone problem in natural units, for solvers that need no more than W itself: W in units of
/// tr W / N.
template <class Law, int N, class Scalar>
struct ScaledCone {
  Mat<N, Scalar> w = Mat<N, Scalar>::Identity(); ///< W / scale
  Scalar scale = 0;                              ///< tr W / N; 0: no W at all
  Scalar friction = 0;                           ///< μ

  ScaledCone() = default;
  ScaledCone(const Mat<N, Scalar>& w_given, Scalar mu) : scale(w_given.trace() / N), friction(mu) {
    if (scale > 0)
      w = w_given / scale;
  }
};

/// Says of a solution of a ScaledCone what it is, from the larger of its natural residual and
/// f_MFB relative to |λ| + |b|: a miss if that exceeds the tolerance. λ and b in units in which |b|
/// is of the order of 1.
template <class Law, int N, class Scalar>
LocalReport judge(const ScaledCone<Law, N, Scalar>& cone, const Vec<N, Scalar>& b,
                  const Vec<N, Scalar>& lambda, double tolerance, int iterations) {
  const Scalar mu = cone.friction;
  const Vec<N, Scalar> gamma = cone.w * lambda + b;
  const Scalar size = lambda.norm() + b.norm();
  if (size == 0)
    return {};
  const Scalar natural = natural_residual<N, Scalar>(Law{}, gamma, lambda, mu, Scalar(1)).norm();
  const Scalar fischer_burmeister = law_residual<N, Scalar>(Law{}, gamma, lambda, mu).norm();
  // a NaN in either stays
  const double residual =
      static_cast<double>((fischer_burmeister <= natural ? natural : fischer_burmeister) / size);
  LocalStatus status = LocalStatus::slide;
  if (!(residual <= tolerance))
    status = LocalStatus::not_converged;
  else if (lambda.norm() <= tolerance * size)
    status = LocalStatus::open;
  else if (lambda.template tail<N - 1>().norm() < mu * lambda[0] * (1 - Scalar(1e-6)))
    status = LocalStatus::stick;
  return {status, iterations, residual};
}

} // namespace talus
