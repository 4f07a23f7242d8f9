// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/signed_distance.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>

namespace talus {

/// A part of space that can be filled with particles. A model R has one of
///   - `r.distance(x)` → m, x: Vec<Dim> in m: a signed distance, negative inside, 1-Lipschitz. All
///     solids of boundary/shapes.hpp are regions.
///   - `r(x)` → bool: whether x is inside; a lambda, say.
/// Prefer a distance: the region's volume comes out more exactly, and filling is faster.
template <class R, int Dim>
concept Region = requires(const R& region, const Vec<Dim>& x) {
  { region.distance(x) } -> std::convertible_to<double>;
}
|| requires(const R& region, const Vec<Dim>& x) {
  { region(x) } -> std::convertible_to<bool>;
};

/// Is x (m) inside? Throws std::invalid_argument where the region gives no distance.
template <int Dim, Region<Dim> R>
bool contains(const R& region, const Vec<Dim>& x) {
  if constexpr (requires { region.distance(x); })
    return distance_to<Dim>(region, x) < 0;
  else
    return region(x);
}

/// Share in [0, 1] of the small box around x (m) with edges `size` (Dim, m) that is inside the
/// region. With a distance s: 1/2 − s/w, at least 0 and at most 1, w the largest change of s over
/// an edge: exact for a plane along an axis, and for any other of the right mean over neighbouring
/// boxes. Without: 0 or 1, by x alone.
template <int Dim, Region<Dim> R>
double share_inside(const R& region, const Vec<Dim>& x, const Vec<Dim>& size) {
  if constexpr (requires { region.distance(x); }) {
    const double s = distance_to<Dim>(region, x);
    if (std::abs(s) < size.norm() / 2) {
      double width = 0; // max_a |n_a| size_a: a corner counts as the faces that meet there
      for (int a = 0; a < Dim; ++a) {
        const Vec<Dim> half = Vec<Dim>::Unit(a) * (size[a] / 2);
        width = std::max(width, std::abs(distance_to<Dim>(region, Vec<Dim>(x + half)) -
                                         distance_to<Dim>(region, Vec<Dim>(x - half))));
      }
      if (width > std::abs(s))
        return std::clamp(0.5 - s / width, 0.0, 1.0);
    }
  }
  return contains(region, x) ? 1 : 0;
}

} // namespace talus
