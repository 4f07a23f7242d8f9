// SPDX-License-Identifier: MIT
// A block on a slope that comes from a map does as on the same plane as a shape, and as the law
// says.

#include "talus/boundary/faces.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/types.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/terrain/polygon.hpp"
#include "talus/terrain/raster.hpp"
#include "talus/terrain/terrain.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <vector>

namespace test_terrain {

using namespace talus;

namespace {

using Sim = Simulation<3, ConstantFriction, PolyPic, GaussSeidel<>>;

constexpr double slope = 0.5;         // dz/dx: 26.6°
const Vec<2> origin(632000, 5094000); // UTM

Raster sloping_map() {
  Raster map{60, 30, origin[0], origin[1], 0.1, std::vector<double>(60 * 30)};
  for (int j = 0; j < map.rows; ++j)
    for (int i = 0; i < map.columns; ++i)
      map.at(i, j) = 0.3 + slope * (i + 0.5) * map.cell;
  return map;
}

/// A layer of 2 m × 1.2 m × 0.4 m (upright) of hard material on the slope, which descends to −x.
Sim scene(const std::shared_ptr<const Obstacle<3>>& ground) {
  Sim::Params params;
  params.grid = {.origin = {1, 0, 0}, .size = {5, 2, 4}, .cells = {25, 10, 40}};
  params.material.density = 1500;
  params.gravity = {0, 0, -9.81};
  params.time_step = 2e-3;
  params.rheology.mu = 2;
  params.faces = Faces<3>::all({FaceKind::open});
  params.obstacles = {ground};
  const BilinearMap height(sloping_map(), origin);
  Polygon area;
  area.add_ring({{3, 0.4}, {5, 0.4}, {5, 1.6}, {3, 1.6}});
  Particles<3> sand;
  fill(sand, Grid<3>(params.grid),
       Release({.area = area,
                .bottom = height,
                .top = [&](const Vec<3>& x) { return height(x) + 0.4; },
                .cell = 0.1}),
       {.per_axis = 2});
  return Sim(params, sand);
}

} // namespace

TEST_CASE("a layer on a tilted map slides or stays as on the plane") {
  const double steep = std::sqrt(1 + slope * slope);
  const Vec<3> down = Vec<3>(-1, 0, -slope) / steep;
  for (const double friction : {0.2, 0.8}) {
    CAPTURE(friction);
    Sim on_map = scene(make_obstacle<Terrain<3>>(
        {.height = BilinearMap(sloping_map(), origin), .friction = friction}));
    Sim on_shape = scene(make_obstacle<ShapeObstacle<3>>(
        {.shape = shapes::HalfSpace<3>({0, 0, 0.3}, {-slope, 0, 1}), .friction = friction}));
    const Vec<3> start = centre_of_mass(on_map.particles());
    const double mass = total_volume(on_map.particles()) * 1500;
    Vec<3> force = Vec<3>::Zero();
    constexpr int steps = 60;
    for (int n = 0; n < steps; ++n) {
      CHECK(on_map.step().completed());
      CHECK(on_shape.step().completed());
      force += on_map.obstacle_wrench(0).force / steps;
    }
    const Vec<3> way = centre_of_mass(on_map.particles()) - start;
    const Vec<3> as_shape = centre_of_mass(on_shape.particles()) - start;
    CHECK((way - as_shape).norm() < 1e-4 * std::max(as_shape.norm(), 0.01));
    // a block: x = (sin θ − μ cos θ) g t²/2
    const double t = on_map.time();
    const double block = std::max(0.0, (slope - friction) / steep) * 9.81 * t * t / 2;
    MESSAGE("μ = ", friction, ": ", way.dot(down), " m, a block ", block, " m");
    CHECK(std::abs(way.dot(down) - block) < 0.05 * block + 1e-3);
    // and the ground bears the weight across the slope
    const Vec<3> normal = Vec<3>(-slope, 0, 1) / steep;
    CHECK(std::abs(force.dot(normal) + mass * 9.81 / steep) < 0.03 * mass * 9.81);
  }
}

} // namespace test_terrain
