// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace talus {

/// Where the support of a node's shape function lies in the box, by axis.
enum class NodeSide { inside, on_lower_face, on_upper_face };

/// The volume fraction of a node whose support is filled with dense material up to one free
/// surface, from where that material lies: 1 without a surface, never below 1/2 on account of one.
///
/// A plane at the distance s h above the node (0 ≤ s ≤ 1) leaves
/// \f[ φ = 1 − q^2/2, \quad |\bar t|\, φ = q^2/2 − q^3/3, \quad q = 1 − s, \f]
/// which is solved for q. Along an axis on whose face the node lies, a layer of thickness s h on
/// the face leaves φ = s (2 − s) and t̄ = (s/2 − s²/3)/(1 − s/2). The direction of the plane
/// matters little: at 45° in 2-D, s = 0 gives |t̄| = 0.33 as well.
///
/// mean: t̄ = Σ V_p N_i t / Σ V_p N_i with t = (x_p − x_i)/h by axis.
template <int Dim>
double dense_fraction(const Vec<Dim>& mean, const SmallArray<NodeSide, Dim>& side) {
  double off2 = 0, layers = 1;
  for (int a = 0; a < Dim; ++a) {
    const double t = std::abs(mean[a]);
    if (side[a] == NodeSide::inside) {
      off2 += t * t;
    } else if (t < 1.0 / 3) {
      const double b = (1 + t) / 2; // s²/3 − b s + t = 0
      const double s = 1.5 * (b - std::sqrt(std::max(0.0, b * b - 4 * t / 3)));
      layers *= std::max(0.5, s * (2 - s));
    }
  }
  const double off = std::sqrt(off2);
  double q = 1;
  if (off < 1.0 / 3) {
    q = std::sqrt(2 * off / (1 + off)); // without q³: below the root, from where Newton converges
    for (int k = 0; k < 4 && q > 0; ++k) {
      const double error = (1 + off) * q * q / 2 - q * q * q / 3 - off;
      q = std::min(1.0, q - error / (q * (1 + off - q)));
    }
  }
  return layers * (1 - q * q / 2);
}

/// How much a node may compact, or must expand. The plain method (Rousseau et al. 2023: slack 0,
/// dilatancy 0, surfaces false) lets any node short of dense compact and never lets one expand:
///   - half a cell below each free surface then carries no stress until it has collapsed into what
///     lies below;
///   - the noise of the particles' positions becomes settling, and beds never rest.
/// `surfaces` mends the first, the others mend the second. See docs/accuracy.md.
struct Packing {
  double slack = 0.02; ///< share of a node's volume by which it may miss dense and count as dense
  /// β: what is packed denser than 1 + slack expands while it is sheared, as dense granular
  /// materials do: Tr D = min(β (φ − 1 − slack), 1/2) |γ̇|, with |γ̇| = sqrt(2 Dev D : Dev D) of the
  /// flow before the step.
  double dilatancy = 5;
  /// Does dense material with a free surface count as dense? See dense_fraction.
  bool surfaces = true;
  /// By what share material with cohesion may miss dense in the mean over a node and its neighbours
  /// and still cohere, if more than the slack. Less than the noise of the particles' positions
  /// takes strength away by chance.
  double cohesion_slack = 0.05;
  /// For flows that are sheared by many times their height, for what is pushed slowly, and for
  /// fields of stress: stress acts on full cells evenly
  /// (even_volume), a node in the midst of dense material makes room only if its neighbours agree,
  /// and particles there even out at `shifting` per unit of strain (shift_particles), what differs
  /// by up to `slack` from node to node. Without `surfaces` the first of the three alone.
  bool even = false;
  double shifting = 3;
  /// A scene whose particles fill some 3^d cells more than so many times is refused, see
  /// check_overfilled. > 0; infinity: none is.
  double densest = 1.5;

  /// Largest Tr D/|γ̇|. Expansion along one axis has |γ̇| = Tr D in 2-D and 1.15 Tr D in 3-D: with 1
  /// it would feed itself.
  static constexpr double steepest = 0.5;

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    if (!(slack >= 0 && slack < 1))
      throw_invalid("packing.slack", slack, "a number in [0, 1)");
    require_non_negative("packing.dilatancy", dilatancy);
    if (!(cohesion_slack >= 0 && cohesion_slack < 1))
      throw_invalid("packing.cohesion_slack", cohesion_slack, "a number in [0, 1)");
    require_non_negative("packing.shifting", shifting);
    if (!(densest > 0))
      throw_invalid("packing.densest", densest, "a number > 0, or infinity");
  }

  /// φ of a node in the midst of dense material, for room(): what lies on both sides of 1 by chance
  /// counts as 1. own: of the node; mean: of the nodes around it.
  static double agreed(double own, double mean) {
    return own < 1 ? std::min(1.0, std::max(own, mean)) : std::max(1.0, std::min(own, mean));
  }

  /// By how much a node may change its volume in this step, over that volume: > 0 to compact, < 0
  /// to expand. fraction: φ_i; dense: what it is when dense, see dense_fraction; shear: |γ̇| δt,
  /// >= 0.
  double room(double fraction, double dense, double shear) const {
    const double excess = fraction - 1 - slack;
    if (excess > 0) // the step's share of an exponential decay, whatever δt is
      return -std::min(-std::expm1(-dilatancy * shear) * excess, steepest * shear);
    return std::max(0.0, dense - fraction - slack);
  }
};

} // namespace talus
