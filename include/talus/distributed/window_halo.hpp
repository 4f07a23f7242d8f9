// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/types.hpp"
#include "talus/distributed/partition.hpp"
#include "talus/dual/colouring.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <utility>

namespace talus::distributed {

/// Where the box of a rank's nodes with one layer around them lies, in the coordinates of the whole
/// grid; beyond a periodic face they go on.
template <int Dim>
NodeBox<Dim> window_of(const Grid<Dim>& grid, NodeBox<Dim> own) {
  if (own.empty())
    return {};
  for (int a = 0; a < Dim; ++a) {
    own.begin[a] = grid.periodic(a) ? own.begin[a] - 1 : std::max(own.begin[a] - 1, 0);
    own.end[a] = grid.periodic(a) ? own.end[a] + 1 : std::min(own.end[a] + 1, grid.cells(a) + 1);
  }
  return own;
}

/// The lists of what a rank sends to the others and receives from them. Both sides go through the
/// same boxes in the same order, so lists fit without being sent.
template <int Dim>
class WindowHalo final : public Halo {
 public:
  WindowHalo(const Grid<Dim>& grid, const Partition<Dim>& partition,
             const Communicator& communicator)
      : grid_(grid), communicator_(communicator),
        touched_(static_cast<std::size_t>(grid.node_count()), 0) {
    const int me = communicator.rank();
    for (int rank = 0; rank < partition.ranks(); ++rank) {
      if (rank == me)
        continue;
      Peer peer;
      peer.rank = rank;
      add_nodes(partition.box(rank), partition.box(me), peer.receive_nodes, peer.send_nodes);
      if (peer.receive_nodes.empty() && peer.send_nodes.empty())
        continue;
      add_cells(partition.box(rank), partition.box(me), peer.receive_cells, peer.send_cells);
      add_colours(partition, partition.box(rank), partition.box(me), peer);
      border_cells_.insert(border_cells_.end(), peer.send_cells.begin(), peer.send_cells.end());
      peers_.push_back(std::move(peer));
    }
  }

  void share_nodes(void* field, std::size_t bytes) const override {
    start(field, bytes, &Peer::send_nodes, &Peer::receive_nodes);
    finish(field, bytes, &Peer::receive_nodes);
  }
  void share_cells(void* field, std::size_t bytes) const override {
    start(field, bytes, &Peer::send_cells, &Peer::receive_cells);
    finish(field, bytes, &Peer::receive_cells);
  }
  const Array<int>& border_cells() const override { return border_cells_; }

  void set_cones(const Array<int>& cones, const Array<std::size_t>& begin) override {
    Array<Message> out, in;
    for (Peer& peer : peers_) {
      out.emplace_back();
      in.emplace_back();
      out.back().rank = in.back().rank = peer.rank;
      std::size_t receive = 0;
      for (const Array<int>& nodes : peer.receive_all)
        receive += nodes.size();
      in.back().bytes.resize(receive);
    }
    for (std::size_t colour = 0; colour < colours; ++colour) {
      ++visit_;
      for (std::size_t k = begin[colour]; k < begin[colour + 1]; ++k)
        for (int n = 0; n < Grid<Dim>::neighbours; ++n)
          touched_[cones[k] + grid_.neighbour_offset(n)] = visit_;
      for (std::size_t p = 0; p < peers_.size(); ++p) {
        Peer& peer = peers_[p];
        peer.send[colour].clear();
        for (const int node : peer.send_all[colour]) {
          const bool may_change = touched_[node] == visit_;
          if (may_change)
            peer.send[colour].push_back(node);
          out[p].bytes.push_back(may_change ? 1 : 0);
        }
      }
    }
    communicator_.start(out, in);
    communicator_.finish();
    for (std::size_t p = 0; p < peers_.size(); ++p) {
      std::size_t next = 0;
      for (std::size_t colour = 0; colour < colours; ++colour) {
        peers_[p].receive[colour].clear();
        for (const int node : peers_[p].receive_all[colour])
          if (in[p].bytes[next++] != 0)
            peers_[p].receive[colour].push_back(node);
      }
    }
  }

  void start_colour(std::size_t colour, const void* field, std::size_t bytes) const override {
    colour_ = colour;
    start(
        field, bytes, [&](const Peer& peer) -> const Array<int>& { return peer.send[colour]; },
        [&](const Peer& peer) -> const Array<int>& { return peer.receive[colour]; });
  }
  void finish_colour(void* field, std::size_t bytes) const override {
    finish(field, bytes,
           [&](const Peer& peer) -> const Array<int>& { return peer.receive[colour_]; });
  }

