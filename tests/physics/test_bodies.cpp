// SPDX-License-Identifier: MIT
// Obstacles of any shape and free bodies: forces, friction, momentum, and that nothing leaks.

#include "../support/about.hpp"
#include "scenes.hpp"

#include "talus/boundary/body.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/checksum.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

namespace test_bodies {

using namespace talus;

namespace {

template <int Dim>
void add_obstacle(typename scenes::Sim<Dim>::Params& params, Shape<Dim> shape, double friction,
                  RigidMotion<Dim> motion = {}) {
  params.obstacles.push_back(
      std::make_shared<ShapeObstacle<Dim>>(typename ShapeObstacle<Dim>::Params{
          .shape = std::move(shape), .friction = friction, .motion = std::move(motion)}));
}

/// A ball falls on a bed of sand: everything that a free body can meet.
template <int Dim>
scenes::Sim<Dim> impact(int threads = 1) {
  auto params = scenes::box<Dim>({0.2, 0.2, 0.24}, {10, 10, 12}, 0, 0.44);
  params.threads = threads;
  Vec<Dim> centre = Vec<Dim>::Constant(0.1);
  centre[up_axis<Dim>] = 0.14;
  auto ball = ball_body<Dim>(centre, 0.03, 3000, 0.3);
  ball.start.velocity[up_axis<Dim>] = -1;
  ball.start.angular_velocity[0] = 5;
  params.bodies.push_back(ball);
  return scenes::Sim<Dim>(params, scenes::block<Dim>(params.grid, 0, 0.2, 0, 0.1, 0.3));
}

/// Particles of a lattice over the whole box for which `where` holds.
template <int Dim, class Predicate>
Particles<Dim> sand_where(const GridParams<Dim>& grid, const Predicate& where) {
  Particles<Dim> all, chosen;
  fill_box<Dim>(all, Grid<Dim>(grid), grid.origin, Vec<Dim>(grid.origin + grid.size),
                {.per_axis = Dim == 2 ? 3 : 2});
  for (std::size_t p = 0; p < all.size(); ++p)
    if (where(all.position[p]))
      chosen.add(all.position[p], Vec<Dim>::Zero(), all.volume[p]);
  return chosen;
}

template <int Dim>
double weight(const scenes::Sim<Dim>& sim) {
  double volume = 0;
  for (const double v : sim.particles().volume)
    volume += v;
  return volume * sim.params().material.density * sim.gravity().norm();
}

Vec<2> turned(double angle_deg, const Vec<2>& v) {
  return rotation_by<2>(Spin<2>(angle_deg * std::numbers::pi / 180)) * v;
}

/// A slab of sand with a high friction of its own on a wall of friction mu: it slides as a whole
/// once it has landed, since the lattice is loose beside an obstacle between nodes. Returns
/// friction force over normal force of the wall, from then on.
template <int Dim>
double sliding_friction(double mu, bool on_face) {
  auto params = scenes::box<Dim>({0.8, 0.04, 0.1}, {40, 2, 10}, 30, 0.8);
  constexpr int up = up_axis<Dim>;
  const double floor = on_face ? 0 : 0.033; // between nodes
  if (on_face)
    params.faces.lower[up] = {FaceKind::frictional, mu};
  else
    add_obstacle<Dim>(
        params, shapes::HalfSpace<Dim>(floor * Vec<Dim>::Unit(up), Vec<Dim>(Vec<Dim>::Unit(up))),
        mu);
  scenes::Sim<Dim> sim(params, scenes::block<Dim>(params.grid, 0.1, 0.3, floor, floor + 0.04));
  Vec<Dim> force = Vec<Dim>::Zero();
  while (sim.time() < 0.1) {
    CHECK(sim.step().solve.status == SolveStatus::converged);
    if (sim.time() > 0.02)
      force += on_face ? sim.face_wrench(up, false).force : sim.obstacle_wrench(0).force;
  }
  return force[0] / -force[up];
}

/// A smooth wall is pushed into sand 0.1 m deep on a smooth floor, or drawn away from it (speed <
/// 0, m/s): mean force on it from 0.1 to 0.2 s over that of a liquid.
double earth_pressure(double mu, double speed, int cells_up) {
  constexpr double depth = 0.1, length = 0.4, wall = 0.1, density = 1500, g = 9.81;
  const double h = depth / cells_up;
  const auto cells = [&](double size) { return static_cast<int>(std::lround(size / h)); };
  auto params =
      scenes::box<2>({wall + length, 0, 2 * depth}, {cells(wall + length), 1, 2 * cells_up}, 0, mu);
  params.faces.lower[1].kind = FaceKind::free_slip;
  params.time_step = 0.05 * std::sqrt(h / g);
  params.packing.even = true; // noise would take friction from what moves so slowly
  const RigidMotion<2> motion = [=](double time) {
    RigidState<2> state;
    state.position[0] = wall + speed * time;
    state.velocity[0] = speed;
    return state;
  };
  add_obstacle<2>(params, shapes::HalfSpace<2>(Vec<2>::Zero(), Vec<2>::UnitX()), 0, motion);
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {wall, 0}, {wall + length, depth}, {.per_axis = 4});
  scenes::Sim<2> sim(params, sand);
  double impulse = 0, liquid = 0;
  while (sim.time() < 0.2) {
    const StepReport report = sim.step();
    CHECK(report.solve.status == SolveStatus::converged);
    if (sim.time() < 0.1)
      continue;
    const double deep = depth * length / (length - speed * sim.time());
    impulse -= sim.obstacle_wrench(0).force[0] * report.time_step;
    liquid += density * g * deep * deep / 2 * report.time_step;
  }
  return impulse / liquid;
}

} // namespace

