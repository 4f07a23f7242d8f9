// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"

#include <algorithm>

namespace talus {

/// What is done about nodes that are nearly dense or overpacked. The plain method (Rousseau et al.
/// 2023: slack and spreading 0) lets any node short of dense compact and keeps all overpacking, so
/// that the noise of the particles' positions becomes settling: it loses 2–8 % of a collapse's
/// volume on coarse grids, and a bed with jittered positions never rests. Slack makes rest of a
/// bed, spreading keeps the volume of what flows. It moves particles, not velocities: momentum and
/// stresses stay, and where nothing is strained nothing moves. See docs/validation.md.
struct Packing {
  double slack = 0.02;  ///< share of a node's volume by which it may miss dense and count as dense
  double spreading = 5; ///< how fast denser material spreads to less dense, per unit of strain

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    if (!(slack >= 0 && slack < 1))
      throw_invalid("packing.slack", slack, "a number in [0, 1)");
    require_non_negative("packing.spreading", spreading);
  }
  /// By how much a node may change its volume in this step, m^d, >= 0. room: v_i − Σ V_p N_i, m^d;
  /// volume: v_i, m^d.
  double room(double room, double volume) const { return std::max(0.0, room - slack * volume); }
  /// e_i, by how much a node is denser than what just counts as dense. φ: its volume fraction.
  double excess(double fraction) const { return std::max(0.0, fraction - (1 - slack)); }
};

} // namespace talus
