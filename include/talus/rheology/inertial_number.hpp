// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"

#include <cmath>
#include <limits>

namespace talus {

/// The inertial number:
/// \f[ I = \frac{d_g\, f\, ‖D‖}{\sqrt{p/ρ}}, \quad ‖D‖ = \sqrt{D:D/2} \f]
/// where ‖D‖ is half of the shear rate of a simple shear, and the factor f says which measure of
/// the strain rate a law was fitted with. Published parameters depend on that convention: Rousseau
/// et al. 2023 take f = 1 and the density of the medium; Jop, Forterre & Pouliquen 2006, where I_0
/// = 0.279 comes from, f = 2 (the shear rate) and the density of the grains. So nothing has a
/// default.
struct InertialNumber {
  double grain_diameter = 0; ///< d_g, m
  double density = 0;        ///< ρ, kg/m³
  double strain_factor = 0;  ///< f: 1 for half of the shear rate, 2 for the shear rate

  void validate() const {
    require_positive("rheology.inertial.grain_diameter", grain_diameter);
    require_positive("rheology.inertial.density", density);
    require_positive("rheology.inertial.strain_factor", strain_factor);
  }

  /// strain_rate: ‖D‖, 1/s, ≥ 0; pressure: Pa. Without strain 0; with strain but no pressure
  /// infinite.
  double operator()(double strain_rate, double pressure) const {
    if (!(strain_rate > 0))
      return 0;
    const double speed2 = pressure / density;
    if (!(speed2 > 0)) // also by underflow, or 0/0 would follow
      return std::numeric_limits<double>::infinity();
    return grain_diameter * strain_factor * strain_rate / std::sqrt(speed2);
  }
};

} // namespace talus
