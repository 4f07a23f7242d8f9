// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/triangle_tree.hpp"
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
#include <utility>
#include <vector>

namespace talus::shapes {

/// The solid that a closed triangle mesh encloses, sampled: signed distances at the nodes of a
/// lattice around it, trilinear in between, exact farther away. A model of SignedDistance<3>, up to
/// an error of about spacing²/(8 r) on surfaces of radius r, and of some tenths of the spacing at
/// edges.
///
/// The winding number is a whole number w off a closed surface; a node is inside where w ≠ 0. The
/// mesh may consist of several closed shells. Turned the same way round, they are joined: they may
/// touch, overlap or lie in each other. A shell turned the other way round within another is a
/// cavity. Corners that should be one may be apart by the rounding of float, 2⁻²¹ of their
/// coordinates, as long as that is small beside the spacing. Where shells cross, a distance inside
/// the solid may be that to the part of a shell that lies within another; the sign and the
/// distances outside are not touched by that. Cost: once; of n triangles a node next to the surface
/// sees about √n, another one log n (see TriangleTree): seconds for 1e5 triangles on 1e6 nodes. A
/// copy is cheap.
class SampledMesh {
 public:
  /// triangles: corners of each, m; spacing: of the lattice, m, the grid's cell or less.
  /// Throws std::invalid_argument if the mesh is empty, not closed, encloses nothing or needs 1e7
  /// nodes or more, or a coordinate is not finite.
  SampledMesh(const std::vector<std::array<Vec<3>, 3>>& triangles, double spacing)
      : spacing_(spacing) {
    require_positive("mesh: spacing", spacing);
    if (triangles.empty())
      throw_invalid("mesh: the number of triangles", 0, "at least 1");
    lower_ = upper_ = triangles[0][0];
    for (const auto& corners : triangles)
      for (const Vec<3>& corner : corners)
        for (int a = 0; a < 3; ++a) {
          require_finite("mesh: a corner's coordinate", corner[a]);
          lower_[a] = std::min(lower_[a], corner[a]);
          upper_[a] = std::max(upper_[a], corner[a]);
          rounding_ = std::max(rounding_, 0x1p-21 * std::abs(corner[a]));
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
    sample(triangles);
  }

  double distance(const Vec<3>& x) const {
    Vec<3> place; // from the lattice's corner, in cells
    for (int a = 0; a < 3; ++a)
      place[a] = (x[a] - lower_[a]) / spacing_ + margin;
    Index<3> cell;
    for (int a = 0; a < 3; ++a) {
      if (!(place[a] >= 0 && place[a] <= count_[a] - 1))
        return tree_->distance(x);
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

  using Triangle = std::array<Vec<3>, 3>;

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

  void sample(const std::vector<Triangle>& triangles) {
    tree_ = std::make_shared<const detail::TriangleTree>(triangles);
    const detail::TriangleTree& tree = *tree_;
    if (tree.is_closed()) // no corners are apart: that of the arithmetic is left
      rounding_ *= 0x1p-29;
    if (near_surface() > spacing_ / 2)
      throw_invalid("mesh: spacing", spacing_,
                    "above " + text_of(2 * near_surface()) +
                        " for a mesh so far from the origin whose edges do not meet to the bit: "
                        "mend it, or move it to the origin");
    std::vector<double> values(static_cast<std::size_t>(count_[0]) *
                               static_cast<std::size_t>(count_[1]) *
                               static_cast<std::size_t>(count_[2]));
    double before = 0;
    for_each_node([&](const Index<3>& node) {
      if (node[2] == 0)
        before = std::numeric_limits<double>::infinity(); // rows begin outside
      const Vec<3> x = place(node);
      const double least = tree.distance(x, farthest(before));
      // no surface passes between two nodes if it is further away from them than they are apart
      const bool alike = std::abs(before) + least > spacing_ + near_surface();
      const bool inside = alike ? before < 0 : is_inside(x, least > near_surface());
      before = values[number(node)] = inside ? -least : least;
    });
    if (std::none_of(values.begin(), values.end(), [&](double v) { return v < -near_surface(); }) &&
        std::none_of(triangles.begin(), triangles.end(),
                     [&](const Triangle& t) { return is_next_to_solid(t); }))
      throw_invalid("mesh: what its triangles enclose", "nothing",
                    "a closed surface around a solid");
    std::vector<Triangle> surface;
    std::remove_copy_if(triangles.begin(), triangles.end(), std::back_inserter(surface),
                        [&](const Triangle& t) { return is_within_solid(values, t); });
    if (surface.size() < triangles.size()) {
      const detail::TriangleTree outside(surface);
      for_each_node([&](const Index<3>& node) {
        double& value = values[number(node)];
        if (std::signbit(value)) // also where a shell touches the node: -0
          value = -outside.distance(place(node));
      });
    }
    values_ = std::make_shared<const std::vector<double>>(std::move(values));
  }

  /// Above the distance of a node whose neighbour has the distance `before`, m.
  double farthest(double before) const { return (1 + 1e-9) * (std::abs(before) + spacing_); }

  /// Where corners are apart by rounding, winding numbers are no whole numbers up to here, m.
  double near_surface() const { return 1e-6 * spacing_ + 8 * rounding_; }

  /// Off a triangle to the side of its normal, just far enough that winding numbers are whole, m;
  /// zero if it has no area.
  Vec<3> next_to(const Triangle& corners) const {
    const Vec<3> normal = detail::TriangleTree::normal_of(corners);
    const double area = norm<3>(normal);
    return scaled<3>(area > 0 ? (1e-3 * spacing_ + near_surface()) / area : 0, normal);
  }
  static Vec<3> centre_of(const Triangle& corners) {
    return scaled<3>(1.0 / 3, plus<3>(plus<3>(corners[0], corners[1]), corners[2]));
  }

  /// Is there solid on either side of a triangle's centre?
  bool is_next_to_solid(const Triangle& corners) const {
    const Vec<3> centre = centre_of(corners), off = next_to(corners);
    return is_inside(plus<3>(centre, off), false) || is_inside(minus<3>(centre, off), false);
  }

  /// Does all of a triangle lie within the solid, where shells touch or overlap: is solid on both
  /// sides of it at points that are no more than the spacing apart?
  bool is_within_solid(const std::vector<double>& values, const Triangle& corners) const {
    const Vec<3> centre = centre_of(corners), off = next_to(corners);
    Index<3> cell;
    for (int a = 0; a < 3; ++a)
      cell[a] = static_cast<int>((centre[a] - lower_[a]) / spacing_ + margin);
    for (int corner = 0; corner < 8; ++corner) { // most triangles are next to a node outside
      Index<3> node = cell;
      for (int a = 0; a < 3; ++a)
        node[a] += corner >> a & 1;
      if (!std::signbit(values[number(node)]))
        return false;
    }
    if (!(norm<3>(off) > 0))
      return false;
    double longest = 0;
    for (std::size_t k = 0; k < 3; ++k)
      longest = std::max(longest, norm<3>(minus<3>(corners[(k + 1) % 3], corners[k])));
    const int parts = std::max(1, static_cast<int>(std::ceil(longest / spacing_)));
    for (int i = 0; i <= parts; ++i)
      for (int j = 0; i + j <= parts; ++j) {
        Vec<3> x = scaled<3>(0.01, centre); // a little towards it: other triangles begin at edges
        const int of_corner[] = {parts - i - j, i, j};
        for (std::size_t k = 0; k < 3; ++k)
          x = plus_scaled<3>(x, 0.99 * of_corner[k] / parts, corners[k]);
        if (!is_inside(plus<3>(x, off), false) || !is_inside(minus<3>(x, off), false))
          return false;
      }
    return true;
  }

  /// check: x is not next to the surface, where the winding number may have any value.
  bool is_inside(const Vec<3>& x, bool check) const {
    const double turns = tree_->winding_number(x, near_surface());
    if (check && !(std::abs(turns - std::round(turns)) < 0.05))
      throw_invalid(
          "mesh: its winding number at (" + text_of(x[0]) + ", " + text_of(x[1]) + ", " +
              text_of(x[2]) + ")",
          turns,
          "whole numbers, as around a closed surface: the mesh is open near there, or its "
          "triangles are not turned alike");
    return std::abs(turns) > 0.5;
  }

  double spacing_;
  Vec<3> lower_, upper_; ///< of the mesh, m
  double rounding_ = 0;  ///< how far corners that should be one may be apart, m
  Index<3> count_;       ///< nodes of the lattice
  std::shared_ptr<const std::vector<double>> values_;
  std::shared_ptr<const detail::TriangleTree> tree_;
};

} // namespace talus::shapes