TEST_CASE("a sliding slab: friction force over normal force is the wall's coefficient") {
  CHECK(sliding_friction<2>(0.3, true) == support::about(0.3, 0.01));
  CHECK(sliding_friction<3>(0.3, true) == support::about(0.3, 0.01));
  CHECK(sliding_friction<2>(0.3, false) == support::about(0.3, 0.01));
  CHECK(sliding_friction<3>(0.3, false) == support::about(0.3, 0.01));
}

TEST_CASE("faces and obstacles feel the weight at rest, and hydrostatic pressure from the side") {
  // sticking floor, slipping sides: their forces are the momentum that they keep the nodes from
  auto params = scenes::box<2>({0.2, 0, 0.3}, {10, 1, 15}, 0, 0);
  scenes::Sim<2> liquid(params, scenes::block<2>(params.grid, 0, 0.2, 0, 0.2));
  while (liquid.time() < 0.1)
    CHECK(liquid.step().solve.status == SolveStatus::converged);
  const double pressure = 1500 * 9.81 * 0.2; // at the bottom, Pa
  CHECK(liquid.face_wrench(1, false).force[1] == support::about(-pressure * 0.2, 1e-3));
  CHECK(liquid.face_wrench(0, true).force[0] == support::about(pressure * 0.2 / 2, 0.03));
  CHECK(liquid.face_wrench(0, false).force[0] == support::about(-pressure * 0.2 / 2, 0.03));
  // the pressure's centre is at a third of the height
  const auto& side = liquid.face_wrench(0, true);
  CHECK(std::abs(side.torque_about({0.2, 0.2 / 3})[0]) < 0.03 * 0.2 * pressure * 0.2);
  CHECK(side.torque[0] == support::about(-side.force[0] * 0.2 / 3, 0.1));
}

