// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

/// \file
/// Maps of square cells, and functions of the place made of them. A map keeps the coordinates of
/// its file, 5e5 and 5e6 m in UTM; the box of a simulation has its own. What ties them together is
/// the map's `origin`, the point that is (0, 0) in the box. Heights are the same in both.

namespace talus {

/// One number a square cell, on a plane with x to the east and y to the north.
struct Raster {
  int columns = 0, rows = 0;
  double x = 0, y = 0;        ///< of the south-western corner, m
  double cell = 0;            ///< edge of a cell, m
  std::vector<double> values; ///< #columns · #rows, from the south, each row from the west; not a
                              ///< number where there is none

  /// column: 0 to columns − 1 from the west; row: 0 to rows − 1 from the south.
  std::size_t number(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  double at(int column, int row) const { return values[number(column, row)]; }
  double& at(int column, int row) { return values[number(column, row)]; }

  /// The column and row of the cell that a point (map coordinates, m) is in; of the nearest one for
  /// a point outside.
  std::array<int, 2> cell_of(double px, double py) const {
    const auto clamped = [](double place, int count) {
      return place > 0 ? static_cast<int>(std::min(place, count - 1.0)) : 0;
    };
    return {clamped((px - x) / cell, columns), clamped((py - y) / cell, rows)};
  }

  /// A map of the same cells, all with one value.
  Raster like(double value) const {
    Raster other = *this;
    std::fill(other.values.begin(), other.values.end(), value);
    return other;
  }

  /// Throws std::invalid_argument if it has no cells, another number of values than of cells, or a
  /// corner or an edge that is no number.
  void validate() const {
    if (columns < 1 || rows < 1)
      throw_invalid("raster: columns or rows", std::min(columns, rows), "an integer >= 1");
    require_finite("raster: x", x);
    require_finite("raster: y", y);
    require_positive("raster: cell", cell);
    const std::size_t cells = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    if (values.size() != cells)
      throw_invalid("raster: the number of values", values.size(), text_of(cells));
  }
};

namespace detail {

/// A map in the coordinates of the box. Throws as Raster::validate, and std::invalid_argument if
/// the origin is not finite.
inline std::shared_ptr<const Raster> in_box(Raster map, const Vec<2>& origin) {
  map.validate();
  require_finite("map: origin.x", origin[0]);
  require_finite("map: origin.y", origin[1]);
  map.x -= origin[0];
  map.y -= origin[1];
  return std::make_shared<const Raster>(std::move(map));
}

} // namespace detail

/// A map as a function of the place, with one value a cell: a friction, say. A copy is cheap.
class CellMap {
 public:
  /// origin: the point of the map that is (0, 0) in the box, m. Throws as Raster::validate, and
  /// std::invalid_argument if the origin is not finite.
  CellMap(Raster raster, const Vec<2>& origin)
      : raster_(detail::in_box(std::move(raster), origin)) {}

  /// x, y: in the box, m. The value of the cell there; outside of the map of the nearest one. Not a
  /// number where the map has none.
  double operator()(double x, double y) const {
    const auto [column, row] = raster_->cell_of(x, y);
    return raster_->at(column, row);
  }
  double operator()(const Vec<3>& x) const { return (*this)(x[0], x[1]); }

 private:
  std::shared_ptr<const Raster> raster_;
};

/// A map as a continuous function of the place: heights, say. Its values are those at the middle of
/// the cells, bilinear between them. A copy is cheap.
class BilinearMap {
 public:
  /// origin: the point of the map that is (0, 0) in the box, m. Throws as Raster::validate, and
  /// std::invalid_argument if the origin is not finite or the map has only one row or column.
  BilinearMap(Raster raster, const Vec<2>& origin)
      : raster_(detail::in_box(std::move(raster), origin)) {
    if (raster_->columns < 2 || raster_->rows < 2)
      throw_invalid("bilinear map: columns or rows", std::min(raster_->columns, raster_->rows),
                    "an integer >= 2");
  }

