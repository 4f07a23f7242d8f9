// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/faces.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/scene/fill.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

namespace talus {

/// A column that collapses over an erodible bed in an inclined channel when a gate rises: the
/// experiments of Rousseau et al. 2023. x points downslope, the last axis away from the floor.
struct CollapseSetup {
  double inclination_deg = 0;               ///< of the channel
  double column_length = 0;                 ///< L_0: from the upstream wall to the gate, m
  double column_height = 0;                 ///< H_0, above the bed, m
  double bed_depth = 0;                     ///< m
  double length = 0, width = 0, height = 0; ///< of the channel, m; the width is ignored in 2-D
  double wall_friction = not_given;         ///< μ_w of upstream, downstream and side walls
  bool downstream_sticks = false;           ///< the downstream wall sticks instead
  int side_wall_cells = 0;                  ///< of rigid side walls outside of the width, 3-D; 0:
                                            ///< the faces of the box are the side walls
  double gate_friction = not_given;         ///< μ_D
  double gate_thickness = 0;                ///< m; 0: as thin as the grid resolves
  GateMotion gate{};
  double gravity = 9.81; ///< m/s²

  /// Throws std::invalid_argument if a value is out of range or the column does not fit the
  /// channel.
  void validate() const {
    if (!(std::abs(inclination_deg) < 90))
      throw_invalid("inclination_deg", inclination_deg, "a number in (-90, 90)");
    require_positive("column_length", column_length);
    require_positive("column_height", column_height);
    require_non_negative("bed_depth", bed_depth);
    require_positive("length", length);
    require_positive("height", height);
    require_given_non_negative("wall_friction", wall_friction);
    require_given_non_negative("gate_friction", gate_friction);
    require_non_negative("gravity", gravity);
    if (side_wall_cells < 0)
      throw_invalid("side_wall_cells", side_wall_cells, "an integer >= 0");
    if (!(column_length < length))
      throw_invalid("column_length", column_length, "less than the channel's length");
    if (!(column_height + bed_depth <= height))
      throw_invalid("column_height + bed_depth", column_height + bed_depth,
                    "at most the channel's height");
  }

  /// Gravity in the frame of the channel, m/s².
  template <int Dim>
  Vec<Dim> gravity_vector() const {
    const double angle = inclination_deg * std::numbers::pi / 180;
    Vec<Dim> g = Vec<Dim>::Zero();
    g[0] = gravity * std::sin(angle);
    g[up_axis<Dim>] = -gravity * std::cos(angle);
    return g;
  }

  /// The channel in cells of about the given size, and rigid side walls in more of them. cell: edge
  /// lengths along the channel, across and up, m.
  template <int Dim>
  GridParams<Dim> grid(const Vec<3>& cell) const {
    const Vec<3> channel(length, width, height);
    GridParams<Dim> params;
    for (int a = 0; a < Dim; ++a) {
      const int from = a == up_axis<Dim> ? 2 : a;
      require_positive("a cell's edge", cell[from]);
      require_positive(from == 1 ? "width" : "length or height", channel[from]);
      if (from != 1 && cell[from] > channel[from])
        throw_invalid("a cell's edge", cell[from],
                      "at most the channel's, " + text_of(channel[from]));
      params.size[a] = channel[from];
      params.cells[a] = std::max(1, static_cast<int>(std::lround(channel[from] / cell[from])));
    }
    if constexpr (Dim == 3) {
      const double thickness = side_wall_cells * width / params.cells[1];
      params.origin[1] -= thickness;
      params.size[1] += 2 * thickness;
      params.cells[1] += 2 * side_wall_cells;
    }
    return params;
  }

  /// Floor: stick. Upstream and side walls: frictional (outside of rigid side walls: slip). Top:
  /// open.
  template <int Dim>
  Faces<Dim> faces() const {
    constexpr std::size_t up = up_axis<Dim>;
    const Face wall{FaceKind::frictional, wall_friction};
    Faces<Dim> faces;
    for (std::size_t a = 0; a < up; ++a)
      faces.lower[a] = faces.upper[a] =
          a == 1 && side_wall_cells > 0 ? Face{FaceKind::free_slip} : wall;
    if (downstream_sticks)
      faces.upper[0] = {FaceKind::no_slip};
    faces.lower[up] = {FaceKind::no_slip};
    faces.upper[up] = {FaceKind::open};
    return faces;
  }

  template <int Dim>
  std::shared_ptr<const Gate<Dim>> make_gate() const {
    return make_obstacle<Gate<Dim>>({.position = column_length,
                                     .bottom = bed_depth,
                                     .thickness = gate_thickness,
                                     .friction = gate_friction,
                                     .motion = gate});
  }

  /// The rigid side walls; none if side_wall_cells is 0, and in 2-D.
  template <int Dim>
  std::vector<std::shared_ptr<const Obstacle<Dim>>> make_side_walls() const {
    std::vector<std::shared_ptr<const Obstacle<Dim>>> walls;
    if constexpr (Dim == 3)
      if (side_wall_cells > 0)
        for (const double y : {0.0, width})
          walls.push_back(make_obstacle<ShapeObstacle<3>>(
              {.shape = shapes::HalfSpace<3>({0, y, 0}, {0, y > 0 ? -1.0 : 1.0, 0}),
               .friction = wall_friction}));
    return walls;
  }

  /// Bed and column.
  template <int Dim, class Real = double>
  Particles<Dim, Real> particles(const Grid<Dim>& channel, const Seeding& seeding) const {
    constexpr int up = up_axis<Dim>;
    Particles<Dim, Real> particles;
    Vec<Dim> lower = channel.origin(), upper = channel.upper();
    if (Dim == 3 && side_wall_cells > 0) {
      lower[1] = 0;
      upper[1] = width;
    }
    upper[up] = lower[up] + bed_depth;
    if (bed_depth > 0)
      fill_box(particles, channel, lower, upper, seeding);
    lower[up] += bed_depth;
    upper[up] = lower[up] + column_height;
    upper[0] = lower[0] + column_length;
    Seeding column = seeding;
    ++column.seed; // not the bed's numbers again
    fill_box(particles, channel, lower, upper, column);
    return particles;
  }
};

} // namespace talus
