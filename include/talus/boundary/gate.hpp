// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace talus {

/// Motion of a pneumatic gate from the opening on (Rousseau et al. 2023),
/// \f[ U(t) = U_∞ (1 − e^{−t/τ}), \f] until it has risen as far as it goes.
struct GateMotion {
  double opening_time = 0;                               ///< s
  double terminal_speed = 0.7;                           ///< U_∞, m/s
  double time_constant = 0.13;                           ///< τ, s; 0: at full speed at once
  double rise = std::numeric_limits<double>::infinity(); ///< m, where it stops

  double speed(double time) const {
    const double t = time - opening_time;
    if (!(t > 0) || !(travel(time) < rise))
      return 0;
    return time_constant > 0 ? -terminal_speed * std::expm1(-t / time_constant) : terminal_speed;
  }

  /// ∫ U dt = U_∞ (t − τ (1 − exp(−t/τ))), m, at most `rise`.
  double travel(double time) const {
    const double t = time - opening_time;
    if (!(t > 0))
      return 0;
    const double lag = time_constant > 0 ? -time_constant * std::expm1(-t / time_constant) : 0;
    return std::min(rise, terminal_speed * (t - lag));
  }

  /// Has it opened and stopped for good?
  bool stopped(double time) const { return time > opening_time && !(speed(time) > 0); }
};

/// A rigid plate across the channel, normal to x, that holds the material upstream of it and rises.
template <int Dim>
class Gate final : public Obstacle<Dim> {
 public:
  struct Params {
    double position = 0;         ///< x of its upstream side, m
    double bottom = 0;           ///< height of its lower edge while closed, m
    double thickness = 0;        ///< m; less than a cell: one layer of nodes
    double friction = not_given; ///< μ_D ≥ 0
    GateMotion motion{};
  };

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit Gate(const Params& params) : params_(params) {
    require_finite("gate.position", params_.position);
    require_finite("gate.bottom", params_.bottom);
    require_non_negative("gate.thickness", params_.thickness);
    require_given_non_negative("gate.friction", params_.friction);
    require_non_negative("gate.motion.opening_time", params_.motion.opening_time);
    require_non_negative("gate.motion.terminal_speed", params_.motion.terminal_speed);
    require_non_negative("gate.motion.time_constant", params_.motion.time_constant);
    if (!(params_.motion.rise >= 0))
      throw_invalid("gate.motion.rise", params_.motion.rise, "0 or more, or infinity");
  }

  /// Height of the lower edge, m.
  double bottom(double time) const { return params_.bottom + params_.motion.travel(time); }
  double speed(double time) const { return params_.motion.speed(time); }

  /// Is it through with what it does to material that is nowhere higher than `top` (m)? Not before
  /// it has opened, nor while it moves in the material, which it may set in motion again.
  bool done(double time, double top) const {
    return params_.motion.stopped(time) ||
           (time > params_.motion.opening_time && bottom(time) >= top);
  }

  /// A slice of the channel.
  RigidState<Dim> frame(double /*time*/) const override {
    RigidState<Dim> frame;
    frame.position[0] = params_.position;
    return frame;
  }
  Vec<Dim> half_box(double far) const override {
    Vec<Dim> half = Obstacle<Dim>::half_box(far);
    half[0] = params_.thickness;
    return half;
  }

  std::optional<ObstacleContact<Dim>> contact(const Vec<Dim>& x, const Vec<Dim>& spacing,
                                              double time) const override {
    constexpr int up = up_axis<Dim>;
    const double h = spacing[0];
    // From half a cell before the face to its back, at least a cell's width: exactly one layer of
    // nodes for a thin plate, wherever it stands between them.
    const double offset = x[0] - params_.position;
    const double slack = 1e-9; // of a cell: positions are sums of rounded numbers
    if (offset < -(0.5 + slack) * h ||
        offset >= std::max(params_.thickness + slack * h, (0.5 - slack) * h))
      return std::nullopt;
    if (x[up] < bottom(time) - slack * spacing[up])
      return std::nullopt;
    ObstacleContact<Dim> contact;
    contact.normal = -Vec<Dim>::Unit(0);
    contact.velocity = speed(time) * Vec<Dim>::Unit(up);
    contact.friction = params_.friction;
    return contact;
  }

  double distance(const Vec<Dim>& x, const Vec<Dim>& /*spacing*/, double time,
                  const RigidState<Dim>& /*frame*/) const override {
    const double half = params_.thickness / 2;
    return shapes::detail::product_distance<2>(
        {std::abs(x[0] - params_.position - half) - half, bottom(time) - x[up_axis<Dim>]});
  }

 private:
  Params params_;
};

} // namespace talus
