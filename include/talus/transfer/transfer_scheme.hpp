// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <concepts>

namespace talus {

/// What the grid says at a particle after the solve.
template <int Dim>
struct GridSample {
  Vec<Dim> velocity;        ///< Σ N_i u_i, m/s
  Vec<Dim> velocity_before; ///< Σ N_i u*_i: the velocity that came from the particles, m/s
  Mat<Dim> gradient;        ///< Σ u_i ⊗ ∇N_i, 1/s
};

/// How particles take up the grid's velocity. A model T has
///   - `T::Params`, an aggregate that T is constructible from;
///   - `T::affine` (bool): do particles carry C_p, so that they give the grid v_p + C_p (x − x_p)?
///   - `t.update(sample, v, C)`: sets the velocity v and the matrix C of a particle from a
///     GridSample.
/// Models: Apic (default: keeps linear and angular momentum, little dissipation), Pic (most
/// dissipative, never noisy), Flip (blend of FLIP and PIC, least dissipative, noisy).
template <class T, int Dim>
concept TransferScheme = std::constructible_from<T, const typename T::Params&> &&
    requires(const T t, const GridSample<Dim> sample, Vec<Dim>& v, Mat<Dim>& c) {
  { T::affine } -> std::convertible_to<bool>;
  t.update(sample, v, c);
};

} // namespace talus
