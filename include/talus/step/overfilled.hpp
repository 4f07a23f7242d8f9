// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/node_copies.hpp"
#include "talus/particles.hpp"

#include <cmath>
#include <cstddef>
#include <string>

namespace talus {

/// Throws std::invalid_argument if the particles of some 3^d cells (fewer at faces) fill more than
/// `densest` times their volume: every step of such a scene would converge, with wrong heights.
/// n particles at random positions make 1/√n of noise; 4/√n is allowed on top. copies: of
/// nodes; null: what lies beyond periodic faces or on other ranks does not count;
/// execution: goes with them.
template <int Dim, class Real>
void check_overfilled(const Particles<Dim, Real>& particles, const Grid<Dim>& grid, double densest,
                      const NodeCopies<Dim>* copies = nullptr,
                      const Execution* execution = nullptr) {
  // by the cells' first nodes, whose numbers have room for neighbours on every side
  Array<double> volume(static_cast<std::size_t>(grid.node_count()), 0);
  Array<int> count(volume.size(), 0);
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const int first = grid.first_node(grid.cell_at(particles.position[p]));
    volume[first] += particles.volume[p];
    ++count[first];
  }
  if (copies) {
    copies->copy(volume, *execution);
    copies->copy(count, *execution);
  }
  for (int c = 0; c < grid.cell_count(); ++c) {
    const Index<Dim> cell = grid.cell_index(c);
    const int first = grid.first_node(cell);
    if (!grid.own().holds(cell) || count[first] == 0)
      continue;
    double sum = 0, room = grid.cell_volume();
    int particles_there = 0;
    for (int a = 0; a < Dim; ++a)
      room *= copies && grid.periodic(a) ? 3 : 1 + (cell[a] > 0) + (cell[a] + 1 < grid.cells(a));
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
      const int other = first + grid.neighbour_offset(k);
      sum += volume[other];
      particles_there += count[other];
    }
    if (sum > (densest + 4 / std::sqrt(particles_there)) * room)
      throw_invalid("the volume of the " + std::to_string(particles_there) + " particles around " +
                        place_text<Dim>(grid.node_position(cell)) +
                        " over that of the cells which hold them",
                    sum / room,
                    "about 1, and 1.1 for random positions; what is filled twice has 2; "
                    "packing.densest sets the limit, infinity sets none");
  }
}

} // namespace talus
