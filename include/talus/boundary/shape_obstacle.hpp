// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <optional>
#include <utility>

namespace talus {

/// An obstacle of any shape, at rest or with a prescribed motion: an inclined plate, a hopper, a
/// rotating drum, a plough. What is thinner than two cells counts as two cells thick, so that
/// nothing leaks (see node_in_solid); gaps narrower than a cell may close.
template <int Dim>
class ShapeObstacle final : public Obstacle<Dim> {
 public:
  struct Params {
    Shape<Dim> shape;             ///< in its own frame
    double friction = not_given;  ///< μ_w ≥ 0
    RigidMotion<Dim> motion = {}; ///< where that frame is; nothing: it is the box's, at rest
  };

  /// Throws std::invalid_argument if there is no shape, or the friction is not given, negative or
  /// not finite.
  explicit ShapeObstacle(Params params) : params_(std::move(params)) {
    if (params_.shape.empty())
      throw_invalid("shape_obstacle.shape", "empty", "a model of SignedDistance");
    require_given_non_negative("shape_obstacle.friction", params_.friction);
  }

  /// Place and velocities at `time` (s). Throws std::invalid_argument if the motion gives a number
  /// that is not finite, or no rotation.
  RigidState<Dim> state(double time) const {
    if (!params_.motion)
      return {};
    const RigidState<Dim> now = params_.motion(time);
    check_rigid_state("shape_obstacle.motion", now);
    return now;
  }

  std::optional<ObstacleContact<Dim>> contact(const Vec<Dim>& x, const Vec<Dim>& spacing,
                                              double time) const override {
    return at_node(x, spacing, time, state(time)).contact;
  }

  double open_fraction(const Vec<Dim>& x, const Vec<Dim>& spacing, double time) const override {
    return at_node(x, spacing, time, state(time)).open_fraction;
  }

  double distance(const Vec<Dim>& x, const Vec<Dim>& /*spacing*/, double /*time*/,
                  const RigidState<Dim>& frame) const override {
    return Posed<Dim>{params_.shape, frame}.distance(x);
  }

  RigidState<Dim> frame(double time) const override { return state(time); }
  Vec<Dim> half_box(double far) const override { return talus::half_box<Dim>(params_.shape, far); }

  ObstacleAtNode<Dim> at_node(const Vec<Dim>& x, const Vec<Dim>& spacing, double /*time*/,
                              const RigidState<Dim>& frame) const override {
    const NodeInSolid<Dim> node = node_in_solid<Dim>(Posed<Dim>{params_.shape, frame}, x, spacing);
    ObstacleAtNode<Dim> seen{node.open_fraction, std::nullopt};
    if (node.contact)
      seen.contact = {node.normal, frame.velocity_at(x), params_.friction};
    return seen;
  }

 private:
  Params params_;
};

} // namespace talus
