// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace talus {

/// Where a rigid obstacle holds the material at a node.
template <int Dim>
struct ObstacleContact {
  Vec<Dim> normal;   ///< unit, towards the material
  Vec<Dim> velocity; ///< of the obstacle at the node, m/s
  double friction;   ///< μ ≥ 0
};

/// How a node sees an obstacle.
template <int Dim>
struct ObstacleAtNode {
  double open_fraction = 1; ///< see Obstacle::open_fraction
  std::optional<ObstacleContact<Dim>> contact;
};

/// A rigid thing in the box whose motion is a given function of time. Nodes on or in it become
/// Coulomb contacts, solved together with the stresses. Derive from it for obstacles of your own:
/// what they give is checked, and what they throw arrives at the caller of step(). contact() is all
/// that must be given. All functions may be called from several threads.
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
  /// cell on the obstacle. Of a node on a face of the box it is asked for what the box has of it:
  /// at h/3 inside, with a spacing of h/√3 along that axis.
  virtual double open_fraction(const Vec<Dim>& /*x*/, const Vec<Dim>& /*spacing*/,
                               double /*time*/) const {
    return 1;
  }

  /// Signed distance (m) of x from the surface, by which free bodies touch it; see SignedDistance.
  /// The friction and velocity that they meet are those of contact() there. Not given: infinity,
  /// bodies pass through it. frame: that at `time`, see frame().
  virtual double distance(const Vec<Dim>& /*x*/, const Vec<Dim>& /*spacing*/, double /*time*/,
                          const RigidState<Dim>& /*frame*/) const {
    return std::numeric_limits<double>::infinity();
  }

  // What saves time. A step asks for the frame once, and for the rest at nodes next to the box.

  /// Where the obstacle's own frame is at `time` (s), and how it moves. Not given: at rest in that
  /// of the grid.
  virtual RigidState<Dim> frame(double /*time*/) const { return {}; }

  /// Half the edges (m) of a box about the origin of that frame: nodes that are 2 Σ_a h_a or more
  /// outside of it along one of its axes are not asked. Infinite: it has no end that way. far: of
  /// the order of 1e6 times the grid, m, for half_box of a shape.
  virtual Vec<Dim> half_box(double /*far*/) const {
    return Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
  }

  /// contact() and open_fraction() at once: what a step calls. frame: that at `time`.
  virtual ObstacleAtNode<Dim> at_node(const Vec<Dim>& x, const Vec<Dim>& spacing, double time,
                                      const RigidState<Dim>& /*frame*/) const {
    return {open_fraction(x, spacing, time), contact(x, spacing, time)};
  }
};

/// Throws std::invalid_argument unless the normal is a unit vector, to a millionth, the velocity is
/// finite and the friction is finite and >= 0. number: of the obstacle; x: of the node, m.
template <int Dim>
void check_contact(std::size_t number, const Vec<Dim>& x, const ObstacleContact<Dim>& contact) {
  double normal2 = 0, speed2 = 0;
  for (int a = 0; a < Dim; ++a) {
    normal2 += contact.normal[a] * contact.normal[a];
    speed2 += contact.velocity[a] * contact.velocity[a];
  }
  const auto refuse = [&](const char* what, double value, const char* allowed) {
    throw_invalid("obstacle " + std::to_string(number) + ": contact at " + place_text<Dim>(x) +
                      ": " + what,
                  value, allowed);
  };
  if (!(std::abs(normal2 - 1) <= 2e-6))
    refuse("|normal|", std::sqrt(normal2), "1");
  if (!std::isfinite(speed2))
    refuse("|velocity|", std::sqrt(speed2), "a finite number");
  if (!(contact.friction >= 0 && std::isfinite(contact.friction)))
    refuse("friction", contact.friction, "a finite number >= 0");
}

/// Throws std::invalid_argument unless 0 <= share <= 1, to a millionth. number: of the obstacle; x:
/// of the node, m.
template <int Dim>
void check_open_share(std::size_t number, const Vec<Dim>& x, double share) {
  if (!(share >= -1e-6 && share <= 1 + 1e-6))
    throw_invalid("obstacle " + std::to_string(number) + ": open_fraction at " + place_text<Dim>(x),
                  share, "a number in [0, 1]");
}

/// An obstacle to put into Simulation::Params: make_obstacle<Gate<2>>({.position = 0.1}). Throws as
/// its constructor does.
template <class AnyObstacle>
std::shared_ptr<const AnyObstacle> make_obstacle(typename AnyObstacle::Params params) {
  return std::make_shared<const AnyObstacle>(std::move(params));
}

/// The same for an obstacle of your own without Params, from what its constructor takes:
/// make_obstacle<Belt>(0.03, 0.2, 0.4).
template <class AnyObstacle, class... Args>
requires(!requires {
  typename AnyObstacle::Params;
}) std::shared_ptr<const AnyObstacle> make_obstacle(Args&&... args) {
  return std::make_shared<const AnyObstacle>(std::forward<Args>(args)...);
}

} // namespace talus
