// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

namespace talus::distributed {

/// What the blocks of this rank's particles cost: a map from the coordinates of a block.
template <int Dim>
class Load {
 public:
  /// A cone costs a step about as much as so many particles: it is visited in every sweep.
  static constexpr std::int64_t cone = 100;

  Load(const Grid<Dim>& grid, const SmallArray<Array<int>, Dim>& edges,
       const std::vector<Vec<Dim>>& positions) {
    std::map<std::size_t, std::int64_t> cells; // particles in each
    for (const Vec<Dim>& x : positions) {
      const Index<Dim> cell = grid.cell_at(x);
      std::size_t number = 0;
      for (int a = 0; a < Dim; ++a)
        number =
            number * static_cast<std::size_t>(grid.cells(a)) + static_cast<std::size_t>(cell[a]);
      ++cells[number];
    }
    for (const auto& [number, count] : cells) {
      Entry entry;
      std::size_t rest = number;
      for (int a = Dim - 1; a >= 0; --a) {
        const auto along = static_cast<std::size_t>(grid.cells(a));
        const int node = static_cast<int>(rest % along);
        rest /= along;
        entry.block[a] = static_cast<int>(std::upper_bound(edges[a].begin(), edges[a].end(), node) -
                                          edges[a].begin() - 1);
      }
      entry.weight = count + cone;
      if (!entries.empty() && entries.back().block == entry.block)
        entries.back().weight += entry.weight;
      else
        entries.push_back(entry);
    }
  }

  struct Entry {
    Index<Dim> block{};
    std::int64_t weight = 0;
  };
  Array<Entry> entries; ///< a block may have several
};

/// Which nodes each rank owns: boxes of whole blocks, found by cutting the grid in two, along its
/// longest edge and where the loads of the ranks on both sides are in proportion to their number,
/// and the halves again (recursive bisection, Berger & Bokhari, IEEE Trans. Comput. 36, 1987).
/// Boxes, not stretches of a curve: in a box all neighbours of a node have constant offsets.
template <int Dim>
class Partition {
 public:
  Partition() = default;

  /// Collective. With more ranks than blocks some ranks own nothing.
  Partition(const Load<Dim>& load, const SmallArray<Array<int>, Dim>& edges,
            const Communicator& communicator)
      : edges_(edges) {
    Array<Part> parts(1);
    parts[0].ranks = communicator.size();
    for (int a = 0; a < Dim; ++a)
      parts[0].blocks.end[a] = static_cast<int>(edges[a].size()) - 1;
    for (bool split = true; split;) {
      split = false;
      Array<std::int64_t> weights; // of slices along each part's longest edge
      for (Part& part : parts) {
        part.axis = part.ranks > 1 ? longest_edge(part.blocks) : -1;
        part.first = weights.size();
        if (part.axis >= 0)
          weights.resize(part.first + static_cast<std::size_t>(extent(part.blocks, part.axis)), 0);
      }
      for (const auto& entry : load.entries)
        for (const Part& part : parts)
          if (part.axis >= 0 && part.blocks.holds(entry.block))
            weights[part.first + static_cast<std::size_t>(entry.block[part.axis] -
                                                          part.blocks.begin[part.axis])] +=
                entry.weight;
      if (!weights.empty())
        communicator.sum(weights.data(), static_cast<int>(weights.size()));
      Array<Part> next;
      for (const Part& part : parts) {
        if (part.ranks == 1) {
          next.push_back(part);
          continue;
        }
        Part low = part, high = part;
        low.ranks = part.ranks / 2;
        high.ranks = part.ranks - low.ranks;
        split = true;
        if (part.axis < 0) { // one block, or none: the others own nothing
          low.ranks = 1;
          high.ranks = part.ranks - 1;
          high.blocks = {};
        } else {
          low.blocks.end[part.axis] = high.blocks.begin[part.axis] =
              cut(part, low.ranks, weights.data() + part.first);
        }
        next.push_back(low);
        next.push_back(high);
      }
      parts.swap(next);
    }
    for (const Part& part : parts) {
      NodeBox<Dim> box;
      if (!part.blocks.empty())
        for (int a = 0; a < Dim; ++a) {
          box.begin[a] = edges[a][part.blocks.begin[a]];
          box.end[a] = edges[a][part.blocks.end[a]];
        }
      boxes_.push_back(box);
    }
  }

  int ranks() const { return static_cast<int>(boxes_.size()); }
  const NodeBox<Dim>& box(int rank) const { return boxes_[rank]; }
  const SmallArray<Array<int>, Dim>& edges() const { return edges_; }

  /// The rank that owns a node of the grid. near: one to look at first.
  int owner(const Index<Dim>& node, int near = 0) const {
    if (boxes_[near].holds(node))
      return near;
    int rank = 0;
    while (!boxes_[rank].holds(node))
      ++rank;
    return rank;
  }

 private:
  struct Part {
    int ranks = 1;
    NodeBox<Dim> blocks{}; ///< coordinates of blocks
    int axis = -1;
    std::size_t first = 0; ///< of its slices' weights
  };

  static int extent(const NodeBox<Dim>& box, int axis) { return box.end[axis] - box.begin[axis]; }

  /// The axis of the longest edge that has more than one block, or −1.
  int longest_edge(const NodeBox<Dim>& blocks) const {
    int longest = -1, nodes = 0;
    for (int a = 0; a < Dim; ++a) {
      const int along = edges_[a][blocks.end[a]] - edges_[a][blocks.begin[a]];
      if (extent(blocks, a) > 1 && along > nodes) {
        longest = a;
        nodes = along;
      }
    }
    return longest;
  }

  /// Where to cut so that the lower part has its ranks' share of the weight, as nearly as whole
  /// blocks allow; empty blocks count as little as one particle.
  static int cut(const Part& part, int low_ranks, const std::int64_t* weights) {
    const int slices = extent(part.blocks, part.axis);
    std::int64_t blocks = 1, all = 0;
    for (int a = 0; a < Dim; ++a)
      if (a != part.axis)
        blocks *= extent(part.blocks, a);
    for (int k = 0; k < slices; ++k)
      all += weights[k] + blocks;
    const std::int64_t wanted = all / part.ranks * low_ranks;
    std::int64_t sum = weights[0] + blocks;
    int end = 1;
    for (; end + 1 < slices; ++end) {
      const std::int64_t more = sum + weights[end] + blocks;
      if (more - wanted > wanted - sum) // farther from it than without
        break;
      sum = more;
    }
    return part.blocks.begin[part.axis] + end;
  }

  SmallArray<Array<int>, Dim> edges_;
  Array<NodeBox<Dim>> boxes_; ///< #ranks
};

} // namespace talus::distributed
