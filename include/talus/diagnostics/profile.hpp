// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

/// \file
/// What is measured of a deposit on the floor of the box: free surface, static–flowing line, front,
/// volume. The functions take anything with grid(), volume_fraction(node) and velocity(node), such
/// as a Simulation.

namespace talus {

/// Surface and static zone along x at one place across the channel. Heights above the floor, m.
struct Profile {
  std::vector<double> x;      ///< nodes along x, m
  std::vector<double> height; ///< contour of the volume fraction at one half of the dense one
  /// top of the zone at the base that is slower than the threshold
  std::vector<double> static_height;
  /// what the material lies on, to half a cell: 0 on the floor, more on an obstacle. Empty: 0
  std::vector<double> base{};
};

/// Height above the floor at which `value` falls below `level`, going up one column of nodes from
/// entry `first` of `axis` (that of `node` is overwritten), linear between nodes; that of the first
/// node if it starts below.
template <int Dim, class Value>
double height_of_contour(const Grid<Dim>& grid, Index<Dim> node, int axis, double level,
                         const Value& value, int first = 0) {
  double below = std::numeric_limits<double>::quiet_NaN();
  for (int k = first; k <= grid.cells(axis); ++k) {
    node[axis] = k;
    const double here = value(node);
    if (!(here >= level))
      return grid.spacing()[axis] * (k == first ? k : k - 1 + (below - level) / (below - here));
    below = here;
  }
  return grid.size()[axis];
}

constexpr int middle_row = -1; ///< of nodes across the channel, for measure_profile

/// The profile along x at node row `row` across the channel, 0 to cells(1): 0 is next to the side
/// wall, middle_row the middle one (2-D: ignored). In each column of nodes it is that of the lowest
/// material; where there is none, all heights are 0. static_speed: m/s, what counts as flowing
/// (0.01 m/s in Rousseau et al. 2023). Throws std::invalid_argument for a row that is not there, or
/// unless static_speed is finite and >= 0.
template <class Flow>
Profile measure_profile(const Flow& flow, int row = middle_row, double static_speed = 0.01) {
  constexpr int dim = Flow::dimension, up = up_axis<dim>;
  require_non_negative("measure_profile: static_speed", static_speed);
  const auto& grid = flow.grid();
  if constexpr (dim == 3) {
    if (row == middle_row)
      row = grid.cells(1) / 2;
    if (row < 0 || row > grid.cells(1))
      throw_invalid("measure_profile: row", row,
                    "middle_row, or 0 to " + std::to_string(grid.cells(1)));
  }
  const auto fraction = [&](const Index<dim>& n) { return flow.volume_fraction(n); };
  Profile profile;
  for (int i = 0; i <= grid.cells(0); ++i) {
    Index<dim> node;
    node[0] = i;
    if constexpr (dim == 3)
      node[1] = row;
    const auto dense = [&](int k) {
      node[up] = k;
      return fraction(node) >= 0.5;
    };
    int first = 0; // the lowest node with material
    while (first <= grid.cells(up) && !dense(first))
      ++first;
    if (first > grid.cells(up))
      first = 0;
    const double base = grid.spacing()[up] * first;
    const double surface = height_of_contour(grid, node, up, 0.5, fraction, first);
    const double still = height_of_contour(
        grid, node, up, -static_speed,
        [&](const Index<dim>& n) { return -flow.velocity(n).norm(); }, first);
    profile.x.push_back(grid.node_position(node)[0]);
    profile.height.push_back(surface);
    profile.static_height.push_back(std::min(surface, still));
    profile.base.push_back(base);
  }
  return profile;
}

namespace detail {

/// The last of the rows of nodes across that a margin of so many cells leaves.
inline int last_row(const std::string& what, int cells, int margin) {
  if (margin < 0 || margin >= cells - margin)
    throw_invalid(what + ": margin", margin,
                  "from 0 to below half of the " + std::to_string(cells) + " cells across");
  return cells - margin;
}

} // namespace detail

/// The mean of the profiles of all rows across, those at the sides counted half (2-D: the profile).
/// margin: rows of cells at each side that are left out, as solid side walls are; static_speed:
/// m/s. Throws std::invalid_argument if no row is left, or as measure_profile does.
template <class Flow>
Profile mean_profile(const Flow& flow, int margin = 0, double static_speed = 0.01) {
  if constexpr (Flow::dimension == 2) {
    return measure_profile(flow, middle_row, static_speed);
  } else {
    const int last = detail::last_row("mean_profile", flow.grid().cells(1), margin);
    Profile mean;
    for (int row = margin; row <= last; ++row) {
      const Profile one = measure_profile(flow, row, static_speed);
      const double weight = (row == margin || row == last ? 0.5 : 1.0) / (last - margin);
      if (row == margin) {
        const std::vector<double> zero(one.x.size(), 0);
        mean = {one.x, zero, zero, zero};
      }
      for (std::size_t i = 0; i < one.x.size(); ++i) {
        mean.height[i] += weight * one.height[i];
        mean.static_height[i] += weight * one.static_height[i];
        mean.base[i] += weight * one.base[i];
      }
    }
    return mean;
  }
}

/// The part of a profile beyond x (m). Throws std::invalid_argument if no node is.
inline Profile profile_beyond(const Profile& profile, double x) {
  const auto first = std::ranges::upper_bound(profile.x, x) - profile.x.begin();
  const auto part = [&](const std::vector<double>& values) {
    return std::vector(values.begin() + first, values.end());
  };
  if (first == std::ssize(profile.x))
    throw_invalid("profile_beyond: x", x, "less than that of the profile's last node");
  return {part(profile.x), part(profile.height), part(profile.static_height),
          profile.base.empty() ? profile.base : part(profile.base)};
}

/// Where the deposit ends downstream: the first x at which the surface falls to `level` (m above
/// the floor) after it was above it, linear between nodes; the last node if it never falls, the
/// first if it never is above. Throws std::invalid_argument if the level is not finite.
inline double front_position(const Profile& profile, double level) {
  require_finite("front_position: level", level);
  std::size_t first = 0; // node of the deposit
  while (first < profile.x.size() && !(profile.height[first] > level))
    ++first;
  if (first == profile.x.size())
    return profile.x.front();
  for (std::size_t i = first + 1; i < profile.x.size(); ++i)
    if (!(profile.height[i] > level)) {
      const double above = profile.height[i - 1] - level, below = profile.height[i] - level;
      return profile.x[i - 1] + (profile.x[i] - profile.x[i - 1]) * above / (above - below);
    }
  return profile.x.back();
}

/// Area between the base and the surface, m².
inline double area_under(const Profile& profile) {
  const auto depth = [&](std::size_t i) {
    return profile.height[i] - (profile.base.empty() ? 0 : profile.base[i]);
  };
  double area = 0;
  for (std::size_t i = 1; i < profile.x.size(); ++i)
    area += (profile.x[i] - profile.x[i - 1]) * (depth(i) + depth(i - 1)) / 2;
  return area;
}

/// Volume between the base and the surface: m³ in 3-D, m² in 2-D. margin: rows of cells at each
/// side that are left out, as solid side walls are (2-D: ignored). Throws std::invalid_argument if
/// none is left.
template <class Flow>
double volume_under_surface(const Flow& flow, int margin = 0) {
  if constexpr (Flow::dimension == 2) {
    return area_under(measure_profile(flow));
  } else {
    const int last = detail::last_row("volume_under_surface", flow.grid().cells(1), margin);
    double volume = 0;
    for (int row = margin; row <= last; ++row)
      volume += area_under(measure_profile(flow, row)) * (row == margin || row == last ? 0.5 : 1.0);
    return volume * flow.grid().spacing()[1];
  }
}

/// Mean height of the surface above what the material lies on, m.
template <class Flow>
double mean_surface_height(const Flow& flow) {
  const auto& size = flow.grid().size();
  return volume_under_surface(flow) * size[up_axis<Flow::dimension>] / size.prod();
}

/// Largest speed of a particle, m/s.
template <class Flow>
double largest_speed(const Flow& flow) {
  if constexpr (requires { flow.largest_speed(); }) // of ranks, without gathering particles
    return flow.largest_speed();
  double largest = 0;
  for (const auto& v : flow.particles().velocity)
    largest = std::max(largest, v.template cast<double>().squaredNorm());
  return std::sqrt(largest);
}

/// Last coordinate of the highest particle, m; -infinity without any.
template <class Flow>
double highest_particle(const Flow& flow) {
  if constexpr (requires { flow.highest_particle(); })
    return flow.highest_particle();
  double highest = -std::numeric_limits<double>::infinity();
  for (const auto& x : flow.particles().position)
    highest = std::max<double>(highest, x[up_axis<Flow::dimension>]);
  return highest;
}

/// Largest x of the particles that are not faster than `speed` (m/s), m; -infinity without any.
template <int Dim, class Real>
double farthest_at_rest(const Particles<Dim, Real>& particles, double speed) {
  double farthest = -std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < particles.size(); ++p)
    if (particles.velocity[p].template cast<double>().norm() <= speed)
      farthest = std::max(farthest, particles.position[p][0]);
  return farthest;
}

/// Remembers the last time at which something moved.
class RestDetector {
 public:
  /// threshold: m/s; hold: s without a speed above it that count as rest.
  RestDetector(double threshold, double hold) : threshold_(threshold), hold_(hold) {}

  /// speed: m/s at `time`, s; infinity while something drives the material that will end, such as a
  /// gate that has not left it.
  void update(double time, double speed) {
    time_ = time;
    if (!(speed <= threshold_))
      last_motion_ = time;
  }
  /// Last time with a speed above the threshold, s.
  double last_motion() const { return last_motion_; }
  bool at_rest() const { return time_ - last_motion_ >= hold_; }

 private:
  double threshold_, hold_, time_ = 0, last_motion_ = 0;
};

} // namespace talus
