// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

namespace talus {

/// What flows through the plane x_axis = position (m) along the axis in a unit of time, as a volume
/// at the dense packing: m³/s, in 2-D m²/s; times the density it is the mass, kg/s. Of the last
/// step, from the nodes on both sides of the plane, so that it is a mean over up to a cell each
/// way. flow: anything with problem() and volume_fraction(node), such as a Simulation. Throws
/// std::invalid_argument for an axis or a position that is not in the box, and what problem()
/// throws: before the first step there is none.
template <class Flow>
double section_flux(const Flow& flow, int axis, double position) {
  constexpr int dim = Flow::dimension;
  const DualProblem<dim>& problem = flow.problem();
  const Grid<dim>& grid = problem.grid;
  if (axis < 0 || axis >= dim)
    throw_invalid("section_flux: axis", axis, "0 to " + std::to_string(dim - 1));
  const double lower = grid.origin()[axis], upper = grid.upper()[axis];
  if (!(position >= lower && position <= upper))
    throw_invalid("section_flux: position", position,
                  "a place in the box, " + text_of(lower) + " to " + text_of(upper) + " m");
  const double place = (position - lower) * grid.inverse_spacing()[axis];
  const int below = std::min(static_cast<int>(place), grid.cells(axis) - 1);
  // Nodes of a layer stand for the material of a cell's length, half of it at a face.
  const auto weight = [&](int layer) {
    const double share = layer == below       ? 1 - (place - below)
                         : layer == below + 1 ? place - below
                                              : 0;
    const bool at_face = !grid.periodic(axis) && (layer == 0 || layer == grid.cells(axis));
    return share * grid.inverse_spacing()[axis] * (at_face ? 2 : 1);
  };
  double flux = 0;
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    const int j = problem.node[i];
    const Index<dim> node = grid.node_index(j);
    double w = weight(node[axis]);
    if (grid.periodic(axis) && node[axis] == 0) // it is the last node, too
      w += weight(grid.cells(axis));
    if (w > 0)
      flux += w * flow.volume_fraction(node) * problem.node_volume[i] * problem.velocity[j][axis];
  }
  return flux;
}

} // namespace talus
