// SPDX-License-Identifier: MIT
// Free bodies on obstacles and on each other, against what mechanics says of rigid ones.

#include "../support/about.hpp"
#include "../support/files.hpp"
#include "scenes.hpp"

#include "talus/boundary/body.hpp"
#include "talus/boundary/floor.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/mesh_distance.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/terrain/terrain.hpp"

#include <doctest/doctest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace test_body_contacts {

using namespace talus;
using support::about;
using support::message_of;

namespace {

constexpr double g = 9.81;

/// A box of 1 m without any material, all faces open, gravity down.
template <int Dim>
typename scenes::Sim<Dim>::Params empty_box() {
  auto params = scenes::box<Dim>({1, 1, 1}, {10, 10, 10}, 0, 0.44);
  params.faces = Faces<Dim>::all({FaceKind::open});
  params.solver.tolerance = 1e-12;
  return params;
}

template <int Dim>
Vec<Dim> up() {
  return Vec<Dim>::Unit(up_axis<Dim>);
}

/// A point in the middle, at a height and a distance from the middle along x.
template <int Dim>
Vec<Dim> at(double z, double x = 0.5) {
  Vec<Dim> point = Vec<Dim>::Constant(0.5);
  point[0] = x;
  point[up_axis<Dim>] = z;
  return point;
}

template <int Dim>
std::shared_ptr<const Obstacle<Dim>> solid(Shape<Dim> shape, double friction,
                                           RigidMotion<Dim> motion = {}) {
  return make_obstacle<ShapeObstacle<Dim>>(
      {.shape = std::move(shape), .friction = friction, .motion = std::move(motion)});
}

/// All below z = height at x = 0.5, rising by `degrees` against x.
template <int Dim>
shapes::HalfSpace<Dim> slope(double height, double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  return {at<Dim>(height),
          Vec<Dim>(std::cos(angle) * up<Dim>() + std::sin(angle) * Vec<Dim>::Unit(0))};
}

template <int Dim>
void run(scenes::Sim<Dim>& sim, double end) {
  while (sim.time() < end - 1e-9) {
    const StepReport report = sim.step();
    CHECK(report.solve.status == SolveStatus::converged);
  }
}

template <int Dim>
void ball_drops() {
  auto params = empty_box<Dim>();
  params.obstacles = {solid<Dim>(shapes::HalfSpace<Dim>(at<Dim>(0.237), up<Dim>()), 0.3)};
  params.bodies = {ball_body<Dim>(at<Dim>(0.5), 0.11, 2000, 0.3)};
  scenes::Sim<Dim> sim(params, {});
  run(sim, 0.1); // it still falls: δt² g n (n + 1)/2
  CHECK(sim.bodies()[0].position[up_axis<Dim>] == about(0.5 - 1e-6 * g * 5050));
  CHECK(sim.obstacle_wrench(0).force.norm() == 0);
  run(sim, 0.5);
  const RigidState<Dim>& ball = sim.bodies()[0];
  const double weight = params.bodies[0].mass * g;
  CHECK(std::abs(ball.position[up_axis<Dim>] - 0.347) < 1e-12);
  CHECK(ball.velocity.norm() < 1e-12);
  CHECK((sim.obstacle_wrench(0).force + weight * up<Dim>()).norm() < 1e-9 * weight);
  CHECK((sim.body_wrench(0).force - weight * up<Dim>()).norm() < 1e-9 * weight);
}

/// The acceleration of a ball down a slope of 30°, and its angular one, in units of g and g/r.
template <int Dim>
std::pair<double, double> down_a_slope(double friction) {
  auto params = empty_box<Dim>();
  params.obstacles = {solid<Dim>(slope<Dim>(0.4, 30), friction)};
  const Vec<Dim> normal(std::sqrt(0.75) * up<Dim>() + 0.5 * Vec<Dim>::Unit(0));
  const Vec<Dim> along(std::sqrt(0.75) * Vec<Dim>::Unit(0) - 0.5 * up<Dim>());
  const double radius = 0.1;
  params.bodies = {ball_body<Dim>(at<Dim>(0.4) + radius * normal, radius, 2000, 0.9)};
  scenes::Sim<Dim> sim(params, {});
  run(sim, 0.2);
  const RigidState<Dim>& ball = sim.bodies()[0];
  CHECK(std::abs((ball.position - at<Dim>(0.4)).dot(normal) - radius) < 1e-12);
  CHECK(std::abs(ball.velocity.dot(normal)) < 1e-12);
  return {ball.velocity.dot(along) / (0.2 * g), ball.angular_velocity.norm() * radius / (0.2 * g)};
}

template <int Dim>
void two_balls(const Vec<Dim>& offset) {
  auto params = empty_box<Dim>();
  params.gravity.setZero();
  params.bodies = {ball_body<Dim>(at<Dim>(0.5, 0.3), 0.1, 2000, 0.2),
                   ball_body<Dim>(at<Dim>(0.5, 0.6) + offset, 0.12, 1000, 0.3)};
  params.bodies[0].start.velocity[0] = 2;
  params.bodies[1].start.velocity[0] = -0.5;
  scenes::Sim<Dim> sim(params, {});
  const auto momentum = [&](const auto& of_body) {
    auto sum = of_body(0);
    sum += of_body(1);
    return sum;
  };
  const auto linear = [&](std::size_t b) {
    return Vec<Dim>(params.bodies[b].mass * sim.bodies()[b].velocity);
  };
  const auto angular = [&](std::size_t b) {
    return Spin<Dim>(params.bodies[b].inertia * sim.bodies()[b].angular_velocity +
                     torque<Dim>(sim.bodies()[b].position, linear(b)));
  };
  const auto before = momentum(linear);
  const auto turn = momentum(angular);
  run(sim, 0.1);
  CHECK((momentum(linear) - before).norm() < 1e-12 * before.norm());
  CHECK((momentum(angular) - turn).norm() < 1e-12 * before.norm());
  const Vec<Dim> between = sim.bodies()[1].position - sim.bodies()[0].position;
  CHECK(between.norm() > 0.22 - 1e-12);
  if (offset.norm() > 0)
    return;
  for (std::size_t b = 0; b < 2; ++b) // no bounce: both have the velocity of their centre of mass
    CHECK(sim.bodies()[b].velocity[0] ==
          about(before[0] / (params.bodies[0].mass + params.bodies[1].mass), 1e-9));
  CHECK(between.norm() == about(0.22, 1e-9));
}

/// Blocks on each other, on a slope of `degrees`; they rest if it is less than their friction.
template <int Dim>
void stack(double degrees) {
  auto params = empty_box<Dim>();
  const double angle = degrees * std::numbers::pi / 180;
  params.gravity = g * (std::sin(angle) * Vec<Dim>::Unit(0) - std::cos(angle) * up<Dim>());
  params.obstacles = {solid<Dim>(shapes::HalfSpace<Dim>(at<Dim>(0.2), up<Dim>()), 0.4)};
  Vec<Dim> size = Vec<Dim>::Constant(0.3);
  size[up_axis<Dim>] = 0.2;
  for (int k = 0; k < 3; ++k)
    params.bodies.push_back(block_body<Dim>(at<Dim>(0.3 + 0.2 * k), size, 1000, 0.4));
  scenes::Sim<Dim> sim(params, {});
  run(sim, 0.3);
  const double weight = params.bodies[0].mass * g;
  for (std::size_t b = 0; b < 3; ++b) {
    CHECK((sim.bodies()[b].position - params.bodies[b].start.position).norm() < 1e-8);
    CHECK(sim.bodies()[b].velocity.norm() < 1e-8);
    CHECK((sim.body_wrench(b).force * g + weight * sim.gravity()).norm() < 1e-6 * weight * g);
  }
  CHECK((sim.obstacle_wrench(0).force * g - 3 * weight * sim.gravity()).norm() < 1e-6 * weight * g);
}

/// A block with a pit: an upside-down pyramid with its apex at (0, 0, 0.1), walls of 45°.
std::vector<std::array<Vec<3>, 3>> pyramid_pit() {
  std::vector<std::array<Vec<3>, 3>> mesh;
  const double half = 0.4, top = 0.5;
  const auto quad = [&](const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d) {
    mesh.push_back({a, b, c});
    mesh.push_back({a, c, d});
  };
  const std::array<Vec<3>, 4> rim{Vec<3>(-half, -half, top), Vec<3>(half, -half, top),
                                  Vec<3>(half, half, top), Vec<3>(-half, half, top)};
  std::array<Vec<3>, 4> edge = rim, foot = rim;
  for (std::size_t k = 0; k < 4; ++k) {
    edge[k].head<2>() *= 1.2;
    foot[k] = edge[k];
    foot[k][2] = 0;
  }
  const Vec<3> apex(0, 0, 0.1);
  for (std::size_t k = 0; k < 4; ++k) {
    const std::size_t next = (k + 1) % 4;
    mesh.push_back({rim[k], rim[next], apex});
    quad(edge[k], edge[next], rim[next], rim[k]);
    quad(foot[k], foot[next], edge[next], edge[k]);
  }
  quad(foot[3], foot[2], foot[1], foot[0]);
  return mesh;
}

/// A ball that drops beside the middle of what it cannot pass: where it comes to rest.
template <int Dim>
Vec<Dim> rests_in(std::shared_ptr<const Obstacle<Dim>> obstacle, double radius, double from,
                  double end = 1.2) {
  auto params = empty_box<Dim>();
  params.obstacles = {std::move(obstacle)};
  params.bodies = {ball_body<Dim>(at<Dim>(from, 0.507), radius, 2000, 0.3)};
  params.solver.tolerance = 1e-5;
  scenes::Sim<Dim> sim(params, {});
  run(sim, end);
  const double weight = params.bodies[0].mass * g;
  CHECK(sim.bodies()[0].velocity.norm() < 1e-6);
  CHECK((sim.obstacle_wrench(0).force + weight * up<Dim>()).norm() < 1e-4 * weight);
  return sim.bodies()[0].position;
}

} // namespace

