// SPDX-License-Identifier: MIT
#pragma once

#include "../physics/scenes.hpp"
#include "../support/collapse.hpp"
#include "../support/materials.hpp"

#include "talus/boundary/body.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/scene/source.hpp"

/// \file
/// Scenes that ranks share in tests: small, but with all that crosses the edges of windows.

namespace scenes {

template <class S>
struct Scene {
  typename S::Params params;
  typename S::ParticleData particles;
};

/// The coarse B15: gate, frictional side walls, a bed. 2-D cells are half as large.
template <int Dim>
Scene<Sim<Dim>> collapse() {
  const CollapseSetup setup = support::b15();
  Scene<Sim<Dim>> scene;
  const double finer = Dim == 2 ? 2 : 1;
  scene.params =
      support::collapse_params<Sim<Dim>>(setup, Vec<3>(0.02, 0.02, 0.01) / finer, 1.66e-3 / finer);
  scene.particles =
      setup.particles<Dim>(Grid<Dim>(scene.params.grid), {.per_axis = Dim == 2 ? 3 : 2});
  return scene;
}

/// A ball falls on sand that runs out of the box on one side.
template <int Dim>
Scene<Sim<Dim>> impact() {
  Scene<Sim<Dim>> scene;
  auto& params = scene.params;
  params = box<Dim>({0.28, 0.2, 0.2}, {14, 10, 10}, 10, 0.44);
  params.faces.upper[0].kind = FaceKind::open;
  params.cfl = 0.5;
  params.time_step = 5e-3;
  Vec<Dim> centre = Vec<Dim>::Constant(0.1);
  centre[up_axis<Dim>] = 0.14;
  for (const double x : {0.08, 0.2}) {
    centre[0] = x;
    auto ball = ball_body<Dim>(centre, 0.04, 3000, 0.3);
    ball.start.velocity[up_axis<Dim>] = -1;
    ball.start.angular_velocity[0] = 5;
    params.bodies.push_back(ball);
  }
  scene.particles = block<Dim>(params.grid, 0, 0.28, 0, 0.1, 0.6);
  return scene;
}

/// A block that slides from one end of a long box to the other, so that other ranks get the load.
template <int Dim>
Scene<Sim<Dim>> sliding_block() {
  Scene<Sim<Dim>> scene;
  scene.params = box<Dim>({0.96, 0.08, 0.08}, {48, 4, 4}, 0, 0.44);
  scene.params.faces.lower[up_axis<Dim>].kind = FaceKind::free_slip;
  scene.params.time_step = 2e-3;
  scene.particles = block<Dim>(scene.params.grid, 0, 0.32, 0, 0.06, 0.5);
  for (auto& v : scene.particles.velocity)
    v[0] = 2;
  return scene;
}

/// A box that is empty at first: sand comes in through a strip, and goes out in a corner.
template <int Dim>
Scene<Sim<Dim>> fountain() {
  Scene<Sim<Dim>> scene;
  auto& params = scene.params;
  params = box<Dim>({0.3, 0.08, 0.16}, {30, 8, 16}, 0, 0.44);
  const Grid<Dim> grid(params.grid);
  Vec<Dim> lower = grid.origin(), upper = grid.upper(), corner = grid.upper();
  lower[0] = 0.12;
  upper[0] = 0.18;
  lower[up_axis<Dim>] = upper[up_axis<Dim>] = 0.14;
  corner[0] = 0.1;
  corner[up_axis<Dim>] = 0.02;
  Vec<Dim> velocity = Vec<Dim>::Zero();
  velocity[up_axis<Dim>] = -1;
  params.exchange =
      together<Dim>({make_source<Dim>(grid, {.lower = lower, .upper = upper, .velocity = velocity}),
                     make_sink<Dim>(shapes::Box<Dim>(grid.origin(), corner))});
  return scene;
}

/// A rate-dependent, slightly viscous flow down an endless slope with a hump: periodic along it
/// and, in 3-D, across; friction from the solution of the step itself, and even packing.
template <int Dim>
using Chute = Simulation<Dim, WithViscosity<MuOfI>, PolyPic, GaussSeidel<>>;
template <int Dim>
Scene<Chute<Dim>> chute() {
  Scene<Chute<Dim>> scene;
  auto& params = scene.params;
  const auto plain = box<Dim>({0.2, 0.12, 0.12}, {20, 6, 12}, 26, 0.4);
  params.grid = plain.grid;
  params.material = plain.material;
  params.gravity = plain.gravity;
  params.time_step = 2e-3;
  params.faces = plain.faces;
  for (int a = 0; a < up_axis<Dim>; ++a)
    params.faces.lower[a].kind = params.faces.upper[a].kind = FaceKind::periodic;
  params.faces.lower[up_axis<Dim>] = {FaceKind::frictional, 0.6};
  Vec<Dim> hump = Vec<Dim>::Constant(0.06);
  hump[0] = 0.1;
  hump[up_axis<Dim>] = 0;
  params.obstacles = {
      make_obstacle<ShapeObstacle<Dim>>({.shape = shapes::Ball<Dim>(hump, 0.03), .friction = 0.3})};
  params.rheology.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.28};
  params.rheology.inertial = {.grain_diameter = 2e-3, .density = 2500, .strain_factor = 2};
  params.rheology.viscosity = 2;
  params.friction_updates = 2;
  params.packing.even = true;
  scene.particles = block<Dim>(params.grid, 0, 0.2, 0, 0.08, 0.8);
  // across a seam, so that it does not stay as it is everywhere
  for (std::size_t p = 0; p < scene.particles.size(); ++p)
    if (scene.particles.position[p][0] < 0.05)
      scene.particles.velocity[p][0] = 0.2;
  return scene;
}

