// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"

#include <cmath>
#include <functional>
#include <string>
#include <string_view>

/// \file
/// Place and velocity of a rigid body. Rotations about the one axis of 2-D are Spin<2>, a vector of
/// one number, counter-clockwise.

namespace talus {

template <int Dim>
inline constexpr int spin_size = Dim == 2 ? 1 : 3;

/// An angular velocity (rad/s), an angle (rad) or a torque.
template <int Dim>
using Spin = Vec<spin_size<Dim>>;

/// r × f: the torque of a force at r.
template <int Dim>
Spin<Dim> torque(const Vec<Dim>& r, const Vec<Dim>& f) {
  if constexpr (Dim == 2)
    return Spin<2>(r[0] * f[1] - r[1] * f[0]);
  else
    return Vec<3>(r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2], r[0] * f[1] - r[1] * f[0]);
}

/// ω × r: the velocity of a point at r.
template <int Dim>
Vec<Dim> cross(const Spin<Dim>& omega, const Vec<Dim>& r) {
  if constexpr (Dim == 2)
    return Vec<2>(-omega[0] * r[1], omega[0] * r[0]);
  else
    return torque<3>(omega, r);
}

/// A force (N; N/m in 2-D) and its torque about the origin of the coordinates (N m; N in 2-D).
template <int Dim>
struct Wrench {
  Vec<Dim> force = Vec<Dim>::Zero();
  Spin<Dim> torque = Spin<Dim>::Zero();

  /// Adds a force (or an impulse) that acts at x.
  void add(const Vec<Dim>& x, const Vec<Dim>& f) {
    force += f;
    torque += talus::torque<Dim>(x, f);
  }
  /// The torque about another point.
  Spin<Dim> torque_about(const Vec<Dim>& point) const {
    return torque - talus::torque<Dim>(point, force);
  }
};

/// The rotation by |angle| (rad) about angle/|angle|: R = I + sin|a| N + (1 − cos|a|) N², N r =
/// a/|a| × r (Rodrigues).
template <int Dim>
Mat<Dim> rotation_by(const Spin<Dim>& angle) {
  const double size = angle.norm();
  if (!(size > 0))
    return Mat<Dim>::Identity();
  Mat<Dim> n;
  for (int a = 0; a < Dim; ++a)
    n.col(a) = cross<Dim>(scaled<spin_size<Dim>>(1 / size, angle), Vec<Dim>(Vec<Dim>::Unit(a)));
  const Mat<Dim> n2 = matrix_product<Dim>(n, n);
  Mat<Dim> rotation = Mat<Dim>::Identity();
  for (int r = 0; r < Dim; ++r)
    for (int c = 0; c < Dim; ++c)
      rotation(r, c) += std::sin(size) * n(r, c) + (1 - std::cos(size)) * n2(r, c);
  return rotation;
}

/// Where a rigid body is and how it moves. A point X of the body's own frame is at
/// position + rotation · X.
template <int Dim>
struct RigidState {
  Vec<Dim> position = Vec<Dim>::Zero();           ///< of the body's origin, m
  Mat<Dim> rotation = Mat<Dim>::Identity();       ///< from the body's frame to the box's
  Vec<Dim> velocity = Vec<Dim>::Zero();           ///< of the body's origin, m/s
  Spin<Dim> angular_velocity = Spin<Dim>::Zero(); ///< rad/s, in the box's frame

  /// Velocity of the body's point at x, m/s.
  Vec<Dim> velocity_at(const Vec<Dim>& x) const {
    return plus<Dim>(velocity, cross<Dim>(angular_velocity, minus<Dim>(x, position)));
  }
  /// x of the box's frame in the body's.
  Vec<Dim> in_body(const Vec<Dim>& x) const {
    return transposed_product<Dim>(rotation, minus<Dim>(x, position));
  }

  /// Moves on at these velocities for `time`, s.
  void advance(double time) {
    position = plus_scaled<Dim>(position, time, velocity);
    const Spin<Dim> angle = scaled<spin_size<Dim>>(time, angular_velocity);
    if (norm<spin_size<Dim>>(angle) == 0)
      return;
    rotation = matrix_product<Dim>(rotation_by<Dim>(angle), rotation);
    for (int c = 0; c < Dim; ++c) { // or rounding would add up
      Vec<Dim> column = rotation.col(c);
      for (int b = 0; b < c; ++b) {
        const Vec<Dim> other = rotation.col(b);
        column = plus_scaled<Dim>(column, -dot<Dim>(column, other), other);
      }
      rotation.col(c) = scaled<Dim>(1 / norm<Dim>(column), column);
    }
  }
};

/// Throws std::invalid_argument unless all is finite and the rotation is one. name: whose state.
template <int Dim>
void check_rigid_state(std::string_view name, const RigidState<Dim>& state) {
  const auto require = [&](const char* what, double value) {
    if (!std::isfinite(value))
      throw_invalid(std::string(name) + what, value, "a finite number");
  };
  for (int a = 0; a < Dim; ++a) {
    require("'s position", state.position[a]);
    require("'s velocity", state.velocity[a]);
  }
  for (int a = 0; a < spin_size<Dim>; ++a)
    require("'s angular velocity", state.angular_velocity[a]);
  const double error = orthogonality_error<Dim>(state.rotation);
  if (!(error < 1e-9))
    throw_invalid(std::string(name) + "'s |R Rᵀ - I|", error, "a rotation, < 1e-9");
}

/// A motion that is known beforehand: the state at a time in s. It must be a function of time
/// alone, may be called from several threads, and its velocities must be the rates of its place.
template <int Dim>
using RigidMotion = std::function<RigidState<Dim>(double time)>;

/// Constant velocity and angular velocity from `start` at time 0.
template <int Dim>
RigidMotion<Dim> steady_motion(const RigidState<Dim>& start) {
  return [start](double time) {
    RigidState<Dim> state = start;
    state.advance(time);
    return state;
  };
}

} // namespace talus
