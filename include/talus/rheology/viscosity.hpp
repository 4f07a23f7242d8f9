// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/rheology.hpp"

#include <concepts>

namespace talus {

/// A rheology with a Newtonian part: `r.viscosity()` → η, Pa s. The stress is
/// \f[ σ = −λ + 2 η D, \quad (D, λ) \ \text{in the yield law}. \f]
template <class R>
concept Viscous = Rheology<R> && requires(const R r) {
  { r.viscosity() } -> std::convertible_to<double>;
};

/// Adds a Newtonian part to a rheology. Its other parameters stand in `.law`.
template <Rheology Law>
class WithViscosity : public Law {
 public:
  struct Params {
    typename Law::Params law{};
    double viscosity = not_given; ///< η, Pa s; ≥ 0
  };

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit WithViscosity(const Params& params) : Law(params.law), viscosity_(params.viscosity) {
    require_given_non_negative("rheology.viscosity", viscosity_);
  }

  double viscosity() const { return viscosity_; }

 private:
  double viscosity_;
};

} // namespace talus
