// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>

namespace talus {

/// The order in which Gauss–Seidel visits the nodes: blocks of 4^d nodes in 2^d colours. A cone
/// changes the velocities of its 3^d neighbours, so two blocks of one colour, a whole block apart,
/// never touch the same velocity, and threads can share a colour without changing a bit of the
/// result. Along a periodic axis blocks have 2 to 8 nodes, and copies of nodes are in no block.
/// With several ranks each has whole blocks: what it does to nodes of others goes to them after
/// each colour. Those blocks come first in their colour, so that there is something to do
/// meanwhile.
template <int Dim>
class BlockOrder {
 public:
  static constexpr int block_edge =
      4; ///< nodes; at least 2 for blocks of a colour to be independent
  static constexpr int colours = ipow(2, Dim);

  BlockOrder() = default;
  explicit BlockOrder(const Grid<Dim>& grid) {
    const NodeBox<Dim>& own = grid.own();
    Index<Dim> first, blocks; // of this rank
    for (int a = 0; a < Dim; ++a) {
      edges_[a] = edges(grid, a);
      first[a] = own.empty() ? 0 : block_of(a, own.begin[a]);
      blocks[a] = own.empty() ? 0 : block_of(a, own.end[a] - 1) + 1 - first[a];
    }
    for (int colour = 0; colour < colours; ++colour) {
      colour_begin_.push_back(begin_.size());
      for (int part = 0; part < 2; ++part) {
        const bool border = part == 0;
        for_each_index(blocks, [&](const Index<Dim>& number) {
          Index<Dim> from, count;
          bool at_border = false;
          for (int a = 0; a < Dim; ++a) {
            const int block = first[a] + number[a];
            if (block % 2 != Grid<Dim>::corner_bit(colour, a))
              return;
            from[a] = edges_[a][block];
            count[a] = edges_[a][block + 1] - from[a];
            at_border =
                at_border || (!grid.whole(a) && (number[a] == 0 || number[a] + 1 == blocks[a]));
          }
          if (at_border != border)
            return;
          begin_.push_back(nodes_.size());
          for_each_index(count, [&](const Index<Dim>& in_block) {
            Index<Dim> node;
            for (int a = 0; a < Dim; ++a)
              node[a] = from[a] + in_block[a];
            nodes_.push_back(grid.node(node));
          });
        });
        if (border)
          border_end_.push_back(begin_.size());
      }
    }
    colour_begin_.push_back(begin_.size());
    begin_.push_back(nodes_.size());
  }

  /// Where blocks begin along an axis of the whole grid, and where the last one ends.
  static Array<int> edges(const Grid<Dim>& grid, int axis) {
    return grid.periodic(axis) ? periodic_edges(grid.cells(axis))
                               : closed_edges(grid.cells(axis) + 1);
  }

  /// A number that sorts the nodes of all ranks in the order in which one rank alone visits them.
  std::size_t place(const Index<Dim>& node) const {
    constexpr auto most = std::size_t{2} * block_edge; // nodes along the edge of a block
    std::size_t colour = 0, block = 0, in_block = 0, nodes = 1;
    for (int a = 0; a < Dim; ++a) {
      const auto number = static_cast<std::size_t>(block_of(a, node[a]));
      colour = 2 * colour + number % 2;
      block = block * (edges_[a].size() - 1) + number;
      in_block = in_block * most + static_cast<std::size_t>(node[a] - edges_[a][number]);
    }
    for (int a = 0; a < Dim; ++a) {
      colour *= edges_[a].size() - 1;
      nodes *= most;
    }
    return (colour + block) * nodes + in_block;
  }

  /// The node of a place: the inverse of place().
  Index<Dim> node_at(std::size_t place) const {
    constexpr auto most = std::size_t{2} * block_edge;
    std::size_t nodes = 1, blocks = 1;
    for (int a = 0; a < Dim; ++a) {
      nodes *= most;
      blocks *= edges_[a].size() - 1;
    }
    std::size_t in_block = place % nodes, block = place / nodes % blocks;
    Index<Dim> node;
    for (int a = Dim - 1; a >= 0; --a) {
      const std::size_t along = edges_[a].size() - 1;
      node[a] = edges_[a][block % along] + static_cast<int>(in_block % most);
      block /= along;
      in_block /= most;
    }
    return node;
  }

  std::size_t blocks() const { return begin_.size() - 1; }
  /// Nodes of block k: nodes()[begin(k)] .. nodes()[begin(k + 1) − 1].
  std::size_t begin(std::size_t block) const { return begin_[block]; }
  const Array<int>& nodes() const { return nodes_; }
  /// Blocks of colour c: colour_begin()[c] .. colour_begin()[c + 1] − 1.
  const Array<std::size_t>& colour_begin() const { return colour_begin_; }
  /// Where those end, in each colour, that change what other ranks have.
  const Array<std::size_t>& border_end() const { return border_end_; }

