// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/particles.hpp"
#include "talus/step/boundaries.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>

namespace talus {

/// All that a simulation hands from one step to the next.
template <int Dim, class Real = double>
struct SimulationState {
  double time = 0;                                ///< s
  std::size_t steps = 0;                          ///< made so far
  double time_step = 0;                           ///< δt of the last step, s
  Vec<Dim> gravity = Vec<Dim>::Zero();            ///< m/s²
  Particles<Dim, Real> particles;                 ///< in any order
  Array<Vec<symmetric_size<Dim>>> stress_impulse; ///< λ, #nodes, Pa s: the warm start
  Array<Contact<Dim>> contacts; ///< node, boundary id and impulse of each: the warm start
  Array<RigidState<Dim>> bodies;
  Array<BodyContact<Dim>> body_contacts; ///< node, boundary id, body, point and impulse of each
};

/// Throws std::invalid_argument unless gravity (m/s²), not_given by default, is finite.
template <int Dim>
void check_gravity(const std::string& name, const Vec<Dim>& gravity) {
  constexpr const char* axis_names[] = {".x", ".y", ".z"};
  for (int a = 0; a < Dim; ++a)
    if (!std::isfinite(gravity[a]))
      throw_invalid(name + axis_names[a],
                    std::isnan(gravity[a]) ? "nan, not given" : text_of(gravity[a]),
                    std::string("finite numbers, m/s²; it has no default: ") +
                        (Dim == 2 ? "{0, 0}" : "{0, 0, 0}") + " for none");
}

/// Throws std::invalid_argument unless all ids differ and are below next_id.
template <int Dim, class Real>
void check_ids(const Particles<Dim, Real>& particles) {
  Array<std::size_t> ids = particles.id;
  std::sort(ids.begin(), ids.end());
  if (const auto twice = std::adjacent_find(ids.begin(), ids.end()); twice != ids.end())
    throw_invalid("the id of two particles", *twice, "ids that differ");
  if (!ids.empty() && !(ids.back() < particles.next_id))
    throw_invalid("particles.next_id", particles.next_id,
                  "above the largest id, " + std::to_string(ids.back()));
}

/// Throws std::invalid_argument if a particle is of a material that is none of `materials`.
template <int Dim, class Real>
void check_materials(const Particles<Dim, Real>& particles, int materials) {
  for (const int m : particles.material)
    if (m < 0 || m >= materials)
      throw_invalid("a particle's material", m,
                    "0 to " + std::to_string(materials - 1) + ": indices into the list of " +
                        (materials == 1 ? "one material (several: see Materials)"
                                        : std::to_string(materials) + " materials"));
}

/// Throws std::invalid_argument if particle p is outside the box, has no positive volume or a
/// number that is not finite.
template <int Dim, class Real>
void check_particle(const Particles<Dim, Real>& particles, std::size_t p, const Grid<Dim>& grid) {
  const Vec<Dim> lower = grid.origin(), upper = grid.upper();
  require_positive("a particle's volume", particles.volume[p]);
  for (int a = 0; a < Dim; ++a) {
    require_finite("a particle's velocity", particles.velocity[p][a]);
    const double x = particles.position[p][a];
    if (!(x >= lower[a] && x <= upper[a])) {
      char beyond[32]; // rounding would not be seen in the coordinate itself
      *std::to_chars(beyond, beyond + sizeof beyond - 1, std::max(lower[a] - x, x - upper[a]),
                     std::chars_format::scientific, 1)
           .ptr = '\0';
      throw_invalid("a particle's coordinate", x,
                    std::string("a position in the box of the grid; it is ") + beyond +
                        " m outside");
    }
    for (int b = 0; b < Dim; ++b)
      require_finite("a particle's affine matrix", particles.affine[p](a, b));
    for (int b = 0; !particles.mixed.empty() && b < particles.mixed[p].cols(); ++b)
      require_finite("a particle's mixed derivative", particles.mixed[p](a, b));
  }
}

/// Throws std::invalid_argument if the arrays of the particles differ in size.
template <int Dim, class Real>
void check_sizes(const Particles<Dim, Real>& particles) {
  const auto check_size = [&](const char* name, std::size_t size) {
    if (size != particles.size())
      throw_invalid(std::string("the number of the particles' ") + name, size,
                    std::to_string(particles.size()) + ", that of their positions");
  };
  check_size("velocities", particles.velocity.size());
  check_size("affine matrices", particles.affine.size());
  if (!particles.mixed.empty())
    check_size("mixed derivatives", particles.mixed.size());
  check_size("volumes", particles.volume.size());
  if (!particles.material.empty())
    check_size("materials", particles.material.size());
  check_size("ids", particles.id.size());
}

/// Throws as check_particle, or if the arrays differ in size or two particles have one id. None at
/// all is fine: a box may start empty, and empty.
template <int Dim, class Real>
void check_particles(const Particles<Dim, Real>& particles, const Grid<Dim>& grid) {
  check_sizes(particles);
  check_ids(particles);
  for (std::size_t p = 0; p < particles.size(); ++p)
    check_particle(particles, p, grid);
}

/// Throws as check_particles, but for ids, of the particles whose id is `first_id` or above.
template <int Dim, class Real>
void check_added(const Particles<Dim, Real>& particles, std::size_t first_id,
                 const Grid<Dim>& grid) {
  check_sizes(particles);
  for (std::size_t p = 0; p < particles.size(); ++p)
    if (particles.id[p] >= first_id)
      check_particle(particles, p, grid);
}

/// Throws std::invalid_argument if a particle is refused or the state does not fit the boundaries.
/// nodes: how many there are.
template <int Dim, class Real>
void check_state(const SimulationState<Dim, Real>& state, const Boundaries<Dim>& bounds,
                 int nodes) {
  require_non_negative("state.time", state.time);
  require_positive("state.time_step", state.time_step);
  check_gravity("state.gravity", state.gravity);
  check_particles(state.particles, bounds.grid);
  if (state.stress_impulse.size() != static_cast<std::size_t>(nodes))
    throw_invalid("the number of nodes of the state", state.stress_impulse.size(),
                  std::to_string(nodes));
  for (const auto& stress : state.stress_impulse)
    for (int k = 0; k < symmetric_size<Dim>; ++k)
      require_finite("a node's stress of the state", stress[k]);
  const auto check_impulse = [](const Contact<Dim>& contact) {
    for (int a = 0; a < Dim; ++a)
      require_finite("the impulse of a contact", contact.impulse[a]);
  };
  const int sources = bounds.body_id(0);
  for (const Contact<Dim>& contact : state.contacts) {
    check_impulse(contact);
    if (contact.node < 0 || contact.node >= nodes)
      throw_invalid("the node of a contact", contact.node, "a node of the grid");
    if (contact.boundary_id < 0 || contact.boundary_id >= sources)
      throw_invalid("the boundary id of a contact", contact.boundary_id,
                    "below " + std::to_string(sources));
  }
  if (state.bodies.size() != bounds.bodies.size())
    throw_invalid("the number of bodies of the state", state.bodies.size(),
                  std::to_string(bounds.bodies.size()));
  for (const RigidState<Dim>& body : state.bodies)
    check_rigid_state("a body", body);
  for (const BodyContact<Dim>& contact : state.body_contacts) {
    check_impulse(contact);
    if (contact.body < 0 || contact.body >= static_cast<int>(bounds.bodies.size()))
      throw_invalid("the body of a contact", contact.body, "a body of the simulation");
    const Body<Dim>& body = bounds.bodies[static_cast<std::size_t>(contact.body)];
    if (contact.node < -static_cast<int>(body.corners.size()) || contact.node >= nodes)
      throw_invalid("the node of a contact", contact.node, "a node of the grid, or a corner");
  }
}
template <int Dim, class Real>
void check_state(const SimulationState<Dim, Real>& state, const Boundaries<Dim>& bounds) {
  check_state(state, bounds, bounds.grid.node_count());
}

} // namespace talus
