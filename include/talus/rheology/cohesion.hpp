// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/modified.hpp"
#include "talus/rheology/rheology.hpp"

#include <concepts>
#include <limits>

namespace talus {

/// A rheology with cohesion: `r.cohesion()` → c ≥ 0, Pa. The yield criterion is
/// \f[ ‖\mathrm{Dev}\, λ‖ ≤ μ p + c, \quad λ = −σ, \quad ‖τ‖ = \sqrt{τ:τ/2}, \f]
/// a cone whose apex lies at the tension −p = c/μ; flow and opening stay those of the cone law for
/// λ' = λ + (c/μ) I. It acts where the medium is dense (see Packing): what has come apart is loose.
/// For the Mohr–Coulomb constants in plane strain, μ = sin φ and c = c_MC cos φ.
template <class R>
concept Cohesive = Rheology<R> && requires(const R r) {
  { r.cohesion() } -> std::convertible_to<double>;
};

/// Adds cohesion to a rheology. Its parameters, with `.cohesion` (c, Pa; ≥ 0) among them: see
/// rheology/modified.hpp.
template <class Law>
class WithCohesion : public Law {
  static_assert(Rheology<Law>);
  static_assert(!OfMaterials<Law>, "cohesion by material: Materials<WithCohesion<Law>>");

 public:
  using Params = ParamsOf<WithCohesion>;

  /// Throws std::invalid_argument if a parameter is out of range, or if there is cohesion but no
  /// friction: that cone has no apex. If the law sees more than I, the step tells that.
  explicit WithCohesion(const Params& params)
      : Law(params_of_law<Law>(params)), cohesion_(params.cohesion) {
    require_given_non_negative("rheology.cohesion", cohesion_);
    if constexpr (!sees_more<Law>)
      for (const double I : {0.0, std::numeric_limits<double>::infinity()})
        if (cohesion_ > 0 && !(this->friction(I) > 0))
          throw_invalid("rheology.cohesion", cohesion_, "0 where there is no friction");
  }

  double cohesion() const { return cohesion_; }

 private:
  double cohesion_;
};

} // namespace talus
