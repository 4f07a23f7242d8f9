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

} // namespace talus
