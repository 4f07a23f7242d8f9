// SPDX-License-Identifier: MIT
// The second file: what a header defines without `inline` the linker finds twice.

#include <talus/talus.hpp>

double slump_in_3d() {
  using Sim = talus::Simulation<3, talus::MuOfI, talus::Pic, talus::GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {0, 0, 0}, .size = {0.3, 0.06, 0.15}, .cells = {10, 2, 5}};
  params.material.density = 1500;
  params.gravity = {0, 0, -9.81};
  params.time_step = 1e-3;
  params.rheology = {.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279},
                     .inertial = {5e-4, 1500, 1}};
  params.faces = talus::Faces<3>::all({talus::FaceKind::free_slip});
  params.faces.lower[2] = {talus::FaceKind::no_slip};
  talus::Particles<3> sand;
  talus::fill_box<3>(sand, talus::Grid<3>(params.grid), {0, 0, 0}, {0.15, 0.06, 0.12}, {});
  Sim sim(params, sand);
  for (int n = 0; n < 5; ++n)
    if (!sim.step().completed())
      return 0;
  return talus::largest_speed(sim);
}
