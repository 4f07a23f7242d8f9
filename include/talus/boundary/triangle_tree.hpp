// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>
#include <vector>

namespace talus::shapes::detail {

/// Triangles in a tree, each branch cut in two at the median of its longest edge: distances and
/// winding numbers for a small part of the triangles' number each. What is in a branch is in a
/// cylinder along its mean normal, which is flat where the surface is smooth.
///
/// Distance: branches that are further away than a triangle already found are left out.
///
/// Winding number Σ Ω/(4π) over the triangles, Ω their solid angles (van Oosterom & Strackee 1983).
/// From outside of a cylinder, all that is in it is seen as any other surface in it with the same
/// rim is: as the cone over the rim, with the centre as apex (after Jacobson et al. 2013). So n
/// triangles count as the about √n edges on the rim of their patch. That holds for any triangles;
/// edges that have no partner to the bit belong to the rim and cost time alone.
class TriangleTree {
 public:
  using Triangle = std::array<Vec<3>, 3>;

  /// triangles: corners, m, at least one.
  explicit TriangleTree(const std::vector<Triangle>& triangles) {
    for (const Triangle& triangle : triangles)
      corners_.insert(corners_.end(), triangle.begin(), triangle.end());
    std::sort(corners_.begin(), corners_.end(), is_before);
    corners_.erase(std::unique(corners_.begin(), corners_.end()), corners_.end());
    for (const Triangle& triangle : triangles) {
      Facet facet{triangle, {}};
      for (std::size_t k = 0; k < 3; ++k)
        facet.number[k] = static_cast<std::size_t>(
            std::lower_bound(corners_.begin(), corners_.end(), triangle[k], is_before) -
            corners_.begin());
      facets_.push_back(facet);
    }
    build(0, facets_.size());
  }

  /// From x to the nearest triangle, m. bound: above that distance, m: one that is known saves
  /// time.
  double distance(const Vec<3>& x, double bound = std::numeric_limits<double>::infinity()) const {
    double least = bound;
    find_nearest(0, x, least);
    return least;
  }

  /// Twice the area times the unit normal, m².
  static Vec<3> normal_of(const Triangle& corners) {
    return cross_product(minus<3>(corners[1], corners[0]), minus<3>(corners[2], corners[0]));
  }

  /// Has each edge a partner, to the bit?
  bool is_closed() const { return branches_[0].rim.empty(); }

  /// Of the triangles about x: a whole number off a closed surface. margin: next to a cylinder, up
  /// to here, the triangles themselves are counted, m; > 0.
  double winding_number(const Vec<3>& x, double margin) const {
    return half_angle(0, x, margin) / (2 * std::numbers::pi);
  }

 private:
  static constexpr std::size_t leaf = 8; ///< triangles that are not divided any more

  struct Facet {
    Triangle corners;
    std::array<std::size_t, 3> number; ///< of each corner
  };
  /// An edge between two corners, from < to. times: how often it is passed in this direction, less
  /// how often in the other one.
  struct Edge {
    std::size_t from, to;
    int times;
    friend bool operator<(const Edge& a, const Edge& b) {
      return std::tie(a.from, a.to) < std::tie(b.from, b.to);
    }
  };
  struct Branch {
    Vec<3> centre;                        ///< of the cylinder, m
    Vec<3> normal = Vec<3>::Zero();       ///< unit, or zero for what is closed: then it is a ball
    double low = 0, high = 0, radius = 0; ///< of normal · (x − centre), and across, m
    std::size_t begin, end;               ///< its facets
    std::size_t second = 0; ///< branch of its second half, the first is the next one; 0: a leaf
    std::vector<Edge> rim;  ///< sorted
  };

  static bool is_before(const Vec<3>& a, const Vec<3>& b) {
    return std::tie(a[0], a[1], a[2]) < std::tie(b[0], b[1], b[2]);
  }

  /// The branch of the facets begin .. end − 1 alone.
  Branch around(std::size_t begin, std::size_t end) const {
    const auto [lower, upper] = box(begin, end);
    Branch branch;
    branch.centre = scaled<3>(0.5, plus<3>(lower, upper));
    branch.begin = begin;
    branch.end = end;
    for (std::size_t f = begin; f < end; ++f)
      branch.normal = plus<3>(branch.normal, normal_of(facets_[f].corners));
    if (const double area = norm<3>(branch.normal); area > 0)
      branch.normal = scaled<3>(1 / area, branch.normal);
    for (std::size_t f = begin; f < end; ++f)
      for (const Vec<3>& corner : facets_[f].corners) {
        const auto [along, across] = in_cylinder(branch, corner);
        branch.low = std::min(branch.low, along);
        branch.high = std::max(branch.high, along);
        branch.radius = std::max(branch.radius, across);
      }
    return branch;
  }

  /// The lower and the upper corner of the box around the facets begin .. end − 1.
  std::pair<Vec<3>, Vec<3>> box(std::size_t begin, std::size_t end) const {
    Vec<3> lower = facets_[begin].corners[0], upper = lower;
    for (std::size_t f = begin; f < end; ++f)
      for (const Vec<3>& corner : facets_[f].corners)
        for (int a = 0; a < 3; ++a) {
          lower[a] = std::min(lower[a], corner[a]);
          upper[a] = std::max(upper[a], corner[a]);
        }
    return {lower, upper};
  }

