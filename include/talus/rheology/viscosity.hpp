// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/rheology.hpp"

#include <concepts>

namespace talus {

/// A Newtonian part 2 η D of the stress, and how exactly a step takes it.
struct Viscosity {
  double eta = not_given; ///< η, Pa s; ≥ 0
  /// Of the velocities: root mean square error over the step's velocity scale, see ViscousSolver.
  double tolerance = 1e-6;
  int max_iterations = 1000;

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    require_given_non_negative("rheology.viscosity.eta", eta);
    require_positive("rheology.viscosity.tolerance", tolerance);
    if (max_iterations < 1)
      throw_invalid("rheology.viscosity.max_iterations", max_iterations, "an integer >= 1");
  }
};

/// A rheology with a Newtonian part: `r.viscosity()` → Viscosity. The stress is
/// \f[ σ = −λ + 2 η D, \quad (D, λ) \ \text{in the yield law}. \f]
template <class R>
concept Viscous = Rheology<R> && requires(const R r) {
  { r.viscosity() } -> std::convertible_to<Viscosity>;
};

/// Adds a Newtonian part to a rheology. Its other parameters stand in `.law`.
template <Rheology Law>
class WithViscosity : public Law {
 public:
  struct Params {
    typename Law::Params law{};
    Viscosity viscosity{};
  };

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit WithViscosity(const Params& params) : Law(params.law), viscosity_(params.viscosity) {
    viscosity_.validate();
  }

  const Viscosity& viscosity() const { return viscosity_; }

 private:
  Viscosity viscosity_;
};

} // namespace talus