TEST_CASE("a ball that drops on an obstacle comes to rest at its radius above it") {
  ball_drops<2>();
  ball_drops<3>();
}

TEST_CASE("a ball on a slope rolls or slides as a rigid one") {
  const double normal = std::sqrt(0.75);
  const auto check = [](const std::pair<double, double>& is, double along, double turn) {
    CHECK(is.first == about(along, 1e-9));
    CHECK(is.second == about(turn, 1e-9));
  };
  check(down_a_slope<2>(0.5), 0.5 * 2 / 3, 0.5 * 2 / 3); // sin θ / (1 + J/(M r²)), without slip
  check(down_a_slope<3>(0.5), 0.5 * 5 / 7, 0.5 * 5 / 7);
  check(down_a_slope<2>(0.1), 0.5 - 0.1 * normal,
        2 * 0.1 * normal); // sin θ − μ cos θ, μ cos θ M r²/J
  check(down_a_slope<3>(0.1), 0.5 - 0.1 * normal, 2.5 * 0.1 * normal);
  CHECK(down_a_slope<3>(0).second < 1e-12);
}

TEST_CASE("two balls keep their momentum, and do not bounce") {
  two_balls<2>(Vec<2>::Zero());
  two_balls<3>(Vec<3>::Zero());
  two_balls<2>(Vec<2>(0, 0.1));
  two_balls<3>(Vec<3>(0, 0.05, 0.1));
}

