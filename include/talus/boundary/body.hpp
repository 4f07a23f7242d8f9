// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/shapes.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace talus {

/// A free rigid body: gravity, the material, faces, obstacles and other bodies move it, and it
/// moves material and bodies. \f[ M\, ΔV = M g\, δt − \sum_k r_k, \quad J\, Δω = −\sum_k a_k × r_k,
/// \f] with the impulses r of its contacts, on arms a, solved together with the stresses. What
/// touches solids are its corners, each a ball of corner_radius: at faces, at Obstacle::distance,
/// and at the shape of another body. There is no bounce.
template <int Dim>
struct Body {
  Shape<Dim> shape; ///< in its own frame, the origin at the centre of mass
  double mass = 0;  ///< M, kg (kg/m in 2-D); > 0
  Mat<spin_size<Dim>> inertia = Mat<spin_size<Dim>>::Zero(); ///< J in its own frame, kg m² (kg m in
                                                             ///< 2-D); positive definite
  double friction = not_given;   ///< μ_w against the material, faces that stick, and bodies: the
                                 ///< lower one of two
  RigidState<Dim> start{};       ///< at time 0
  bool rotates = true;           ///< false: held upright, as by guides that take no force
  std::vector<Vec<Dim>> corners; ///< in its own frame, m; none: it passes through faces and
                                 ///< obstacles
  double corner_radius = 0;      ///< m

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    if (shape.empty())
      throw_invalid("body.shape", "empty", "a model of SignedDistance");
    require_positive("body.mass", mass);
    if (rotates)
      validate_inertia();
    require_given_non_negative("body.friction", friction);
    require_non_negative("body.corner_radius", corner_radius);
    for (const Vec<Dim>& corner : corners)
      for (int a = 0; a < Dim; ++a)
        require_finite("a corner of a body", corner[a]);
  }

  /// Inverse of the inertia, 1/(kg m²), by cofactors: a library of decompositions would cost every
  /// program that compiles this more than all else here.
  Mat<spin_size<Dim>> inverse_inertia() const {
    const auto& j = inertia;
    Mat<spin_size<Dim>> inverse;
    if constexpr (Dim == 2) {
      inverse(0, 0) = 1 / j(0, 0);
    } else {
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          inverse(c, r) = cofactor(r, c);
      inverse *= 1 / determinant();
    }
    return inverse;
  }

 private:
  /// For any cyclic r, c: no sign to mind.
  double cofactor(int r, int c) const {
    const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
    return inertia(r1, c1) * inertia(r2, c2) - inertia(r1, c2) * inertia(r2, c1);
  }
  double determinant() const {
    return inertia(0, 0) * cofactor(0, 0) + inertia(0, 1) * cofactor(0, 1) +
           inertia(0, 2) * cofactor(0, 2);
  }
  /// Symmetric, and all leading minors are positive (Sylvester).
  void validate_inertia() const {
    constexpr const char* allowed = "a symmetric positive definite matrix";
    for (int r = 0; r < spin_size<Dim>; ++r)
      for (int c = 0; c < r; ++c)
        if (!(std::abs(inertia(r, c) - inertia(c, r)) <=
              1e-12 * (std::abs(inertia(r, r)) + std::abs(inertia(c, c)))))
          throw_invalid("body.inertia, what its halves differ by", inertia(r, c) - inertia(c, r),
                        allowed);
    double least = inertia(0, 0);
    if constexpr (Dim == 3) { // each in units of the first
      const double unit = std::abs(inertia(0, 0));
      least = std::min({least, cofactor(2, 2) / unit, determinant() / (unit * unit)});
    }
    if (!(least > 0) || !std::isfinite(least))
      throw_invalid("body.inertia, its least leading minor", least, allowed);
  }
};

/// A ball (2-D: a disc) of uniform density. radius: m; density: kg/m³; centre: m.
template <int Dim>
Body<Dim> ball_body(const Vec<Dim>& centre, double radius, double density, double friction) {
  require_positive("ball: density", density);
  Body<Dim> body;
  body.shape = shapes::Ball<Dim>(Vec<Dim>::Zero(), radius);
  const double r2 = radius * radius;
  body.mass = density * std::numbers::pi * (Dim == 2 ? r2 : 4 * r2 * radius / 3);
  body.inertia = (Dim == 2 ? 0.5 : 0.4) * body.mass * r2 * Mat<spin_size<Dim>>::Identity();
  body.friction = friction;
  body.start.position = centre;
  body.corners = {Vec<Dim>::Zero()};
  body.corner_radius = radius;
  return body;
}

/// A block of uniform density. centre, size (edges): m; density: kg/m³. rounding: radius of its
/// corners in smallest edges, in [0, 1/2]. Sharp ones (0) catch on each other where blocks slide
/// over edges. The material sees it sharp.
template <int Dim>
Body<Dim> block_body(const Vec<Dim>& centre, const Vec<Dim>& size, double density, double friction,
                     double rounding = 0.1) {
  require_positive("block: density", density);
  if (!(rounding >= 0 && rounding <= 0.5))
    throw_invalid("block: rounding", rounding, "a number in [0, 1/2]");
  Body<Dim> body;
  body.shape = shapes::Box<Dim>(-size / 2, size / 2);
  body.mass = density * size.prod();
  const Vec<Dim> squares = size.cwiseAbs2() * (body.mass / 12);
  if constexpr (Dim == 2)
    body.inertia(0, 0) = squares.sum();
  else
    body.inertia = (Vec<3>::Constant(squares.sum()) - squares).asDiagonal();
  body.friction = friction;
  body.start.position = centre;
  body.corner_radius = rounding * size.minCoeff();
  for (int c = 0; c < 1 << Dim; ++c) {
    Vec<Dim> corner = size / 2 - Vec<Dim>::Constant(body.corner_radius);
    for (int a = 0; a < Dim; ++a)
      if ((c >> a & 1) == 0)
        corner[a] = -corner[a];
    body.corners.push_back(corner);
  }
  return body;
}

} // namespace talus
