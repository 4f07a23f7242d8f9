// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/exact_sum.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <cstddef>

/// \file
/// What all particles are together, whatever their order.

namespace talus {

/// Σ V_p term(p).
template <int Dim, class Real, class Term>
double volume_sum(const Particles<Dim, Real>& particles, const Term& term) {
  ExactSum sum;
  for (std::size_t p = 0; p < particles.size(); ++p)
    sum.add(static_cast<double>(particles.volume[p]) * term(p));
  return sum.value();
}

/// Σ V_p, m^d.
template <int Dim, class Real>
double total_volume(const Particles<Dim, Real>& particles) {
  return volume_sum(particles, [](std::size_t) { return 1; });
}

/// The index of a particle's material, see Materials.
template <int Dim, class Real>
int material_of(const Particles<Dim, Real>& particles, std::size_t p) {
  return particles.material.empty() ? 0 : particles.material[p];
}

/// Σ V_p of the particles of one material, m^d. material: its index.
template <int Dim, class Real>
double total_volume(const Particles<Dim, Real>& particles, int material) {
  return volume_sum(particles,
                    [&](std::size_t p) { return material_of(particles, p) == material ? 1 : 0; });
}

/// Σ V_p x_p / Σ V_p, m; not a number without particles.
template <int Dim, class Real>
Vec<Dim> centre_of_mass(const Particles<Dim, Real>& particles) {
  Vec<Dim> sum;
  for (int a = 0; a < Dim; ++a)
    sum[a] = volume_sum(particles, [&](std::size_t p) { return particles.position[p][a]; });
  return sum / total_volume(particles);
}

/// Σ V_p v_p / Σ V_p, m/s; not a number without particles.
template <int Dim, class Real>
Vec<Dim> mean_velocity(const Particles<Dim, Real>& particles) {
  Vec<Dim> sum;
  for (int a = 0; a < Dim; ++a)
    sum[a] = volume_sum(
        particles, [&](std::size_t p) { return static_cast<double>(particles.velocity[p][a]); });
  return sum / total_volume(particles);
}

/// ρ Σ V_p |v_p|²/2, J (2-D: J/m). density: ρ, kg/m³. The motion within a particle (C_p and the
/// mixed derivatives) is not counted.
template <int Dim, class Real>
double kinetic_energy(const Particles<Dim, Real>& particles, double density) {
  return density * volume_sum(particles, [&](std::size_t p) {
           return particles.velocity[p].template cast<double>().squaredNorm() / 2;
         });
}

/// Σ ρ_p V_p |v_p|²/2 of a simulation, ρ_p the density of the particle's material, J (2-D: J/m);
/// else as above. With ranks that of this rank's particles.
template <class Sim>
double kinetic_energy(const Sim& sim) {
  const auto& particles = sim.particles();
  return volume_sum(particles, [&](std::size_t p) {
    return sim.density(material_of(particles, p)) *
           particles.velocity[p].template cast<double>().squaredNorm() / 2;
  });
}

/// −ρ Σ V_p g·x_p, J (2-D: J/m); 0 at the origin of the coordinates. density: ρ, kg/m³; gravity:
/// g, m/s².
template <int Dim, class Real>
double potential_energy(const Particles<Dim, Real>& particles, double density,
                        const Vec<Dim>& gravity) {
  return -density *
         volume_sum(particles, [&](std::size_t p) { return gravity.dot(particles.position[p]); });
}

/// −Σ ρ_p V_p g·x_p of a simulation, with its gravity; else as above and as kinetic_energy.
template <class Sim>
double potential_energy(const Sim& sim) {
  const auto& particles = sim.particles();
  return -volume_sum(particles, [&](std::size_t p) {
    return sim.density(material_of(particles, p)) * sim.gravity().dot(particles.position[p]);
  });
}

} // namespace talus
