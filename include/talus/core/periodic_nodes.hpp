// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <cstddef>
#include <cstdint>

namespace talus {

/// Nodes that stand for the same place of a box with periodic faces. The nodes 0 to n−1 along a
/// periodic axis of n cells are owners; node −1 is a copy of node n−1 and node n one of node 0, so
/// that owners have all their neighbours at constant offsets. Nothing in a box without periodic
/// faces.
template <int Dim>
class PeriodicNodes {
 public:
  PeriodicNodes() = default;
  explicit PeriodicNodes(const Grid<Dim>& grid) : grid_(grid) {
    if (!grid.any_periodic())
      return;
    near_copy_.assign(static_cast<std::size_t>(grid.node_count()), 0);
    for (int node = 0; node < grid.node_count(); ++node) {
      const Index<Dim> index = grid.node_index(node);
      const int owner = grid.node(grid.owner(index));
      if (owner == node || !is_used(index))
        continue;
      copies_.push_back({node, owner});
      mark_neighbours(index);
      mark_neighbours(grid.node_index(owner));
    }
  }

  bool any() const { return !copies_.empty(); }

  /// Gives the copies the owners' values.
  template <class Value>
  void copy(Array<Value>& field, const Execution& execution) const {
    if (any())
      execution.for_ranges(static_cast<std::ptrdiff_t>(copies_.size()),
                           [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                             for (std::ptrdiff_t k = begin; k < end; ++k) {
                               const Copy& copy = copies_[k];
                               field[copy.node] = field[copy.owner];
                             }
                           });
  }

  /// Adds the copies' values to the owners'.
  template <class Value>
  void fold(Array<Value>& field) const {
    for (const Copy& copy : copies_)
      field[copy.owner] += field[copy.node];
  }

  /// Is a neighbour of the node, or itself, one of several nodes of a place?
  bool near_copy(int node) const { return any() && near_copy_[node] != 0; }

  /// Gives all nodes of a node's place the value of that one.
  template <class Value>
  void share(Array<Value>& field, int node) const {
    const Value value = field[node];
    const Index<Dim> owner = grid_.owner(grid_.node_index(node));
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) { // by axis: the copy below, the owner, above
      Index<Dim> index = owner;
      bool there = true;
      for (int a = Dim - 1, rest = k; a >= 0; --a, rest /= 3) {
        const int step = rest % 3 - 1, n = grid_.cells(a);
        there = there && (step == 0 || (grid_.periodic(a) && owner[a] == (step < 0 ? n - 1 : 0)));
        index[a] += step * n;
      }
      if (there)
        field[grid_.node(index)] = value;
    }
  }

 private:
  struct Copy {
    int node, owner;
  };

  /// Of the nodes beyond the box only copies are used, not what lies farther.
  bool is_used(const Index<Dim>& index) const {
    for (int a = 0; a < Dim; ++a)
      if (index[a] > grid_.cells(a) || (index[a] < 0 && !grid_.periodic(a)))
        return false;
    return true;
  }

  void mark_neighbours(const Index<Dim>& index) {
    const int node = grid_.node(index);
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
      bool inside = true;
      for (int a = Dim - 1, rest = k; a >= 0; --a, rest /= 3) {
        const int i = index[a] + rest % 3 - 1;
        inside = inside && i >= 0 && i <= grid_.cells(a);
      }
      if (inside)
        near_copy_[node + grid_.neighbour_offset(k)] = 1;
    }
  }

  Grid<Dim> grid_;
  Array<Copy> copies_;
  Array<std::uint8_t> near_copy_; ///< #nodes
};

} // namespace talus
