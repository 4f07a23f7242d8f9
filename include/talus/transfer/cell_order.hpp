// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <iterator>
#include <numeric>
#include <utility>
#include <vector>

namespace talus {

/// Lists the particles cell by cell (a counting sort of their indices), so that one thread has all
/// of a cell's particles; in a cell by their ids, so that sums over them hang neither on what came
/// before nor on ranks. The particles themselves are put in that order only when more than one in
/// sixteen is out of place: few change their cell in a step, and moving all of them each time would
/// cost more memory traffic than the rest of a transfer.
template <int Dim>
class CellOrder {
 public:
  /// Lists `particles`, which must be in the box; may change their order.
  template <class Real>
  void update(Particles<Dim, Real>& particles, const Grid<Dim>& grid, const Execution& execution) {
    list(particles, grid, execution);
    execution.for_balanced(
        grid.cell_count(), [&](std::ptrdiff_t cell) { return begin_[cell]; },
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          for (std::ptrdiff_t cell = begin; cell < end; ++cell)
            sort_cell(particles.id, cell);
        });
    const std::size_t misplaced = execution.reduce(
        std::ssize(cell_), partials_, std::size_t{0},
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          std::size_t count = 0;
          for (auto p = static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, begin));
               p < static_cast<std::size_t>(end); ++p)
            count += cell_[p] < cell_[p - 1] ? 1U : 0U;
          return count;
        },
        std::plus<>());
    if (16 * misplaced > particles.size()) {
      reorder(particles, execution);
      execution.for_ranges(std::ssize(order_), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        std::iota(order_.begin() + begin, order_.begin() + end, static_cast<std::size_t>(begin));
      });
    }
  }

  /// The particles of cell c are particle(k) for begin(c) ≤ k < begin(c + 1).
  std::size_t begin(int cell) const { return begin_[cell]; }
  std::size_t particle(std::size_t k) const { return order_[k]; }
  /// Has the cell no particle? Cells that other ranks own count as filled.
  bool empty(int cell) const {
    return begin(cell) == begin(cell + 1) && (others_.empty() || !others_[cell]);
  }
  /// Looks up which cells of the window other ranks own.
  void find_others(const Grid<Dim>& grid) {
    others_.assign(static_cast<std::size_t>(grid.cell_count()), 0);
    for (int c = 0; c < grid.cell_count(); ++c)
      if (!grid.own().holds(grid.cell_index(c)))
        others_[c] = 1;
  }

 private:
  /// Puts a cell's part of the list in the order of ids, by insertion: nearly all of it is.
  void sort_cell(const std::vector<std::size_t>& id, std::ptrdiff_t cell) {
    for (std::size_t k = begin_[cell] + 1; k < begin_[cell + 1]; ++k) {
      const std::size_t particle = order_[k];
      std::size_t to = k;
      for (; to > begin_[cell] && id[order_[to - 1]] > id[particle]; --to)
        order_[to] = order_[to - 1];
      order_[to] = particle;
    }
  }

  /// A range of the particles that one thread counts and lists, and the cells that they are in.
  struct Part {
    std::size_t begin = 0, end = 0;    ///< particles
    int first_cell = 0, last_cell = 0; ///< last: past the end
    std::size_t counts = 0;            ///< where its counts begin, one a cell of its range
  };

  /// The list is the same for any number of parts: by cell, and in a cell by index. Particles are
  /// nearly in order, so that the parts' cells hardly overlap, and counts are about #cells.
  template <class Real>
  void list(const Particles<Dim, Real>& particles, const Grid<Dim>& grid,
            const Execution& execution) {
    const std::size_t count = particles.size();
    const int cells = grid.cell_count();
    cell_.resize(count);
    order_.resize(count);
    begin_.resize(static_cast<std::size_t>(cells) + 1);
    divide(count, static_cast<std::size_t>(execution.threads()));
    for_each_part(execution, [&](Part& part) {
      int first = cells, last = 0; // not in the part: others of them are in its cache line
      for (std::size_t p = part.begin; p < part.end; ++p) {
        const int cell = grid.cell(grid.cell_at(particles.position[p]));
        cell_[p] = cell;
        first = std::min(first, cell);
        last = std::max(last, cell + 1);
      }
      part.first_cell = first;
      part.last_cell = last;
    });
    std::size_t counts = 0;
    for (Part& part : parts_) {
      part.counts = counts;
      counts += static_cast<std::size_t>(std::max(0, part.last_cell - part.first_cell));
    }
    if (counts > 2 * static_cast<std::size_t>(cells)) { // far from in order: one part for all
      divide(count, 1);
      parts_[0].last_cell = cells;
      counts = static_cast<std::size_t>(cells);
    }
    next_.assign(counts, 0);
    for_each_part(execution, [&](const Part& part) {
      for (std::size_t p = part.begin; p < part.end; ++p)
        ++next(part, cell_[p]);
    });
    sum_counts(cells, execution);
    for_each_part(execution, [&](const Part& part) {
      for (std::size_t p = part.begin; p < part.end; ++p)
        order_[next(part, cell_[p])++] = p;
    });
  }

  void divide(std::size_t count, std::size_t parts) {
    parts_.assign(parts, Part{});
    for (std::size_t t = 0; t < parts; ++t) {
      parts_[t].begin = count * t / parts;
      parts_[t].end = count * (t + 1) / parts;
    }
  }

  template <class Body>
  void for_each_part(const Execution& execution, const Body& body) {
    execution.for_each(std::ssize(parts_), [&](std::ptrdiff_t t) { body(parts_[t]); });
  }

  std::size_t& next(const Part& part, int cell) {
    return next_[part.counts + static_cast<std::size_t>(cell - part.first_cell)];
  }

  /// From counts to places: begin_, and where each part lists its next particle of a cell.
  void sum_counts(int cells, const Execution& execution) {
    const std::ptrdiff_t ranges = execution.threads();
    const auto for_each_count = [&](std::ptrdiff_t range, const auto& before_cell,
                                    const auto& visit) {
      const auto edge = [&](std::ptrdiff_t r) { return static_cast<int>(cells * r / ranges); };
      for (int c = edge(range); c < edge(range + 1); ++c) {
        before_cell(c);
        for (const Part& part : parts_)
          if (c >= part.first_cell && c < part.last_cell)
            visit(next(part, c));
      }
    };
    sums_.assign(static_cast<std::size_t>(ranges) + 1, 0);
    execution.for_each(ranges, [&](std::ptrdiff_t r) {
      std::size_t sum = 0;
      for_each_count(
          r, [](int) {}, [&](std::size_t count) { sum += count; });
      sums_[static_cast<std::size_t>(r) + 1] = sum;
    });
    std::partial_sum(sums_.begin(), sums_.end(), sums_.begin());
    execution.for_each(ranges, [&](std::ptrdiff_t r) {
      std::size_t sum = sums_[r];
      for_each_count(
          r, [&](int c) { begin_[c] = sum; },
          [&](std::size_t& count) { sum += std::exchange(count, sum); });
    });
    begin_[cells] = sums_.back();
  }

  /// Puts particle order_[k] at place k for all k, in place, one thread an array.
  template <class Real>
  void reorder(Particles<Dim, Real>& particles, const Execution& execution) {
    constexpr std::ptrdiff_t arrays = 6;
    moved_.assign(arrays * order_.size(), 0);
    execution.for_each(arrays, [&](std::ptrdiff_t array) {
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
        if (!particles.material.empty()) {
          std::fill(moved, moved + order_.size(), char{0});
          permute(particles.material, moved);
        }
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

  Array<int> cell_; ///< of each particle
  Array<Part> parts_;
  Array<std::size_t> begin_, next_; ///< #cells + 1, about #cells
  Array<std::size_t> sums_;         ///< #ranges of cells + 1
  Array<std::size_t> partials_;
  Array<std::size_t> order_; ///< #p
  Array<char> others_;       ///< empty if there is one rank
  Array<char> moved_;
};

/// Calls visit(cell) for every cell that holds particles of this rank; threads have about as many
/// particles each.
template <int Dim, class Visit>
void for_each_filled_cell(const Execution& execution, const CellOrder<Dim>& order,
                          const Grid<Dim>& grid, const Visit& visit) {
  execution.for_balanced(
      grid.cell_count(), [&](std::ptrdiff_t cell) { return order.begin(static_cast<int>(cell)); },
      [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        for (int c = static_cast<int>(begin); c < end; ++c)
          if (order.begin(c) < order.begin(c + 1))
            visit(c);
      });
}

} // namespace talus
