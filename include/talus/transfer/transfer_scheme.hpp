// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <concepts>

namespace talus {

/// What a particle keeps of the velocity around it, r = x − x_p.
enum class ParticleField {
  constant,   ///< v_p
  affine,     ///< v_p + C_p r
  multilinear ///< v_p + C_p r + Σ_S m_S Π_{b ∈ S} r_b over the sets S of two axes or more
};

/// The velocity field of one particle, about its place.
template <int Dim>
struct VelocityField {
  Vec<Dim> velocity;           ///< v_p, m/s
  Mat<Dim> gradient;           ///< C_p, 1/s
  MixedDerivatives<Dim> mixed; ///< m_S
};

/// What the grid says at a particle after the solve: Σ N_i u_i and its derivatives.
template <int Dim>
struct GridSample : VelocityField<Dim> {
  Vec<Dim> velocity_before; ///< Σ N_i u*_i: the velocity that came from the particles, m/s
  /// tr ∇u in the middle of the cell less the mean of what its nodes see, Σ_j u_j·g_ij/V_i, V_i
  /// what stress acts on, 1/s: a part of the divergence on which no stress acts. For multilinear
  /// fields only.
  double divergence_error;
  double cell_fill; ///< Σ V_p of the particle's cell over the cell's volume. As above.
};

/// What a transfer may scale its rates by.
struct TransferStep {
  double time_step = 0; ///< δt, s
  double grid_rate = 0; ///< sqrt(|g|/h), h the shortest edge of a cell, 1/s
};

/// How particles take up the grid's velocity. A model T has
///   - `T::Params`, an aggregate that T is constructible from;
///   - `T::field`, a ParticleField: what particles carry and give to the grid;
///   - `t.update(sample, field)`: sets the VelocityField of a particle, which holds its old one,
///     from a GridSample;
///   - if update() uses nothing of the old field, `t.replaces()` → true: the field is zero then
///     before the call, and is not read, which saves time;
///   - if it has rates, `t.prepare(step)`, called with a TransferStep before the updates of a step.
/// Models: PolyPic (default: loses nothing of what the grid has), Apic (keeps linear and
/// angular momentum, damps mixed derivatives in each step), Pic (most dissipative), Flip (blend of
/// FLIP and PIC, noisy).
template <class T, int Dim>
concept TransferScheme = std::constructible_from<T, const typename T::Params&> &&
    requires(const T t, const GridSample<Dim> sample, VelocityField<Dim>& field) {
  { T::field } -> std::convertible_to<ParticleField>;
  t.update(sample, field);
};

} // namespace talus
