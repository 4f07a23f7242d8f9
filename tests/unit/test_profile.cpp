// SPDX-License-Identifier: MIT
// What is measured of a deposit, wherever it lies and before it has moved.

#include "talus/boundary/floor.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/error.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/about.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace test_profile {

using namespace talus;
using support::about;

namespace {

template <int Dim>
using Sim = Simulation<Dim, ConstantFriction, PolyPic, GaussSeidel<>>;

/// A box of 0.4 m × 0.1 m × 0.2 m in cells of 1 cm (2 cm across).
template <int Dim>
typename Sim<Dim>::Params box() {
  typename Sim<Dim>::Params params;
  params.grid.size[0] = 0.4;
  params.grid.cells[0] = 40;
  params.grid.size[1] = 0.1;
  params.grid.cells[1] = 5;
  params.grid.size[Dim - 1] = 0.2;
  params.grid.cells[Dim - 1] = 20;
  params.material.density = 1500;
  params.gravity = -9.81 * Vec<Dim>::Unit(Dim - 1);
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = Faces<Dim>::all({FaceKind::free_slip});
  params.faces.lower[Dim - 1] = {FaceKind::no_slip};
  params.faces.upper[Dim - 1] = {FaceKind::open};
  return params;
}

Sim<2> heap(double from, double to, double bottom, double top, const Sim<2>::Params& params) {
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {from, bottom}, {to, top}, {.jitter = 0});
  return Sim<2>(params, sand);
}

} // namespace

TEST_CASE("the front of a heap that does not touch the left edge is its downstream end") {
  const std::vector<double> x = {0, 1, 2, 3, 4, 5};
  const auto front = [&](const std::vector<double>& height) {
    return front_position({x, height, height}, 1);
  };
  CHECK(front({0, 0, 3, 3, 0, 0}) == doctest::Approx(3 + 2.0 / 3));
  CHECK(front({2, 0, 0, 0, 0, 0}) == doctest::Approx(0.5));
  CHECK(front({0, 0, 0, 0, 0, 3}) == 5);
  CHECK(front({3, 3, 3, 3, 3, 3}) == 5);
  CHECK(front({0, 1, 1, 0, 0, 0}) == 0);                        // nothing above the level
  CHECK(front({3, 3, 0, 0, 3, 0}) == doctest::Approx(5.0 / 3)); // of two heaps the first
}

TEST_CASE("profile, front and volume are there after the first step, and refused before") {
  Sim<2> sim = heap(0.1, 0.2, 0, 0.1, box<2>());
  CHECK_THROWS_AS(measure_profile(sim), std::invalid_argument);
  CHECK_THROWS_AS(volume_under_surface(sim), std::invalid_argument);
  REQUIRE(sim.step().completed());
  const Profile profile = measure_profile(sim);
  CHECK(profile.height[15] == about(0.1, 0.06)); // half a cell
  CHECK(profile.height[5] == 0);
  CHECK(std::abs(front_position(profile, 0.01) - 0.2) < 0.01);
  CHECK(volume_under_surface(sim) == about(0.01, 0.1));
}

TEST_CASE("a profile's speed and a front's level are numbers") {
  Sim<2> sim = heap(0.1, 0.2, 0, 0.1, box<2>());
  REQUIRE(sim.step().completed());
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double wrong : {nan, infinity, -1.0}) {
    const std::string message =
        "measure_profile: static_speed is " + text_of(wrong) + "; allowed: a finite number >= 0";
    CHECK_THROWS_WITH_AS(measure_profile(sim, middle_row, wrong), message.c_str(),
                         std::invalid_argument);
    CHECK_THROWS_WITH_AS(mean_profile(sim, 0, wrong), message.c_str(), std::invalid_argument);
  }
  CHECK(measure_profile(sim, middle_row, 0).static_height[15] >= 0); // what stands still
  const Profile profile = measure_profile(sim);
  for (const double wrong : {nan, infinity, -infinity}) {
    const std::string message =
        "front_position: level is " + text_of(wrong) + "; allowed: a finite number";
    CHECK_THROWS_WITH_AS(front_position(profile, wrong), message.c_str(), std::invalid_argument);
  }
}

