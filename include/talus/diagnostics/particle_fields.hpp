// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cstddef>
#include <type_traits>
#include <vector>

namespace talus {

/// A nodal field at the particles, f(x_p) = Σ_i N_i(x_p) f_i with the multilinear N_i: stress,
/// pressure or inertial number for a file of particles, say. `flow`: anything with grid() and
/// particles(), such as a Simulation; value(node): a number, Vec or Mat for the node Index. #p
/// values. The positions must lie in the box.
template <class Flow, class Function>
auto at_particles(const Flow& flow, const Function& value) {
  constexpr int dim = Flow::dimension;
  using Value = std::decay_t<decltype(value(Index<dim>()))>;
  const auto& grid = flow.grid();
  const auto& positions = flow.particles().position;
  std::vector<Value> values;
  values.reserve(positions.size());
  for (const Vec<dim>& x : positions) {
    const Index<dim> cell = grid.cell_at(x);
    const Vec<dim> xi = grid.local(x, cell);
    Value sum{};
    for (int corner = 0; corner < grid.corners; ++corner) {
      Index<dim> node = cell;
      double shape = 1;
      for (int a = 0; a < dim; ++a) {
        const int bit = grid.corner_bit(corner, a);
        node[a] += bit;
        shape *= bit == 1 ? xi[a] : 1 - xi[a];
      }
      if (corner == 0)
        sum = shape * value(node);
      else
        sum += shape * value(node);
    }
    values.push_back(sum);
  }
  return values;
}

} // namespace talus
