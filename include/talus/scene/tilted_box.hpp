// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/faces.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/scene/fill.hpp"

#include <cmath>
#include <numbers>

namespace talus {

/// A box with a level bed that is tilted: the avalanche test of Rousseau et al. 2023. x points
/// downslope, the last axis away from the floor.
struct TiltedBoxSetup {
  double length = 1, width = 0.1, height = 0.3; ///< m; the width is ignored in 2-D
  double bed_depth = 0.1;                       ///< m
  double gravity = 9.81;                        ///< m/s²

  /// Throws std::invalid_argument if a value is out of range or the bed does not fit the box.
  void validate() const {
    require_positive("length", length);
    require_positive("width", width);
    require_positive("height", height);
    require_positive("bed_depth", bed_depth);
    require_non_negative("gravity", gravity);
    if (!(bed_depth <= height))
      throw_invalid("bed_depth", bed_depth, "at most the box's height");
  }

  /// Gravity in the frame of the box, tilted by so many degrees, m/s².
  template <int Dim>
  Vec<Dim> gravity_vector(double tilt_deg) const {
    const double angle = tilt_deg * std::numbers::pi / 180;
    Vec<Dim> g = Vec<Dim>::Zero();
    g[0] = gravity * std::sin(angle);
    g[up_axis<Dim>] = -gravity * std::cos(angle);
    return g;
  }

  /// The box in so many cells along, across and up.
  template <int Dim>
  GridParams<Dim> grid(const Index<3>& cells) const {
    const Vec<3> size(length, width, height);
    GridParams<Dim> params;
    for (int a = 0; a < Dim; ++a) {
      const int from = a == up_axis<Dim> ? 2 : a;
      params.size[a] = size[from];
      params.cells[a] = cells[from];
    }
    return params;
  }

  /// Floor: stick. Sides: slip. Top: open.
  template <int Dim>
  Faces<Dim> faces() const {
    constexpr std::size_t up = up_axis<Dim>;
    auto faces = Faces<Dim>::all({FaceKind::free_slip});
    faces.lower[up] = {FaceKind::no_slip};
    faces.upper[up] = {FaceKind::open};
    return faces;
  }

  /// The bed.
  template <int Dim>
  Particles<Dim> particles(const Grid<Dim>& box, const Seeding& seeding) const {
    Particles<Dim> particles;
    fill_bed(particles, box, bed_depth, seeding);
    return particles;
  }
};

} // namespace talus