// Rankine's earth pressures. Material that keeps its volume yields on planes where tau = mu sigma
// (K_p = tan²(45° + atan(mu)/2)) or everywhere (K_p = (1 + mu)/(1 − mu)); K_a = 1/K_p. These are
// 1.488 and 1.5 for mu = 0.2.
TEST_CASE("a smooth wall that is pushed into sand or gives way bears Rankine's pressures") {
  for (const int cells : {5, 10}) {
    CAPTURE(cells);
    CHECK(earth_pressure(0.2, 0.01, cells) == support::about(1.494, 0.03));
    CHECK(earth_pressure(0.2, -0.01, cells) == support::about(1 / 1.494, 0.03));
  }
}

namespace {

/// Friction over normal force of a slab that slides along a channel on a floor which is as wide as
/// the box, or `beyond` (m) wider on either side.
double friction_in_a_channel(double beyond) {
  auto params = scenes::box<3>({0.8, 0.08, 0.12}, {40, 4, 6}, 30, 0.8);
  add_obstacle<3>(params, shapes::Box<3>(Vec<3>(-1, -beyond, -1), Vec<3>(2, 0.08 + beyond, 0.04)),
                  0.3);
  scenes::Sim<3> sim(params, scenes::block<3>(params.grid, 0.1, 0.3, 0.04, 0.08));
  Vec<3> force = Vec<3>::Zero();
  while (sim.time() < 0.1) {
    CHECK(sim.step().solve.status == SolveStatus::converged);
    if (sim.time() > 0.02)
      force += sim.obstacle_wrench(0).force;
  }
  return force[0] / -force[2];
}

} // namespace

TEST_CASE("what ends at faces of the box holds as what goes on beyond them") {
  CHECK(friction_in_a_channel(1) == support::about(0.3, 0.01));
  CHECK(friction_in_a_channel(0) == support::about(0.3, 0.01));
  constexpr double h = 0.02;
  for (const double floor : {2 * h, 2.4 * h}) { // on a row of nodes and between two
    CAPTURE(floor);
    auto params = scenes::box<2>({20 * h, 0, 15 * h}, {20, 1, 15}, 0, 0);
    params.packing.even = true;
    add_obstacle<2>(params, shapes::Box<2>(Vec<2>::Zero(), Vec<2>(20 * h, floor)), 0.2);
    scenes::Sim<2> liquid(params, scenes::block<2>(params.grid, 0, 20 * h, floor, floor + 10 * h));
    double impulse = 0, start = 0;
    while (liquid.time() < 0.2) {
      REQUIRE(liquid.step().completed());
      if (liquid.time() < 0.1)
        start = liquid.time();
      else
        impulse -= liquid.obstacle_wrench(0).force[1] * liquid.time_step();
    }
    CHECK(impulse / (liquid.time() - start) == support::about(weight(liquid), 0.01));
    for (const auto& x : liquid.particles().position)
      CHECK(x[1] > floor - 0.1 * h);
  }
}

TEST_CASE("a block on the floor is pushed sideways alone by what it stands in") {
  constexpr double h = 0.02;
  for (const double place : {10 * h, 10.4 * h}) {
    auto params = scenes::box<2>({20 * h, 0, 15 * h}, {20, 1, 15}, 0, 0);
    params.faces.lower[1].kind = FaceKind::free_slip;
    params.bodies = {block_body<2>(Vec<2>(place, 2 * h), Vec<2>(6 * h, 4 * h), 5000, 0)};
    const shapes::Box<2> block(Vec<2>(place - 3 * h, 0), Vec<2>(place + 3 * h, 4 * h));
    scenes::Sim<2> sim(params, sand_where<2>(params.grid, [&](const Vec<2>& x) {
                         return x[1] < 10 * h && block.distance(x) > 0;
                       }));
    REQUIRE(sim.step().completed());
    int on_floor = 0;
    for (const auto& contact : sim.problem().body_contacts)
      if (contact.node >= 0 && sim.grid().node_index(contact.node)[1] == 0) {
        ++on_floor;
        CHECK(std::abs(contact.normal[1]) < 1e-3);
      }
    CHECK(on_floor >= 2);
  }
}

