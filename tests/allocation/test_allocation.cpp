// SPDX-License-Identifier: MIT
// A warm step takes no memory. In a program of its own, as it replaces operator new.

#include "talus/boundary/body.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/scene/collapse.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/collapse.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <cstddef>

extern std::atomic<std::size_t> allocations; // count.cpp

using namespace talus;

namespace {

template <int Dim>
std::size_t allocations_of_a_warm_step(int threads) {
  using Sim = Simulation<Dim, WithViscosity<WithCohesion<MuOfI>>, PolyPic, GaussSeidel<>>;
  CollapseSetup setup = support::b15();
  auto params = support::collapse_params<Sim>(setup, Vec<3>(0.04, 0.02, 0.02), 1.66e-3);
  params.rheology = {.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279},
                     .inertial = {.grain_diameter = 5e-4, .density = 1470, .strain_factor = 1},
                     .cohesion = 5,
                     .viscosity = 0.1};
  params.friction_updates = 3;
  params.threads = threads;
  // a roller and a ball in the bed
  const double radius = 1.2 * Grid<Dim>(params.grid).spacing().minCoeff();
  RigidState<Dim> turning;
  turning.position = 0.5 * params.grid.size;
  turning.position[up_axis<Dim>] = radius;
  turning.angular_velocity[0] = 1;
  params.obstacles.push_back(
      make_obstacle<ShapeObstacle<Dim>>({.shape = shapes::Ball<Dim>(Vec<Dim>::Zero(), radius),
                                         .friction = 0.3,
                                         .motion = steady_motion(turning)}));
  Vec<Dim> centre = turning.position;
  centre[0] *= 0.2;
  params.bodies.push_back(ball_body<Dim>(centre, radius, 1500, 0.3));
  Sim sim(params, setup.particles<Dim>(Grid<Dim>(params.grid), {.per_axis = 3}));
  for (int i = 0; i < 30; ++i)
    static_cast<void>(sim.step());
  const std::size_t before = allocations;
  for (int i = 0; i < 3; ++i)
    static_cast<void>(sim.step());
  return allocations - before;
}

} // namespace

TEST_CASE("this program counts allocations") {
  const std::size_t before = allocations;
  int* volatile kept = new int(1); // volatile: or the pair is left out
  delete kept;
  CHECK(allocations - before == 1);
}

TEST_CASE("a warm step allocates nothing") {
  for (const int threads : {1, 2}) {
    CHECK(allocations_of_a_warm_step<2>(threads) == 0);
    CHECK(allocations_of_a_warm_step<3>(threads) == 0);
  }
}