  /// Nodes for share_touched(), by rank: numbers here of what is sent, and of what is received.
  struct Touched {
    int rank = 0;
    Array<int> send, receive;
  };
  void set_touched(Array<Touched> touched) { touched_peers_ = std::move(touched); }

  void share_touched(void* field, std::size_t bytes) const override {
    start(touched_peers_, field, bytes, &Touched::send, &Touched::receive);
    finish(touched_peers_, field, bytes, &Touched::receive);
  }

 private:
  static constexpr std::size_t colours = BlockOrder<Dim>::colours;

  struct Peer {
    int rank = 0;
    Array<int> send_nodes, receive_nodes, send_cells, receive_cells;
    // by colour: all that may ever change, and what may in this step
    SmallArray<Array<int>, ipow(2, Dim)> send_all, receive_all, send, receive;
  };

  template <class Visit>
  static void for_each(const NodeBox<Dim>& box, const Visit& visit) {
    if (box.empty())
      return;
    Index<Dim> index = box.begin;
    for (int a = 0; a >= 0;) {
      visit(index);
      for (a = Dim - 1; a >= 0 && ++index[a] == box.end[a]; --a)
        index[a] = box.begin[a];
    }
  }

  /// Calls visit(shift) for the steps by whole boxes along periodic axes, none among them.
  template <class Visit>
  void for_each_shift(const Visit& visit) const {
    NodeBox<Dim> steps;
    for (int a = 0; a < Dim; ++a) {
      steps.begin[a] = grid_.periodic(a) ? -1 : 0;
      steps.end[a] = grid_.periodic(a) ? 2 : 1;
    }
    for_each(steps, [&](Index<Dim> shift) {
      for (int a = 0; a < Dim; ++a)
        shift[a] *= grid_.cells(a);
      visit(shift);
    });
  }

  static NodeBox<Dim> shifted(NodeBox<Dim> box, const Index<Dim>& by) {
    for (int a = 0; a < Dim; ++a) {
      box.begin[a] += by[a];
      box.end[a] += by[a];
    }
    return box;
  }
  static Index<Dim> minus(Index<Dim> index, const Index<Dim>& by) {
    for (int a = 0; a < Dim; ++a)
      index[a] -= by[a];
    return index;
  }
  static NodeBox<Dim> common(NodeBox<Dim> a, const NodeBox<Dim>& b) {
    for (int k = 0; k < Dim; ++k) {
      a.begin[k] = std::max(a.begin[k], b.begin[k]);
      a.end[k] = std::min(a.end[k], b.end[k]);
    }
    return a;
  }

  /// What a window has copies of, of `owned` nodes: visit(index in the window, index there).
  template <class Visit>
  void for_each_copy(const NodeBox<Dim>& window, const NodeBox<Dim>& owned,
                     const Visit& visit) const {
    if (window.empty() || owned.empty())
      return;
    for_each_shift([&](const Index<Dim>& shift) {
      for_each(common(window, shifted(owned, shift)),
               [&](const Index<Dim>& index) { visit(index, minus(index, shift)); });
    });
  }

  void add_nodes(const NodeBox<Dim>& theirs, const NodeBox<Dim>& mine, Array<int>& receive,
                 Array<int>& send) const {
    for_each_copy(window_of(grid_, mine), theirs, [&](const Index<Dim>& here, const Index<Dim>&) {
      receive.push_back(grid_.node(here));
    });
    for_each_copy(window_of(grid_, theirs), mine, [&](const Index<Dim>&, const Index<Dim>& here) {
      send.push_back(grid_.node(here));
    });
  }

  /// The cells of the window of a rank that has `own`; see Grid::first_cell.
  NodeBox<Dim> cell_window(const NodeBox<Dim>& own) const {
    NodeBox<Dim> cells = own;
    for (int a = 0; a < Dim && !own.empty(); ++a) {
      const bool whole =
          own.begin[a] == 0 && own.end[a] == grid_.cells(a) + (grid_.periodic(a) ? 0 : 1);
      if (!whole)
        cells.begin[a] = grid_.periodic(a) ? own.begin[a] - 1 : std::max(own.begin[a] - 1, 0);
      cells.end[a] = std::min(own.end[a], grid_.cells(a));
    }
    return cells;
  }
  NodeBox<Dim> own_cells(NodeBox<Dim> own) const {
    for (int a = 0; a < Dim; ++a)
      own.end[a] = std::min(own.end[a], grid_.cells(a));
    return own;
  }
  void add_cells(const NodeBox<Dim>& theirs, const NodeBox<Dim>& mine, Array<int>& receive,
                 Array<int>& send) const {
    for_each_copy(
        cell_window(mine), own_cells(theirs),
        [&](const Index<Dim>& here, const Index<Dim>&) { receive.push_back(grid_.cell(here)); });
    for_each_copy(
        cell_window(theirs), own_cells(mine),
        [&](const Index<Dim>&, const Index<Dim>& here) { send.push_back(grid_.cell(here)); });
  }

