// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/signed_distance.hpp"
#include "talus/core/error.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

/// \file
/// Solids to compose: models of SignedDistance. All constructors throw std::invalid_argument for
/// numbers that make no solid. In 2-D a Ball is a disc, and so on.

namespace talus::shapes {

namespace detail {

template <int Dim>
void require_finite_point(const std::string& name, const Vec<Dim>& point) {
  for (int a = 0; a < Dim; ++a)
    require_finite(name, point[a]);
}

/// The distance to a product of N convex sets, given those to each.
template <int N>
double product_distance(const Vec<N>& gaps) {
  Vec<N> outside;
  double largest = gaps[0];
  for (int a = 0; a < N; ++a) {
    outside[a] = std::max(gaps[a], 0.0);
    largest = std::max(largest, gaps[a]);
  }
  return norm<N>(outside) + std::min(largest, 0.0);
}

} // namespace detail

/// All that lies behind a plane (2-D: a line): (x − point)·normal.
template <int Dim>
class HalfSpace {
 public:
  /// point: on the plane, m; normal: out of the solid, of any length but 0.
  HalfSpace(const Vec<Dim>& point, const Vec<Dim>& normal) : point_(point), normal_(normal) {
    detail::require_finite_point<Dim>("half space: point", point);
    const double length = norm<Dim>(normal);
    require_positive("half space: |normal|", length);
    normal_ = scaled<Dim>(1 / length, normal);
  }
  double distance(const Vec<Dim>& x) const { return dot<Dim>(minus<Dim>(x, point_), normal_); }

 private:
  Vec<Dim> point_, normal_;
};

template <int Dim>
class Ball {
 public:
  /// m
  Ball(const Vec<Dim>& centre, double radius) : centre_(centre), radius_(radius) {
    detail::require_finite_point<Dim>("ball: centre", centre);
    require_positive("ball: radius", radius);
  }
  double distance(const Vec<Dim>& x) const { return norm<Dim>(minus<Dim>(x, centre_)) - radius_; }

 private:
  Vec<Dim> centre_;
  double radius_;
};

/// A box along the axes.
template <int Dim>
class Box {
 public:
  /// Its corners, m; lower = upper along an axis is a plate without thickness.
  Box(const Vec<Dim>& lower, const Vec<Dim>& upper)
      : centre_(scaled<Dim>(0.5, plus<Dim>(lower, upper))),
        half_(scaled<Dim>(0.5, minus<Dim>(upper, lower))) {
    for (int a = 0; a < Dim; ++a)
      require_non_negative("box: upper - lower", upper[a] - lower[a]);
  }
  double distance(const Vec<Dim>& x) const {
    Vec<Dim> gaps;
    for (int a = 0; a < Dim; ++a)
      gaps[a] = std::abs(x[a] - centre_[a]) - half_[a];
    return detail::product_distance<Dim>(gaps);
  }

 private:
  Vec<Dim> centre_, half_;
};

/// All points within `radius` of the segment from `a` to `b`.
template <int Dim>
class Capsule {
 public:
  /// m; radius 0 is a needle.
  Capsule(const Vec<Dim>& a, const Vec<Dim>& b, double radius)
      : a_(a), ab_(minus<Dim>(b, a)), radius_(radius) {
    require_positive("capsule: |b - a|", norm<Dim>(ab_));
    require_non_negative("capsule: radius", radius);
  }
  double distance(const Vec<Dim>& x) const {
    const Vec<Dim> to_x = minus<Dim>(x, a_);
    const double along = std::clamp(dot<Dim>(to_x, ab_) / dot<Dim>(ab_, ab_), 0.0, 1.0);
    return norm<Dim>(plus_scaled<Dim>(to_x, -along, ab_)) - radius_;
  }

 private:
  Vec<Dim> a_, ab_;
  double radius_;
};

/// A cylinder with flat ends, 3-D.
class Cylinder {
 public:
  /// a, b: centres of the ends, m.
  Cylinder(const Vec<3>& a, const Vec<3>& b, double radius)
      : middle_(scaled<3>(0.5, plus<3>(a, b))), axis_(minus<3>(b, a)),
        half_length_(norm<3>(axis_) / 2), radius_(radius) {
    require_positive("cylinder: |b - a|", half_length_);
    axis_ = scaled<3>(1 / (2 * half_length_), axis_);
    require_positive("cylinder: radius", radius);
  }
  double distance(const Vec<3>& x) const {
    const Vec<3> from_middle = minus<3>(x, middle_);
    const double along = dot<3>(from_middle, axis_);
    const double across = norm<3>(plus_scaled<3>(from_middle, -along, axis_));
    return detail::product_distance<2>({std::abs(along) - half_length_, across - radius_});
  }

 private:
  Vec<3> middle_, axis_;
  double half_length_, radius_;
};

/// What is in A or in B: min(a, b), not a number if one of them is not.
template <class A, class B>
class Union {
 public:
  Union(A a, B b) : a_(std::move(a)), b_(std::move(b)) {}
  template <class Point>
  double distance(const Point& x) const {
    const double a = a_.distance(x), b = b_.distance(x);
    return a < b || std::isnan(a) ? a : b;
  }

 private:
  A a_;
  B b_;
};

/// What is in A and in B: max(a, b), not a number if one of them is not.
template <class A, class B>
class Intersection {
 public:
  Intersection(A a, B b) : a_(std::move(a)), b_(std::move(b)) {}
  template <class Point>
  double distance(const Point& x) const {
    const double a = a_.distance(x), b = b_.distance(x);
    return a > b || std::isnan(a) ? a : b;
  }

 private:
  A a_;
  B b_;
};

/// All that is not in A, −a: a ball becomes a drum, a box a container.
template <class A>
class Complement {
 public:
  explicit Complement(A a) : a_(std::move(a)) {}
  template <class Point>
  double distance(const Point& x) const {
    return -a_.distance(x);
  }

 private:
  A a_;
};

/// What is in A and not in B: max(a, −b).
template <class A, class B>
auto difference(A a, B b) {
  return Intersection(std::move(a), Complement<B>(std::move(b)));
}

/// A turned about the origin, then shifted: its points are rotation · a + shift.
template <int Dim, class A>
class Transformed {
 public:
  /// rotation: orthogonal, or this throws; shift: m.
  Transformed(A a, const Mat<Dim>& rotation, const Vec<Dim>& shift)
      : a_(std::move(a)), rotation_(rotation), shift_(shift) {
    const double error = orthogonality_error<Dim>(rotation);
    if (!(error < 1e-9))
      throw_invalid("moved: |R Rᵀ - I|", error, "a rotation, < 1e-9");
    detail::require_finite_point<Dim>("moved: shift", shift);
  }
  double distance(const Vec<Dim>& x) const {
    return a_.distance(transposed_product<Dim>(rotation_, minus<Dim>(x, shift_)));
  }

 private:
  A a_;
  Mat<Dim> rotation_;
  Vec<Dim> shift_;
};

template <int Dim, class A>
Transformed<Dim, A> translated(A a, const Vec<Dim>& shift) {
  return {std::move(a), Mat<Dim>::Identity(), shift};
}

} // namespace talus::shapes
