// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

namespace talus {

/// All that bounds the material during one step: the box, obstacles and free bodies. A view.
///
/// Each has a number, its source: faces first, then obstacles, then bodies. Contacts carry the
/// source that they are with, and wrenches are stored by it.
template <int Dim>
struct Boundaries {
  const Grid<Dim>& grid;
  const Faces<Dim>& faces;
  const std::vector<std::shared_ptr<const Obstacle<Dim>>>& obstacles;
  const std::vector<Body<Dim>>& bodies;
  const std::vector<RigidState<Dim>>& body_states; ///< #bodies: where they are now
  const std::vector<double>& body_reach;           ///< #bodies, m: see FreeBodies
  double time;                                     ///< s

  static int face_source(int axis, bool upper) { return 2 * axis + (upper ? 1 : 0); }
  int obstacle_source(std::size_t obstacle) const { return 2 * Dim + static_cast<int>(obstacle); }
  int body_source(std::size_t body) const { return obstacle_source(obstacles.size() + body); }
  std::size_t sources() const { return static_cast<std::size_t>(body_source(bodies.size())); }
};

/// How body b sees a node at x (m).
template <int Dim>
NodeInSolid<Dim> node_in_body(const Boundaries<Dim>& bounds, std::size_t b, const Vec<Dim>& x) {
  const Placed<Dim> body{bounds.bodies[b].shape, bounds.body_states[b]};
  return node_in_solid<Dim>(body, x, bounds.grid.spacing());
}

/// Share of the volume of a node at x (m) that obstacles and bodies leave to the material: at least
/// 0.1, also for what has got into a solid. Throws std::invalid_argument if an obstacle gives
/// something else than a share, or a shape no distance.
template <int Dim>
double open_share(const Boundaries<Dim>& bounds, const Vec<Dim>& x) {
  double share = 1;
  for (std::size_t o = 0; o < bounds.obstacles.size(); ++o) {
    const double of_one = bounds.obstacles[o]->open_share(x, bounds.grid.spacing(), bounds.time);
    check_open_share<Dim>(o, x, of_one);
    share *= of_one;
  }
  for (std::size_t b = 0; b < bounds.bodies.size(); ++b)
    share *= node_in_body(bounds, b, x).open_share;
  return std::max(share, 0.1);
}

} // namespace talus
