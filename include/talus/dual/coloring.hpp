// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"

#include <cstddef>
#include <vector>

namespace talus {

/// The order in which Gauss–Seidel visits the nodes: blocks of 4^d nodes in 2^d colours. A cone
/// changes the velocities of its 3^d neighbours, so two blocks of one colour, a whole block apart,
/// never touch the same velocity, and threads can share a colour without changing a bit of the
/// result.
template <int Dim>
class BlockOrder {
 public:
  static constexpr int block_edge =
      4; ///< nodes; at least 2 for blocks of a colour to be independent
  static constexpr int colours = ipow(2, Dim);

  BlockOrder() = default;
  explicit BlockOrder(const Grid<Dim>& grid) {
    Index<Dim> blocks;
    for (int a = 0; a < Dim; ++a)
      blocks[a] = grid.cells(a) / block_edge + 1;
    for (int colour = 0; colour < colours; ++colour) {
      colour_begin_.push_back(begin_.size());
      for_each_index(blocks, [&](const Index<Dim>& block) {
        for (int a = 0; a < Dim; ++a)
          if (block[a] % 2 != Grid<Dim>::corner_bit(colour, a))
            return;
        begin_.push_back(nodes_.size());
        Index<Dim> edges;
        for (int& edge : edges.values)
          edge = block_edge;
        for_each_index(edges, [&](const Index<Dim>& in_block) {
          Index<Dim> node;
          for (int a = 0; a < Dim; ++a) {
            node[a] = block[a] * block_edge + in_block[a];
            if (node[a] > grid.cells(a))
              return;
          }
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
  const std::vector<int>& nodes() const { return nodes_; }
  /// Blocks of colour c: colour_begin()[c] .. colour_begin()[c + 1] − 1.
  const std::vector<std::size_t>& colour_begin() const { return colour_begin_; }

 private:
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

  std::vector<int> nodes_;
  std::vector<std::size_t> begin_, colour_begin_;
};

/// Sets the problem's blocks and colours. Its cones must stand in the order of `order`, which may
/// have more nodes; its contacts are left for the caller to assign.
template <int Dim>
void assign_blocks(const BlockOrder<Dim>& order, DualProblem<Dim>& problem) {
  problem.blocks.clear();
  problem.colour_begin.clear();
  const std::vector<std::size_t>& colours = order.colour_begin();
  std::size_t cone = 0;
  for (std::size_t colour = 0; colour + 1 < colours.size(); ++colour) {
    problem.colour_begin.push_back(problem.blocks.size());
    for (std::size_t b = colours[colour]; b < colours[colour + 1]; ++b) {
      Block block;
      block.cone_begin = cone;
      for (std::size_t k = order.begin(b); k < order.begin(b + 1); ++k)
        if (cone < problem.cones() && problem.node[cone] == order.nodes()[k])
          ++cone;
      block.cone_end = cone;
      if (block.cone_end > block.cone_begin)
        problem.blocks.push_back(block);
    }
  }
  problem.colour_begin.push_back(problem.blocks.size());
}

} // namespace talus
