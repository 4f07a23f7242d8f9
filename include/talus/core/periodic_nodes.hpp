// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace talus {

/// Nodes that stand for the same place of a box with periodic faces. The nodes 0 to n−1 along a
/// periodic axis of n cells are owners; node −1 is a copy of node n−1 and node n one of node 0, so
/// that owners have all their neighbours at constant offsets. Nothing in a box without periodic
/// faces.
template <int Dim>
class PeriodicNodes {
 public:
  PeriodicNodes() = default;
  explicit PeriodicNodes(const Grid<Dim>& grid) {
    if (!grid.any_periodic())
      return;
    const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
    first_.assign(nodes + 1, 0);
    near_copy_.assign(nodes, 0);
    for (int node = 0; node < grid.node_count(); ++node) {
      const int owner = grid.node(grid.owner(grid.node_index(node)));
      if (owner != node && is_used(grid, node))
        copies_.emplace_back(node, owner);
    }
    // each node of such a place gets the list of all of them
    std::vector<std::vector<int>> places(nodes);
    for (const auto& [copy, owner] : copies_) {
      std::vector<int>& place = places[static_cast<std::size_t>(owner)];
      if (place.empty())
        place.push_back(owner);
      place.push_back(copy);
    }
    for (const auto& [copy, owner] : copies_)
      places[static_cast<std::size_t>(copy)] = places[static_cast<std::size_t>(owner)];
    for (std::size_t j = 0; j < nodes; ++j) {
      first_[j + 1] = first_[j] + places[j].size();
      same_.insert(same_.end(), places[j].begin(), places[j].end());
    }
    for (int node = 0; node < grid.node_count(); ++node)
      if (!places[static_cast<std::size_t>(node)].empty())
        mark_neighbours(grid, node);
  }

  bool any() const { return !copies_.empty(); }

  /// Gives the copies the owners' values.
  template <class Value, class AnyExecution>
  void copy(std::vector<Value>& field, const AnyExecution& execution) const {
    if (any())
      execution.for_ranges(static_cast<std::ptrdiff_t>(copies_.size()), [&](std::ptrdiff_t begin,
                                                                            std::ptrdiff_t end) {
        for (std::ptrdiff_t k = begin; k < end; ++k) {
          const auto [to, from] = copies_[static_cast<std::size_t>(k)];
          field[static_cast<std::size_t>(to)] = field[static_cast<std::size_t>(from)];
        }
      });
  }

  /// Adds the copies' values to the owners'.
  template <class Value>
  void fold(std::vector<Value>& field) const {
    for (const auto& [copy, owner] : copies_)
      field[static_cast<std::size_t>(owner)] += field[static_cast<std::size_t>(copy)];
  }

  /// Is a neighbour of the node, or itself, one of several nodes of a place?
  bool near_copy(int node) const {
    return any() && near_copy_[static_cast<std::size_t>(node)] != 0;
  }

  /// Gives all nodes of a node's place the value of that one.
  template <class Value>
  void share(std::vector<Value>& field, int node) const {
    const std::size_t j = static_cast<std::size_t>(node);
    for (std::size_t k = first_[j]; k < first_[j + 1]; ++k)
      field[static_cast<std::size_t>(same_[k])] = field[j];
  }

 private:
  /// Of the nodes beyond the box only copies are used, not what lies farther.
  static bool is_used(const Grid<Dim>& grid, int node) {
    const Index<Dim> index = grid.node_index(node);
    for (int a = 0; a < Dim; ++a)
      if (index[a] > grid.cells(a) || (index[a] < 0 && !grid.periodic(a)))
        return false;
    return true;
  }

  void mark_neighbours(const Grid<Dim>& grid, int node) {
    const Index<Dim> index = grid.node_index(node);
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
      bool inside = true;
      for (int a = Dim - 1, rest = k; a >= 0; --a, rest /= 3) {
        const int i = index[a] + rest % 3 - 1;
        inside = inside && i >= 0 && i <= grid.cells(a);
      }
      if (inside)
        near_copy_[static_cast<std::size_t>(node + grid.neighbour_offset(k))] = 1;
    }
  }

  std::vector<std::pair<int, int>> copies_; ///< copy and owner
  std::vector<std::size_t> first_;          ///< where a node's list in same_ begins, #nodes + 1
  std::vector<int> same_;
  std::vector<std::uint8_t> near_copy_; ///< #nodes
};

} // namespace talus
