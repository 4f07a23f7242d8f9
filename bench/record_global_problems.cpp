// SPDX-License-Identifier: MIT
// Records dual problems of many kinds, each with its warm start:
//   record_global_problems FOLDER [NAME...]
// leaves FOLDER/NAME.talus for all of them, or for those that are named; a file that is there
// already is not made again. Takes ten minutes.

#include "scenes.hpp"

#include "talus/boundary/body.hpp"
#include "talus/boundary/floor.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/scene/fill.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace talus;
using scenes::Sim;
namespace fs = std::filesystem;

using Cohesive2 = Simulation<2, WithCohesion<ConstantFriction>, PolyPic, GaussSeidel<>>;
using Cohesive3 = Simulation<3, WithCohesion<ConstantFriction>, PolyPic, GaussSeidel<>>;

/// What is recorded of one scene: a problem at each of the times (s).
struct Recorder {
  fs::path folder;
  std::vector<std::string> wanted; ///< empty: all

  template <class MakeSim>
  void operator()(const std::string& scene, const MakeSim& make,
                  const std::vector<std::pair<std::string, double>>& moments) const {
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    const auto missing = [&](const std::string& moment) {
      const std::string name = scene + "_" + moment;
      return (wanted.empty() || std::ranges::find(wanted, name) != wanted.end()) &&
             !fs::exists(folder / (name + ".talus"));
    };
    if (std::ranges::none_of(moments, [&](const auto& m) { return missing(m.first); }))
      return;
    auto sim = make();
    constexpr int dim = decltype(sim)::dimension;
    for (const auto& [moment, time] : moments) {
      while (sim.time() < time)
        if (!sim.step().completed())
          throw std::runtime_error(scene + ": a step failed");
      if (!missing(moment))
        continue;
      const fs::path path = folder / (scene + "_" + moment + ".talus");
      const auto report =
          sim.step([&](const DualProblem<dim>& problem) { write_problem(path, problem); });
      std::printf("%s: %zu cones, %.0f s\n", path.c_str(), report.cones,
                  std::chrono::duration<double>(Clock::now() - start).count());
      std::fflush(stdout);
    }
  }
};

/// A box with slipping walls, a sticking floor and an open top, gravity turned by `angle_deg`.
template <class S>
typename S::Params box(const Vec<3>& size, double cell, double angle_deg, double mu) {
  constexpr int dim = S::dimension;
  constexpr int up = up_axis<dim>;
  typename S::Params params;
  for (int a = 0; a < dim; ++a) {
    params.grid.size[a] = size[a == up ? 2 : a];
    params.grid.cells[a] = static_cast<int>(std::lround(params.grid.size[a] / cell));
  }
  params.material.density = 1500;
  params.gravity = Vec<dim>::Zero();
  params.gravity[0] = 9.81 * std::sin(angle_deg * 3.14159265358979 / 180);
  params.gravity[up] = -9.81 * std::cos(angle_deg * 3.14159265358979 / 180);
  params.time_step = 0.1 * cell;
  if constexpr (requires { params.rheology.mu; })
    params.rheology.mu = mu;
  else
    params.rheology.law.mu = mu;
  params.solver.tolerance = 1e-5;
  params.faces = Faces<dim>::all({FaceKind::free_slip});
  params.faces.lower[up].kind = FaceKind::no_slip;
  params.faces.upper[up].kind = FaceKind::open;
  return params;
}

/// Particles between two x and two heights, over the whole width.
template <class S>
S filled(const typename S::Params& params, double x0, double x1, double z0, double z1,
         double down = 0) {
  constexpr int dim = S::dimension;
  Vec<dim> lower = params.grid.origin, upper = params.grid.origin + params.grid.size;
  lower[0] = x0;
  upper[0] = x1;
  lower[up_axis<dim>] = z0;
  upper[up_axis<dim>] = z1;
  typename S::ParticleData sand;
  fill_box(sand, Grid<dim>(params.grid), lower, upper, {.per_axis = dim == 2 ? 3 : 2});
  for (auto& v : sand.velocity)
    v[up_axis<dim>] = -down;
  return S(params, sand);
}

/// A column collapses in a box.
template <int Dim>
Sim<Dim> column(double mu, double cell) {
  return filled<Sim<Dim>>(box<Sim<Dim>>({0.6, 0.12, 0.24}, cell, 0, mu), 0, 0.2, 0, 0.2);
}

/// A step of sand that holds together.
template <class S>
S cliff(double cohesion, double cell) {
  auto params = box<S>({0.4, 0.12, 0.24}, cell, 0, 0.5);
  params.rheology.cohesion = cohesion;
  return filled<S>(params, 0, 0.2, 0, 0.2);
}

/// A bed in a box that is periodic along the slope, and across it.
template <int Dim>
Sim<Dim> slope(double angle_deg, double mu, double length, double cell) {
  auto params = box<Sim<Dim>>({length, length, 0.24}, cell, angle_deg, mu);
  for (int a = 0; a < up_axis<Dim>; ++a)
    params.faces.lower[a].kind = params.faces.upper[a].kind = FaceKind::periodic;
  return filled<Sim<Dim>>(params, 0, length, 0, 0.2);
}

template <int Dim>
Sim<Dim> silo(double mu, double opening, double cell) {
  const double width = 0.2;
  auto params = box<Sim<Dim>>({width, width, 0.24}, cell, 0, mu);
  for (int a = 0; a < up_axis<Dim>; ++a)
    params.faces.lower[a] = params.faces.upper[a] = {FaceKind::frictional, 0.4};
  params.faces.lower[up_axis<Dim>] = {FaceKind::open};
  Vec<Dim> centre = params.grid.size / 2;
  params.obstacles = {
      make_obstacle<Floor<Dim>>({.centre = centre, .opening = opening, .friction = 0.4})};
  return filled<Sim<Dim>>(params, 0, width, 0, 0.2);
}

