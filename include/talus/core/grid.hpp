// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

/// \file
/// The Cartesian grid: a box cut into equal cells. Nodes are stored with one layer of ghosts around
/// the box, so that all 3^d neighbours of a node of the box exist and have constant offsets.

namespace talus {

/// Position, size and resolution of the box.
template <int Dim>
struct GridParams {
  Vec<Dim> origin = Vec<Dim>::Zero(); ///< lower corner, m
  Vec<Dim> size = Vec<Dim>::Zero();   ///< extent, m; > 0
  Index<Dim> cells{};                 ///< number of cells along each axis; >= 1
};

/// The nodes that a rank owns: begin ≤ index < end by axis; the cells that it owns are those that
/// begin at them.
template <int Dim>
struct NodeBox {
  Index<Dim> begin{}, end{};

  bool empty() const {
    bool any = false;
    for (int a = 0; a < Dim; ++a)
      any = any || begin[a] >= end[a];
    return any;
  }
  bool holds(const Index<Dim>& node) const {
    bool all = true;
    for (int a = 0; a < Dim; ++a)
      all = all && node[a] >= begin[a] && node[a] < end[a];
    return all;
  }
  friend bool operator==(const NodeBox&, const NodeBox&) = default;
};

/// A box of equal cells. Cells and nodes are numbered with the last axis fastest.
///
/// Where ranks share a simulation, each has a window of the grid: the nodes that it owns with one
/// layer of others' around them, and the cells of its own nodes. Coordinates are those of the whole
/// grid everywhere; numbers, and the arrays that they index, are of the window alone.
template <int Dim>
class Grid {
  static_assert(Dim == 2 || Dim == 3, "talus: the dimension is 2 or 3");

 public:
  static constexpr int corners = ipow(2, Dim); ///< nodes of a cell
  static constexpr int neighbours =
      ipow(3, Dim); ///< nodes that share a cell with a node, itself included

  Grid() = default;

  /// Throws std::invalid_argument if a size is not finite and positive, a number of cells is below
  /// 1 or above 2^30, or the grid has more than 2^30 nodes.
  /// periodic: along which axes the box goes on at its opposite face.
  explicit Grid(const GridParams<Dim>& params, const SmallArray<bool, Dim>& periodic = {})
      : Grid(params, periodic, all_nodes(params, periodic)) {}

  /// The window of the rank that owns `own`, which lies in all_nodes(). Throws as the other one.
  Grid(const GridParams<Dim>& params, const SmallArray<bool, Dim>& periodic,
       const NodeBox<Dim>& own)
      : origin_(params.origin), size_(params.size), cells_(params.cells), periodic_(periodic),
        own_(own) {
    constexpr const char* axis_names[] = {"x", "y", "z"};
    for (int a = 0; a < Dim; ++a) {
      const std::string axis = axis_names[a];
      require_finite("grid.origin." + axis, origin_[a]);
      require_positive("grid.size." + axis, size_[a]);
      if (cells(a) < 1 || cells(a) > most_nodes)
        throw_invalid("grid.cells." + axis, cells(a), "an integer in 1..2^30");
      spacing_[a] = size_[a] / cells(a);
      inverse_spacing_[a] = 1 / spacing_[a];
    }
    double nodes = 1;
    const NodeBox<Dim> all = all_nodes(params, periodic);
    for (int a = 0; a < Dim; ++a) {
      whole_[a] = own_.begin[a] == 0 && own_.end[a] == all.end[a];
      // a whole axis has one more layer beyond its upper face, whether it is periodic or not
      node_layers_[a] = whole_[a] ? cells(a) + 3 : own_.end[a] - own_.begin[a] + 2;
      first_cell_[a] = whole_[a] || (own_.begin[a] == 0 && !periodic_[a]) ? 0 : own_.begin[a] - 1;
      cell_end_[a] = std::max(std::min(own_.end[a], cells(a)), first_cell_[a]);
      nodes *= node_layers_[a];
    }
    if (nodes > most_nodes)
      throw_invalid("the number of grid nodes", nodes, "at most 2^30");
    int node_stride = 1, cell_stride = 1;
    for (int a = Dim - 1; a >= 0; --a) {
      node_stride_[a] = node_stride;
      cell_stride_[a] = cell_stride;
      node_stride *= node_layers_[a];
      cell_stride *= cell_end_[a] - first_cell_[a];
    }
    node_count_ = node_stride;
    cell_count_ = cell_stride;
  }