TEST_CASE("a stack of blocks rests") {
  stack<2>(0);
  stack<3>(0);
  stack<2>(15);
  stack<3>(15);
}

TEST_CASE("a ball rests in a hopper, on all walls at once") {
  const shapes::HalfSpace<2> left({0.5, 0.2}, {1, 1}), right({0.5, 0.2}, {-1, 2});
  const Vec<2> groove = rests_in<2>(solid<2>(shapes::Union(left, right), 0), 0.1, 0.6);
  CHECK(left.distance(groove) == about(0.1, 1e-6));
  CHECK(right.distance(groove) == about(0.1, 1e-6));

  RigidState<3> place;
  place.position = {0.5, 0.5, 0};
  const Vec<3> pit = rests_in<3>(
      solid<3>(shapes::SampledMesh(pyramid_pit(), 0.01), 0, steady_motion<3>(place)), 0.1, 0.4);
  CHECK((pit - Vec<3>(0.5, 0.5, 0.1 + 0.1 * std::numbers::sqrt2)).norm() < 1e-6);
}

TEST_CASE("a ball rests on the rim of a hole, or falls through") {
  const auto hole = [](auto centre, double opening) {
    return make_obstacle<Floor<decltype(centre)::RowsAtCompileTime>>(
        {.height = 0.3, .centre = centre, .opening = opening, .friction = 0});
  };
  CHECK((rests_in<2>(hole(at<2>(0), 0.12), 0.1, 0.45) - at<2>(0.38)).norm() < 1e-6);
  CHECK((rests_in<3>(hole(at<3>(0), 0.12), 0.1, 0.45) - at<3>(0.38)).norm() < 1e-6);
  auto params = empty_box<3>();
  params.obstacles = {hole(at<3>(0), 0.21)};
  params.bodies = {ball_body<3>(at<3>(0.5), 0.1, 2000, 0.3)};
  scenes::Sim<3> sim(params, {});
  run(sim, 0.3);
  CHECK(sim.bodies()[0].position[2] < 0.2);
}