TEST_CASE("a thin inclined plate holds sand, wherever it lies between nodes") {
  for (const double thickness : {0.0, 0.01, 0.1})
    for (const double shift : {0.0, 0.007, 0.013}) {
      auto params = scenes::box<2>({0.3, 0, 0.3}, {15, 1, 15}, 0, 0.6);
      params.faces.lower[1].kind = FaceKind::open;
      const Vec<2> normal = turned(20, {0, 1}), on_top(0.15, 0.11 + shift);
      const shapes::HalfSpace<2> top(on_top, normal);
      add_obstacle<2>(params,
                      shapes::Intersection(
                          top, shapes::HalfSpace<2>(on_top - thickness * normal, Vec<2>(-normal))),
                      0.5);
      // what is thinner than two cells counts as two cells thick
      const double cell = 0.02 * normal.cwiseAbs().sum();
      const double surface = std::max(0.0, cell - thickness / 2);
      scenes::Sim<2> sim(params, sand_where<2>(params.grid, [&](const Vec<2>& x) {
                           return top.distance(x) > surface && top.distance(x) < surface + 0.06;
                         }));
      const auto start = centre_of_mass(sim.particles());
      while (sim.time() < 0.3) {
        const StepReport report = sim.step();
        CHECK(report.completed());
        CHECK(report.outflow == 0);
      }
      double lowest = 1;
      for (const auto& x : sim.particles().position)
        lowest = std::min(lowest, top.distance(x));
      INFO("thickness ", thickness, ", shift ", shift);
      CHECK(lowest > surface - 0.25 * cell);
      CHECK((centre_of_mass(sim.particles()) - start).norm() < 0.1 * cell);
      CHECK(sim.obstacle_wrench(0).force[1] == support::about(-weight(sim), 0.02));
      CHECK(sim.volume_fraction({7, 8}) > 0.8);
    }
}

TEST_CASE("a heavy ball falls freely and keeps turning") {
  auto params = scenes::box<3>({0.4, 0.4, 1}, {10, 10, 25}, 0, 0.44);
  auto ball = ball_body<3>(Vec<3>(0.2, 0.2, 0.8), 0.09, 8000, 0.3);
  ball.start.velocity = Vec<3>(0.1, 0, 0.3);
  ball.start.angular_velocity = Vec<3>(1, 2, 3);
  params.bodies.push_back(ball);
  scenes::Sim<3> sim(params, scenes::block<3>(params.grid, 0, 0.08, 0, 0.04));
  constexpr int steps = 200;
  for (int n = 0; n < steps; ++n)
    CHECK(sim.step().completed());
  const double t = steps * params.time_step;
  const RigidState<3>& now = sim.bodies()[0];
  CHECK((now.velocity - ball.start.velocity - t * params.gravity).norm() < 1e-12);
  CHECK((now.position - ball.start.position - t * ball.start.velocity -
         t * (t + params.time_step) / 2 * params.gravity)
            .norm() < 1e-12);
  CHECK((now.angular_velocity - ball.start.angular_velocity).norm() < 1e-12);
  CHECK((now.rotation - rotation_by<3>(Spin<3>(t * ball.start.angular_velocity))).norm() < 1e-12);
  CHECK(sim.body_wrench(0).force.norm() == 0);
}

