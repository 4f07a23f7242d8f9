// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/terrain/raster.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

/// \file
/// What lies on a terrain, as maps: rasters to be written back in the coordinates of the file.

namespace talus {

/// Calls visit(value of the map's cell, number of the particle) for each particle above a cell of
/// `map`; those on an edge of the map, where closed faces hold them, are above its outermost cells.
/// origin: the point of the map that is (0, 0) in the box, m.
template <class Real, class Visit>
void for_each_particle_in(Raster& map, const Particles<3, Real>& particles, const Vec<2>& origin,
                          const Visit& visit) {
  const double left = map.x - origin[0], lower = map.y - origin[1];
  const auto cell_at = [&](double distance, int count) { // from the first edge, m; -1: beside
    const double place = distance / map.cell;
    const double rounding = 1e-6 * count; // of floats, and of coordinates in UTM
    if (!(place >= -rounding && place <= count + rounding))
      return -1;
    return std::clamp(static_cast<int>(std::floor(place)), 0, count - 1);
  };
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const int column = cell_at(particles.position[p][0] - left, map.columns);
    const int row = cell_at(particles.position[p][1] - lower, map.rows);
    if (column >= 0 && row >= 0)
      visit(map.at(column, row), p);
  }
}

/// Depth of the material over each cell, m, as if dense: Σ V_p / cell² over the particles above it.
/// Its sum times cell² is the volume over the map, to rounding. Cells smaller than those of the
/// grid show single particles. cells: the map whose cells are taken; origin: as above.
template <class Real>
Raster depth_map(const Particles<3, Real>& particles, const Raster& cells, const Vec<2>& origin) {
  Raster map = cells.like(0);
  for_each_particle_in(map, particles, origin, [&](double& depth, std::size_t p) {
    depth += static_cast<double>(particles.volume[p]) / (map.cell * map.cell);
  });
  return map;
}

/// Largest speed of the particles above each cell, m/s; 0 without any.
template <class Real>
Raster speed_map(const Particles<3, Real>& particles, const Raster& cells, const Vec<2>& origin) {
  Raster map = cells.like(0);
  for_each_particle_in(map, particles, origin, [&](double& speed, std::size_t p) {
    speed = std::max(speed, static_cast<double>(particles.velocity[p].norm()));
  });
  return map;
}

} // namespace talus
