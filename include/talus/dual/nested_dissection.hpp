// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace talus {

/// Reorders nodes of a grid so that the factors of a matrix that couples nodes up to two cells
/// apart fill little: two layers of nodes halve the set and come last, the halves before them, each
/// in the same manner. Of the axes the one with the fewest nodes in its layers is taken.
///
/// George 1973 (nested dissection).
template <int Dim>
void dissect(const Grid<Dim>& grid, int* first, int* last) {
  constexpr int layers = 2;
  const auto at = [&](int node, int axis) { return grid.node_index(node)[axis]; };
  std::ptrdiff_t fewest = std::numeric_limits<std::ptrdiff_t>::max();
  int axis = -1, middle = 0;
  for (int a = 0; a < Dim; ++a) {
    std::nth_element(first, first + (last - first) / 2, last,
                     [&](int i, int j) { return at(i, a) < at(j, a); });
    const int m = first == last ? 0 : at(first[(last - first) / 2], a);
    const auto in_layers =
        std::count_if(first, last, [&](int j) { return at(j, a) >= m && at(j, a) < m + layers; });
    const bool two_halves = std::any_of(first, last, [&](int j) { return at(j, a) < m; }) &&
                            std::any_of(first, last, [&](int j) { return at(j, a) >= m + layers; });
    if (two_halves && in_layers < fewest) {
      fewest = in_layers;
      axis = a;
      middle = m;
    }
  }
  std::sort(first, last);
  if (axis < 0)
    return;
  int* upper = std::stable_partition(first, last, [&](int j) { return at(j, axis) < middle; });
  int* separator =
      std::stable_partition(upper, last, [&](int j) { return at(j, axis) >= middle + layers; });
  dissect(grid, first, upper);
  dissect(grid, upper, separator);
}

} // namespace talus