namespace {

/// A plate that rises with a ball on it, and one that turns about a vertical axis under another.
template <int Dim>
void plate_carries_ball() {
  auto params = empty_box<Dim>();
  RigidState<Dim> start;
  start.position = at<Dim>(0.3);
  start.velocity[up_axis<Dim>] = 0.5;
  start.velocity[0] = 0.2;
  Vec<Dim> half = Vec<Dim>::Constant(0.3);
  half[up_axis<Dim>] = 0; // no thickness
  params.obstacles = {solid<Dim>(shapes::Box<Dim>(-half, half), 0.5, steady_motion<Dim>(start))};
  Vec<Dim> size = Vec<Dim>::Constant(0.3);
  params.bodies = {block_body<Dim>(at<Dim>(0.45), size, 2000, 0.9)};
  scenes::Sim<Dim> sim(params, {});
  run(sim, 0.3); // μ g t > 0.2 m/s: no slip any more
  CHECK((sim.bodies()[0].velocity - start.velocity).norm() < 1e-9);
  CHECK(sim.bodies()[0].position[up_axis<Dim>] == about(0.45 + 0.15, 1e-9));
  CHECK(sim.obstacle_wrench(0).force[up_axis<Dim>] == about(-params.bodies[0].mass * g, 1e-6));
}

/// The liquid left of a block that leans on a wall: the wall carries what the liquid does.
template <int Dim>
void block_between_liquid_and_wall() {
  constexpr int z = up_axis<Dim>;
  auto params = scenes::box<Dim>({0.4, 0.06, 0.2}, {20, 3, 10}, 0, 0);
  Vec<Dim> face = Vec<Dim>::Zero(), size = params.grid.size, centre = params.grid.size / 2;
  face[0] = 0.32;
  size[0] = 0.1;
  size[z] = 0.15;
  centre[0] = 0.27;
  centre[z] = 0.075;
  params.faces.lower[z].kind = FaceKind::free_slip;
  params.obstacles = {solid<Dim>(shapes::HalfSpace<Dim>(face, Vec<Dim>(-Vec<Dim>::Unit(0))), 0)};
  params.bodies = {block_body<Dim>(centre, size, 2000, 0)};
  params.solver.tolerance = 1e-8;
  scenes::Sim<Dim> sim(params, scenes::block<Dim>(params.grid, 0, 0.22, 0, 0.1));
  run(sim, 0.1);
  const double liquid = -sim.face_wrench(0, false).force[0]; // what it does to the other side
  CHECK(liquid == about(1500 * g * 0.1 * 0.1 / 2 * (Dim == 2 ? 1 : 0.06), 0.1));
  CHECK(sim.obstacle_wrench(0).force[0] == about(liquid, 1e-3));
  CHECK(std::abs(sim.body_wrench(0).force[0]) < 1e-3 * liquid);
  CHECK(sim.bodies()[0].position[0] == about(0.27, 1e-6));
}

template <int Dim>
void ball_leans_on_gate() {
  auto params = empty_box<Dim>();
  params.gravity = Vec<Dim>(0.5 * g * Vec<Dim>::Unit(0) - g * up<Dim>());
  params.faces.lower[up_axis<Dim>] = {FaceKind::free_slip};
  params.obstacles = {make_obstacle<Gate<Dim>>(
      {.position = 0.7, .thickness = 0.02, .friction = 0, .motion = {.opening_time = 0.3}})};
  params.bodies = {ball_body<Dim>(at<Dim>(0.1, 0.55), 0.1, 2000, 0.9)};
  scenes::Sim<Dim> sim(params, {});
  run(sim, 0.3);
  CHECK(sim.bodies()[0].position[0] == about(0.6, 1e-9));
  CHECK(sim.obstacle_wrench(0).force[0] == about(0.5 * g * params.bodies[0].mass, 1e-9));
  run(sim, 1.2);
  CHECK(sim.bodies()[0].position[0] > 1); // it rolls out under the gate
}

std::string refused(const scenes::Sim<2>::Params& params) {
  return message_of<std::invalid_argument>([&] { scenes::Sim<2>(params, {}); });
}

} // namespace

