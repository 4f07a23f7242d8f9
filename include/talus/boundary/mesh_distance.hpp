// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

namespace talus::shapes {

/// The solid that a closed triangle mesh encloses, sampled: signed distances at the nodes of a
/// lattice around it, trilinear in between. A model of SignedDistance<3>, up to an error of about
/// spacing²/(8 r) on surfaces of radius r, and of some tenths of the spacing at edges.
///
/// The winding number Σ Ω/(4π) over the triangles, Ω their solid angles (van Oosterom & Strackee
/// 1983), is a whole number w off a closed surface; a node is inside where w ≠ 0. The mesh may
/// consist of several closed shells. Turned the same way round, they are joined: they may touch,
/// overlap or lie in each other. A shell turned the other way round within another is a cavity.
/// Corners that should be one may be apart by the rounding of float, 2⁻²¹ of their coordinates.
/// Where shells cross, a distance inside the solid may be that to the part of a shell that lies
/// within another; the sign and the distances outside are not touched by that.
/// Cost: nodes times triangles, once; a copy is cheap.
class SampledMesh {
 public:
  /// triangles: corners of each, m; spacing: of the lattice, m, the grid's cell or less.
  /// Throws std::invalid_argument if the mesh is empty, not closed, or needs 1e7 nodes or more, or
  /// a coordinate is not finite.
  SampledMesh(const std::vector<std::array<Vec<3>, 3>>& triangles, double spacing)
      : spacing_(spacing) {
    require_positive("mesh: spacing", spacing);
    if (triangles.empty())
      throw_invalid("mesh: the number of triangles", 0, "at least 1");
    std::vector<Facet> facets;
    lower_ = upper_ = triangles[0][0];
    for (const auto& corners : triangles) {
      const Vec<3> corner_sum = plus<3>(plus<3>(corners[0], corners[1]), corners[2]);
      Facet facet{corners, scaled<3>(1.0 / 3, corner_sum), 0};
      for (const Vec<3>& corner : corners) {
        for (int a = 0; a < 3; ++a) {
          require_finite("mesh: a corner's coordinate", corner[a]);
          lower_[a] = std::min(lower_[a], corner[a]);
          upper_[a] = std::max(upper_[a], corner[a]);
          rounding_ = std::max(rounding_, 0x1p-21 * std::abs(corner[a]));
        }
        facet.radius = std::max(facet.radius, norm<3>(minus<3>(corner, facet.centre)));
      }
      facets.push_back(facet);
    }
    double nodes = 1;
    for (int a = 0; a < 3; ++a) {
      const double cells = std::ceil((upper_[a] - lower_[a]) / spacing) + 2 * margin;
      nodes *= cells + 1;
      if (!(nodes < 1e7))
        throw_invalid("mesh: the number of lattice nodes", nodes,
                      "below 1e7, 80 MB: a larger spacing, or a mesh in metres (the scale of "
                      "read_stl)");
      count_[a] = static_cast<int>(cells) + 1;
    }
    sample(facets);
  }

  double distance(const Vec<3>& x) const {
    Vec<3> place; // from the lattice's corner, in cells
    for (int a = 0; a < 3; ++a)
      place[a] = (x[a] - lower_[a]) / spacing_ + margin;
    Index<3> cell;
    for (int a = 0; a < 3; ++a) {
      if (!(place[a] >= 0 && place[a] <= count_[a] - 1)) // far away: the distance to its box
        return distance_to_box(x);
      cell[a] = std::min(static_cast<int>(place[a]), count_[a] - 2);
      place[a] -= cell[a];
    }
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      Index<3> node = cell;
      double weight = 1;
      for (int a = 0; a < 3; ++a) {
        const int bit = corner >> a & 1;
        node[a] += bit;
        weight *= bit == 1 ? place[a] : 1 - place[a];
      }
      sum += weight * (*values_)[number(node)];
    }
    return sum;
  }

 private:
  static constexpr int margin = 3; ///< cells of the lattice around the mesh

  struct Facet {
    std::array<Vec<3>, 3> corners;
    Vec<3> centre;
    double radius; ///< of a ball about the centre that holds it, m
  };

  double distance_to_box(const Vec<3>& x) const {
    Vec<3> gap;
    for (int a = 0; a < 3; ++a)
      gap[a] = x[a] - std::clamp(x[a], lower_[a], upper_[a]);
    return norm<3>(gap);
  }

  std::size_t number(const Index<3>& node) const {
    return (static_cast<std::size_t>(node[0]) * static_cast<std::size_t>(count_[1]) +
            static_cast<std::size_t>(node[1])) *
               static_cast<std::size_t>(count_[2]) +
           static_cast<std::size_t>(node[2]);
  }

  Vec<3> place(const Index<3>& node) const {
    Vec<3> x = lower_;
    for (int a = 0; a < 3; ++a)
      x[a] += spacing_ * (node[a] - margin);
    return x;
  }

  /// Calls visit(node), along z first.
  template <class Visit>
  void for_each_node(const Visit& visit) const {
    Index<3> node;
    for (node[0] = 0; node[0] < count_[0]; ++node[0])
      for (node[1] = 0; node[1] < count_[1]; ++node[1])
        for (node[2] = 0; node[2] < count_[2]; ++node[2])
          visit(node);
  }

