// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

namespace nodes {

/// Calls visit(index) for the nodes of the box.
template <int Dim, class Visit>
void for_each(const talus::Grid<Dim>& grid, const Visit& visit) {
  for (int n = 0; n < grid.node_count(); ++n) {
    const talus::Index<Dim> index = grid.node_index(n);
    bool inside = true;
    for (int a = 0; a < Dim; ++a)
      inside = inside && index[a] >= 0 && index[a] <= grid.cells(a);
    if (inside)
      visit(index);
  }
}

/// The mean of σ_zz over the row of nodes at height number k, Pa; visit(index): of each.
template <class Sim, class Visit>
double mean_vertical_stress(const Sim& sim, int k, const Visit& visit) {
  constexpr int up = talus::up_axis<Sim::dimension>;
  double sum = 0, area = 0;
  for_each(sim.grid(), [&](const talus::Index<Sim::dimension>& index) {
    if (index[up] != k)
      return;
    sum += sim.grid().node_volume(index) * sim.stress(index)(up, up);
    area += sim.grid().node_volume(index);
    visit(index);
  });
  return sum / area;
}

} // namespace nodes
