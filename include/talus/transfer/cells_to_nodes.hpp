// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"

#include <cstddef>

namespace talus {

/// Gathers Σ_p V_p N_i and u*_i = Σ_p V_p N_i (v_p + C_p (x_i − x_p)) / Σ_p V_p N_i from the
/// moments of the cells around each node. nodes: those of the box; volume: m^d, velocity: m/s, 0
/// without material, #nodes of the grid × at least d each.
template <int Dim, class NodeVelocity>
void cells_to_nodes(const Array<CellMoments<Dim>>& moments, const CellOrder<Dim>& order,
                    const Grid<Dim>& grid, const Array<int>& nodes, const Execution& execution,
                    Array<double>& volume, Array<NodeVelocity>& velocity) {
  execution.for_ranges(std::ssize(nodes), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t k = begin; k < end; ++k) {
      const int node = nodes[k];
      double sum = 0;
      Vec<Dim> momentum = Vec<Dim>::Zero();
      for_each_cell_of_node(grid, grid.node_index(node), [&](int cell, int corner) {
        if (order.empty(cell))
          return;
        const CellMoments<Dim>& m = moments[cell];
        sum += corner_volume(m, corner);
        momentum += m.momentum[corner];
      });
      volume[node] = sum;
      velocity[node].setZero();
      if (sum > 0)
        velocity[node].template head<Dim>() = momentum / sum;
    }
  });
}

} // namespace talus
