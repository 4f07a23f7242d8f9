// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <cstddef>

/// \file
/// What all particles are together.

namespace talus {

/// Σ V_p, m^d.
template <int Dim, class Real>
double total_volume(const Particles<Dim, Real>& particles) {
  double sum = 0;
  for (const Real volume : particles.volume)
    sum += static_cast<double>(volume);
  return sum;
}

/// Σ V_p x_p / Σ V_p, m; not a number without particles.
template <int Dim, class Real>
Vec<Dim> centre_of_mass(const Particles<Dim, Real>& particles) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (std::size_t p = 0; p < particles.size(); ++p)
    sum += static_cast<double>(particles.volume[p]) * particles.position[p];
  return sum / total_volume(particles);
}

/// Σ V_p v_p / Σ V_p, m/s; not a number without particles.
template <int Dim, class Real>
Vec<Dim> mean_velocity(const Particles<Dim, Real>& particles) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (std::size_t p = 0; p < particles.size(); ++p)
    sum += static_cast<double>(particles.volume[p]) * particles.velocity[p].template cast<double>();
  return sum / total_volume(particles);
}

/// ρ Σ V_p |v_p|²/2, J (2-D: J/m). density: ρ, kg/m³. The motion within a particle (C_p and the
/// mixed derivatives) is not counted.
template <int Dim, class Real>
double kinetic_energy(const Particles<Dim, Real>& particles, double density) {
  double sum = 0;
  for (std::size_t p = 0; p < particles.size(); ++p)
    sum += static_cast<double>(particles.volume[p]) *
           particles.velocity[p].template cast<double>().squaredNorm() / 2;
  return density * sum;
}

/// −ρ Σ V_p g·x_p, J (2-D: J/m); 0 at the origin of the coordinates. density: ρ, kg/m³; gravity:
/// g, m/s².
template <int Dim, class Real>
double potential_energy(const Particles<Dim, Real>& particles, double density,
                        const Vec<Dim>& gravity) {
  double sum = 0;
  for (std::size_t p = 0; p < particles.size(); ++p)
    sum += static_cast<double>(particles.volume[p]) * gravity.dot(particles.position[p]);
  return -density * sum;
}

} // namespace talus