TEST_CASE("profile, front and volume of sand on an obstacle, next to nothing and next to sand") {
  auto params = box<2>();
  SUBCASE("a floor above that of the box") {
    params.obstacles = {make_obstacle<Floor<2>>({.height = 0.05, .friction = 0.5})};
  }
  SUBCASE("a solid block") {
    params.obstacles = {make_obstacle<ShapeObstacle<2>>(
        {.shape = shapes::HalfSpace<2>({0, 0.05}, {0, 1}), .friction = 0.5})};
  }
  Sim<2> sim = heap(0, 0.2, 0.05, 0.15, params);
  const double volume = total_volume(sim.particles());
  for (int step = 0; step < 3; ++step) {
    REQUIRE(sim.step().completed());
    const Profile profile = measure_profile(sim);
    CHECK(profile.base[10] == about(0.05, 0.21)); // a cell
    CHECK(profile.height[10] == about(0.15, 0.04));
    CHECK(profile.static_height[10] >= profile.base[10]);
    CHECK(profile.static_height[10] <= profile.height[10]);
    CHECK(profile.height[30] == 0);
    CHECK(std::abs(front_position(profile, 0.06) - 0.2) < 0.01);
    CHECK(volume_under_surface(sim) == about(volume, 0.12));
  }
}

TEST_CASE("the profile of a channel is that of its middle, and of another row if it is asked for") {
  const auto params = box<3>();
  Particles<3> sand; // in the middle alone
  fill_box<3>(sand, Grid<3>(params.grid), {0, 0.02, 0}, {0.2, 0.08, 0.1}, {.jitter = 0});
  Sim<3> sim(params, sand);
  REQUIRE(sim.step().completed());
  const Profile middle = measure_profile(sim), wall = measure_profile(sim, 0);
  CHECK(middle.height[10] == about(0.1, 0.06));
  CHECK(measure_profile(sim, middle_row).height == middle.height);
  CHECK(measure_profile(sim, 2).height == middle.height);
  CHECK(wall.height[10] == 0);
  CHECK_THROWS_WITH_AS(measure_profile(sim, 6),
                       "measure_profile: row is 6; allowed: middle_row, or 0 to 5",
                       std::invalid_argument);
  CHECK_THROWS_AS(measure_profile(sim, -2), std::invalid_argument);
}

TEST_CASE("a gate is done when it has left the material or has stopped, not before") {
  const auto gate = [](const GateMotion& motion) {
    return Gate<2>({.position = 0.2, .bottom = 0.02, .friction = 0, .motion = motion});
  };
  const auto rising = gate({.opening_time = 1, .terminal_speed = 0.1, .time_constant = 0});
  CHECK(!rising.done(0.5, 0.1));
  CHECK(!rising.done(1, 0.1));
  CHECK(!rising.done(1.7, 0.1)); // at 0.09 m
  CHECK(rising.done(1.9, 0.1));
  CHECK(!rising.done(0.5, 0.01)); // above the material, but it has not opened yet
  const auto stopping = gate({.terminal_speed = 0.1, .time_constant = 0, .rise = 0.03});
  CHECK(!stopping.done(0.2, 0.1));
  CHECK(stopping.done(0.4, 0.1));
  const auto slow = gate({.terminal_speed = 0.1, .time_constant = 10}); // starts with no speed
  CHECK(!slow.done(1e-9, 0.1));
}

TEST_CASE("the friction of a face that is not frictional is refused") {
  auto faces = Faces<2>::all({FaceKind::free_slip});
  faces.lower[0] = {FaceKind::frictional, 0.3};
  faces.upper[0] = {FaceKind::no_slip, 0};
  faces.validate();
  faces.lower[1] = {FaceKind::no_slip, 0.3};
  CHECK_THROWS_WITH_AS(
      faces.validate(),
      "faces.lower.y.friction is 0.3; allowed: none for a face that is not FaceKind::frictional",
      std::invalid_argument);
}

namespace {

/// A solver of one's own around another, which counts what it did.
class Counting {
 public:
  using Params = GaussSeidel<>::Params;
  template <int Dim>
  struct Workspace {
    GaussSeidel<>::Workspace<Dim> inner;
    int solves = 0;
  };
  explicit Counting(const Params& params) : inner_(params) {}
  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                    const Execution& execution) const {
    ++workspace.solves;
    return inner_.solve(problem, workspace.inner, execution);
  }

