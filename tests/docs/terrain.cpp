// SPDX-License-Identifier: MIT
// The program of docs/how-to/terrain.md: a slide on a map, in 3-D, and along a line of it, in 2-D.

#include <talus/talus.hpp>
#include <talus/terrain/ascii_grid.hpp>
#include <talus/terrain/deposit_maps.hpp>
#include <talus/terrain/polygon.hpp>
#include <talus/terrain/raster.hpp>
#include <talus/terrain/terrain.hpp>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <vector>

using Sim = talus::Simulation<3, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;

/// The files that a user has: a slope of 27° to the east, smooth in its lower half.
void write_files() {
  talus::Raster heights{30, 12, 632000.5, 5094000.5, 5, std::vector<double>(30 * 12)};
  talus::Raster friction = heights;
  for (int row = 0; row < heights.rows; ++row)
    for (int column = 0; column < heights.columns; ++column) {
      heights.at(column, row) = 1200 - 0.5 * 5 * (column + 0.5);
      friction.at(column, row) = column < 15 ? 0.4 : 0.2;
    }
  talus::write_ascii_grid("heights.asc", heights);
  talus::write_ascii_grid("friction.asc", friction);
  std::ofstream("release.csv") << "x,y\n632020.5,5094015.5\n632050.5,5094015.5\n"
                                  "632050.5,5094045.5\n632020.5,5094045.5\n";
}

void profile(const talus::BilinearMap& ground) {
  // [profile]
  // along the line from (0, 30 m) to the east-north-east, at 1 m a metre of s
  const talus::Vec<2> from(0, 30), along = talus::Vec<2>(2, 1).normalized();
  const auto line = talus::make_obstacle<talus::Terrain<2>>(
      {.height =
           [=](const talus::Vec<2>& s) {
             return ground(from[0] + s[0] * along[0], from[1] + s[0] * along[1]);
           },
       .friction = 0.3});
  // [profile]
  const auto contact = line->contact({50, ground(50 * along[0], 30 + 50 * along[1])}, {1, 1}, 0);
  std::printf("slope along the line: %.3f\n", contact->normal[0] / contact->normal[1]);
}

int main() {
  write_files();
  // [read]
  const talus::Raster heights = talus::read_ascii_grid("heights.asc");
  const talus::Vec<2> origin(heights.x, heights.y); // this point of the map is (0, 0) in the box
  const talus::BilinearMap ground(heights, origin);
  const talus::CellMap friction(talus::read_ascii_grid("friction.asc", 0), origin);
  const talus::Polygon area = talus::read_polygon("release.csv").moved(-origin[0], -origin[1]);
  // [read]

  Sim::Params params;
  params.grid = {.origin = {0, 0, 1120}, .size = {150, 60, 90}, .cells = {30, 12, 18}};
  params.material.density = 1800;
  params.gravity = {0, 0, -9.81};
  params.time_step = 0.03;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<3>::all({talus::FaceKind::open});
  // [scene]
  params.obstacles = {
      talus::make_obstacle<talus::Terrain<3>>({.height = ground, .friction_at = friction})};
  const talus::Release release({.area = area,
                                .bottom = ground,
                                .top = [=](const talus::Vec<3>& x) { return ground(x) + 10; },
                                .cell = heights.cell});
  talus::Particles<3> debris;
  fill(debris, talus::Grid<3>(params.grid), release, {.per_axis = 3});
  // [scene]
  Sim sim(params, debris);
  const double volume = talus::total_volume(sim.particles());
  while (sim.time() < 3)
    if (!sim.step().completed())
      return 1;
  // [deposit]
  talus::write_ascii_grid("deposit.asc", depth_map(sim.particles(), heights, origin));
  // [deposit]
  double on_map = 0; // m³
  for (const double depth : talus::read_ascii_grid("deposit.asc").values)
    on_map += depth * heights.cell * heights.cell;
  profile(ground);
  std::printf("%.0f m³ slide, %.0f m³ are on the map\n", volume, on_map);
  return std::abs(on_map / volume - 1) < 1e-9 ? 0 : 1;
}
