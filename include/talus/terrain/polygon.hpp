// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/io/bytes.hpp"
#include "talus/io/number.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace talus {

/// An area on a map, bounded by one or more closed lines. A point is inside if a ray from it
/// crosses them an odd number of times, so a ring within a ring is a hole.
class Polygon {
 public:
  using Point = std::array<double, 2>; ///< x, y, m

  /// corners: of one closed line; the last is joined to the first. Throws std::invalid_argument if
  /// there are less than three or a coordinate is not finite.
  void add_ring(std::vector<Point> corners) {
    while (corners.size() > 1 && corners.front() == corners.back()) // closed twice
      corners.pop_back();
    if (corners.size() < 3)
      throw_invalid("polygon: the number of corners of a ring", corners.size(), "at least 3");
    for (const Point& corner : corners)
      for (const double coordinate : corner)
        require_finite("polygon: a corner's coordinate", coordinate);
    for (std::size_t k = 0; k < corners.size(); ++k)
      edges_.push_back({corners[k], corners[(k + 1) % corners.size()]});
  }

  /// The same area with (x, y) where (0, 0) was, m.
  Polygon moved(double x, double y) const {
    Polygon other = *this;
    for (Edge& edge : other.edges_)
      for (Point* end : {&edge.from, &edge.to})
        *end = {(*end)[0] + x, (*end)[1] + y};
    return other;
  }

  bool contains(double x, double y) const {
    bool inside = false;
    for (const auto& [a, b] : edges_)
      if ((a[1] > y) != (b[1] > y) &&
          x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])) // the ray to the east
        inside = !inside;
    return inside;
  }

  /// m: to the nearest edge, negative inside; infinite without a ring.
  double distance(double x, double y) const {
    double least2 = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : edges_) {
      const double ux = b[0] - a[0], uy = b[1] - a[1], px = x - a[0], py = y - a[1];
      const double length2 = ux * ux + uy * uy;
      const double along = length2 > 0 ? std::clamp((px * ux + py * uy) / length2, 0.0, 1.0) : 0.0;
      const double dx = px - along * ux, dy = py - along * uy;
      least2 = std::min(least2, dx * dx + dy * dy);
    }
    return contains(x, y) ? -std::sqrt(least2) : std::sqrt(least2);
  }

  /// Smallest and largest x and y of the corners, m: {{x, y}, {x, y}}.
  std::array<Point, 2> bounds() const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    std::array<Point, 2> box{Point{infinity, infinity}, Point{-infinity, -infinity}};
    for (const Edge& edge : edges_)
      for (const std::size_t a : {0U, 1U}) {
        box[0][a] = std::min(box[0][a], edge.from[a]);
        box[1][a] = std::max(box[1][a], edge.from[a]);
      }
    return box;
  }

 private:
  struct Edge {
    Point from, to;
  };
  std::vector<Edge> edges_;
};

/// Reads a polygon from a text file: a corner a line, x and y (m) with a comma or blanks between
/// them. A blank line ends a ring; lines that begin with # are skipped, and so is a first line of
/// two names. Throws std::runtime_error that names the file, the line, the value and what is
/// allowed if a line is not two numbers as a whole, a ring has less than three corners, or there is
/// none.
inline Polygon read_polygon(const std::filesystem::path& path) {
  const std::string bytes = detail::read_bytes(path);
  std::string_view text = bytes;
  if (text.starts_with("\xef\xbb\xbf")) // byte order mark of UTF-8
    text.remove_prefix(3);
  Polygon polygon;
  std::vector<Polygon::Point> ring;
  std::size_t rings = 0, number = 0;
  const auto fail = [&](const std::string& reason) {
    detail::cannot_read(path, "line " + std::to_string(number) + ": " + reason);
  };
  const auto end_ring = [&] {
    if (ring.empty())
      return;
    try {
      polygon.add_ring(ring);
    } catch (const std::invalid_argument& error) {
      fail(error.what());
    }
    ++rings;
    ring.clear();
  };
  constexpr std::string_view blank = " \t\r\f\v";
  bool content = false; // before this line
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t first = std::min(line.find_first_not_of(blank), line.size());
    line = line.substr(first, line.find_last_not_of(blank) + 1 - first);
    if (line.empty()) {
      end_ring();
      continue;
    }
    if (line.starts_with('#'))
      continue;
    // x, then a comma or blanks, then y
    const std::size_t cut = std::min(line.find_first_of(", \t"), line.size());
    const std::size_t comma = line.find_first_not_of(" \t", cut);
    const bool has_comma = comma != std::string_view::npos && line[comma] == ',';
    const std::size_t second =
        std::min(line.find_first_not_of(" \t", has_comma ? comma + 1 : cut), line.size());
    const auto x = parse_number<double>(line.substr(0, cut));
    const auto y = parse_number<double>(line.substr(second));
    const bool names = !content && !x && !y && line.find_first_of("0123456789") > line.size();
    content = true;
    if (names)
      continue;
    if (!x || !y)
      fail("a corner is \"" + std::string(line) +
           "\"; allowed: two finite numbers, x and y, with a comma or blanks between them");
    ring.push_back({*x, *y});
  }
  end_ring();
  if (rings == 0)
    detail::cannot_read(path, "it holds no corner");
  return polygon;
}

} // namespace talus
