// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/friction_law.hpp"

namespace talus {

/// One friction coefficient: what Rousseau et al. 2023 find enough for collapses.
class ConstantFriction {
 public:
  struct Params {
    double mu = not_given; ///< μ ≥ 0; 0.44 for the beads of Rousseau et al. 2023
  };
  static constexpr bool rate_dependent = false;

  /// Throws std::invalid_argument unless mu is finite and >= 0.
  explicit ConstantFriction(const Params& params) : params_(params) {
    require_given_non_negative("rheology.mu", params_.mu);
  }
  double friction(double) const { return params_.mu; }

 private:
  Params params_;
};

/// The law of dense flows of Jop, Forterre & Pouliquen 2006:
/// \f[ μ(I) = μ_s + \frac{μ_2 − μ_s}{1 + I_0/I}. \f]
/// For glass beads Jop et al. give μ_s = 0.38, μ_2 = 0.64 and I_0 = 0.279, fitted with f = 2 and
/// the density of the grains (see InertialNumber); Rousseau et al. 2023 take them with f = 1 and
/// that of the medium.
struct MuOfICurve {
  double mu_static = not_given; ///< μ_s ≥ 0, at I = 0
  double mu_limit = not_given;  ///< μ_2, for I → ∞; ≥ μ_s
  double I_0 = 0;               ///< > 0

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    require_given_non_negative("rheology.law.mu_static", mu_static);
    require_given_non_negative("rheology.law.mu_limit", mu_limit);
    require_positive("rheology.law.I_0", I_0);
    if (!(mu_limit >= mu_static))
      throw_invalid("rheology.law.mu_limit", mu_limit, "a number >= rheology.law.mu_static");
  }
  double operator()(double I) const {
    return I > 0 ? mu_static + (mu_limit - mu_static) / (1 + I_0 / I) : mu_static;
  }
};
using MuOfI = FrictionLaw<MuOfICurve>;

/// Friction that is higher at rest, and falls to μ at I_* (Rousseau et al. 2023), as a ramp:
/// \f[ μ(I) = μ + Δμ\, \max(0, 1 − I/I_*). \f]
/// For their beads μ = 0.38, Δμ = 0.16 and I_* = 0.04, fitted with f = 1 (see InertialNumber).
struct HystereticCurve {
  enum class Shape {
    ramp, ///< μ + Δμ (1 − I/I_*) below I_*: the paper's text
    step, ///< μ + Δμ below I_*: its authors' scripts
  };
  double mu = not_given;        ///< in flow, ≥ 0
  double mu_excess = not_given; ///< Δμ ≥ 0
  double I_star = 0;            ///< I_*, > 0
  Shape shape = Shape::ramp;

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    require_given_non_negative("rheology.law.mu", mu);
    require_given_non_negative("rheology.law.mu_excess", mu_excess);
    require_positive("rheology.law.I_star", I_star);
  }
  double operator()(double I) const {
    if (I >= I_star)
      return mu;
    return mu + mu_excess * (shape == Shape::step ? 1 : 1 - I / I_star);
  }
};
using HystereticFriction = FrictionLaw<HystereticCurve>;

} // namespace talus