  /// x, y: in the box, m. Beyond the outermost middles it goes on as the cells there do. Not a
  /// number where one of the values that it needs is none.
  double operator()(double x, double y) const {
    const Raster& map = *raster_;
    const double px = (x - map.x) / map.cell - 0.5, py = (y - map.y) / map.cell - 0.5;
    const int i = px > 0 ? static_cast<int>(std::min(px, map.columns - 2.0)) : 0;
    const int j = py > 0 ? static_cast<int>(std::min(py, map.rows - 2.0)) : 0;
    const double u = px - i, v = py - j;
    double sum = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const int right = corner & 1, upper = corner >> 1;
      const double weight = (right == 1 ? u : 1 - u) * (upper == 1 ? v : 1 - v);
      if (weight != 0) // where there is no data next to it
        sum += weight * map.at(i + right, j + upper);
    }
    return sum;
  }
  double operator()(const Vec<3>& x) const { return (*this)(x[0], x[1]); }

 private:
  std::shared_ptr<const Raster> raster_;
};

/// Lowest and highest value of a map; NaN twice if it has none.
inline std::pair<double, double> range_of(const Raster& raster) {
  std::pair<double, double> range{std::numeric_limits<double>::quiet_NaN(),
                                  std::numeric_limits<double>::quiet_NaN()};
  for (const double value : raster.values)
    if (!std::isnan(value)) {
      range.first = value >= range.first ? range.first : value;
      range.second = value <= range.second ? range.second : value;
    }
  return range;
}

/// The height of an open sheet of triangles, such as a scan of the ground, as a map: the z of the
/// sheet over the middle of each cell, of the highest one where several lie over each other; not a
/// number where none does. The map begins at the sheet's lowest x and y.
/// triangles: corners of each, m; cell: edge of the map's cells, m. Throws std::invalid_argument
/// without triangles, for a coordinate that is not finite, or if the map would have 1e8 cells.
inline Raster height_map(const std::vector<std::array<Vec<3>, 3>>& triangles, double cell) {
  require_positive("height_map: cell", cell);
  if (triangles.empty())
    throw_invalid("height_map: the number of triangles", 0, "at least 1");
  Vec<3> lower = triangles[0][0], upper = lower;
  for (const auto& corners : triangles)
    for (const Vec<3>& corner : corners)
      for (int a = 0; a < 3; ++a) {
        require_finite("height_map: a corner's coordinate", corner[a]);
        lower[a] = std::min(lower[a], corner[a]);
        upper[a] = std::max(upper[a], corner[a]);
      }
  const double columns = std::max(1.0, std::round((upper[0] - lower[0]) / cell));
  const double rows = std::max(1.0, std::round((upper[1] - lower[1]) / cell));
  if (!(columns * rows < 1e8))
    throw_invalid("height_map: the number of cells", columns * rows,
                  "below 1e8: larger cells, or a sheet in metres (the scale of read_stl)");
  Raster map{static_cast<int>(columns), static_cast<int>(rows), lower[0], lower[1], cell, {}};
  map.values.assign(static_cast<std::size_t>(columns * rows),
                    std::numeric_limits<double>::quiet_NaN());
  for (const auto& [a, b, c] : triangles) {
    const double ux = b[0] - a[0], uy = b[1] - a[1], vx = c[0] - a[0], vy = c[1] - a[1];
    const double twice_area = ux * vy - uy * vx;
    if (twice_area == 0) // upright: it has no height
      continue;
    const auto [first, south] =
        map.cell_of(std::min({a[0], b[0], c[0]}), std::min({a[1], b[1], c[1]}));
    const auto [last, north] =
        map.cell_of(std::max({a[0], b[0], c[0]}), std::max({a[1], b[1], c[1]}));
    for (int row = south; row <= north; ++row)
      for (int column = first; column <= last; ++column) {
        const double px = map.x + (column + 0.5) * cell - a[0];
        const double py = map.y + (row + 0.5) * cell - a[1];
        const double s = (px * vy - py * vx) / twice_area, t = (ux * py - uy * px) / twice_area;
        constexpr double rounding = 1e-9; // no gap between triangles that share an edge
        if (s < -rounding || t < -rounding || s + t > 1 + rounding)
          continue;
        const double z = a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]);
        double& highest = map.at(column, row);
        highest = z <= highest ? highest : z;
      }
  }
  return map;
}

} // namespace talus
