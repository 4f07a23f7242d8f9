// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <array>
#include <cstddef>

namespace talus {

/// Particles of one cell that are worked on side by side, with the machine's vector instructions.
inline constexpr std::size_t particle_lanes = 8;

/// How many times as many are read before they are worked on: a vector that is loaded right after
/// its lanes were stored one by one waits for all of the stores (half of a transfer, measured).
inline constexpr std::size_t particle_packs = 4;

/// One number of each of the particles side by side.
using ParticleLanes = Eigen::Array<double, static_cast<int>(particle_lanes), 1>;

/// Their sum. Not Eigen's: with AVX-512 g++ 12 warns of it in every user's build (GCC bug 105593).
inline double sum_of(const ParticleLanes& l) {
  static_assert(particle_lanes == 8);
  return ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]));
}

/// A Dim-vector of each, by component.
template <int Dim>
using VecLanes = SmallArray<ParticleLanes, Dim>;

/// The set {axis} among the sets of axes, numbered like the corners of a cell.
template <int Dim>
constexpr std::size_t axis_term(std::size_t axis) {
  return std::size_t{1} << (static_cast<std::size_t>(Dim) - 1 - axis);
}

/// The set of axes of each column of MixedDerivatives.
template <int Dim>
inline constexpr auto mixed_terms = [] {
  if constexpr (Dim == 2)
    return std::array<std::size_t, 1>{3};
  else
    return std::array<std::size_t, 4>{3, 5, 6, 7};
}();

/// Coordinates in `cell`, in [0, 1], from positions x (m).
template <int Dim>
VecLanes<Dim> local_lanes(const Grid<Dim>& grid, const Index<Dim>& cell, const VecLanes<Dim>& x) {
  VecLanes<Dim> xi;
  for (int a = 0; a < Dim; ++a)
    xi[a] = (x[a] - grid.origin()[a]) * grid.inverse_spacing()[a] - static_cast<double>(cell[a]);
  return xi;
}

/// Puts the components of v into one lane.
template <int Dim, class Real>
void set_lane(VecLanes<Dim>& lanes, std::size_t lane, const Real* v) {
  for (int a = 0; a < Dim; ++a)
    lanes[a][static_cast<Eigen::Index>(lane)] = static_cast<double>(v[a]);
}

} // namespace talus