  /// The nodes of the box: 0..cells(a) along an axis, without the last if it is periodic.
  static NodeBox<Dim> all_nodes(const GridParams<Dim>& params,
                                const SmallArray<bool, Dim>& periodic) {
    NodeBox<Dim> all;
    for (int a = 0; a < Dim; ++a)
      all.end[a] = std::min(params.cells[a], most_nodes) + (periodic[a] ? 0 : 1);
    return all;
  }

  const NodeBox<Dim>& own() const { return own_; }
  /// Does this rank own all nodes along an axis? A periodic one then goes on in the window.
  bool whole(int axis) const { return whole_[axis]; }
  /// The cells that the window has: from first_cell(a) to below cell_end(a) along each axis.
  int first_cell(int axis) const { return first_cell_[axis]; }
  int cell_end(int axis) const { return cell_end_[axis]; }

  const Vec<Dim>& origin() const { return origin_; }
  const Vec<Dim>& size() const { return size_; }
  Vec<Dim> upper() const { return origin_ + size_; }
  const Vec<Dim>& spacing() const { return spacing_; } ///< edge lengths of a cell, m
  const Vec<Dim>& inverse_spacing() const { return inverse_spacing_; }
  int cells(int axis) const { return cells_[axis]; } ///< of the whole grid
  double cell_volume() const { return spacing_.prod(); }
  int cell_count() const { return cell_count_; } ///< of the window
  /// Of the window, ghosts included: the size of nodal arrays.
  int node_count() const { return node_count_; }

  bool periodic(int axis) const { return periodic_[axis]; }
  bool any_periodic() const {
    bool any = false;
    for (const bool axis : periodic_)
      any = any || axis;
    return any;
  }

  /// The node of the window that stands for the same place: the same one, but for the last node
  /// along a periodic axis that the window has as a whole and the ghosts beyond.
  Index<Dim> owner(Index<Dim> node) const {
    for (int a = 0; a < Dim; ++a)
      if (periodic(a) && whole(a))
        node[a] = (node[a] % cells(a) + cells(a)) % cells(a);
    return node;
  }

  /// The same by numbers.
  int owner(int number) const { return node(owner(node_index(number))); }
  /// Does this rank own all nodes?
  bool whole() const {
    bool all = true;
    for (int a = 0; a < Dim; ++a)
      all = all && whole(a);
    return all;
  }

  /// x moved by whole boxes along the periodic axes, so that it lies in the box.
  Vec<Dim> wrapped(Vec<Dim> x) const {
    for (int a = 0; a < Dim; ++a)
      if (periodic(a) && !(x[a] >= origin_[a] && x[a] < origin_[a] + size_[a])) {
        x[a] -= size_[a] * std::floor((x[a] - origin_[a]) / size_[a]);
        if (!(x[a] >= origin_[a] && x[a] < origin_[a] + size_[a])) // by rounding
          x[a] = origin_[a];
      }
    return x;
  }

  int node_stride(int axis) const { return node_stride_[axis]; }

  /// Number of the node with coordinates 0..cells(a) on each axis (-1 and cells(a)+1: ghosts), or
  /// those of the window.
  int node(const Index<Dim>& index) const {
    int n = 0;
    for (int a = 0; a < Dim; ++a)
      n += (index[a] - own_.begin[a] + 1) * node_stride(a);
    return n;
  }

  /// Number of the owner of a node. Throws std::invalid_argument if the window does not have it.
  int node_in_window(const Index<Dim>& index) const {
    const Index<Dim> there = owner(index);
    for (int a = 0; a < Dim; ++a)
      if (const int layer = there[a] - own_.begin[a] + 1; layer < 0 || layer >= node_layers_[a])
        throw_invalid(std::string("node.") + "xyz"[a], index[a],
                      std::to_string(own_.begin[a]) + " to " +
                          std::to_string(std::min(cells(a), own_.begin[a] + node_layers_[a] - 2)));
    return node(there);
  }