 private:
  GaussSeidel<> inner_;
};

} // namespace

namespace {

/// Dense up to a height that rises across the channel, static up to half of it.
struct Slanted {
  static constexpr int dimension = 3;
  talus::Grid<3> box{{.origin = {0, 0, 0}, .size = {0.2, 0.4, 1}, .cells = {2, 4, 100}}};
  const talus::Grid<3>& grid() const { return box; }
  static double top(const Index<3>& n) { return 0.105 + 0.1 * n[1] * n[1]; }
  double z(const Index<3>& n) const { return box.spacing()[2] * n[2]; }
  double volume_fraction(const Index<3>& n) const { return z(n) < top(n) ? 1 : 0; }
  Vec<3> velocity(const Index<3>& n) const { return {z(n) < top(n) / 2 ? 0.0 : 1.0, 0, 0}; }
};

} // namespace

TEST_CASE("the mean profile across counts the rows at the walls half") {
  const Slanted flow;
  const auto height = [&](int row) { return measure_profile(flow, row).height.at(1); };
  const auto still = [&](int row) { return measure_profile(flow, row).static_height.at(1); };
  const Profile mean = mean_profile(flow);
  CHECK(mean.x == measure_profile(flow, 0).x);
  CHECK(mean.height.at(1) ==
        about((height(0) / 2 + height(1) + height(2) + height(3) + height(4) / 2) / 4));
  CHECK(mean.static_height.at(1) ==
        about((still(0) / 2 + still(1) + still(2) + still(3) + still(4) / 2) / 4));
  CHECK(mean_profile(flow, 1).height.at(1) ==
        about((height(1) / 2 + height(2) + height(3) / 2) / 2));
  CHECK(mean_profile(flow, 0, 2.0).static_height == mean.height); // nothing is so fast
  CHECK_THROWS_WITH_AS(
      static_cast<void>(mean_profile(flow, 2)),
      "mean_profile: margin is 2; allowed: from 0 to below half of the 4 cells across",
      std::invalid_argument);
  CHECK_THROWS_AS(static_cast<void>(volume_under_surface(flow, 2)), std::invalid_argument);
}

TEST_CASE("the statistics of a user's solver are read back from its workspace") {
  using Mine = Simulation<2, ConstantFriction, PolyPic, Counting>;
  const auto params = box<2>();
  Mine::Params mine;
  mine.grid = params.grid;
  mine.material = params.material;
  mine.gravity = params.gravity;
  mine.time_step = params.time_step;
  mine.rheology = params.rheology;
  mine.faces = params.faces;
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(mine.grid), {0, 0}, {0.1, 0.1}, {});
  Mine sim(mine, sand);
  for (int n = 0; n < 3; ++n)
    CHECK(sim.step().completed());
  CHECK(sim.solver_workspace().solves == 3);
  CHECK(sim.rheology().friction(0) == 0.44);
}

TEST_CASE("particles on faces, edges and nodes count once, and one beyond by rounding is refused "
          "in words") {
  Sim<2>::Params params = box<2>();
  params.grid = {.origin = {0, 0}, .size = {0.3, 0.2}, .cells = {3, 2}};
  Particles<2> sand;
  for (int i = 0; i <= 6; ++i)
    for (int k = 0; k <= 4; ++k)
      sand.add({std::min(0.3, 0.05 * i), std::min(0.2, 0.05 * k)}, Vec<2>::Zero(), 1e-4);
  Sim<2> sim(params, sand);
  REQUIRE(sim.step().completed());
  double volume = 0;
  for (int i = 0; i <= 3; ++i)
    for (int k = 0; k <= 2; ++k)
      volume += sim.volume_fraction({i, k}) * sim.grid().node_volume({i, k});
  CHECK(volume == about(total_volume(sand), 1e-14));
  sand.add({6 * 0.05, 0.1}, Vec<2>::Zero(), 1e-4);
  CHECK_THROWS_WITH_AS(Sim<2>(params, sand),
                       "a particle's coordinate is 0.3; allowed: a position in the box of the "
                       "grid; it is 5.6e-17 m outside",
                       std::invalid_argument);
}

} // namespace test_profile
