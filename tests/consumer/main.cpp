// SPDX-License-Identifier: MIT
// A user's program in two files, both of which include everything: heaps in 2-D and in 3-D.

#include <talus/talus.hpp>

#include <cstdio>

double slump_in_3d(); // other.cpp

int main() {
  using Sim = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {20, 10}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.threads = 2;
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0}, {0.15, 0.15}, {});
  Sim sim(params, sand);
  for (int n = 0; n < 5; ++n)
    if (sim.step().solve.status != talus::SolveStatus::converged)
      return 1;
  const double in_2d = talus::largest_speed(sim), in_3d = slump_in_3d();
  std::printf("talus " TALUS_VERSION ": fastest %.3f m/s in 2-D, %.3f m/s in 3-D\n", in_2d, in_3d);
  return in_2d > 0 && in_3d > 0 ? 0 : 1;
}
