// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/types.hpp"
#include "talus/transfer/transfer_scheme.hpp"

namespace talus {

/// Affine particle-in-cell (Jiang et al. 2015):
/// \f[ v_p = \sum_i N_i u_i, \quad C_p = \sum_i u_i ⊗ ∇N_i. \f]
/// For multilinear shape functions this C_p is B_p D_p⁻¹ of that paper; linear and angular momentum
/// are kept.
struct Apic {
  struct Params {};
  static constexpr bool affine = true;
  Apic() = default;
  explicit Apic(const Params&) {}

  template <int Dim>
  void update(const GridSample<Dim>& sample, Vec<Dim>& v, Mat<Dim>& c) const {
    v = sample.velocity;
    c = sample.gradient;
  }
};

/// Particle-in-cell: v_p = Σ N_i u_i. Averages away whatever the grid can't see: dissipative.
struct Pic {
  struct Params {};
  static constexpr bool affine = false;
  Pic() = default;
  explicit Pic(const Params&) {}

  template <int Dim>
  void update(const GridSample<Dim>& sample, Vec<Dim>& v, Mat<Dim>&) const {
    v = sample.velocity;
  }
};

/// The blend of FLIP (r = 1) and PIC (r = 0):
/// \f[ v_p ← r\, \Bigl( v_p + \sum_i N_i (u_i − u^*_i) \Bigr) + (1 − r) \sum_i N_i u_i. \f]
struct Flip {
  struct Params {
    double ratio = 0.97; ///< r, in [0, 1]
  };
  static constexpr bool affine = false;
  Flip() = default;

  /// Throws std::invalid_argument unless 0 <= ratio <= 1.
  explicit Flip(const Params& params) : ratio_(params.ratio) {
    if (!(ratio_ >= 0 && ratio_ <= 1))
      throw_invalid("transfer.ratio", ratio_, "a number in [0, 1]");
  }

  template <int Dim>
  void update(const GridSample<Dim>& sample, Vec<Dim>& v, Mat<Dim>&) const {
    v = ratio_ * (v + sample.velocity - sample.velocity_before) + (1 - ratio_) * sample.velocity;
  }

 private:
  double ratio_ = Params{}.ratio;
};

} // namespace talus
