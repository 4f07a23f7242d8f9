// SPDX-License-Identifier: MIT
#pragma once

#include "talus/rheology/laws.hpp"
#include "talus/scene/collapse.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../tests/support/collapse.hpp"

/// The scenes that the benchmarks measure on.
namespace scenes {

template <int Dim, class ParticleReal = double>
using Sim = talus::Simulation<Dim, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>,
                              ParticleReal>;

/// Run B15 of Rousseau et al. 2023 with cells of 2 cm (across: the same) by 1 cm and a time step of
/// 1.66 ms, all divided by `finer`.
template <int Dim, class ParticleReal = double>
Sim<Dim, ParticleReal> collapse_b15(double finer, double tolerance, int per_axis = 3,
                                    int threads = 1) {
  const talus::CollapseSetup setup = support::b15();
  using S = Sim<Dim, ParticleReal>;
  auto params =
      support::collapse_params<S>(setup, talus::Vec<3>(0.02, 0.02, 0.01) / finer, 1.66e-3 / finer);
  params.solver.tolerance = tolerance;
  params.threads = threads;
  const talus::Grid<Dim> grid(params.grid);
  return S(params, setup.particles<Dim, ParticleReal>(grid, {.per_axis = per_axis}));
}

/// A bed 0.1 m deep between slipping ends on a sticking floor, inclined by angle_deg.
inline Sim<2> bed(double angle_deg, double mu, double tolerance, double jitter = 0,
                  const talus::Packing& packing = {}) {
  talus::CollapseSetup setup; // an inclined box with a bed and no column
  setup.inclination_deg = angle_deg;
  Sim<2>::Params params;
  params.grid = {.origin = {0, 0}, .size = {1, 0.2}, .cells = {50, 20}};
  params.material.density = 1470;
  params.gravity = setup.gravity_vector<2>();
  params.time_step = 1e-3;
  params.rheology.mu = mu;
  params.faces.lower[0].kind = params.faces.upper[0].kind = talus::FaceKind::free_slip;
  params.faces.lower[1].kind = talus::FaceKind::no_slip;
  params.faces.upper[1].kind = talus::FaceKind::open;
  params.solver.tolerance = tolerance;
  params.solver.max_sweeps = 20000;
  params.packing = packing;
  talus::Particles<2> particles;
  talus::fill_box<2>(particles, talus::Grid<2>(params.grid), {0, 0}, {1, 0.1},
                     {.per_axis = 3, .jitter = jitter});
  return Sim<2>(params, particles);
}

} // namespace scenes
