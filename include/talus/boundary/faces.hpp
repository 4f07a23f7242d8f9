// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <array>
#include <cstddef>
#include <string>

namespace talus {

/// What a face of the box does to the material.
enum class FaceKind {
  stick,      ///< u = 0
  slip,       ///< u·n = 0
  free,       ///< nothing: material that passes it leaves the simulation
  frictional, ///< Coulomb contact with coefficient `friction`; the material may come off
};

struct Face {
  FaceKind kind = FaceKind::slip;
  double friction = 0; ///< μ_w ≥ 0, for frictional faces
};

/// The 2d faces of the box.
template <int Dim>
struct Faces {
  std::array<Face, static_cast<std::size_t>(Dim)> lower{}, upper{};

  /// Throws std::invalid_argument if a friction coefficient is negative or not finite.
  void validate() const {
    constexpr std::array axis_names{"x", "y", "z"};
    for (std::size_t a = 0; a < static_cast<std::size_t>(Dim); ++a) {
      require_non_negative(std::string("faces.lower.") + axis_names[a] + ".friction",
                           lower[a].friction);
      require_non_negative(std::string("faces.upper.") + axis_names[a] + ".friction",
                           upper[a].friction);
    }
  }
};

/// Calls visit(axis, upper, face) for every face of the box that a node lies on. index: the node's.
template <int Dim, class Visit>
void for_each_face(const Grid<Dim>& grid, const Faces<Dim>& faces, const Index<Dim>& index,
                   const Visit& visit) {
  for (int a = 0; a < Dim; ++a) {
    const std::size_t s = static_cast<std::size_t>(a);
    if (index[a] == 0)
      visit(a, false, faces.lower[s]);
    if (index[a] == grid.cells(a))
      visit(a, true, faces.upper[s]);
  }
}

} // namespace talus
