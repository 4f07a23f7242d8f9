// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/types.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <cmath>

namespace talus {

/// Particle-in-cell that loses nothing of the grid's field: a particle carries all 2^d coefficients
/// of the multilinear velocity of its cell (polynomial PIC, Fu et al. 2017, for multilinear shape
/// functions), so that grid → particles → grid is the identity on nodal velocities where nothing
/// moves. Linear and angular momentum are kept as by Apic, the latter but for b below.
///
/// Some of what the grid can have no stress acts on, since stress sees the strain rate averaged
/// around a node, and a velocity that alternates from node to node has none: that is the mixed
/// derivatives m_S, and the part E of a cell's divergence that its nodes do not see. They are
/// damped at a rate of their own,
/// \f[ m_S ← κ\, m_S, \quad C_p ← C_p − (1 − κ)\, \frac{E}{d} I, \quad
///     κ = e^{−c \sqrt{g/h}\, δt}. \f]
/// In a cell that is filled to a share f < 1, the nodes beyond the free surface get velocities that
/// are extrapolated from a thin layer, and may move much faster than it. Friction slows them by
/// what they weigh, which is less than the layer does, so that it would slide too far. There C_p
/// and m_S lose the rate b (1 − f) sqrt(g/h) as well. A smooth flow loses energy to κ in proportion
/// to c sqrt(g/h) h⁴. See docs/accuracy.md.
struct PolyPic {
  struct Params {
    double damping = 10;       ///< c, >= 0, in units of sqrt(|g|/h), h the shortest edge of a cell
    double thin_damping = 0.2; ///< b, >= 0, in the same units
  };
  static constexpr ParticleField field = ParticleField::multilinear;
  static constexpr bool replaces() { return true; }
  PolyPic() = default;

  /// Throws std::invalid_argument unless both are finite and >= 0.
  explicit PolyPic(const Params& params) : params_(params) {
    require_non_negative("transfer.damping", params_.damping);
    require_non_negative("transfer.thin_damping", params_.thin_damping);
  }

  void prepare(const TransferStep& step) {
    const double natural = step.grid_rate * step.time_step;
    kept_ = std::exp(-params_.damping * natural);
    thin_rate_ = params_.thin_damping * natural;
  }

  template <int Dim>
  void update(const GridSample<Dim>& sample, VelocityField<Dim>& p) const {
    p.velocity = sample.velocity;
    const double beyond = sample.cell_fill < 1 ? std::exp(-thin_rate_ * (1 - sample.cell_fill)) : 1;
    p.gradient = beyond * sample.gradient;
    const double lost = (1 - kept_) * sample.divergence_error / Dim;
    for (int a = 0; a < Dim; ++a)
      p.gradient(a, a) -= lost;
    p.mixed = beyond * kept_ * sample.mixed;
  }

 private:
  Params params_{};
  double kept_ = 1, thin_rate_ = 0;
};

/// Affine particle-in-cell (Jiang et al. 2015):
/// \f[ v_p = \sum_i N_i u_i, \quad C_p = \sum_i u_i ⊗ ∇N_i. \f]
/// For multilinear shape functions this C_p is B_p D_p⁻¹ of that paper; linear and angular momentum
/// are kept. Mixed derivatives of the grid's field are lost in each step, however short.
struct Apic {
  struct Params {};
  static constexpr ParticleField field = ParticleField::affine;
  static constexpr bool replaces() { return true; }
  Apic() = default;
  explicit Apic(const Params&) {}

  template <int Dim>
  void update(const GridSample<Dim>& sample, VelocityField<Dim>& p) const {
    p.velocity = sample.velocity;
    p.gradient = sample.gradient;
  }
};

/// Particle-in-cell: v_p = Σ N_i u_i. Averages away whatever the grid can't see: dissipative.
struct Pic {
  struct Params {};
  static constexpr ParticleField field = ParticleField::constant;
  static constexpr bool replaces() { return true; }
  Pic() = default;
  explicit Pic(const Params&) {}

  template <int Dim>
  void update(const GridSample<Dim>& sample, VelocityField<Dim>& p) const {
    p.velocity = sample.velocity;
  }
};

/// The blend of FLIP and PIC: velocities of their own decay towards the grid's,
/// \f[ v_p ← r\, \Bigl( v_p + \sum_i N_i (u_i − u^*_i) \Bigr) + (1 − r) \sum_i N_i u_i, \quad
///     r = e^{−c \sqrt{g/h}\, δt}. \f]
struct Flip {
  struct Params {
    double damping = 1; ///< c, >= 0, in units of sqrt(|g|/h); 0 is FLIP
  };
  static constexpr ParticleField field = ParticleField::constant;
  Flip() = default;

  /// Throws std::invalid_argument unless 0 <= damping.
  explicit Flip(const Params& params) : damping_(params.damping) {
    require_non_negative("transfer.damping", damping_);
  }

  void prepare(const TransferStep& step) {
    ratio_ = std::exp(-damping_ * step.grid_rate * step.time_step);
  }

  template <int Dim>
  void update(const GridSample<Dim>& sample, VelocityField<Dim>& p) const {
    p.velocity = ratio_ * (p.velocity + sample.velocity - sample.velocity_before) +
                 (1 - ratio_) * sample.velocity;
  }

 private:
  double damping_ = Params{}.damping, ratio_ = 1;
};

} // namespace talus
