// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/obstacle.hpp"
#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/solids.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>

namespace talus {

/// A step of at most `step` (s) in which no node that an obstacle holds goes along further than
/// 1.01 cfl cells; `step` itself if a millionth of it is not short enough, as places jump. The
/// other arguments: see cfl_time_step.
template <int Dim>
double without_jumps(double cfl, double step, const Boundaries<Dim>& bounds,
                     const SolidsAtCones<Dim>& solids, const Execution& execution) {
  const Grid<Dim>& grid = bounds.grid;
  constexpr double allowed = 1.01;
  double shorter = step;
  for (int halvings = 0; halvings < 20 && !bounds.obstacles.empty(); ++halvings) {
    double most = 0;
    for (std::size_t o = 0; o < bounds.obstacles.size(); ++o) {
      const RigidState<Dim>& now = solids.frame(o);
      const RigidState<Dim> then = bounds.obstacles[o]->frame(bounds.time + shorter);
      check_rigid_state("an obstacle's frame", then);
      bool moves = false;
      for (int a = 0; a < Dim; ++a) {
        moves = moves || then.position[a] != now.position[a];
        for (int b = 0; b < Dim; ++b)
          moves = moves || then.rotation(a, b) != now.rotation(a, b);
      }
      if (!moves)
        continue;
      solids.for_each_node_near(grid, o, [&](int node) {
        const Vec<Dim> x = grid.node_position(node);
        const Vec<Dim> goes_to =
            plus<Dim>(then.position, product<Dim>(then.rotation, now.in_body(x)));
        double cells = 0; // over what is allowed
        for (int a = 0; a < Dim; ++a)
          cells = std::max(cells, std::abs(goes_to[a] - x[a]) * grid.inverse_spacing()[a] / cfl);
        if (cells > std::max(most, allowed) && solids.at_obstacle(bounds, o, x).contact)
          most = cells;
      });
    }
    if (!(execution.largest(most) > allowed))
      return shorter;
    shorter /= 2;
  }
  return step;
}

/// The longest δt ≤ δt_max with (|u_a| + |g_a| δt) δt ≤ cfl h_a at nodes and corners of bodies, s,
/// and |v_a| δt ≤ cfl h_a at the nodes that obstacles hold, whether there is material yet or not,
/// so that they don't jump into it; for those that are about to start or turn the way until t + δt
/// counts, to 1 %. A body outside of the box may go on until it has come back by
/// that share of a cell; an obstacle outside has no influence. cfl: largest share of a cell to
/// cross in a step, > 0; largest: δt_max, s; solids: where they are; nodes: those of the box;
/// velocity: u*, #nodes of the grid, m/s; gravity: m/s²; partials: workspace. Throws
/// std::invalid_argument if an obstacle gives what is no contact (see check_contact).
template <int Dim>
double cfl_time_step(double cfl, double largest, const Boundaries<Dim>& bounds,
                     const SolidsAtCones<Dim>& solids, const Array<int>& nodes,
                     const Array<NodeVec<Dim>>& velocity, const FreeBodies<Dim>& bodies,
                     const Vec<Dim>& gravity, const Execution& execution, Array<double>& partials) {
  const Grid<Dim>& grid = bounds.grid;
  const auto larger = [](double a, double b) { return std::max(a, b); };
  // 1/δt of a way, m, at a speed and with gravity along an axis
  const auto inverse_time = [&](double way, double speed, int a) {
    return (speed + std::sqrt(speed * speed + 4 * way * std::abs(gravity[a]))) / (2 * way);
  };
  double rate = execution.reduce(
      std::ssize(nodes), partials, 0.0,
      [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        Vec<Dim> fastest = Vec<Dim>::Zero();
        for (std::ptrdiff_t k = begin; k < end; ++k)
          for (int a = 0; a < Dim; ++a)
            fastest[a] = std::max(fastest[a], std::abs(velocity[nodes[k]][a]));
        double of_range = 0;
        for (int a = 0; a < Dim; ++a)
          of_range = std::max(of_range, inverse_time(cfl * grid.spacing()[a], fastest[a], a));
        return of_range;
      },
      larger);
  for (std::size_t o = 0; o < bounds.obstacles.size(); ++o)
    solids.for_each_node_near(grid, o, [&](int node) {
      const Vec<Dim> x = grid.node_position(node);
      const auto held = solids.at_obstacle(bounds, o, x).contact;
      if (!held)
        return;
      check_contact(o, x, *held);
      for (int a = 0; a < Dim; ++a)
        rate = std::max(rate, std::abs(held->velocity[a]) * grid.inverse_spacing()[a] / cfl);
    });
  for (std::size_t b = 0; b < bounds.body_states.size(); ++b) {
    double of_body = 0, to_box = std::numeric_limits<double>::infinity();
    for (int a = 0; a < Dim; ++a) {
      const double speed = std::abs(bounds.body_states[b].velocity[a]) +
                           bounds.body_states[b].angular_velocity.norm() * bodies.radius[b];
      const double way = cfl * grid.spacing()[a];
      of_body = std::max(of_body, inverse_time(way, speed, a));
      const double gap = gap_to_box(grid, bounds.body_states[b].position, bodies.reach[b], a);
      if (gap > 0)
        to_box = std::min(to_box, inverse_time(gap + way, speed, a));
    }
    rate = std::max(rate, std::min(of_body, to_box));
  }
  return without_jumps(cfl, std::min(largest, 1 / execution.largest(rate)), bounds, solids,
                       execution);
}

} // namespace talus