TEST_CASE("a free top keeps its angular momentum and its energy, about all axes of inertia") {
  auto params = scenes::box<3>({1, 1, 1}, {10, 10, 10}, 0, 0.44);
  params.gravity.setZero();
  auto block = block_body<3>(Vec<3>(0.5, 0.5, 0.6), Vec<3>(0.3, 0.45, 0.6), 1000, 0.3);
  block.start.angular_velocity = Vec<3>(1, 20, 1); // about the middle axis: unstable, it tumbles
  params.bodies.push_back(block);
  scenes::Sim<3> sim(params, scenes::block<3>(params.grid, 0, 0.1, 0, 0.1));
  const auto momentum = [&] {
    const RigidState<3>& s = sim.bodies()[0];
    return Vec<3>(s.rotation * block.inertia * s.rotation.transpose() * s.angular_velocity);
  };
  const auto energy = [&] { return momentum().dot(sim.bodies()[0].angular_velocity) / 2; };
  const Vec<3> before = momentum();
  const double energy_before = energy();
  double least = 1, error = 0;
  for (int n = 0; n < 1000; ++n) {
    CHECK(sim.step().completed());
    least = std::min(least, sim.bodies()[0].rotation(1, 1));
    error = std::max(error, std::abs(energy() / energy_before - 1));
  }
  CHECK(least < 0); // it has turned over
  CHECK(error < 1e-4);
  CHECK((momentum() - before).norm() < 1e-11 * before.norm());
  CHECK((sim.bodies()[0].rotation * sim.bodies()[0].rotation.transpose() - Mat<3>::Identity())
            .norm() < 1e-13);
}

namespace {

/// A ball hits a blob of sand in empty space: linear and angular momentum of both together.
template <int Dim>
void momentum_is_kept() {
  auto params = scenes::box<Dim>({1, 0.6, 0.6}, {25, 15, 15}, 0, 0.44);
  params.gravity.setZero();
  Vec<Dim> centre = Vec<Dim>::Constant(0.3), lower = Vec<Dim>::Constant(0.2),
           upper = Vec<Dim>::Constant(0.4);
  auto ball = ball_body<Dim>(centre, 0.09, 3000, 0.4);
  ball.start.velocity[0] = 2;
  ball.start.velocity[1] = 0.3;
  ball.start.angular_velocity[0] = 4;
  params.bodies.push_back(ball);
  lower[0] = 0.42;
  upper[0] = 0.6;
  Particles<Dim> blob;
  fill_box(blob, Grid<Dim>(params.grid), lower, upper, {.per_axis = 2});
  scenes::Sim<Dim> sim(params, blob);
  const auto momentum = [&] {
    Vec<Dim> sum = ball.mass * sim.bodies()[0].velocity;
    for (std::size_t p = 0; p < sim.particles().size(); ++p)
      sum += 1500 * sim.particles().volume[p] * sim.particles().velocity[p];
    return sum;
  };
  const Vec<Dim> before = momentum();
  double most = 0;
  for (int n = 0; n < 60; ++n) {
    CHECK(sim.step().solve.status == SolveStatus::converged);
    CHECK((momentum() - before).norm() < 1e-12 * before.norm());
    most = std::max(most, sim.body_wrench(0).force.norm());
  }
  CHECK(most > 0);
  CHECK(sim.bodies()[0].velocity[0] < 1.9);
}

template <int Dim>
std::string checksum_of_impact(int threads) {
  auto sim = impact<Dim>(threads);
  for (int n = 0; n < 40; ++n)
    CHECK(sim.step().completed());
  CHECK(sim.problem().body_contacts.size() > 2);
  const RigidState<Dim>& ball = sim.bodies()[0];
  std::string text = state_checksum(sim.particles());
  for (int a = 0; a < Dim; ++a)
    text += " " + std::to_string(std::bit_cast<std::uint64_t>(ball.velocity[a])) + " " +
            std::to_string(std::bit_cast<std::uint64_t>(ball.position[a]));
  return text;
}

} // namespace

TEST_CASE("a body and what it hits keep their momentum") {
  momentum_is_kept<2>();
  momentum_is_kept<3>();
}

TEST_CASE("free bodies: the same bits for any number of threads") {
  CHECK(checksum_of_impact<2>(1) == checksum_of_impact<2>(3));
  CHECK(checksum_of_impact<3>(1) == checksum_of_impact<3>(3));
}