/// Two balls fall on a viscous block in a box of friction, one of them beside a wall.
template <int Dim>
Scene<Chute<Dim>> viscous_impact() {
  Scene<Chute<Dim>> scene = chute<Dim>();
  auto& params = scene.params;
  params.faces = box<Dim>({0.2, 0.12, 0.12}, {20, 6, 12}, 0, 0.4).faces;
  params.faces.lower[0] = {FaceKind::frictional, 0.3};
  params.rheology.viscosity = 100;
  for (const double x : {0.04, 0.11}) {
    Vec<Dim> centre = Vec<Dim>::Constant(0.06);
    centre[0] = x;
    centre[up_axis<Dim>] = 0.09;
    auto ball = ball_body<Dim>(centre, 0.03, 3000, 0.3);
    ball.start.velocity[up_axis<Dim>] = -1;
    ball.start.angular_velocity[0] = 5;
    params.bodies.push_back(ball);
  }
  scene.particles = block<Dim>(params.grid, 0, 0.2, 0, 0.06, 0.8);
  return scene;
}

/// Two materials with cohesion, of which one comes in, too.
template <int Dim>
Scene<Mixed<Dim, WithCohesion<MuOfI>>> materials() {
  Scene<Mixed<Dim, WithCohesion<MuOfI>>> scene;
  scene.params = mixed_collapse<Dim>();
  scene.particles = two_columns<Dim>(scene.params.grid);
  return scene;
}

/// The same scene with another solver.
template <class Solver, int Dim>
Scene<Simulation<Dim, ConstantFriction, PolyPic, Solver>>
with_solver(const Scene<Sim<Dim>>& scene, const typename Solver::Params& solver) {
  Scene<Simulation<Dim, ConstantFriction, PolyPic, Solver>> other;
  other.params.grid = scene.params.grid;
  other.params.material = scene.params.material;
  other.params.gravity = scene.params.gravity;
  other.params.time_step = scene.params.time_step;
  other.params.cfl = scene.params.cfl;
  other.params.faces = scene.params.faces;
  other.params.bodies = scene.params.bodies;
  other.params.rheology = scene.params.rheology;
  other.params.solver = solver;
  other.particles = scene.particles;
  return other;
}

} // namespace scenes
