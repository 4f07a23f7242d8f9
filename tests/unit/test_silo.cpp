// SPDX-License-Identifier: MIT
// Pieces of a silo: the floor with a hole, Janssen's formula, what all particles are together.

#include "talus/boundary/floor.hpp"
#include "talus/core/grid.hpp"
#include "talus/diagnostics/silo.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/particles.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace test_silo {

using namespace talus;

TEST_CASE("a floor holds the nodes on it, but for those in its hole") {
  const auto slot = make_obstacle<Floor<2>>(
      {.height = 0.1, .centre = {0.5, 7}, .opening = 0.2, .friction = 0.3, .sink_speed = 0.04});
  const Vec<2> spacing(0.1, 0.1);
  const auto held = slot->contact({0.3, 0.1}, spacing, 0);
  REQUIRE(held);
  CHECK(held->normal == Vec<2>(0, 1));
  CHECK(held->velocity == Vec<2>(0, -0.04));
  CHECK(held->friction == 0.3);
  CHECK(slot->contact({0.4, 0.1}, spacing, 0)); // on the edge of the slot
  CHECK(slot->contact({0.4 - 1e-15, 0}, spacing, 0));
  CHECK_FALSE(slot->contact({0.41, 0.1}, spacing, 0));
  CHECK(slot->contact({0.3, 0.15}, spacing, 0));
  CHECK_FALSE(slot->contact({0.3, 0.16}, spacing, 0)); // nearer to the next layer of nodes

  const auto hole =
      make_obstacle<Floor<3>>({.centre = {0.5, 0.5, 0}, .opening = 0.2, .friction = 0});
  CHECK_FALSE(hole->contact({0.56, 0.56, 0}, Vec<3>::Constant(0.1), 0)); // it is round
  CHECK(hole->contact({0.58, 0.58, 0}, Vec<3>::Constant(0.1), 0));
  const auto closed = make_obstacle<Floor<3>>({.friction = 0});
  CHECK(closed->contact({0, 0, 0}, Vec<3>::Constant(0.1), 0));
}

TEST_CASE("floors that are none are refused") {
  CHECK_THROWS_AS(make_obstacle<Floor<2>>({.opening = -0.1, .friction = 0}), std::invalid_argument);
  CHECK_THROWS_AS(make_obstacle<Floor<2>>({.friction = -1}), std::invalid_argument);
  CHECK_THROWS_AS(make_obstacle<Floor<2>>({.friction = 0, .sink_speed = -1}),
                  std::invalid_argument);
  CHECK_THROWS_AS(make_obstacle<Floor<2>>({.height = std::nan(""), .friction = 0}),
                  std::invalid_argument);
  CHECK_THROWS_AS(make_obstacle<Floor<2>>(
                      {.centre = {std::numeric_limits<double>::infinity(), 0}, .friction = 0}),
                  std::invalid_argument);
}

TEST_CASE("Janssen's pressure") {
  const SiloLoad load{.depth = 0.5, .wall_normal = 300, .vertical = 600}; // K = 1/2
  // z_0 = 0.2/(4 · 0.4 · 0.5) = 0.25 m: p = p_0 (1 − e⁻²)/2
  CHECK(janssen_pressure(load, 1000, 0.2, 0.4) == doctest::Approx(500 * (1 - std::exp(-2.0))));
  CHECK(janssen_pressure(load, 1000, 0.2, 0) == 1000);
  CHECK(janssen_pressure({.depth = 0.5}, 1000, 0.2, 0.4) == 1000);
  // deep silos: ρ g z_0, whatever the depth
  const SiloLoad deep{.depth = 100, .wall_normal = 300, .vertical = 600};
  CHECK(janssen_pressure(deep, 15000 * 100.0, 0.2, 0.4) == doctest::Approx(15000 * 0.25));

  CHECK(hydraulic_diameter(Grid<2>({.size = {0.3, 1}, .cells = {3, 10}})) == doctest::Approx(0.6));
  CHECK(hydraulic_diameter(Grid<3>({.size = {0.3, 0.6, 1}, .cells = {3, 6, 10}})) ==
        doctest::Approx(0.4)); // 4 · 0.18/1.8
}

TEST_CASE("total volume, centre of mass and mean velocity") {
  Particles<2> particles;
  particles.add({0, 0}, {1, 0}, 3);
  particles.add({1, 2}, {-3, 4}, 1);
  CHECK(total_volume(particles) == 4);
  CHECK(centre_of_mass(particles) == Vec<2>(0.25, 0.5));
  CHECK(mean_velocity(particles) == Vec<2>(0, 1));
  CHECK(std::isnan(centre_of_mass(Particles<2>())[0]));

  Particles<3, float> singles;
  singles.add({0, 0, 1}, {1, 0, 0}, 0.5);
  CHECK(total_volume(singles) == 0.5);
  CHECK(mean_velocity(singles) == Vec<3>(1, 0, 0));
}

} // namespace test_silo
