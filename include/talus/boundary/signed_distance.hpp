// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <functional>
#include <limits>
#include <utility>

namespace talus {

/// A solid that says how far away it is. A model S has
///   - `s.distance(x)` → m, x: Vec<Dim> in m: negative inside, 0 on the surface, positive outside;
///     1-Lipschitz. Its magnitude is the distance to the surface or less, and exact near the
///     surface but for edges.
/// No normal is asked for: see surface_normal. Models: boundary/shapes.hpp, Shape. Which when, and
/// one of your own: docs/concepts/boundary.md.
template <class S, int Dim>
concept SignedDistance = std::copy_constructible<S> && requires(const S s, const Vec<Dim> x) {
  { s.distance(x) } -> std::convertible_to<double>;
};

/// s.distance(x), m. Throws std::invalid_argument where that is none: every comparison with NaN is
/// false, so that a solid which gives NaN would silently not be there.
template <int Dim, class S>
double distance_to(const S& solid, const Vec<Dim>& x) {
  const double distance = solid.distance(x);
  if (!(distance > -std::numeric_limits<double>::infinity()))
    throw_invalid("a shape's distance at " + place_text<Dim>(x), distance,
                  "a number, or infinity far away");
  return distance;
}

/// Any model of SignedDistance, with its type forgotten.
template <int Dim>
class Shape {
 public:
  /// Nothing yet: distance() must not be called.
  Shape() = default;
  // Not SignedDistance, whose copies would ask for this constructor again: Complement<Shape>, say,
  // is made of a Shape.
  template <class S>
  requires(!std::same_as<S, Shape>) && requires(const S s, const Vec<Dim> x) {
    { s.distance(x) } -> std::convertible_to<double>;
  }
  Shape(S shape) // NOLINT(google-explicit-constructor): a solid is a Shape
      : distance_([s = std::move(shape)](const Vec<Dim>& x) { return distance_to<Dim>(s, x); }) {
    static_assert(SignedDistance<S, Dim>, "a shape must be copyable");
  }

  bool empty() const { return !distance_; }
  /// m; throws as distance_to.
  double distance(const Vec<Dim>& x) const { return distance_(x); }

 private:
  std::function<double(const Vec<Dim>&)> distance_;
};

/// A solid in its own frame, seen from the box.
template <int Dim>
struct Posed {
  const Shape<Dim>& shape;
  const RigidState<Dim>& state;
  double distance(const Vec<Dim>& x) const { return shape.distance(state.in_body(x)); }
};

/// Half the edges (m) of a box about the origin that holds the solid, from its distances at ± far
/// (m) along each axis, where a sphere of that distance is nearly a plane: for whatever has no
/// slope above 1, distance(x) ≥ |x_a| − half_box_a − |x|²/(2 far). Of the order of `far` where the
/// solid has no end; infinite if it tells by more than 1 in slope, or by infinity, that it is no
/// distance out there.
template <int Dim, SignedDistance<Dim> S>
Vec<Dim> half_box(const S& solid, double far) {
  const double at_origin = std::abs(distance_to<Dim>(solid, Vec<Dim>::Zero()));
  Vec<Dim> half = Vec<Dim>::Zero();
  for (int a = 0; a < Dim; ++a)
    for (const double side : {-far, far}) {
      const double distance = distance_to<Dim>(solid, scaled<Dim>(side, Vec<Dim>::Unit(a)));
      if (distance > (1 + 1e-9) * far + at_origin)
        return Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
      half[a] = std::max(half[a], far - distance);
    }
  return half;
}

/// The outward unit normal of the level set of `solid` through x (m), by central differences over
/// ± step (m). Where they cancel, in the middle of a plate, one-sided ones choose a side; never
/// zero.
template <int Dim, SignedDistance<Dim> S>
Vec<Dim> surface_normal(const S& solid, const Vec<Dim>& x, double step) {
  Vec<Dim> central, forward;
  const double here = distance_to<Dim>(solid, x);
  for (int a = 0; a < Dim; ++a) {
    Vec<Dim> shifted = x;
    shifted[a] = x[a] + step;
    const double above = distance_to<Dim>(solid, shifted);
    shifted[a] = x[a] - step;
    central[a] = (above - distance_to<Dim>(solid, shifted)) / (2 * step);
    forward[a] = (above - here) / step;
  }
  for (const Vec<Dim>& gradient : {central, forward})
    if (const double size = norm<Dim>(gradient); size > 0.1) // 1 but for edges and ridges
      return scaled<Dim>(1 / size, gradient);
  return Vec<Dim>::Unit(up_axis<Dim>);
}

} // namespace talus
