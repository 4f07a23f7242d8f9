// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/parallel.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace talus {

/// Lists the particles cell by cell (a stable counting sort of their indices), so that one thread
/// has all of a cell's particles. The particles themselves are put in that order only when more
/// than one in sixteen is out of place: few change their cell in a step, and moving all of them
/// each time would cost more memory traffic than the rest of a transfer.
template <int Dim>
class CellOrder {
 public:
  /// Lists `particles`, which must be in the box; may change their order.
  /// Throws std::invalid_argument if there are 2^32 particles or more.
  template <class Real>
  void update(Particles<Dim, Real>& particles, const Grid<Dim>& grid, int threads) {
    if (particles.size() > std::numeric_limits<std::uint32_t>::max())
      throw_invalid("the number of particles", particles.size(), "below 2^32");
    list(particles, grid, threads);
    std::size_t misplaced = 0;
    for (std::size_t p = 1; p < cell_.size(); ++p)
      misplaced += cell_[p] < cell_[p - 1] ? 1U : 0U;
    if (16 * misplaced > particles.size()) {
      reorder(particles, threads);
      for (std::size_t k = 0; k < order_.size(); ++k)
        order_[k] = static_cast<std::uint32_t>(k);
    }
  }

  /// The particles of cell c are particle(k) for begin(c) ≤ k < begin(c + 1).
  std::size_t begin(int cell) const { return begin_[static_cast<std::size_t>(cell)]; }
  std::size_t particle(std::size_t k) const { return order_[k]; }
  bool empty(int cell) const { return begin(cell) == begin(cell + 1); }

 private:
  /// Each thread counts and then lists one part of the particles. The list is the same for any
  /// number of parts: by cell, and in a cell by index.
  template <class Real>
  void list(const Particles<Dim, Real>& particles, const Grid<Dim>& grid, int threads) {
    const std::size_t count = particles.size();
    const std::size_t cells = static_cast<std::size_t>(grid.cell_count());
    const std::size_t parts = static_cast<std::size_t>(threads);
    cell_.resize(count);
    order_.resize(count);
    begin_.resize(cells + 1);
    next_.assign(parts * cells, 0);
    const auto for_each_part = [&](const auto& body) {
      parallel_for(threads, threads, [&](std::ptrdiff_t part) {
        const std::size_t t = static_cast<std::size_t>(part);
        body(next_.data() + t * cells, count * t / parts, count * (t + 1) / parts);
      });
    };
    for_each_part([&](std::uint32_t* counts, std::size_t first, std::size_t last) {
      for (std::size_t p = first; p < last; ++p) {
        const int cell = grid.cell(grid.cell_at(particles.position[p]));
        cell_[p] = cell;
        ++counts[cell];
      }
    });
    std::uint32_t sum = 0;
    for (std::size_t c = 0; c < cells; ++c) {
      begin_[c] = sum;
      for (std::size_t t = 0; t < parts; ++t) {
        const std::uint32_t here = next_[t * cells + c];
        next_[t * cells + c] = sum;
        sum += here;
      }
    }
    begin_[cells] = sum;
    for_each_part([&](std::uint32_t* next, std::size_t first, std::size_t last) {
      for (std::size_t p = first; p < last; ++p)
        order_[next[cell_[p]]++] = static_cast<std::uint32_t>(p);
    });
  }

  /// Puts particle order_[k] at place k for all k, in place, one thread an array.
  template <class Real>
  void reorder(Particles<Dim, Real>& particles, int threads) {
    constexpr std::ptrdiff_t arrays = 6;
    moved_.assign(arrays * order_.size(), 0);
    parallel_for(threads, arrays, [&](std::ptrdiff_t array) {
      char* moved = moved_.data() + static_cast<std::size_t>(array) * order_.size();
      switch (array) {
      case 0:
        permute(particles.affine, moved);
        break;
      case 1:
        permute(particles.position, moved);
        break;
      case 2:
        permute(particles.velocity, moved);
        break;
      case 3:
        permute(particles.volume, moved);
        break;
      case 4:
        if (!particles.mixed.empty())
          permute(particles.mixed, moved);
        break;
      default:
        permute(particles.id, moved);
      }
    });
  }

  /// Follows each cycle of the permutation once; `moved`: #p, zero.
  template <class Value>
  void permute(std::vector<Value>& values, char* moved) const {
    for (std::size_t start = 0; start < order_.size(); ++start) {
      if (moved[start])
        continue;
      const Value first = values[start];
      std::size_t to = start;
      for (std::size_t from = order_[to]; from != start; from = order_[to]) {
        values[to] = values[from];
        moved[to] = 1;
        to = from;
      }
      values[to] = first;
      moved[to] = 1;
    }
  }

  std::vector<int> cell_;                   ///< of each particle
  std::vector<std::uint32_t> begin_, next_; ///< #cells + 1, #threads × #cells
  std::vector<std::uint32_t> order_;        ///< #p
  std::vector<char> moved_;
};

} // namespace talus