  /// Coordinates of a node: the inverse of node().
  Index<Dim> node_index(int node) const {
    Index<Dim> index;
    for (int a = 0; a < Dim; ++a) {
      index[a] = node / node_stride(a) - 1 + own_.begin[a];
      node %= node_stride(a);
    }
    return index;
  }

  Vec<Dim> node_position(const Index<Dim>& index) const {
    Vec<Dim> x;
    for (int a = 0; a < Dim; ++a)
      x[a] = origin_[a] + spacing_[a] * index[a];
    return x;
  }
  Vec<Dim> node_position(int node) const { return node_position(node_index(node)); }

  /// v_i = ∫ N_i over the box (m^d): a cell's volume, halved for each face that the node lies on
  /// and that is not periodic.
  double node_volume(const Index<Dim>& index) const {
    double v = cell_volume();
    for (int a = 0; a < Dim; ++a) {
      const int i = index[a];
      if (!periodic(a) && (i == 0 || i == cells(a)))
        v *= 0.5;
    }
    return v;
  }

  /// Number of a cell of the window from its coordinates.
  int cell(const Index<Dim>& index) const {
    int c = 0;
    for (int a = 0; a < Dim; ++a)
      c += (index[a] - first_cell_[a]) * cell_stride_[a];
    return c;
  }

  Index<Dim> cell_index(int cell) const {
    Index<Dim> index;
    for (int a = 0; a < Dim; ++a) {
      index[a] = cell / cell_stride_[a] + first_cell_[a];
      cell %= cell_stride_[a];
    }
    return index;
  }

  /// The cell that holds x; a point on an upper face belongs to the last cell. x must be in the
  /// box.
  Index<Dim> cell_at(const Vec<Dim>& x) const {
    Index<Dim> index;
    for (int a = 0; a < Dim; ++a) {
      const double s = (x[a] - origin_[a]) * inverse_spacing_[a];
      index[a] = std::clamp(static_cast<int>(s), 0, cells(a) - 1);
    }
    return index;
  }

  /// Coordinates of x in its cell, each in [0, 1].
  Vec<Dim> local(const Vec<Dim>& x, const Index<Dim>& cell) const {
    Vec<Dim> xi;
    for (int a = 0; a < Dim; ++a)
      xi[a] = (x[a] - origin_[a]) * inverse_spacing_[a] - cell[a];
    return xi;
  }

  /// Number of the lowest node of a cell; corner c is at + corner_offset(c).
  int first_node(const Index<Dim>& cell) const { return node(cell); }

  /// Offset of corner c of a cell; bit a of c (from the last axis up) says which end of axis a.
  int corner_offset(int corner) const {
    int offset = 0;
    for (int a = 0; a < Dim; ++a)
      offset += corner_bit(corner, a) * node_stride(a);
    return offset;
  }

  /// 0 or 1: on which end of `axis` the corner lies.
  static constexpr int corner_bit(int corner, int axis) { return (corner >> (Dim - 1 - axis)) & 1; }

  /// Offset of neighbour k of a node, k in 0..3^d-1 with the last axis fastest; the middle is
  /// itself.
  int neighbour_offset(int k) const {
    int offset = 0;
    for (int a = Dim - 1; a >= 0; --a, k /= 3)
      offset += (k % 3 - 1) * node_stride(a);
    return offset;
  }
  /// Its weight in a mean around the node: 1, 2, 1 along each axis, which takes out what alternates
  /// from node to node.
  static constexpr double neighbour_weight(int k) {
    double weight = 1;
    for (int a = 0; a < Dim; ++a, k /= 3)
      weight *= k % 3 == 1 ? 2 : 1;
    return weight;
  }

 private:
  static constexpr int most_nodes = 1 << 30;

  Vec<Dim> origin_ = Vec<Dim>::Zero(), size_ = Vec<Dim>::Zero();
  Vec<Dim> spacing_ = Vec<Dim>::Zero(), inverse_spacing_ = Vec<Dim>::Zero();
  Index<Dim> cells_{}, node_stride_{}, cell_stride_{}, node_layers_{}, first_cell_{}, cell_end_{};
  SmallArray<bool, Dim> periodic_{}, whole_{};
  NodeBox<Dim> own_{};
  int node_count_ = 0, cell_count_ = 0;
};

} // namespace talus