TEST_CASE("an obstacle that moves carries a block along, and keeps it") {
  plate_carries_ball<2>();
  plate_carries_ball<3>();
}

TEST_CASE("a block between a liquid and a wall hands the pressure on") {
  block_between_liquid_and_wall<2>();
  block_between_liquid_and_wall<3>();
}

TEST_CASE("a ball leans on a gate until it opens") {
  ball_leans_on_gate<2>();
  ball_leans_on_gate<3>();
}

TEST_CASE("a ball rolls over terrain as down a slope") {
  auto params = empty_box<3>();
  params.obstacles = {make_obstacle<Terrain<3>>(
      {.height = [](const Vec<3>& x) { return 0.6 - 0.75 * x[0]; }, .friction = 0.9})};
  const Vec<3> normal(0.6, 0, 0.8);
  params.bodies = {ball_body<3>(Vec<3>(0.2, 0.5, 0.45) + 0.1 * normal, 0.1, 2000, 0.9)};
  scenes::Sim<3> sim(params, {});
  run(sim, 0.2);
  CHECK((sim.bodies()[0].velocity - 0.2 * g * 5 / 7 * 0.6 * Vec<3>(0.8, 0, -0.6)).norm() < 1e-9);
}

TEST_CASE("bodies that pass: obstacles of one's own without a distance, bodies that have left") {
  struct Net final : Obstacle<2> {
    std::optional<ObstacleContact<2>> contact(const Vec<2>& x, const Vec<2>&,
                                              double) const override {
      if (x[1] > 0.3)
        return std::nullopt;
      return ObstacleContact<2>{{0, 1}, {0, 0}, 0.3};
    }
  };
  auto params = empty_box<2>();
  params.obstacles = {std::make_shared<Net>(), solid<2>(shapes::HalfSpace<2>({0, -2}, {0, 1}), 0)};
  params.bodies = {ball_body<2>({0.5, 0.5}, 0.1, 2000, 0.3)};
  scenes::Sim<2> sim(params, {});
  run(sim, 1);
  CHECK(sim.bodies()[0].position[1] == about(0.5 - 1e-6 * g * 500500, 1e-9)); // through both
}