  /// Calls visit(colour, nodes that a visit of the block may change) for the blocks of a rank.
  template <class Visit>
  void for_each_block(const Partition<Dim>& partition, const NodeBox<Dim>& own,
                      const Visit& visit) const {
    if (own.empty())
      return;
    NodeBox<Dim> blocks;
    for (int a = 0; a < Dim; ++a) {
      const Array<int>& edges = partition.edges()[a];
      const auto at = [&](int node) {
        return static_cast<int>(std::lower_bound(edges.begin(), edges.end(), node) - edges.begin());
      };
      blocks.begin[a] = at(own.begin[a]);
      blocks.end[a] = at(own.end[a]);
    }
    for_each(blocks, [&](const Index<Dim>& block) {
      std::size_t colour = 0;
      NodeBox<Dim> nodes;
      for (int a = 0; a < Dim; ++a) {
        colour = 2 * colour + static_cast<std::size_t>(block[a] % 2);
        nodes.begin[a] = partition.edges()[a][block[a]];
        nodes.end[a] = partition.edges()[a][block[a] + 1];
      }
      visit(colour, window_of(grid_, nodes));
    });
  }

  void add_colours(const Partition<Dim>& partition, const NodeBox<Dim>& theirs,
                   const NodeBox<Dim>& mine, Peer& peer) const {
    const NodeBox<Dim> here = window_of(grid_, mine), there = window_of(grid_, theirs);
    for_each_block(partition, theirs, [&](std::size_t colour, const NodeBox<Dim>& nodes) {
      for_each_copy(here, nodes, [&](const Index<Dim>& index, const Index<Dim>&) {
        peer.receive_all[colour].push_back(grid_.node(index));
      });
    });
    for_each_block(partition, mine, [&](std::size_t colour, const NodeBox<Dim>& nodes) {
      for_each_copy(there, nodes, [&](const Index<Dim>&, const Index<Dim>& index) {
        peer.send_all[colour].push_back(grid_.node(index));
      });
    });
  }

  template <class Send, class Receive>
  void start(const void* field, std::size_t bytes, const Send& send, const Receive& receive) const {
    start(peers_, field, bytes, send, receive);
  }
  template <class Receive>
  void finish(void* field, std::size_t bytes, const Receive& receive) const {
    finish(peers_, field, bytes, receive);
  }

  /// send, receive: which of a peer's lists.
  template <class AnyPeer, class Send, class Receive>
  void start(const Array<AnyPeer>& peers, const void* field, std::size_t bytes, const Send& send,
             const Receive& receive) const {
    out_.resize(peers.size());
    in_.resize(peers.size());
    const char* const from = static_cast<const char*>(field);
    for (std::size_t p = 0; p < peers.size(); ++p) {
      out_[p].rank = in_[p].rank = peers[p].rank;
      const Array<int>& nodes = std::invoke(send, peers[p]);
      out_[p].bytes.resize(nodes.size() * bytes);
      char* to = out_[p].bytes.data();
      for (const int node : nodes) {
        std::memcpy(to, from + static_cast<std::size_t>(node) * bytes, bytes);
        to += bytes;
      }
      in_[p].bytes.resize(std::invoke(receive, peers[p]).size() * bytes);
    }
    communicator_.start(out_, in_);
  }
  template <class AnyPeer, class Receive>
  void finish(const Array<AnyPeer>& peers, void* field, std::size_t bytes,
              const Receive& receive) const {
    communicator_.finish();
    char* const to = static_cast<char*>(field);
    for (std::size_t p = 0; p < peers.size(); ++p) {
      const char* from = in_[p].bytes.data();
      for (const int node : std::invoke(receive, peers[p])) {
        std::memcpy(to + static_cast<std::size_t>(node) * bytes, from, bytes);
        from += bytes;
      }
    }
  }

  Grid<Dim> grid_; ///< the window of this rank
  const Communicator& communicator_;
  Array<Peer> peers_;
  Array<Touched> touched_peers_;
  Array<int> border_cells_;
  Array<int> touched_; ///< number of the last visit that may change a node, #nodes
  int visit_ = 0;
  mutable std::size_t colour_ = 0;
  mutable Array<Message> out_, in_;
};

} // namespace talus::distributed
