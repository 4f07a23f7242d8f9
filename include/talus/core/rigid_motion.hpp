// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cmath>
#include <functional>

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

/// [r]×, spin_size × Dim: torque(r, f) = [r]× f and cross(ω, r) = [r]×ᵀ ω.
template <int Dim>
Eigen::Matrix<double, spin_size<Dim>, Dim> cross_matrix(const Vec<Dim>& r) {
  Eigen::Matrix<double, spin_size<Dim>, Dim> m;
  for (int a = 0; a < Dim; ++a)
    m.col(a) = torque<Dim>(r, Vec<Dim>::Unit(a));
  return m;
}

/// The rotation by |angle| (rad) about angle/|angle|: R = I + sin|a| N + (1 − cos|a|) N², N r =
/// a/|a| × r (Rodrigues).
template <int Dim>
Mat<Dim> rotation_by(const Spin<Dim>& angle) {
  const double size = angle.norm();
  if (!(size > 0))
    return Mat<Dim>::Identity();
  Mat<Dim> n;
  for (int a = 0; a < Dim; ++a)
    n.col(a) = cross<Dim>(Spin<Dim>(angle / size), Vec<Dim>::Unit(a));
  return Mat<Dim>::Identity() + std::sin(size) * n + (1 - std::cos(size)) * n * n;
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
    return velocity + cross<Dim>(angular_velocity, Vec<Dim>(x - position));
  }
  /// x of the box's frame in the body's.
  Vec<Dim> in_body(const Vec<Dim>& x) const { return rotation.transpose() * (x - position); }

  /// Moves on at these velocities for `time`, s.
  void advance(double time) {
    position += time * velocity;
    if (angular_velocity.isZero(0))
      return;
    rotation = rotation_by<Dim>(Spin<Dim>(time * angular_velocity)) * rotation;
    for (int c = 0; c < Dim; ++c) { // or rounding would add up
      for (int b = 0; b < c; ++b)
        rotation.col(c) -= rotation.col(c).dot(rotation.col(b)) * rotation.col(b);
      rotation.col(c).normalize();
    }
  }
};

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
