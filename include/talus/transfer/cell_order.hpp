// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/parallel.hpp"
#include "talus/particles.hpp"

#include <cstddef>
#include <utility>
#include <vector>

namespace talus {

/// Keeps particles in cell order (a stable counting sort), so that each cell's particles are a
/// range that one thread reads alone and in sequence.
template <int Dim>
class CellOrder {
 public:
  /// Sorts `particles` by cell. Particles must be in the box.
  void sort(Particles<Dim>& particles, const Grid<Dim>& grid, int threads) {
    const std::size_t count = particles.size();
    cell_.resize(count);
    parallel_chunks(threads, static_cast<std::ptrdiff_t>(count), 4096,
                    [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                      for (std::ptrdiff_t p = begin; p < end; ++p)
                        cell_[static_cast<std::size_t>(p)] = grid.cell(
                            grid.cell_at(particles.position[static_cast<std::size_t>(p)]));
                    });
    begin_.assign(static_cast<std::size_t>(grid.cell_count()) + 1, 0);
    bool sorted = true;
    for (std::size_t p = 0; p < count; ++p) {
      ++begin_[static_cast<std::size_t>(cell_[p]) + 1];
      sorted = sorted && (p == 0 || cell_[p - 1] <= cell_[p]);
    }
    for (std::size_t c = 1; c < begin_.size(); ++c)
      begin_[c] += begin_[c - 1];
    if (sorted)
      return;

    next_.assign(begin_.begin(), begin_.end() - 1);
    target_.resize(count);
    for (std::size_t p = 0; p < count; ++p)
      target_[p] = next_[static_cast<std::size_t>(cell_[p])]++;
    spare_.resize(count);
    parallel_chunks(threads, static_cast<std::ptrdiff_t>(count), 4096,
                    [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                      for (std::ptrdiff_t p = begin; p < end; ++p)
                        spare_.copy(target_[static_cast<std::size_t>(p)], particles,
                                    static_cast<std::size_t>(p));
                    });
    std::swap(particles, spare_);
  }

  /// Particles of cell c: begin(c) ≤ p < begin(c + 1).
  std::size_t begin(int cell) const { return begin_[static_cast<std::size_t>(cell)]; }
  bool empty(int cell) const { return begin(cell) == begin(cell + 1); }

 private:
  std::vector<int> cell_;
  std::vector<std::size_t> begin_, next_, target_;
  Particles<Dim> spare_;
};

} // namespace talus