  /// Appends the branch of the facets begin .. end − 1 and all below it; returns its number.
  std::size_t build(std::size_t begin, std::size_t end) {
    const std::size_t number = branches_.size();
    branches_.push_back(around(begin, end));
    std::vector<Edge> edges;
    if (end - begin <= leaf) {
      for (std::size_t f = begin; f < end; ++f)
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t from = facets_[f].number[k], to = facets_[f].number[(k + 1) % 3];
          edges.push_back(from < to ? Edge{from, to, 1} : Edge{to, from, -1});
        }
      std::sort(edges.begin(), edges.end());
    } else {
      const auto [lower, upper] = box(begin, end);
      const Vec<3> size = minus<3>(upper, lower);
      const int axis = size[0] >= std::max(size[1], size[2]) ? 0 : size[1] >= size[2] ? 1 : 2;
      const auto place = [axis](const Facet& f) {
        return f.corners[0][axis] + f.corners[1][axis] + f.corners[2][axis];
      };
      const auto at = [this](std::size_t f) {
        return facets_.begin() + static_cast<std::ptrdiff_t>(f);
      };
      const std::size_t middle = begin + (end - begin) / 2;
      std::nth_element(at(begin), at(middle), at(end),
                       [&](const Facet& a, const Facet& b) { return place(a) < place(b); });
      build(begin, middle);
      const std::size_t second = build(middle, end);
      branches_[number].second = second;
      const std::vector<Edge>&one = branches_[number + 1].rim, &other = branches_[second].rim;
      std::merge(one.begin(), one.end(), other.begin(), other.end(), std::back_inserter(edges));
    }
    std::vector<Edge>& rim = branches_[number].rim;
    for (const Edge& edge : edges) {
      const bool again = !rim.empty() && rim.back().from == edge.from && rim.back().to == edge.to;
      if (again)
        rim.back().times += edge.times;
      else
        rim.push_back(edge);
      if (rim.back().times == 0)
        rim.pop_back();
    }
    rim.shrink_to_fit();
    return number;
  }

  /// Of x − centre, m: along the axis, and the distance from it.
  static std::pair<double, double> in_cylinder(const Branch& branch, const Vec<3>& x) {
    const Vec<3> from_centre = minus<3>(x, branch.centre);
    const double along = dot<3>(branch.normal, from_centre);
    return {along, norm<3>(plus_scaled<3>(from_centre, -along, branch.normal))};
  }
  /// From x to the cylinder of a branch, m.
  static double gap(const Branch& branch, const Vec<3>& x) {
    const auto [along, across] = in_cylinder(branch, x);
    const double beyond = std::max({branch.low - along, 0.0, along - branch.high});
    const double beside = std::max(0.0, across - branch.radius);
    return std::sqrt(beyond * beyond + beside * beside);
  }

  void find_nearest(std::size_t number, const Vec<3>& x, double& least) const {
    const Branch& branch = branches_[number];
    if (branch.second == 0) {
      for (std::size_t f = branch.begin; f < branch.end; ++f)
        least = std::min(least, distance_to(facets_[f].corners, x, least));
      return;
    }
    std::size_t near = number + 1, far = branch.second;
    double near_gap = gap(branches_[near], x), far_gap = gap(branches_[far], x);
    if (far_gap < near_gap) {
      std::swap(near, far);
      std::swap(near_gap, far_gap);
    }
    if (near_gap < least)
      find_nearest(near, x, least);
    if (far_gap < least)
      find_nearest(far, x, least);
  }

  /// Σ Ω/2 of a branch.
  double half_angle(std::size_t number, const Vec<3>& x, double margin) const {
    const Branch& branch = branches_[number];
    const bool outside = gap(branch, x) > margin;
    double sum = 0;
    if (outside && branch.rim.size() < branch.end - branch.begin) {
      for (const Edge& edge : branch.rim)
        sum += edge.times * half_angle({branch.centre, corners_[edge.from], corners_[edge.to]}, x);
    } else if (outside || branch.second == 0) {
      for (std::size_t f = branch.begin; f < branch.end; ++f)
        sum += half_angle(facets_[f].corners, x);
    } else {
      sum = half_angle(number + 1, x, margin) + half_angle(branch.second, x, margin);
    }
    return sum;
  }

  static double half_angle(const Triangle& corners, const Vec<3>& x) {
    const Vec<3> a = minus<3>(corners[0], x), b = minus<3>(corners[1], x),
                 c = minus<3>(corners[2], x);
    const double la = norm<3>(a), lb = norm<3>(b), lc = norm<3>(c);
    const double volume = dot<3>(a, cross_product(b, c));
    const double rest = la * lb * lc + dot<3>(a, b) * lc + dot<3>(b, c) * la + dot<3>(c, a) * lb;
    return std::atan2(volume, rest);
  }

  /// Infinite if it is seen at once that it is not below `bound`, m.
  static double distance_to(const Triangle& corners, const Vec<3>& x, double bound) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const Vec<3> normal = normal_of(corners);
    const double area = norm<3>(normal);
    const double height = area > 0 ? std::abs(dot<3>(minus<3>(x, corners[0]), normal)) / area : 0;
    if (!(height < bound))
      return infinity;
    bool above = area > 0; // x is above the inside of the triangle
    double least2 = infinity;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec<3> edge = minus<3>(corners[(k + 1) % 3], corners[k]);
      const Vec<3> to_x = minus<3>(x, corners[k]);
      above = above && dot<3>(cross_product(edge, to_x), normal) >= 0;
      const double length2 = dot<3>(edge, edge);
      const double along = length2 > 0 ? std::clamp(dot<3>(to_x, edge) / length2, 0.0, 1.0) : 0;
      const Vec<3> from_edge = plus_scaled<3>(to_x, -along, edge);
      least2 = std::min(least2, dot<3>(from_edge, from_edge));
    }
    return above ? height : std::sqrt(least2);
  }

  static Vec<3> cross_product(const Vec<3>& a, const Vec<3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }

  std::vector<Vec<3>> corners_; ///< each once, sorted
  std::vector<Facet> facets_;
  std::vector<Branch> branches_; ///< the first is all
};

} // namespace talus::shapes::detail
