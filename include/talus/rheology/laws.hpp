// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/inertial_number.hpp"
#include "talus/rheology/rheology.hpp"

namespace talus {

/// One friction coefficient: what Rousseau et al. 2023 find enough for collapses.
class ConstantFriction {
 public:
  struct Params {
    double mu = 0.44; ///< μ ≥ 0; default: the avalanche angle of the paper's beads, tan 23.75°
  };
  static constexpr bool rate_dependent = false;

  ConstantFriction() = default;
  /// Throws std::invalid_argument unless mu is finite and >= 0.
  explicit ConstantFriction(const Params& params) : params_(params) {
    require_non_negative("rheology.mu", params_.mu);
  }
  double friction(double) const { return params_.mu; }

 private:
  Params params_{};
};

/// μ(I) = μ_s + (μ_2 − μ_s) / (1 + I_0/I) (Jop, Forterre & Pouliquen 2006).
class MuOfI {
 public:
  struct Params {
    double mu_static = 0.38; ///< μ_s, at I = 0
    double mu_limit = 0.64;  ///< μ_2, for I → ∞; ≥ μ_s
    double I_0 = 0.279;      ///< > 0
    InertialNumber inertial{};
  };
  static constexpr bool rate_dependent = true;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit MuOfI(const Params& params) : params_(params) {
    require_non_negative("rheology.mu_static", params_.mu_static);
    require_positive("rheology.I_0", params_.I_0);
    if (!(params_.mu_limit >= params_.mu_static))
      throw_invalid("rheology.mu_limit", params_.mu_limit, "a number >= rheology.mu_static");
    require_finite("rheology.mu_limit", params_.mu_limit);
    params_.inertial.validate();
  }
  double friction(double inertial_number) const {
    if (!(inertial_number > 0))
      return params_.mu_static;
    return params_.mu_static +
           (params_.mu_limit - params_.mu_static) / (1 + params_.I_0 / inertial_number);
  }
  const InertialNumber& inertial_number() const { return params_.inertial; }

 private:
  Params params_;
};

/// Friction that is higher at rest, μ + Δμ, and falls to μ at I_* (Rousseau et al. 2023).
class HystereticFriction {
 public:
  enum class Shape {
    ramp, ///< μ + Δμ (1 − I/I_*) below I_*: the paper's text
    step, ///< μ + Δμ below I_*: its authors' scripts
  };
  struct Params {
    double mu = 0.38;        ///< in flow
    double mu_excess = 0.16; ///< Δμ
    double I_star = 0.04;    ///< I_*, > 0
    Shape shape = Shape::ramp;
    InertialNumber inertial{};
  };
  static constexpr bool rate_dependent = true;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit HystereticFriction(const Params& params) : params_(params) {
    require_non_negative("rheology.mu", params_.mu);
    require_non_negative("rheology.mu_excess", params_.mu_excess);
    require_positive("rheology.I_star", params_.I_star);
    params_.inertial.validate();
  }
  double friction(double inertial_number) const {
    if (inertial_number >= params_.I_star)
      return params_.mu;
    if (params_.shape == Shape::step)
      return params_.mu + params_.mu_excess;
    return params_.mu + params_.mu_excess * (1 - inertial_number / params_.I_star);
  }
  const InertialNumber& inertial_number() const { return params_.inertial; }

 private:
  Params params_;
};

} // namespace talus
