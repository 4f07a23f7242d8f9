// SPDX-License-Identifier: MIT
// first.cpp: a heap of sand slumps on a rough floor.
#include <talus/talus.hpp>

#include <cstdio>

int main() {
  using Sim = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.6, 0.2}, .cells = {60, 20}}; // m
  params.material.density = 1500;                                          // kg/m³
  params.gravity = {0, -9.81};                                             // m/s²
  params.time_step = 1e-3;                                                 // s
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[1] = {talus::FaceKind::open};

  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0}, {0.15, 0.15}, {.per_axis = 3});

  Sim sim(params, sand);
  while (sim.time() < 1) {
    const talus::StepReport report = sim.step();
    if (report.solve.status != talus::SolveStatus::converged)
      std::printf("t = %.3f s: residual %.1e\n", sim.time(), report.solve.residual.l2);
  }
  std::printf("the front is at x = %.3f m\n",
              talus::front_position(talus::measure_profile(sim), 0.01));
}