namespace {

/// A block with a speed on a frictional face, diagonal to the grid in 3-D, until it rests.
template <int Dim>
void free_block_slides() {
  constexpr int up = up_axis<Dim>;
  constexpr double mu = 0.3, speed = 1.5;
  auto params = scenes::box<Dim>({1.2, 1.2, 0.4}, {30, 30, 10}, 0, 0.44);
  params.faces.lower[up] = {FaceKind::frictional, mu};
  Vec<Dim> centre = Vec<Dim>::Constant(0.3), size = Vec<Dim>::Constant(0.3),
           direction = Vec<Dim>::Ones();
  size[up] = 0.1;
  centre[up] = 0.05;
  direction[up] = 0;
  direction.normalize();
  auto block = block_body<Dim>(centre, size, 2000, 0.5);
  block.start.velocity = speed * direction;
  params.bodies.push_back(block);
  params.solver.tolerance = 1e-10;
  Particles<Dim> sand; // out of the way
  Vec<Dim> lower = Vec<Dim>::Constant(1.12), upper = Vec<Dim>::Constant(1.2);
  lower[up] = 0;
  upper[up] = 0.04;
  fill_box(sand, Grid<Dim>(params.grid), lower, upper, {.per_axis = 2});
  scenes::Sim<Dim> sim(params, sand);
  while (sim.time() < 0.7) {
    CHECK(sim.step().completed());
    if (sim.time() < 0.4) {
      const Vec<Dim> force = sim.body_wrench(0).force;
      CHECK(force[up] == support::about(block.mass * 9.81, 1e-6));
      CHECK((force - force[up] * (Vec<Dim>::Unit(up) - mu * direction)).norm() < 1e-6 * force[up]);
    }
  }
  const RigidState<Dim>& now = sim.bodies()[0];
  CHECK(now.velocity.norm() < 1e-6);
  CHECK((now.position - centre).dot(direction) ==
        support::about(speed * speed / (2 * mu * 9.81), 5e-3)); // a step's length
  CHECK(now.position[up] == support::about(0.05, 1e-6));
}

} // namespace

TEST_CASE("a free block slides on a face as on Coulomb's plane") {
  free_block_slides<2>();
  free_block_slides<3>();
}

namespace {

/// A closed drum, half full, turns once; nothing may get out.
template <int Dim>
void drum_is_tight() {
  auto params = scenes::box<Dim>({0.3, 0.08, 0.3}, {20, 4, 20}, 0, 0.5);
  params.faces = Faces<Dim>::all({FaceKind::free_slip});
  const Vec<2> centre(0.15, 0.15);
  RigidState<Dim> start;
  start.position[0] = start.position[up_axis<Dim>] = 0.15;
  start.angular_velocity[Dim == 2 ? 0 : 1] =
      (Dim == 2 ? 2 : -2) * std::numbers::pi; // the same sense
  const double radius = 0.12;
  if constexpr (Dim == 2)
    add_obstacle<2>(params, shapes::Complement(shapes::Ball<2>(Vec<2>::Zero(), radius)), 0.6,
                    steady_motion<2>(start));
  else
    add_obstacle<3>(params, shapes::Complement(shapes::Cylinder({0, -1, 0}, {0, 1, 0}, radius)),
                    0.6, steady_motion<3>(start));
  const auto from_axis = [&](const Vec<Dim>& x) {
    return std::hypot(x[0] - 0.15, x[up_axis<Dim>] - 0.15);
  };
  scenes::Sim<Dim> sim(params, sand_where<Dim>(params.grid, [&](const Vec<Dim>& x) {
                         return from_axis(x) < radius && x[up_axis<Dim>] < 0.15;
                       }));
  while (sim.time() < (Dim == 2 ? 0.5 : 0.15)) {
    CHECK(sim.step().completed());
    for (const auto& x : sim.particles().position)
      CHECK(from_axis(x) < radius + 0.5 * 0.015);
  }
  CHECK(centre_of_mass(sim.particles())[0] > 0.16); // carried up on the right
}

} // namespace

TEST_CASE("a rotating closed drum keeps its sand") {
  drum_is_tight<2>();
  drum_is_tight<3>();
}

} // namespace test_bodies
