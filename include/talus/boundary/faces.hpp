// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <cmath>
#include <cstddef>
#include <string>

namespace talus {

/// What a face of the box does to the material.
enum class FaceKind {
  no_slip,    ///< u = 0
  free_slip,  ///< u·n = 0
  open,       ///< nothing: material that passes it leaves the simulation
  frictional, ///< Coulomb contact with coefficient `friction`; the material may come off
  periodic,   ///< the box goes on at the opposite face, which must be periodic as well
  unset,      ///< refused: a face has no default
};

struct Face {
  FaceKind kind = FaceKind::unset;
  double friction = not_given; ///< μ_w ≥ 0, of frictional faces alone
};

/// The 2d faces of the box.
template <int Dim>
struct Faces {
  SmallArray<Face, Dim> lower{}, upper{};

  /// The same face everywhere, to change some of them.
  static Faces all(const Face& face) {
    Faces faces;
    faces.lower.fill(face);
    faces.upper.fill(face);
    return faces;
  }

  /// Throws std::invalid_argument if a face was not given, if the friction of a frictional face is
  /// not given, negative or not finite, if a face that is not frictional has one, or if only one
  /// of two opposite faces is periodic.
  void validate() const {
    constexpr const char* axis_names[] = {"x", "y", "z"};
    const auto check = [](const std::string& name, const Face& face) {
      if (face.kind == FaceKind::unset)
        throw_invalid(
            name, "not given",
            "FaceKind::no_slip, free_slip, open, frictional or periodic; it has no default");
      if (face.kind == FaceKind::frictional)
        require_given_non_negative(name + ".friction", face.friction);
      else if (!std::isnan(face.friction) && face.friction != 0)
        throw_invalid(name + ".friction", face.friction,
                      "none for a face that is not FaceKind::frictional");
    };
    for (int a = 0; a < Dim; ++a) {
      check(std::string("faces.lower.") + axis_names[a], lower[a]);
      check(std::string("faces.upper.") + axis_names[a], upper[a]);
      if ((lower[a].kind == FaceKind::periodic) != (upper[a].kind == FaceKind::periodic))
        throw_invalid(std::string("faces: the number of periodic ones along ") + axis_names[a], 1,
                      "0 or 2");
    }
  }

  /// Along which axes the box is periodic.
  SmallArray<bool, Dim> periodic() const {
    SmallArray<bool, Dim> axes{};
    for (int a = 0; a < Dim; ++a)
      axes[a] = lower[a].kind == FaceKind::periodic;
    return axes;
  }
};

/// Calls visit(axis, upper, face) for every face of the box that a node lies on. index: the node's.
template <int Dim, class Visit>
void for_each_face(const Grid<Dim>& grid, const Faces<Dim>& faces, const Index<Dim>& index,
                   const Visit& visit) {
  for (int a = 0; a < Dim; ++a) {
    if (index[a] == 0)
      visit(a, false, faces.lower[a]);
    if (index[a] == grid.cells(a))
      visit(a, true, faces.upper[a]);
  }
}

} // namespace talus
