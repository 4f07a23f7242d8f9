// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/signed_distance.hpp"
#include "talus/core/error.hpp"
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

/// The distance to a product of two convex sets, given those to each.
template <class Gaps>
double product_distance(const Gaps& gaps) {
  return gaps.cwiseMax(0).norm() + std::min(gaps.maxCoeff(), 0.0);
}

} // namespace detail

/// All that lies behind a plane (2-D: a line): (x − point)·normal.
template <int Dim>
class HalfSpace {
 public:
  /// point: on the plane, m; normal: out of the solid, of any length but 0.
  HalfSpace(const Vec<Dim>& point, const Vec<Dim>& normal) : point_(point), normal_(normal) {
    detail::require_finite_point<Dim>("half space: point", point);
    require_positive("half space: |normal|", normal.norm());
    normal_.normalize();
  }
  double distance(const Vec<Dim>& x) const { return (x - point_).dot(normal_); }

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
  double distance(const Vec<Dim>& x) const { return (x - centre_).norm() - radius_; }

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
      : centre_((lower + upper) / 2), half_((upper - lower) / 2) {
    for (int a = 0; a < Dim; ++a)
      require_non_negative("box: upper - lower", upper[a] - lower[a]);
  }
  double distance(const Vec<Dim>& x) const {
    return detail::product_distance(Vec<Dim>((x - centre_).cwiseAbs() - half_));
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
      : a_(a), ab_(b - a), radius_(radius) {
    require_positive("capsule: |b - a|", ab_.norm());
    require_non_negative("capsule: radius", radius);
  }
  double distance(const Vec<Dim>& x) const {
    const double along = std::clamp((x - a_).dot(ab_) / ab_.squaredNorm(), 0.0, 1.0);
    return (x - a_ - along * ab_).norm() - radius_;
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
      : middle_((a + b) / 2), axis_((b - a).normalized()), half_length_((b - a).norm() / 2),
        radius_(radius) {
    require_positive("cylinder: |b - a|", half_length_);
    require_positive("cylinder: radius", radius);
  }
  double distance(const Vec<3>& x) const {
    const double along = (x - middle_).dot(axis_);
    const double across = (x - middle_ - along * axis_).norm();
    return detail::product_distance(Vec<2>(std::abs(along) - half_length_, across - radius_));
  }

 private:
  Vec<3> middle_, axis_;
  double half_length_, radius_;
};

/// What is in A or in B: min(a, b).
template <class A, class B>
class Union {
 public:
  Union(A a, B b) : a_(std::move(a)), b_(std::move(b)) {}
  template <class Point>
  double distance(const Point& x) const {
    return std::min<double>(a_.distance(x), b_.distance(x));
  }

 private:
  A a_;
  B b_;
};

/// What is in A and in B: max(a, b).
template <class A, class B>
class Intersection {
 public:
  Intersection(A a, B b) : a_(std::move(a)), b_(std::move(b)) {}
  template <class Point>
  double distance(const Point& x) const {
    return std::max<double>(a_.distance(x), b_.distance(x));
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
class Moved {
 public:
  /// rotation: orthogonal, or this throws; shift: m.
  Moved(A a, const Mat<Dim>& rotation, const Vec<Dim>& shift)
      : a_(std::move(a)), rotation_(rotation), shift_(shift) {
    const double error = (rotation * rotation.transpose() - Mat<Dim>::Identity()).norm();
    if (!(error < 1e-9))
      throw_invalid("moved: |R Rᵀ - I|", error, "a rotation, < 1e-9");
    detail::require_finite_point<Dim>("moved: shift", shift);
  }
  double distance(const Vec<Dim>& x) const {
    return a_.distance(Vec<Dim>(rotation_.transpose() * (x - shift_)));
  }

 private:
  A a_;
  Mat<Dim> rotation_;
  Vec<Dim> shift_;
};

template <int Dim, class A>
Moved<Dim, A> translated(A a, const Vec<Dim>& shift) {
  return {std::move(a), Mat<Dim>::Identity(), shift};
}

} // namespace talus::shapes