  void sample(std::vector<Facet> facets) {
    std::vector<double> values(static_cast<std::size_t>(count_[0]) *
                               static_cast<std::size_t>(count_[1]) *
                               static_cast<std::size_t>(count_[2]));
    double before = 0;
    for_each_node([&](const Index<3>& node) {
      if (node[2] == 0)
        before = std::numeric_limits<double>::infinity(); // rows begin outside
      const Vec<3> x = place(node);
      const double least = least_distance(facets, x);
      // between nodes that are a step apart lies no surface that is further away than that
      const bool inside =
          std::abs(before) > spacing_ ? before < 0 : is_inside(facets, x, least > near_surface());
      before = values[number(node)] = inside ? -least : least;
    });
    const auto within = [&](const Facet& f) { return is_within_solid(facets, values, f); };
    std::vector<Facet> surface;
    std::remove_copy_if(facets.begin(), facets.end(), std::back_inserter(surface), within);
    if (surface.size() < facets.size())
      for_each_node([&](const Index<3>& node) {
        double& value = values[number(node)];
        if (std::signbit(value)) // also where a shell touches the node: -0
          value = -least_distance(surface, place(node));
      });
    values_ = std::make_shared<const std::vector<double>>(std::move(values));
  }

  /// Where corners are apart by rounding, winding numbers are no whole numbers up to here, m.
  double near_surface() const { return 1e-6 * spacing_ + 8 * rounding_; }

  static double least_distance(const std::vector<Facet>& facets, const Vec<3>& x) {
    double least = std::numeric_limits<double>::infinity();
    for (const Facet& facet : facets)
      if (norm<3>(minus<3>(x, facet.centre)) - facet.radius < least)
        least = std::min(least, distance_to(facet.corners, x));
    return least;
  }

  /// Does all of a facet lie within the solid, where shells touch or overlap? Next to its centre
  /// and corners, on both sides of it.
  bool is_within_solid(const std::vector<Facet>& facets, const std::vector<double>& values,
                       const Facet& facet) const {
    Index<3> cell;
    for (int a = 0; a < 3; ++a)
      cell[a] = static_cast<int>((facet.centre[a] - lower_[a]) / spacing_ + margin);
    for (int corner = 0; corner < 8; ++corner) { // most facets are next to a node outside
      Index<3> node = cell;
      for (int a = 0; a < 3; ++a)
        node[a] += corner >> a & 1;
      if (!std::signbit(values[number(node)]))
        return false;
    }
    const Vec<3> normal = cross_product(minus<3>(facet.corners[1], facet.corners[0]),
                                        minus<3>(facet.corners[2], facet.corners[0]));
    if (!(norm<3>(normal) > 0))
      return false;
    const Vec<3> off = scaled<3>((1e-3 * spacing_ + near_surface()) / norm<3>(normal), normal);
    const auto both_inside = [&](const Vec<3>& x) {
      return is_inside(facets, plus<3>(x, off), false) &&
             is_inside(facets, minus<3>(x, off), false);
    };
    bool within = both_inside(facet.centre);
    for (const Vec<3>& corner : facet.corners) // a little towards the centre
      within = within && both_inside(plus_scaled<3>(scaled<3>(0.99, corner), 0.01, facet.centre));
    return within;
  }

  static double distance_to(const std::array<Vec<3>, 3>& corners, const Vec<3>& x) {
    const Vec<3> ab = minus<3>(corners[1], corners[0]);
    const Vec<3> ac = minus<3>(corners[2], corners[0]);
    const Vec<3> normal = cross_product(ab, ac);
    const double area = norm<3>(normal);
    bool above = area > 0; // x is above the inside of the triangle
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec<3> edge = minus<3>(corners[(k + 1) % 3], corners[k]);
      const Vec<3> to_x = minus<3>(x, corners[k]);
      above = above && dot<3>(cross_product(edge, to_x), normal) >= 0;
      const double length2 = dot<3>(edge, edge);
      const double along = length2 > 0 ? std::clamp(dot<3>(to_x, edge) / length2, 0.0, 1.0) : 0;
      least = std::min(least, norm<3>(plus_scaled<3>(to_x, -along, edge)));
    }
    return above ? std::abs(dot<3>(minus<3>(x, corners[0]), normal)) / area : least;
  }

  /// check: x is not next to the surface, where the winding number may have any value.
  static bool is_inside(const std::vector<Facet>& facets, const Vec<3>& x, bool check) {
    double turns = 0;
    for (const Facet& facet : facets) {
      const Vec<3> a = minus<3>(facet.corners[0], x), b = minus<3>(facet.corners[1], x),
                   c = minus<3>(facet.corners[2], x);
      const double la = norm<3>(a), lb = norm<3>(b), lc = norm<3>(c);
      const double volume = dot<3>(a, cross_product(b, c));
      const double rest = la * lb * lc + dot<3>(a, b) * lc + dot<3>(b, c) * la + dot<3>(c, a) * lb;
      turns += std::atan2(volume, rest) / (2 * std::numbers::pi);
    }
    if (check && !(std::abs(turns - std::round(turns)) < 0.05))
      throw_invalid(
          "mesh: its winding number at (" + text_of(x[0]) + ", " + text_of(x[1]) + ", " +
              text_of(x[2]) + ")",
          turns,
          "whole numbers, as around a closed surface: the mesh is open near there, or its "
          "triangles are not turned alike");
    return std::abs(turns) > 0.5;
  }

  static Vec<3> cross_product(const Vec<3>& a, const Vec<3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }

  double spacing_;
  Vec<3> lower_, upper_; ///< of the mesh, m
  double rounding_ = 0;  ///< how far corners that should be one may be apart, m
  Index<3> count_;       ///< nodes of the lattice
  std::shared_ptr<const std::vector<double>> values_;
};

} // namespace talus::shapes