Sim<2> drum(double mu, double cell) {
  const double radius = 0.12, edge = 2 * radius + 4 * cell;
  auto params = box<Sim<2>>({edge, 0, edge}, cell, 0, mu);
  const RigidState<2> motion{.position = {edge / 2, edge / 2}, .angular_velocity = Spin<2>(0.5)};
  const shapes::Ball<2> hollow({0, 0}, radius);
  params.obstacles = {make_obstacle<ShapeObstacle<2>>(
      {.shape = shapes::Complement(hollow), .friction = 0.6, .motion = steady_motion(motion)})};
  Particles<2> sand;
  fill(sand, Grid<2>(params.grid),
       shapes::translated(shapes::Intersection(hollow, shapes::HalfSpace<2>({0, 0}, {0, 1})),
                          motion.position),
       {.per_axis = 4});
  return Sim<2>(params, sand);
}

/// A ball falls into a bed.
template <int Dim>
Sim<Dim> impact(double cell) {
  auto params = box<Sim<Dim>>({0.4, 0.2, 0.24}, cell, 0, 0.44);
  Vec<Dim> centre = params.grid.size / 2;
  centre[up_axis<Dim>] = 0.17;
  auto ball = ball_body<Dim>(centre, 0.04, 3000, 0.3);
  ball.start.velocity[up_axis<Dim>] = -1;
  params.bodies.push_back(ball);
  return filled<Sim<Dim>>(params, 0, 0.4, 0, 0.12);
}

void record(const Recorder& recorder) {
  for (const int finer : {1, 2, 4}) {
    const std::string of = "_h" + std::to_string(finer);
    recorder("b15_2d" + of, [&] { return scenes::collapse_b15<2>(finer, 1e-4); },
             {{"opening", 0.02}, {"flow", 0.2}, {"rest", finer < 4 ? 1.2 : 0.6}});
  }
  for (const double mu : {0.1, 0.5, 0.9, 1.5, 2.0})
    recorder("column_2d_mu" + std::to_string(std::lround(10 * mu)),
             [&] { return column<2>(mu, 0.01); }, {{"flow", 0.1}, {"rest", 0.8}});
  recorder("column_2d_mu20_h2", [] { return column<2>(2, 0.005); }, {{"flow", 0.1}});
  recorder("bed_2d", [] { return scenes::bed(22, 0.44, 1e-5); }, {{"rest", 0.3}});
  recorder("slope_2d", [] { return slope<2>(23, 0.44, 0.03, 0.01); }, {{"rest", 0.5}});
  recorder("slope_2d_fast", [] { return slope<2>(30, 0.44, 0.2, 0.01); }, {{"flow", 0.3}});
  recorder(
      "fall_2d",
      [] {
        return filled<Sim<2>>(box<Sim<2>>({0.4, 0, 0.24}, 0.01, 0, 0.6), 0.1, 0.3, 0.06, 0.2, 1);
      },
      {{"falling", 0.03}, {"landing", 0.08}});
  recorder("silo_2d", [] { return silo<2>(0.5, 0.06, 0.01); }, {{"flow", 0.2}});
  recorder("silo_2d_mu9", [] { return silo<2>(0.9, 0.02, 0.01); }, {{"jammed", 0.2}});
  recorder("drum_2d", [] { return drum(0.5, 0.01); }, {{"flow", 0.6}});
  recorder("impact_2d", [] { return impact<2>(0.01); }, {{"body", 0.05}, {"rest", 0.5}});
  recorder("cliff_2d", [] { return cliff<Cohesive2>(300, 0.01); }, {{"flow", 0.1}});
  recorder("cliff_2d_strong", [] { return cliff<Cohesive2>(1500, 0.01); }, {{"rest", 0.3}});

  recorder("b15_3d_h1", [] { return scenes::collapse_b15<3>(1, 1e-4, 2); },
           {{"opening", 0.02}, {"flow", 0.2}, {"rest", 1.2}});
  recorder("b15_3d_h2", [] { return scenes::collapse_b15<3>(2, 1e-4, 2); }, {{"flow", 0.2}});
  for (const double mu : {0.1, 0.9, 2.0})
    recorder("column_3d_mu" + std::to_string(std::lround(10 * mu)),
             [&] { return column<3>(mu, 0.02); }, {{"flow", 0.1}, {"rest", 0.6}});
  recorder("slope_3d", [] { return slope<3>(22, 0.44, 0.06, 0.02); }, {{"rest", 0.3}});
  recorder(
      "fall_3d",
      [] {
        return filled<Sim<3>>(box<Sim<3>>({0.4, 0.12, 0.24}, 0.02, 0, 0.6), 0.1, 0.3, 0.06, 0.2, 1);
      },
      {{"landing", 0.08}});
  recorder("silo_3d", [] { return silo<3>(0.5, 0.08, 0.02); }, {{"flow", 0.2}});
  recorder("silo_3d_mu9", [] { return silo<3>(0.9, 0.04, 0.02); }, {{"jammed", 0.2}});
  recorder("impact_3d", [] { return impact<3>(0.02); }, {{"body", 0.05}});
  recorder("cliff_3d", [] { return cliff<Cohesive3>(1000, 0.02); }, {{"rest", 0.2}});
}

} // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s FOLDER [NAME...]\n", argv[0]);
    return 2;
  }
  try {
    fs::create_directories(argv[1]);
    record({argv[1], {argv + 2, argv + argc}});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
