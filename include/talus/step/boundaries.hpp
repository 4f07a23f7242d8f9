// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace talus {

/// All that bounds the material during one step: the box, obstacles and free bodies. A view.
///
/// Each has a boundary id: faces first, then obstacles, then bodies. Contacts carry that of what
/// they are with, and wrenches are stored by it.
template <int Dim>
struct Boundaries {
  const Grid<Dim>& grid;
  const Faces<Dim>& faces;
  const std::vector<std::shared_ptr<const Obstacle<Dim>>>& obstacles;
  const std::vector<Body<Dim>>& bodies;
  const Array<RigidState<Dim>>& body_states; ///< #bodies: where they are now
  const Array<double>& body_reach;           ///< #bodies, m: see FreeBodies
  double time;                               ///< s

  static int face_id(int axis, bool upper) { return 2 * axis + (upper ? 1 : 0); }
  static int obstacle_id(std::size_t obstacle) { return 2 * Dim + static_cast<int>(obstacle); }
  int body_id(std::size_t body) const { return obstacle_id(obstacles.size() + body); }
  std::size_t sources() const { return static_cast<std::size_t>(body_id(bodies.size())); }
};

} // namespace talus
