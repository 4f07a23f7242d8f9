// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/modified.hpp"
#include "talus/rheology/rheology.hpp"

#include <concepts>

namespace talus {

/// A rheology with a Newtonian part: `r.viscosity()` → η, Pa s. The stress is
/// \f[ σ = −λ + 2 η D, \quad (D, λ) \ \text{in the yield law}. \f]
template <class R>
concept Viscous = Rheology<R> && requires(const R r) {
  { r.viscosity() } -> std::convertible_to<double>;
};

/// Adds a Newtonian part to a rheology. Its parameters, with `.viscosity` (η, Pa s; ≥ 0) among
/// them: see rheology/modified.hpp.
template <class Law>
class WithViscosity : public Law {
  static_assert(Rheology<Law>);

 public:
  using Params = ParamsOf<WithViscosity>;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit WithViscosity(const Params& params)
      : Law(params_of_law<Law>(params)), viscosity_(params.viscosity) {
    require_given_non_negative("rheology.viscosity", viscosity_);
  }

  double viscosity() const { return viscosity_; }

 private:
  double viscosity_;
};

} // namespace talus
