// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <optional>

namespace talus {

/// A level floor with a hole: the outlet of a silo. It stands on the lower face of the box, which
/// is free, so that what falls through the hole leaves the simulation. With a sink speed it is a
/// piston that goes down: material leaves at that speed all over the floor.
template <int Dim>
class Floor final : public Obstacle<Dim> {
 public:
  struct Params {
    double height = 0;                  ///< m
    Vec<Dim> centre = Vec<Dim>::Zero(); ///< of the hole, m; its height does not count
    double opening = 0;          ///< diameter of the hole, in 2-D the width of the slot, m; 0: none
    double friction = not_given; ///< μ_w ≥ 0
    double sink_speed = 0;       ///< m/s, downwards
  };

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit Floor(const Params& params) : params_(params) {
    require_finite("floor.height", params_.height);
    for (int a = 0; a < Dim; ++a)
      require_finite("floor.centre", params_.centre[a]);
    require_non_negative("floor.opening", params_.opening);
    require_given_non_negative("floor.friction", params_.friction);
    require_non_negative("floor.sink_speed", params_.sink_speed);
  }

  /// All nodes below half a cell above the floor, but those in the hole.
  std::optional<ObstacleContact<Dim>> contact(const Vec<Dim>& x, const Vec<Dim>& spacing,
                                              double /*time*/) const override {
    constexpr int up = up_axis<Dim>;
    const double from_centre = (x - params_.centre).template head<up>().norm();
    const double slack = 1e-9; // of the opening: positions are sums of rounded numbers
    if (x[up] - params_.height > spacing[up] / 2 || 2 * from_centre < params_.opening * (1 - slack))
      return std::nullopt;
    return ObstacleContact<Dim>{Vec<Dim>::Unit(up), -params_.sink_speed * Vec<Dim>::Unit(up),
                                params_.friction};
  }

  double distance(const Vec<Dim>& x, const Vec<Dim>& /*spacing*/, double /*time*/,
                  const RigidState<Dim>& /*frame*/) const override {
    constexpr int up = up_axis<Dim>;
    const double from_centre = (x - params_.centre).template head<up>().norm();
    return shapes::detail::product_distance<2>(
        {x[up] - params_.height, params_.opening / 2 - from_centre});
  }

 private:
  Params params_;
};

} // namespace talus
