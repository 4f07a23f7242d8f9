// SPDX-License-Identifier: MIT
// The program of docs/how-to/hopper.md: a hopper from an STL file, filled, with a ball in it.

#include <talus/boundary/mesh_distance.hpp>
#include <talus/io/stl.hpp>
#include <talus/talus.hpp>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

namespace {

/// A funnel with thick walls: a profile (r, z), turned about the z axis; in mm.
void write_funnel(const std::string& file) {
  const std::vector<std::array<double, 2>> profile{{30, 60},   {85, 180},  {85, 240},
                                                   {125, 240}, {125, 150}, {75, 60}};
  const int sectors = 48;
  std::ofstream out(file);
  out << "solid funnel\n";
  const auto corner = [&](std::size_t k, int sector) {
    const auto& [r, z] = profile[k % profile.size()];
    const double angle = 2 * std::numbers::pi * (sector % sectors) / sectors;
    return "vertex " + std::to_string(r * std::cos(angle)) + " " +
           std::to_string(r * std::sin(angle)) + " " + std::to_string(z) + "\n";
  };
  const auto facet = [&](const std::string& corners) {
    out << "facet normal 0 0 0\nouter loop\n" << corners << "endloop\nendfacet\n";
  };
  for (int s = 0; s < sectors; ++s)
    for (std::size_t k = 0; k < profile.size(); ++k) {
      facet(corner(k, s) + corner(k, s + 1) + corner(k + 1, s + 1));
      facet(corner(k, s) + corner(k + 1, s + 1) + corner(k + 1, s));
    }
  out << "endsolid funnel\n";
}

} // namespace

int main() {
  write_funnel("funnel.stl");

  // [hopper]
  using Sim = talus::Simulation<3, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {-0.13, -0.13, 0}, .size = {0.26, 0.26, 0.28}, .cells = {20, 20, 22}};
  params.material.density = 1500;
  params.gravity = {0, 0, -9.81};
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<3>::all({talus::FaceKind::open});

  const double cell = 0.013; // m, sampled half as wide
  const talus::shapes::SampledMesh funnel(talus::read_stl("funnel.stl", 1e-3), cell / 2);
  params.obstacles = {
      talus::make_obstacle<talus::ShapeObstacle<3>>({.shape = funnel, .friction = 0.3})};

  // All that is inside, a little off the wall, between the outlet and a level.
  const auto inside = [&](const talus::Vec<3>& x) {
    return x[2] > 0.07 && x[2] < 0.16 && x.head<2>().norm() < 0.1 && funnel.distance(x) > 0.001;
  };
  talus::Particles<3> sand;
  const talus::Grid<3> grid(params.grid);
  talus::fill(sand, grid, inside, {.per_axis = 2});

  params.bodies = {talus::ball_body<3>({0, 0, 0.22}, 0.04, 2500, 0.3)}; // too large for the outlet
  Sim sim(params, sand);
  const double before = talus::total_volume(sim.particles());
  while (sim.time() < 0.2)
    if (!sim.step().completed())
      return 1;
  std::printf("%.0f %% has run out, the ball is at z = %.3f m\n",
              100 * (1 - talus::total_volume(sim.particles()) / before),
              sim.bodies()[0].position[2]);
  // [hopper]
  const double z = sim.bodies()[0].position[2];
  return z > 0.09 && z < 0.2 ? 0 : 1;
}
