// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/projection_step.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <cmath>

namespace talus {

/// ProjectionStep for Coulomb's law whose de Saxcé term s lags behind the motion,
/// \f[ s ← s + \text{share} \, (μ |γ_T| − s), \quad λ ← P_{K_μ}(λ − (γ + s e_N) / L), \f]
/// a model of LocalStep for GaussSeidel<LaggingSlipStep, CoulombLaw>. Sweeps that go in circles, s
/// pushing λ and λ pushing s, may arrive with it, since with s at rest the problem is convex; those
/// that do not go in circles arrive later. The first step takes s = μ |γ_T|.
class LaggingSlipStep {
 public:
  struct Params {
    double share = 0.02; ///< of the way that s goes in a visit, in (0, 1]
  };

  /// One cone's; s is not known before the first step.
  template <class, int N, class Scalar = double>
  struct Prepared {
    ProjectionStep::Prepared<AssociatedLaw, N, Scalar> step;
    mutable Scalar shift = -1; ///< s, in the unit of γ; < 0: not known
  };

  LaggingSlipStep() = default;
  /// Throws std::invalid_argument if share is out of range.
  explicit LaggingSlipStep(const Params& params) : share_(params.share) {
    if (!(share_ > 0 && share_ <= 1))
      throw_invalid("solver.local.share", share_, "a number in (0, 1]");
  }

  template <int N, class Scalar>
  Prepared<CoulombLaw, N, Scalar> prepare(CoulombLaw, const Mat<N, Scalar>& w,
                                          Scalar friction) const {
    return {ProjectionStep().prepare(AssociatedLaw{}, w, friction), -1};
  }

  /// gamma: W λ + b (N) of the λ on entry.
  template <int N, class Scalar>
  void step(const Prepared<CoulombLaw, N, Scalar>& cone, const Vec<N, Scalar>& gamma,
            Vec<N, Scalar>& lambda) const noexcept {
    using std::sqrt;
    Scalar slip2(0);
    for (int k = 1; k < N; ++k)
      slip2 += gamma[k] * gamma[k];
    const Scalar now = cone.step.friction * sqrt(slip2);
    cone.shift = cone.shift < 0 ? now : cone.shift + share_ * (now - cone.shift);
    Vec<N, Scalar> shifted = gamma;
    shifted[0] += cone.shift;
    ProjectionStep().step(cone.step, shifted, lambda);
  }

 private:
  double share_ = Params{}.share;
};

} // namespace talus
