// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>

/// \file
/// How much of each material nodes have, where there are several.

namespace talus {

/// Σ_p V_p N_c(x_p), m^d, over the particles of each material at each corner c of a cell that holds
/// particles: #cells × #materials × 2^d. particles.material: #p, each below `materials`; halo: how
/// ranks share cells, if there are several.
template <int Dim, class Real>
void material_corner_volumes(const Particles<Dim, Real>& particles, const CellOrder<Dim>& order,
                             const Grid<Dim>& grid, int materials, const Execution& execution,
                             Array<double>& volumes, const Halo* halo) {
  constexpr int corners = Grid<Dim>::corners;
  const std::ptrdiff_t per_cell = std::ptrdiff_t{materials} * corners;
  volumes.resize(static_cast<std::size_t>(per_cell) * static_cast<std::size_t>(grid.cell_count()));
  const auto clear = [&](int cell) {
    const auto begin = volumes.begin() + cell * per_cell;
    std::fill(begin, begin + per_cell, 0.0);
    return begin;
  };
  for_each_filled_cell(execution, order, grid, [&](int cell) {
    const auto of_cell = clear(cell);
    const Index<Dim> index = grid.cell_index(cell);
    for (std::size_t k = order.begin(cell); k < order.begin(cell + 1); ++k) {
      const std::size_t p = order.particle(k);
      const auto of_material = of_cell + particles.material[p] * corners;
      Vec<Dim> xi;
      for (int a = 0; a < Dim; ++a)
        xi[a] =
            (particles.position[p][a] - grid.origin()[a]) * grid.inverse_spacing()[a] - index[a];
      for (int c = 0; c < corners; ++c) {
        double share = static_cast<double>(particles.volume[p]);
        for (int a = 0; a < Dim; ++a)
          share *= Grid<Dim>::corner_bit(c, a) ? xi[a] : 1 - xi[a];
        of_material[c] += share;
      }
    }
  });
  if (!halo)
    return;
  for (const int cell : halo->border_cells())
    if (order.empty(cell))
      clear(cell);
  halo->share_cells(volumes.data(), static_cast<std::size_t>(per_cell) * sizeof(double));
}

/// Gathers V_im = Σ_{p ∈ m} V_p N_i and m_i = Σ_m ρ_m V_im at the nodes of the box, and makes
/// u*_i = Σ_p ρ_p V_p N_i u_p(x_i)/m_i of what cells_to_nodes has given where momenta are those of
/// mass: the same over Σ_p V_p N_i. volumes: of material_corner_volumes; density(m) → ρ_m, kg/m³;
/// node_volume: Σ_p V_p N_i, #nodes, m^d; by_material: V_im, #nodes × #materials, m^d; mass:
/// #nodes, kg (2-D: kg/m).
template <int Dim, class Density, class NodeVelocity>
void materials_to_nodes(const Array<double>& volumes, int materials, const Density& density,
                        const CellOrder<Dim>& order, const Grid<Dim>& grid, const Array<int>& nodes,
                        const Execution& execution, const Array<double>& node_volume,
                        Array<double>& by_material, Array<double>& mass,
                        Array<NodeVelocity>& velocity) {
  constexpr int corners = Grid<Dim>::corners;
  by_material.resize(node_volume.size() * static_cast<std::size_t>(materials));
  mass.resize(node_volume.size());
  execution.for_ranges(std::ssize(nodes), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t k = begin; k < end; ++k) {
      const int node = nodes[k];
      double* const of_node = by_material.data() + std::ptrdiff_t{node} * materials;
      std::fill(of_node, of_node + materials, 0.0);
      for_each_cell_of_node(grid, grid.node_index(node), [&](int cell, int corner) {
        if (order.empty(cell))
          return;
        for (int m = 0; m < materials; ++m)
          of_node[m] += volumes[(std::ptrdiff_t{cell} * materials + m) * corners + corner];
      });
      mass[node] = 0;
      for (int m = 0; m < materials; ++m)
        mass[node] += density(m) * of_node[m];
      velocity[node] *= mass[node] > 0 ? node_volume[node] / mass[node] : 0;
    }
  });
}

} // namespace talus
