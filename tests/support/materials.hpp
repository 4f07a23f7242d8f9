// SPDX-License-Identifier: MIT
#pragma once

#include "../physics/scenes.hpp"

#include "talus/rheology/materials.hpp"

namespace scenes {

/// Several materials of a kind of law, in the box of box().
template <int Dim, class Law = ConstantFriction, class Transfer = PolyPic>
using Mixed = Simulation<Dim, Materials<Law>, Transfer, GaussSeidel<>>;

/// box() for another rheology.
template <class S>
typename S::Params box_for(const Vec<3>& size, const Index<3>& cells, double angle_deg) {
  const auto plain = box<S::dimension>(size, cells, angle_deg, 0);
  typename S::Params params;
  params.grid = plain.grid;
  params.gravity = plain.gravity;
  params.time_step = plain.time_step;
  params.solver = plain.solver;
  params.faces = plain.faces;
  return params;
}

/// Fills the box between two heights with a material, on a regular lattice.
template <int Dim>
void add_layer(Particles<Dim>& particles, const GridParams<Dim>& grid, double z0, double z1,
               int material) {
  Vec<Dim> lower = grid.origin, upper = grid.origin + grid.size;
  lower[up_axis<Dim>] = z0;
  upper[up_axis<Dim>] = z1;
  fill_box(particles, Grid<Dim>(grid), lower, upper,
           {.per_axis = 2, .jitter = 0, .material = material});
}

} // namespace scenes
