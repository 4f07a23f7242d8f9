// SPDX-License-Identifier: MIT
// A user's program in two files, both of which include everything: a heap in 2-D, a filling in 3-D.

#include <talus/talus.hpp>

#include <cmath>
#include <cstdio>

double volume_in_3d(); // other.cpp

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
  const double fastest = talus::largest_speed(sim), volume = volume_in_3d();
  std::printf("talus " TALUS_VERSION ": fastest %.3f m/s, %.3g m3 in 3-D\n", fastest, volume);
  return fastest > 0 && std::abs(volume - 1.08e-3) < 1e-12 ? 0 : 1;
}
