// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/types.hpp"

#include <cstddef>
#include <cstdint>

namespace talus {

/// Nodes of the window that stand for a place of which another node is the owner.
///
/// In a box with periodic faces the nodes 0 to n−1 along a periodic axis of n cells are owners;
/// node −1 is a copy of node n−1 and node n one of node 0, so that owners have all their neighbours
/// at constant offsets. With several ranks the outermost layer of each window holds copies of nodes
/// that others own.
template <int Dim>
class NodeCopies {
 public:
  NodeCopies() = default;
  /// halo: how ranks share nodes; null: there is one rank.
  explicit NodeCopies(const Grid<Dim>& grid, Halo* halo = nullptr) : grid_(grid), halo_(halo) {
    bool any_here = false;
    for (int a = 0; a < Dim; ++a)
      any_here = any_here || (grid.periodic(a) && grid.whole(a));
    if (!any_here)
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

  Halo* halo() const { return halo_; }

  /// Gives the copies the owners' values, those that other ranks own, too.
  template <class Value>
  void copy(Array<Value>& field, const Execution& execution) const {
    if (halo_)
      halo_->share_nodes(field.data(), sizeof(Value));
    copy_here(field, execution);
  }
  /// The same where the owner is a node of this window.
  template <class Value>
  void copy_here(Array<Value>& field, const Execution& execution) const {
    if (any_here())
      execution.for_ranges(static_cast<std::ptrdiff_t>(copies_.size()),
                           [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                             for (std::ptrdiff_t k = begin; k < end; ++k) {
                               const Copy& copy = copies_[k];
                               field[copy.node] = field[copy.owner];
                             }
                           });
  }

  /// Is a neighbour of the node, or itself, one of several nodes of a place in this window?
  bool near_copy(int node) const { return any_here() && near_copy_[node] != 0; }

  /// Gives all nodes of a node's place in this window the value of that one.
  template <class Value>
  void share(Array<Value>& field, int node) const {
    const Value value = field[node];
    const Index<Dim> owner = grid_.owner(grid_.node_index(node));
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) { // by axis: the copy below, the owner, above
      Index<Dim> index = owner;
      bool there = true;
      for (int a = Dim - 1, rest = k; a >= 0; --a, rest /= 3) {
        const int step = rest % 3 - 1, n = grid_.cells(a);
        there = there && (step == 0 || (grid_.periodic(a) && grid_.whole(a) &&
                                        owner[a] == (step < 0 ? n - 1 : 0)));
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

  bool any_here() const { return !copies_.empty(); }

  /// Is the index that of a node along this axis, or of a copy that is used?
  bool is_used(const Index<Dim>& index, int axis) const {
    const int below = grid_.periodic(axis) || !grid_.whole(axis) ? 1 : 0;
    const int end = grid_.whole(axis) ? grid_.cells(axis) + 1 : grid_.own().end[axis] + 1;
    return index[axis] >= grid_.own().begin[axis] - below && index[axis] < end;
  }
  bool is_used(const Index<Dim>& index) const {
    bool used = true;
    for (int a = 0; a < Dim; ++a)
      used = used && is_used(index, a);
    return used;
  }

  void mark_neighbours(const Index<Dim>& index) {
    const int node = grid_.node(index);
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
      Index<Dim> other = index;
      for (int a = Dim - 1, rest = k; a >= 0; --a, rest /= 3)
        other[a] += rest % 3 - 1;
      if (is_used(other))
        near_copy_[node + grid_.neighbour_offset(k)] = 1;
    }
  }

  Grid<Dim> grid_;
  Halo* halo_ = nullptr;
  Array<Copy> copies_;
  Array<std::uint8_t> near_copy_; ///< #nodes
};

} // namespace talus
