// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"

#include <cstddef>

namespace talus {

/// What ranks exchange of nodal fields and cells around the edges of their windows; type-erased: an
/// entry has `bytes` bytes, and those of a node or cell lie at its number times that. Collective.
class Halo {
 public:
  Halo() = default;
  virtual ~Halo() = default;
  Halo(const Halo&) = delete;
  Halo& operator=(const Halo&) = delete;

  /// Gives the copies of nodes, or of cells, in the windows of other ranks their owners' values.
  virtual void share_nodes(void* field, std::size_t bytes) const = 0;
  virtual void share_cells(void* field, std::size_t bytes) const = 0;
  /// The cells whose values share_cells() sends.
  virtual const Array<int>& border_cells() const = 0;

  /// Says which nodes around a visit of each colour may change: those next to `cones`, the nodes
  /// that carry cones, listed by colour from begin[colour] to begin[colour + 1].
  virtual void set_cones(const Array<int>& cones, const Array<std::size_t>& begin) = 0;
  /// Between the two calls other windows get what this rank's visits of a colour have changed.
  virtual void start_colour(std::size_t colour, const void* field, std::size_t bytes) const = 0;
  virtual void finish_colour(void* field, std::size_t bytes) const = 0;

  /// Gives the nodes that free bodies touch in other windows, see Ranks::share_contacts, their
  /// owners' values.
  virtual void share_touched(void* field, std::size_t bytes) const = 0;
};

} // namespace talus
