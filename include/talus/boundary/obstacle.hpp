// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <memory>
#include <optional>
#include <utility>

namespace talus {

/// Where a rigid obstacle holds the material at a node.
template <int Dim>
struct ObstacleContact {
  Vec<Dim> normal;   ///< unit, towards the material
  Vec<Dim> velocity; ///< of the obstacle at the node, m/s
  double friction;   ///< μ ≥ 0
};

/// A rigid thing in the box whose motion is a given function of time. Nodes on or in it become
/// Coulomb contacts, solved together with the stresses. Derive from it for obstacles of your own.
template <int Dim>
class Obstacle {
 public:
  virtual ~Obstacle() = default;

  /// The contact at node position x (m) at `time` (s), if the obstacle is there. `spacing`: cell
  /// edges, m: an obstacle thinner than a cell must still catch one layer of nodes, or material
  /// leaks through.
  virtual std::optional<ObstacleContact<Dim>> contact(const Vec<Dim>& x, const Vec<Dim>& spacing,
                                                      double time) const = 0;

  /// Share of the volume of the node at x that is outside of the obstacle, in [0, 1]. Without it
  /// material that fills the rest of a node's volume counts as loose, and settles by up to half a
  /// cell on the obstacle. Called from several threads.
  virtual double open_share(const Vec<Dim>& /*x*/, const Vec<Dim>& /*spacing*/,
                            double /*time*/) const {
    return 1;
  }
};

/// An obstacle to put into Simulation::Params: make_obstacle<Gate<2>>({.position = 0.1}). Throws as
/// its constructor does.
template <class AnyObstacle>
std::shared_ptr<const AnyObstacle> make_obstacle(typename AnyObstacle::Params params) {
  return std::make_shared<const AnyObstacle>(std::move(params));
}

} // namespace talus
