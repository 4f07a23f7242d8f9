// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/step/free_bodies.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace talus {

/// δt = cfl / max_a (|u_a| + |g_a| δt_max)/h_a over nodes and corners of bodies, at most δt_max, s.
/// cfl: largest share of a cell to cross in a step, > 0; largest: δt_max, s; nodes: those of the
/// box; velocity: u*, #nodes of the grid, m/s; gravity: m/s².
template <int Dim>
double cfl_time_step(double cfl, double largest, const Grid<Dim>& grid,
                     const std::vector<int>& nodes, const std::vector<NodeVec<Dim>>& velocity,
                     const FreeBodies<Dim>& bodies, const Vec<Dim>& gravity) {
  double rate = cfl / largest; // cells a second
  for (const int node : nodes)
    for (int a = 0; a < Dim; ++a) {
      const double speed =
          std::abs(velocity[static_cast<std::size_t>(node)][a]) + std::abs(gravity[a]) * largest;
      rate = std::max(rate, speed * grid.inverse_spacing()[a]);
    }
  for (std::size_t b = 0; b < bodies.state.size(); ++b)
    for (int a = 0; a < Dim; ++a) {
      const double speed = std::abs(bodies.state[b].velocity[a]) + std::abs(gravity[a]) * largest +
                           bodies.state[b].angular_velocity.norm() * bodies.radius[b];
      rate = std::max(rate, speed * grid.inverse_spacing()[a]);
    }
  return cfl / rate;
}

/// Takes the warm start to a time step that is `ratio` times the last: impulses are forces times
/// δt. node_stress: λ, #nodes, Pa s.
template <int Dim>
void scale_impulses(double ratio, std::vector<Vec<symmetric_size<Dim>>>& node_stress,
                    DualProblem<Dim>& problem) {
  for (Vec<symmetric_size<Dim>>& stress : node_stress)
    stress *= ratio;
  for (Contact<Dim>& contact : problem.contacts)
    contact.impulse *= ratio;
  for (BodyContact<Dim>& contact : problem.body_contacts)
    contact.impulse *= ratio;
}

} // namespace talus
