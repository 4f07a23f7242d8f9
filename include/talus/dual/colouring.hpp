// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace talus {

/// The order in which Gauss–Seidel visits the nodes: blocks of 4^d nodes in 2^d colours. A cone
/// changes the velocities of its 3^d neighbours, so two blocks of one colour, a whole block apart,
/// never touch the same velocity, and threads can share a colour without changing a bit of the
/// result. Along a periodic axis blocks have 2 to 8 nodes, and copies of nodes are in no block.
template <int Dim>
class BlockOrder {
 public:
  static constexpr int block_edge =
      4; ///< nodes; at least 2 for blocks of a colour to be independent
  static constexpr int colours = ipow(2, Dim);

  BlockOrder() = default;
  explicit BlockOrder(const Grid<Dim>& grid) {
    SmallArray<Array<int>, Dim> edges; // where blocks begin along each axis
    Index<Dim> blocks;
    for (int a = 0; a < Dim; ++a) {
      Array<int>& edge = edges[a];
      edge = grid.periodic(a) ? periodic_edges(grid.cells(a)) : closed_edges(grid.cells(a) + 1);
      blocks[a] = static_cast<int>(edge.size()) - 1;
    }
    const auto edge = [&](int a, int block) { return edges[a][block]; };
    for (int colour = 0; colour < colours; ++colour) {
      colour_begin_.push_back(begin_.size());
      for_each_index(blocks, [&](const Index<Dim>& block) {
        Index<Dim> count;
        for (int a = 0; a < Dim; ++a) {
          if (block[a] % 2 != Grid<Dim>::corner_bit(colour, a))
            return;
          count[a] = edge(a, block[a] + 1) - edge(a, block[a]);
        }
        begin_.push_back(nodes_.size());
        for_each_index(count, [&](const Index<Dim>& in_block) {
          Index<Dim> node;
          for (int a = 0; a < Dim; ++a)
            node[a] = edge(a, block[a]) + in_block[a];
          nodes_.push_back(grid.node(node));
        });
      });
    }
    colour_begin_.push_back(begin_.size());
    begin_.push_back(nodes_.size());
  }

  std::size_t blocks() const { return begin_.size() - 1; }
  /// Nodes of block k: nodes()[begin(k)] .. nodes()[begin(k + 1) − 1].
  std::size_t begin(std::size_t block) const { return begin_[block]; }
  const Array<int>& nodes() const { return nodes_; }
  /// Blocks of colour c: colour_begin()[c] .. colour_begin()[c + 1] − 1.
  const Array<std::size_t>& colour_begin() const { return colour_begin_; }

 private:
  static Array<int> closed_edges(int nodes) {
    Array<int> edges;
    for (int first = 0; first < nodes; first += block_edge)
      edges.push_back(first);
    edges.push_back(nodes);
    return edges;
  }

  /// One block, or an even number, so that the first and the last, which are neighbours, differ in
  /// colour.
  static Array<int> periodic_edges(int nodes) {
    const int count = nodes <= block_edge ? 1 : 2 * std::max(1, nodes / (2 * block_edge));
    Array<int> edges;
    for (int k = 0; k <= count; ++k)
      edges.push_back(nodes * k / count);
    return edges;
  }

  /// Calls visit for all indices below `count`, last axis fastest.
  template <class Visit>
  static void for_each_index(const Index<Dim>& count, const Visit& visit) {
    int total = 1;
    for (const int n : count.values)
      total *= n;
    for (int i = 0; i < total; ++i) {
      Index<Dim> index;
      int rest = i;
      for (int a = Dim - 1; a >= 0; --a) {
        index[a] = rest % count[a];
        rest /= count[a];
      }
      visit(index);
    }
  }

  Array<int> nodes_;
  Array<std::size_t> begin_, colour_begin_;
};

/// Gives the problem a cone for each node that carries one, in the order of the blocks, and sets
/// its blocks and colours; its contacts are left for the caller to assign. carries(node): does the
/// node carry a cone? Called once or twice a node. counts: workspace.
template <int Dim, class Carries>
void collect_cones(const BlockOrder<Dim>& order, const Carries& carries, const Execution& execution,
                   Array<std::size_t>& counts, DualProblem<Dim>& problem) {
  const auto for_each_node = [&](std::ptrdiff_t block, const auto& visit) {
    const std::size_t b = static_cast<std::size_t>(block);
    for (std::size_t k = order.begin(b); k < order.begin(b + 1); ++k)
      if (carries(order.nodes()[k]))
        visit(order.nodes()[k]);
  };
  const std::ptrdiff_t blocks = static_cast<std::ptrdiff_t>(order.blocks());
  counts.assign(order.blocks() + 1, 0);
  execution.for_each(blocks, [&](std::ptrdiff_t b) {
    for_each_node(b, [&](int) { ++counts[static_cast<std::size_t>(b) + 1]; });
  });
  std::partial_sum(counts.begin(), counts.end(), counts.begin());
  problem.node.resize(counts.back());
  execution.for_each(blocks, [&](std::ptrdiff_t b) {
    std::size_t cone = counts[b];
    for_each_node(b, [&](int node) { problem.node[cone++] = node; });
  });
  problem.blocks.clear();
  problem.colour_begin.clear();
  const Array<std::size_t>& colours = order.colour_begin();
  for (std::size_t colour = 0; colour + 1 < colours.size(); ++colour) {
    problem.colour_begin.push_back(problem.blocks.size());
    for (std::size_t b = colours[colour]; b < colours[colour + 1]; ++b)
      if (counts[b + 1] > counts[b])
        problem.blocks.push_back({.cone_begin = counts[b], .cone_end = counts[b + 1]});
  }
  problem.colour_begin.push_back(problem.blocks.size());
}

/// Calls visit(block) for all blocks, one colour after the other; those of one colour at once, on
/// threads that have about as many cones each.
template <int Dim, class Visit>
void for_each_block(const DualProblem<Dim>& problem, const Execution& execution,
                    const Visit& visit) {
  for (std::size_t colour = 0; colour + 1 < problem.colour_begin.size(); ++colour) {
    const std::size_t first = problem.colour_begin[colour];
    const std::size_t count = problem.colour_begin[colour + 1] - first;
    const auto cones_before = [&](std::ptrdiff_t b) {
      return b == 0 ? problem.blocks[first].cone_begin
                    : problem.blocks[first + static_cast<std::size_t>(b) - 1].cone_end;
    };
    if (count > 0)
      execution.for_balanced(static_cast<std::ptrdiff_t>(count), cones_before,
                             [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                               for (std::ptrdiff_t b = begin; b < end; ++b)
                                 visit(first + static_cast<std::size_t>(b));
                             });
  }
}

/// Calls visit(cone) for all cones; those that share a neighbour never at once.
template <int Dim, class Visit>
void for_each_cone(const DualProblem<Dim>& problem, const Execution& execution,
                   const Visit& visit) {
  for_each_block(problem, execution, [&](std::size_t b) {
    for (std::size_t i = problem.blocks[b].cone_begin; i < problem.blocks[b].cone_end; ++i)
      visit(i);
  });
}

} // namespace talus
