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

/// The share of the volume of a node at x (m) that is outside of a solid: Σ h_a beyond its surface
/// 1 or 0. For a plane it is the part of a hat function along n, of width W² = Σ_a n_a² h_a², on
/// the outer side: 1/2 + s (1 − |s|/2), s = distance/W in [−1, 1]. Where it is no plane, what that
/// misses at x ± h/√6, points with the mean square of the node's shape function: at an edge of a
/// box 3/4. normal: of the surface; distance: m, that of the solid less `thicker`, m.
template <int Dim, SignedDistance<Dim> S>
double open_share(const S& solid, const Vec<Dim>& x, const Vec<Dim>& spacing,
                  const Vec<Dim>& normal, double distance, double thicker) {
  double width2 = 0, edges = 0;
  for (int a = 0; a < Dim; ++a) {
    width2 += normal[a] * normal[a] * spacing[a] * spacing[a];
    edges += spacing[a];
  }
  if (std::abs(distance) >= edges)
    return distance > 0 ? 1 : 0;
  const double width = std::sqrt(width2), s = std::clamp(distance / width, -1.0, 1.0);
  // Steep: 0 for what is 1/12 inside, however near another surface is, such as that on which a
  // block stands on a face.
  const auto outside = [&](double d) { return std::clamp(0.5 + 6 * d / width, 0.0, 1.0); };
  double beyond_plane = 0;
  for (int part = 0; part < 1 << Dim; ++part) {
    Vec<Dim> offset;
    for (int a = 0; a < Dim; ++a)
      offset[a] = ((part >> a & 1) != 0 ? 1 : -1) * spacing[a] / std::sqrt(6.0);
    beyond_plane += outside(distance_to<Dim>(solid, plus<Dim>(x, offset)) - thicker) -
                    outside(distance + dot<Dim>(normal, offset));
  }
  return std::clamp(0.5 + s * (1 - std::abs(s) / 2) + beyond_plane / (1 << Dim), 0.0, 1.0);
}

/// The node at x (m) of a grid with cells of `spacing` (Dim, m).
///
/// Contacts are the nodes with a distance of at most H/2, H = Σ_a |n_a| h_a the extent of a cell
/// along the normal: the held layer then lies on the surface on average. A cell that reaches
/// outside must not have a corner that is pushed to the other side, or material leaks through. So a
/// solid must be 2 H thick, and where it is thinner (measured by the distances H and 2 H below the
/// surface) it counts as that. Throws std::invalid_argument where the solid gives no distance.
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
  const auto distance_below = [&](double depth) {
    return distance_to<Dim>(solid, plus_scaled<Dim>(x, -(distance + depth), node.normal));
  };
  double thicker = distance_below(reach);
  thicker = thicker > 0 ? (reach + thicker) / 2 : distance_below(2 * reach) / 2;
  thicker = std::clamp(thicker, 0.0, reach);
  distance -= thicker;
  node.open_fraction = open_share<Dim>(solid, x, spacing, node.normal, distance, thicker);
  node.contact = distance <= (0.5 + 1e-9) * reach; // positions are sums of rounded numbers
  return node;
}

} // namespace talus
