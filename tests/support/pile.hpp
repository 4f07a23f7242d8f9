// SPDX-License-Identifier: MIT
#pragma once

#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/transfer/schemes.hpp"

namespace support {

using namespace talus;

/// The problem of the first step of a small pile of moving material against a wall.
template <int Dim, class SolverT>
Simulation<Dim, ConstantFriction, PolyPic, SolverT> small_pile(double tolerance, double mu) {
  typename Simulation<Dim, ConstantFriction, PolyPic, SolverT>::Params params;
  for (int a = 0; a < Dim; ++a) {
    params.grid.size[a] = 0.3;
    params.grid.cells[a] = 3;
  }
  params.material.density = 1500;
  params.gravity = -9.81 * Vec<Dim>::Unit(up_axis<Dim>);
  params.time_step = 1e-3;
  params.rheology.mu = mu;
  params.solver.tolerance = tolerance;
  params.solver.max_sweeps = 20000;
  params.faces = Faces<Dim>::all({FaceKind::free_slip});
  params.faces.lower[0] = {FaceKind::frictional, 0.3};
  params.faces.lower[up_axis<Dim>].kind = FaceKind::no_slip;
  params.faces.upper[up_axis<Dim>].kind = FaceKind::open;
  Particles<Dim> particles;
  Vec<Dim> upper = Vec<Dim>::Constant(0.2);
  fill_box(particles, Grid<Dim>(params.grid), Vec<Dim>(Vec<Dim>::Zero()), upper,
           {.per_axis = 2, .jitter = 0.5});
  Random random(3);
  for (auto& v : particles.velocity)
    for (int a = 0; a < Dim; ++a)
      v[a] = 0.05 * (random.uniform() - 0.7);
  return Simulation<Dim, ConstantFriction, PolyPic, SolverT>(params, particles);
}

} // namespace support
