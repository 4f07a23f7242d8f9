// SPDX-License-Identifier: MIT
#pragma once

#include "talus/diagnostics/totals.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

/// Small scenes that the physics tests share.
namespace scenes {

using namespace talus;

template <int Dim, class Transfer = PolyPic>
using Sim = Simulation<Dim, ConstantFriction, Transfer, GaussSeidel<>>;

/// A box with slip walls, a sticking floor and an open top, gravity turned by `angle_deg`.
/// size and cells: along x, across (3-D) and up.
template <int Dim>
typename Sim<Dim>::Params box(const Vec<3>& size, const Index<3>& cells, double angle_deg,
                              double mu) {
  typename Sim<Dim>::Params params;
  for (int a = 0; a < Dim; ++a) {
    const int from = a == up_axis<Dim> ? 2 : a;
    params.grid.size[a] = size[from];
    params.grid.cells[a] = cells[from];
  }
  params.material.density = 1500;
  const double angle = angle_deg * std::numbers::pi / 180;
  params.gravity =
      9.81 * (std::sin(angle) * Vec<Dim>::Unit(0) - std::cos(angle) * Vec<Dim>::Unit(up_axis<Dim>));
  params.time_step = 1e-3;
  params.rheology.mu = mu;
  params.solver.max_sweeps = 5000;
  params.faces = Faces<Dim>::all({FaceKind::free_slip});
  params.faces.lower[up_axis<Dim>].kind = FaceKind::no_slip;
  params.faces.upper[up_axis<Dim>].kind = FaceKind::open;
  return params;
}

/// Particles on a regular lattice between two heights and two x, over the whole width.
template <int Dim>
Particles<Dim> block(const GridParams<Dim>& grid, double x0, double x1, double z0, double z1,
                     double jitter = 0) {
  Particles<Dim> particles;
  Vec<Dim> lower = grid.origin, upper = grid.origin + grid.size;
  lower[0] = x0;
  upper[0] = x1;
  lower[up_axis<Dim>] = z0;
  upper[up_axis<Dim>] = z1;
  fill_box(particles, Grid<Dim>(grid), lower, upper, {.per_axis = 2, .jitter = jitter});
  return particles;
}

/// Sets up a box with a block in the air.
template <int Dim, class Transfer>
Particles<Dim> block_in_the_air(typename Sim<Dim, Transfer>::Params& params) {
  const auto base = box<Dim>({1, 0.6, 1}, {10, 6, 10}, 0, 0.44);
  params.grid = base.grid;
  params.material = base.material;
  params.gravity = base.gravity;
  params.faces = base.faces;
  params.rheology = base.rheology;
  params.time_step = 1e-3;
  Particles<Dim> particles;
  Vec<Dim> lower = Vec<Dim>::Constant(0.21), upper = Vec<Dim>::Constant(0.38);
  lower[up_axis<Dim>] += 0.4;
  upper[up_axis<Dim>] += 0.4;
  fill_box(particles, Grid<Dim>(params.grid), lower, upper, {.per_axis = 2});
  return particles;
}

} // namespace scenes
