// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace talus {

/// `count` random points, none close to another: draws points until one keeps its distance to all
/// others, and shortens the distance where none does (relaxation dart throwing, after McCool &
/// Fiume 1992). lower, upper: corners of a box that holds all that draw() → Vec<Dim> gives, m.
/// spacing: mean distance of neighbours along each axis, m; the unit in which distances are
/// measured. The same draws give the same points.
template <int Dim, class Draw>
std::vector<Vec<Dim>> blue_noise_points(std::size_t count, const Vec<Dim>& lower,
                                        const Vec<Dim>& upper, const Vec<Dim>& spacing,
                                        const Draw& draw) {
  // Points by cells of one spacing, as linked lists; neighbours within one spacing are in the 3^d
  // cells around.
  constexpr int none = -1;
  Index<Dim> cells;
  std::size_t total = 1;
  for (int a = 0; a < Dim; ++a) {
    cells[a] = std::max(1, static_cast<int>(std::ceil((upper[a] - lower[a]) / spacing[a])));
    total *= static_cast<std::size_t>(cells[a]);
  }
  std::vector<int> first(total, none), next;
  std::vector<Vec<Dim>> points;
  points.reserve(count);
  next.reserve(count);
  const auto cell_of = [&](const Vec<Dim>& x) {
    Index<Dim> cell;
    for (int a = 0; a < Dim; ++a)
      cell[a] = std::clamp(static_cast<int>((x[a] - lower[a]) / spacing[a]), 0, cells[a] - 1);
    return cell;
  };
  const auto number = [&](const Index<Dim>& cell) {
    std::size_t n = 0;
    for (int a = 0; a < Dim; ++a)
      n = n * static_cast<std::size_t>(cells[a]) + static_cast<std::size_t>(cell[a]);
    return n;
  };
  const auto is_close = [&](const Vec<Dim>& x, double distance) {
    const Index<Dim> middle = cell_of(x);
    for (int k = 0; k < ipow(3, Dim); ++k) {
      Index<Dim> cell = middle;
      bool inside = true;
      for (int a = 0, rest = k; a < Dim; ++a, rest /= 3) {
        cell[a] += rest % 3 - 1;
        inside = inside && cell[a] >= 0 && cell[a] < cells[a];
      }
      if (!inside)
        continue;
      for (int p = first[number(cell)]; p != none; p = next[static_cast<std::size_t>(p)])
        if ((points[static_cast<std::size_t>(p)] - x).cwiseQuotient(spacing).norm() < distance)
          return true;
    }
    return false;
  };
  double distance = 1;
  constexpr int patience = 200; // draws in vain before the distance is shortened
  for (int misses = 0; points.size() < count;) {
    const Vec<Dim> x = draw();
    if (is_close(x, distance)) {
      if (++misses == patience) {
        distance *= 0.98;
        misses = 0;
      }
      continue;
    }
    misses = 0;
    int& head = first[number(cell_of(x))];
    next.push_back(head);
    head = static_cast<int>(points.size());
    points.push_back(x);
  }
  return points;
}

} // namespace talus