TEST_CASE("bodies that start in something, and obstacles that give no distance, are refused") {
  auto params = empty_box<2>();
  params.obstacles = {solid<2>(shapes::HalfSpace<2>({0, 0.25}, {0, 1}), 0)};
  params.bodies = {ball_body<2>({0.5, 0.36}, 0.1, 2000, 0.3),
                   ball_body<2>({0.5, 0.55}, 0.1, 2000, 0.3)};
  CHECK(refused(params).starts_with("the distance of corner 0 of body 0 to body 1 is -0.01"));
  params.bodies[1].start.position[1] = 0.56; // touching
  CHECK(refused(params) == "(nothing thrown)");
  params.bodies[0].start.position[1] = 0.34;
  CHECK(refused(params).starts_with("the distance of corner 0 of body 0 to obstacle 0 is -0.01"));
  CHECK(refused(params).ends_with("allowed: >= 0: it must not start inside of it"));
  params.bodies[0].start.position[1] = 0.36;
  struct Odd final : Obstacle<2> {
    std::optional<ObstacleContact<2>> contact(const Vec<2>&, const Vec<2>&, double) const override {
      return std::nullopt;
    }
    double distance(const Vec<2>&, const Vec<2>&, double, const RigidState<2>&) const override {
      return std::numeric_limits<double>::quiet_NaN();
    }
  };
  params.obstacles.push_back(std::make_shared<Odd>());
  CHECK(refused(params).starts_with("a shape's distance at x = (0.5, 0.36) m is nan"));
  for (const double rounding : {-0.1, 0.6, std::numeric_limits<double>::quiet_NaN()})
    CHECK(message_of<std::invalid_argument>([&] {
            block_body<2>({0, 0}, {1, 1}, 1000, 0.3, rounding);
          }).starts_with("block: rounding is "));
}

namespace {

/// Two balls in a groove, a block on them, and sand beside.
scenes::Sim<3> pile(int threads) {
  auto params = scenes::box<3>({0.4, 0.4, 0.4}, {20, 20, 20}, 0, 0.44);
  params.threads = threads;
  params.solver.tolerance = 1e-3;
  params.obstacles = {solid<3>(
      shapes::Intersection(shapes::HalfSpace<3>({0.12, 0, 0}, {1, 0, 0}),
                           shapes::Union(shapes::HalfSpace<3>({0.06, 0.2, 0.1}, {0, 1, 1}),
                                         shapes::HalfSpace<3>({0.06, 0.2, 0.1}, {0, -1, 1}))),
      0.3)};
  params.bodies = {ball_body<3>({0.05, 0.2, 0.16}, 0.04, 2000, 0.3),
                   ball_body<3>({0.09, 0.21, 0.235}, 0.04, 1000, 0.3),
                   block_body<3>({0.165, 0.2, 0.13}, {0.06, 0.1, 0.14}, 1000, 0.3)};
  return scenes::Sim<3>(params, scenes::block<3>(params.grid, 0.14, 0.24, 0, 0.06, 0.5));
}

std::string bits(const scenes::Sim<3>& sim) {
  std::string text = state_checksum(sim.particles());
  for (const RigidState<3>& body : sim.bodies())
    for (int a = 0; a < 3; ++a)
      for (const double x : {body.position[a], body.velocity[a], body.angular_velocity[a]})
        text += " " + std::to_string(std::bit_cast<std::uint64_t>(x));
  return text;
}

} // namespace

TEST_CASE("bodies that touch: the same bits for any number of threads, and from a checkpoint") {
  const support::Folder folder;
  auto one = pile(1), three = pile(3), again = pile(2);
  for (int n = 0; n < 60; ++n) {
    CHECK(one.step().completed());
    CHECK(three.step().completed());
  }
  CHECK(bits(one) == bits(three));
  int points = 0, pairs = 0;
  for (const auto& contact : one.problem().body_contacts) {
    points += contact.point > 0 && contact.impulse.norm() > 0;
    pairs += contact.other >= 0 && contact.impulse.norm() > 0;
  }
  CHECK(points > 0);
  CHECK(pairs > 0);
  write_checkpoint(folder / "pile.talus", one);
  read_checkpoint(folder / "pile.talus", again);
  for (int n = 0; n < 20; ++n) {
    CHECK(one.step().completed());
    CHECK(again.step().completed());
  }
  CHECK(bits(one) == bits(again));
}

} // namespace test_body_contacts
