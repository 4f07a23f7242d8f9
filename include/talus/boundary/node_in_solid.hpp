// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/signed_distance.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>

namespace talus {

/// How a node of the grid sees a solid.
template <int Dim>
struct NodeInSolid {
  bool contact = false;     ///< the solid holds the material at this node
  double open_fraction = 1; ///< share of the node's volume that is outside of the solid
  Vec<Dim> normal =
      Vec<Dim>::Zero(); ///< unit, out of the solid; where open_fraction < 1 or contact
};

/// The node at x (m) of a grid with cells of `spacing` (Dim, m).
///
/// Contacts are the nodes with a distance of at most H/2, H = Σ_a |n_a| h_a the extent of a cell
/// along the normal: the held layer then lies on the surface on average. A cell that reaches
/// outside must not have a corner that is pushed to the other side, or material leaks through. So a
/// solid must be 2 H thick, and where it is thinner (measured by the distance H below the surface)
/// it counts as that. The open share is the part of a hat function of width H along n on the outer
/// side, 1/2 + s (1 − |s|/2), s = distance/H in [−1, 1]. Throws std::invalid_argument where the
/// solid gives no distance.
template <int Dim, SignedDistance<Dim> S>
NodeInSolid<Dim> node_in_solid(const S& solid, const Vec<Dim>& x, const Vec<Dim>& spacing) {
  NodeInSolid<Dim> node;
  double distance = distance_to<Dim>(solid, x);
  double edges = 0;
  for (int a = 0; a < Dim; ++a)
    edges += spacing[a];
  if (!(distance < 2 * edges)) // H ≤ Σ h_a, and at most H more for a thin solid
    return node;
  node.normal = surface_normal<Dim>(solid, x, 1e-3 * spacing.minCoeff());
  double reach = 0;
  for (int a = 0; a < Dim; ++a)
    reach += std::abs(node.normal[a]) * spacing[a];
  const Vec<Dim> below = plus_scaled<Dim>(x, -(distance + reach), node.normal);
  distance -= std::clamp((reach + distance_to<Dim>(solid, below)) / 2, 0.0, reach);
  const double s = std::clamp(distance / reach, -1.0, 1.0);
  node.open_fraction = 0.5 + s * (1 - std::abs(s) / 2);
  node.contact = s <= 0.5 + 1e-9; // positions are sums of rounded numbers
  return node;
}

} // namespace talus
