// SPDX-License-Identifier: MIT
// ranks.cpp: the heap of the README on all ranks of mpirun.
#include <talus/distributed/mpi.hpp>
#include <talus/talus.hpp>

#include <algorithm>
#include <cstdio>

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
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

  // [line]
  params.ranks = talus::distributed::make_ranks<2>(MPI_COMM_WORLD);
  // [line]

  Sim sim(params, sand); // keeps this rank's part of the sand
  while (sim.time() < 0.05)
    if (!sim.step().completed())
      return 1;
  // [own]
  double front = 0; // of this rank's particles, m
  for (const talus::Vec<2>& x : sim.particles().position)
    front = std::max(front, x[0]);
  const talus::Execution execution(1, &params.ranks->communicator());
  front = execution.largest(front); // of all
  if (execution.first_rank())
    std::printf("the front is at x = %.3f m\n", front);
  // [own]
  MPI_Finalize();
}