 private:
  /// The number, along an axis, of the block that a node is in.
  int block_of(int axis, int node) const {
    const Array<int>& edges = edges_[axis];
    int low = 0, high = static_cast<int>(edges.size()) - 1;
    while (high - low > 1) {
      const int middle = (low + high) / 2;
      (edges[middle] <= node ? low : high) = middle;
    }
    return low;
  }

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
      edges.push_back(static_cast<int>(std::int64_t{nodes} * k / count));
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

  SmallArray<Array<int>, Dim> edges_;
  Array<int> nodes_;
  Array<std::size_t> begin_, colour_begin_, border_end_;
};

/// BlockOrder::place of a node by its number; of corner c of a free body, −1 − c: after all nodes.
template <int Dim>
std::size_t place_of(const Grid<Dim>& grid, const BlockOrder<Dim>& order, int node) {
  return node < 0 ? (~std::size_t{0} >> 1U) + static_cast<std::size_t>(-1 - node)
                  : order.place(grid.node_index(node));
}

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
  problem.border_end.clear();
  const Array<std::size_t>& colours = order.colour_begin();
  for (std::size_t colour = 0; colour + 1 < colours.size(); ++colour) {
    problem.colour_begin.push_back(problem.blocks.size());
    for (std::size_t b = colours[colour]; b < colours[colour + 1]; ++b) {
      if (b == order.border_end()[colour])
        problem.border_end.push_back(problem.blocks.size());
      if (counts[b + 1] > counts[b])
        problem.blocks.push_back({.cone_begin = counts[b], .cone_end = counts[b + 1]});
    }
    if (order.border_end()[colour] == colours[colour + 1])
      problem.border_end.push_back(problem.blocks.size());
  }
  problem.colour_begin.push_back(problem.blocks.size());
  if (Halo* const halo = problem.copies.halo()) {
    Array<std::size_t> cones; // where each colour's begin
    for (const std::size_t first : colours)
      cones.push_back(counts[first]);
    halo->set_cones(problem.node, cones);
  }
}

/// Calls visit(block) for all blocks, one colour after the other; those of one colour at once, on
/// threads that have about as many cones each. field: a value a node that visits change next to
/// their cones: other ranks get it after each colour.
template <int Dim, class Value, class Visit>
void for_each_block(const DualProblem<Dim>& problem, const Execution& execution,
                    Array<Value>& field, const Visit& visit) {
  const Halo* const halo = problem.copies.halo();
  const auto visit_range = [&](std::size_t first, std::size_t end) {
    const auto cones_before = [&](std::ptrdiff_t b) {
      return b == 0 ? problem.blocks[first].cone_begin
                    : problem.blocks[first + static_cast<std::size_t>(b) - 1].cone_end;
    };
    execution.for_balanced(static_cast<std::ptrdiff_t>(end - first), cones_before,
                           [&](std::ptrdiff_t begin, std::ptrdiff_t last) {
                             for (std::ptrdiff_t b = begin; b < last; ++b)
                               visit(first + static_cast<std::size_t>(b));
                           });
  };
  for (std::size_t colour = 0; colour + 1 < problem.colour_begin.size(); ++colour) {
    std::size_t first = problem.colour_begin[colour];
    if (halo) {
      visit_range(first, problem.border_end[colour]);
      first = problem.border_end[colour];
      halo->start_colour(colour, field.data(), sizeof(Value));
    }
    visit_range(first, problem.colour_begin[colour + 1]);
    if (halo)
      halo->finish_colour(field.data(), sizeof(Value));
  }
}

/// Calls visit(cone) for all cones; those that share a neighbour never at once. field: as
/// for_each_block.
template <int Dim, class Value, class Visit>
void for_each_cone(const DualProblem<Dim>& problem, const Execution& execution, Array<Value>& field,
                   const Visit& visit) {
  for_each_block(problem, execution, field, [&](std::size_t b) {
    for (std::size_t i = problem.blocks[b].cone_begin; i < problem.blocks[b].cone_end; ++i)
      visit(i);
  });
}

/// N sums at once over the blocks of all ranks: term(block, of_block) sets the N numbers of a
/// block, and these are added without rounding, so that the sums depend on neither ranks nor
/// threads. partials: workspace; afterwards the numbers of all blocks, N each.
template <int N, int Dim, class Term>
SmallArray<double, N> sum_over_blocks(const DualProblem<Dim>& problem, const Execution& execution,
                                      Array<double>& partials, const Term& term) {
  partials.resize(N * problem.blocks.size());
  execution.for_each(std::ssize(problem.blocks),
                     [&](std::ptrdiff_t b) { term(problem.blocks[b], partials.data() + N * b); });
  SmallArray<ExactSum, N> sums;
  for (std::size_t k = 0; k < partials.size(); ++k)
    sums[k % N].add(partials[k]);
  execution.join(sums.values, N);
  SmallArray<double, N> total;
  for (int k = 0; k < N; ++k)
    total[k] = sums[k].value();
  return total;
}

} // namespace talus
