// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"
#include "talus/terrain/polygon.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>

namespace talus {

/// A number at a place in the box (m), whose last coordinate does not count: the height of a
/// surface, a friction.
template <int Dim>
using GroundFunction = std::function<double(const Vec<Dim>&)>;

/// All that lies below the plane that touches the surface z = height below or above x, with the
/// slope as it is over a cell:
/// ∂z/∂x_a = (height(x + e_a s_a/2) − height(x − e_a s_a/2)) / s_a. A plane is met exactly; at a
/// distance d from a surface of radius r the plane is off by about d²/2r.
/// x: m; cell: s, edges (Dim) of a cell, m. Throws std::invalid_argument where there is no height.
template <int Dim>
shapes::HalfSpace<Dim> ground_at(const GroundFunction<Dim>& height, const Vec<Dim>& x,
                                 const Vec<Dim>& cell) {
  constexpr int up = up_axis<Dim>;
  const auto at = [&](const Vec<Dim>& place) {
    const double z = height(place);
    if (!std::isfinite(z))
      throw_invalid("terrain: the height at " + place_text<Dim>(place), z,
                    "a finite number: the map has no data there");
    return z;
  };
  Vec<Dim> foot = x, normal = Vec<Dim>::Unit(up);
  foot[up] = at(x);
  for (int a = 0; a < up; ++a) {
    Vec<Dim> before = x, after = x;
    before[a] -= cell[a] / 2;
    after[a] += cell[a] / 2;
    normal[a] = (at(before) - at(after)) / cell[a];
  }
  return {foot, normal};
}

/// The ground: all below a surface z = height(x, y), in 2-D y = height(x), solid down to any depth.
/// Nodes see it as they see the plane that touches it below them (ground_at, node_in_solid).
///
///     const BilinearMap height(read_ascii_grid("valley.asc"), origin);
///     params.obstacles = {make_obstacle<Terrain<3>>({.height = height, .friction = 0.3})};
template <int Dim>
class Terrain final : public Obstacle<Dim> {
 public:
  struct Params {
    GroundFunction<Dim> height = {};      ///< m; from several threads
    double friction = not_given;          ///< μ_w ≥ 0, everywhere
    GroundFunction<Dim> friction_at = {}; ///< or μ_w at a place; from several threads
  };

  /// Throws std::invalid_argument without a height, or unless one of friction and friction_at is
  /// given, or if the friction is negative or not finite.
  explicit Terrain(Params params) : params_(std::move(params)) {
    if (!params_.height)
      throw_invalid("terrain.height", "empty", "a function of the place");
    if (!params_.friction_at)
      require_given_non_negative("terrain.friction", params_.friction);
    else if (!std::isnan(params_.friction))
      throw_invalid("terrain.friction", params_.friction, "no number where friction_at is given");
  }

  std::optional<ObstacleContact<Dim>> contact(const Vec<Dim>& x, const Vec<Dim>& spacing,
                                              double time) const override {
    return at_node(x, spacing, time, {}).contact;
  }

  double open_fraction(const Vec<Dim>& x, const Vec<Dim>& spacing, double time) const override {
    return at_node(x, spacing, time, {}).open_fraction;
  }

  ObstacleAtNode<Dim> at_node(const Vec<Dim>& x, const Vec<Dim>& spacing, double /*time*/,
                              const RigidState<Dim>& /*frame*/) const override {
    const NodeInSolid<Dim> node =
        node_in_solid<Dim>(ground_at<Dim>(params_.height, x, spacing), x, spacing);
    ObstacleAtNode<Dim> seen{node.open_fraction, std::nullopt};
    if (node.contact)
      seen.contact = {node.normal, Vec<Dim>::Zero(),
                      params_.friction_at ? friction_at(x) : params_.friction};
    return seen;
  }

  double distance(const Vec<Dim>& x, const Vec<Dim>& spacing, double /*time*/,
                  const RigidState<Dim>& /*frame*/) const override {
    return ground_at<Dim>(params_.height, x, spacing).distance(x);
  }

 private:
  double friction_at(const Vec<Dim>& x) const {
    const double friction = params_.friction_at(x);
    if (!(std::isfinite(friction) && friction >= 0))
      throw_invalid("terrain: the friction at " + place_text<Dim>(x), friction,
                    "a finite number >= 0: the map has no data there, or a wrong one");
    return friction;
  }

  Params params_;
};

/// What lies over an area between two surfaces, such as the ground and the top of what is about to
/// slide: a Region<3>.
class Release {
 public:
  struct Params {
    Polygon area = {};             ///< in the box, m: read_polygon(file).moved(−origin)
    GroundFunction<3> bottom = {}; ///< height of the lower surface, m
    GroundFunction<3> top = {};    ///< and of the upper one, m
    double cell = 0; ///< m: their slopes are taken over it; that of the map, or of the grid
  };

  /// Throws std::invalid_argument without a surface or a cell > 0.
  explicit Release(Params params) : params_(std::move(params)) {
    if (!params_.bottom || !params_.top)
      throw_invalid(params_.bottom ? "release.top" : "release.bottom", "empty",
                    "a function of the place");
    require_positive("release.cell", params_.cell);
  }

  /// Signed distance, m: exact between planes but for edges, else as ground_at. Throws where a
  /// surface has no height, up to a cell around the area.
  double distance(const Vec<3>& x) const {
    const double beside = params_.area.distance(x[0], x[1]);
    if (beside >= params_.cell)
      return beside;
    const Vec<3> cell = Vec<3>::Constant(params_.cell);
    const double above_bottom = ground_at<3>(params_.bottom, x, cell).distance(x);
    const double above_top = ground_at<3>(params_.top, x, cell).distance(x);
    return std::max({beside, -above_bottom, above_top});
  }

 private:
  Params params_;
};

} // namespace talus
