// SPDX-License-Identifier: MIT
// States that a run can reach: empty, emptied, failed, broken off by an exception of user code,
// left by its bodies. Each can be saved, restored, gone on from and measured; what is refused
// changes nothing.

#include "talus/boundary/body.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/particle_fields.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/io/vtk.hpp"
#include "talus/rheology/friction_law.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace test_states {

using namespace talus;
using support::about, support::contains, support::Folder, support::message_of;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class Law = ConstantFriction, class Transfer = Apic>
using Sim = Simulation<2, Law, Transfer, GaussSeidel<>>;

/// An open box of 20 × 10 cells.
template <class AnySim = Sim<>>
typename AnySim::Params box() {
  typename AnySim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {20, 10}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 2e-3;
  if constexpr (requires { params.rheology.mu; })
    params.rheology.mu = 0.44;
  params.faces = Faces<2>::all({FaceKind::free_slip});
  params.faces.lower[1] = {FaceKind::no_slip};
  params.faces.upper[1] = {FaceKind::open};
  return params;
}

Particles<2> column(const GridParams<2>& grid) {
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(grid), {0, 0}, {0.1, 0.12}, {.per_axis = 2});
  return sand;
}

template <class AnySim>
void advance(AnySim& sim, int steps) {
  for (int n = 0; n < steps; ++n)
    REQUIRE(sim.step().completed());
}

/// Of the particles in the order of their ids.
std::string sorted_checksum(const Particles<2>& particles) {
  Particles<2> sorted = particles;
  std::vector<std::size_t> order(particles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return particles.id[a] < particles.id[b]; });
  for (std::size_t p = 0; p < order.size(); ++p)
    sorted.copy(p, particles, order[p]);
  return state_checksum(sorted);
}

/// All that a simulation tells of itself.
template <class AnySim>
std::vector<double> all_of(const AnySim& sim) {
  std::vector<double> all{sim.time(), static_cast<double>(sim.steps()), sim.time_step(),
                          sim.gravity()[1]};
  const auto add = [&](const auto& vector) {
    for (Eigen::Index k = 0; k < vector.size(); ++k)
      all.push_back(vector.data()[k]);
  };
  for (int i = 0; i <= sim.grid().cells(0); ++i)
    for (int j = 0; j <= sim.grid().cells(1); ++j) {
      const Index<2> node{i, j};
      all.push_back(sim.volume_fraction(node));
      all.push_back(sim.inertial_number(node));
      add(sim.velocity(node));
      add(sim.stress(node));
    }
  for (int a = 0; a < 2; ++a)
    for (const bool upper : {false, true})
      add(sim.face_wrench(a, upper).force);
  for (std::size_t o = 0; o < sim.params().obstacles.size(); ++o)
    add(sim.obstacle_wrench(o).force);
  const auto& state = sim.state();
  for (const auto& stress : state.stress_impulse)
    add(stress);
  for (const auto& contact : state.contacts)
    add(contact.impulse);
  for (const auto& contact : state.body_contacts)
    add(contact.impulse);
  for (const auto& body : state.bodies) {
    add(body.position);
    add(body.rotation);
    add(body.velocity);
    add(body.angular_velocity);
  }
  return all;
}

/// What a user's function does.
enum class Mood { fine, throws, not_a_number };
Mood mood = Mood::fine;

double moody(double value) {
  if (mood == Mood::throws)
    throw std::runtime_error("no value there");
  return mood == Mood::fine ? value : nan;
}

struct MoodyLaw {
  double operator()(double) const { return moody(0.44); }
};
using Moody = FrictionLaw<MoodyLaw>;

class MoodyWall final : public Obstacle<2> {
 public:
  enum class Part { normal, velocity, friction, share };
  explicit MoodyWall(Part part) : part_(part) {}

  std::optional<ObstacleContact<2>> contact(const Vec<2>& x, const Vec<2>&, double) const override {
    if (x[0] < 0.09)
      return std::nullopt;
    ObstacleContact<2> contact{{-1, 0}, {0, 0}, 0.3};
    if (part_ == Part::normal)
      contact.normal[0] = -moody(1);
    if (part_ == Part::velocity)
      contact.velocity[1] = moody(0);
    if (part_ == Part::friction)
      contact.friction = moody(0.3);
    return contact;
  }
  double open_fraction(const Vec<2>& x, const Vec<2>&, double) const override {
    if (x[0] < 0.05)
      return 1;
    // from several threads; the lowest node must be heard
    if (part_ == Part::share && mood == Mood::throws)
      throw std::runtime_error("no share at x = " + std::to_string(x[0]) + ", " +
                               std::to_string(x[1]));
    return part_ == Part::share ? moody(1) : 1;
  }

 private:
  Part part_;
};

struct MoodyBall {
  double distance(const Vec<2>& x) const { return moody(x.norm() - 0.03); }
};

/// A scene in which `mood` rules one function.
Sim<Moody>::Params moody_box(const std::string& which, int threads) {
  auto params = box<Sim<Moody>>();
  params.threads = threads;
  params.cfl = 0.02; // so that δt changes
  params.rheology.inertial = {.grain_diameter = 1e-3, .density = 1500, .strain_factor = 1};
  params.faces.lower[0] = {FaceKind::frictional, 0.2};
  using Part = MoodyWall::Part;
  const auto wall = [&](Part part) { params.obstacles = {std::make_shared<MoodyWall>(part)}; };
  if (which == "normal")
    wall(Part::normal);
  if (which == "velocity")
    wall(Part::velocity);
  if (which == "friction")
    wall(Part::friction);
  if (which == "share")
    wall(Part::share);
  if (which == "shape")
    params.obstacles = {make_obstacle<ShapeObstacle<2>>(
        {.shape = shapes::translated<2>(MoodyBall{}, {0.15, 0.03}), .friction = 0.3})};
  if (which == "motion")
    params.obstacles = {make_obstacle<ShapeObstacle<2>>(
        {.shape = shapes::Ball<2>({0.15, 0.03}, 0.03), .friction = 0.3, .motion = [](double) {
           RigidState<2> state;
           state.velocity[0] = moody(0);
           return state;
         }})};
  if (which == "body") {
    auto body = ball_body<2>({0.15, 0.04}, 0.03, 2600, 0.3);
    body.shape = MoodyBall{};
    params.bodies = {body};
  }
  return params;
}

const std::vector<std::string> functions{"law",   "normal", "velocity", "friction",
                                         "share", "shape",  "motion",   "body"};

} // namespace

TEST_CASE("an id is given once, however particles come and go") {
  Particles<2> s;
  for (int i = 0; i < 3; ++i)
    s.add({0.1 * i, 0.1}, {0, 0}, 1e-4);
  for (std::size_t i = 1; i < 3; ++i)
    s.copy(i - 1, s, i);
  s.resize(2); // the first is gone, as in an outflow
  s.add({0, 0.1}, {0, 0}, 1e-4);
  CHECK(s.id == std::vector<std::size_t>{1, 2, 3});
  s.resize(2);
  s.resize(4);
  CHECK(s.id == std::vector<std::size_t>{1, 2, 4, 5});
  s.volume.assign(4, 1e-4);

  const auto params = box();
  const auto refused = [&](const Particles<2>& bad) {
    return message_of<std::invalid_argument>([&] { Sim<>(params, bad); });
  };
  CHECK(refused(s) == "(nothing thrown)");
  Particles<2> twice = s;
  twice.id[3] = twice.id[1];
  CHECK(contains(refused(twice), "the id of two particles is 2"));
  s.next_id = 5;
  CHECK(contains(refused(s), "particles.next_id is 5"));
}

TEST_CASE("the ids of what has left are not given again after a checkpoint") {
  const Folder folder;
  auto params = box();
  params.faces.upper[0] = {FaceKind::open};
  Particles<2> sand = column(params.grid);
  const std::size_t first = sand.size();
  sand.add({0.399, 0.1}, {2, 0}, 1e-5); // the newest leaves at once
  Sim<> run(params, sand), other(params, sand);
  CHECK(run.step().outflow == 1);
  write_checkpoint(folder / "a.talus", run);
  read_checkpoint(folder / "a.talus", other);
  auto state = other.state();
  state.particles.add({0.3, 0.1}, {0, 0}, 1e-5);
  CHECK(state.particles.id.back() == first + 1);
  other.restore(state);
  advance(other, 1);
}

TEST_CASE("a box may start empty, be filled, run dry and be filled again") {
  const Folder folder;
  auto params = box();
  params.faces.lower[1] = {FaceKind::open}; // no floor
  params.cfl = 0.5;
  for (const bool with_body : {false, true}) {
    CAPTURE(with_body);
    params.bodies.clear();
    if (with_body)
      params.bodies = {ball_body<2>({0.3, 0.1}, 0.03, 2600, 0.3)};
    Sim<> sim(params, {});
    const auto save_and_go_on = [&] {
      Sim<> other(params, {});
      write_checkpoint(folder / "a.talus", sim);
      read_checkpoint(folder / "a.talus", other);
      advance(sim, 2);
      advance(other, 2);
      CHECK(sorted_checksum(sim.particles()) == sorted_checksum(other.particles()));
      CHECK(all_of(sim) == all_of(other));
      const auto profile = measure_profile(sim);
      CHECK(std::isfinite(front_position(profile, 0.01)));
      CHECK(std::isfinite(largest_speed(sim)));
      write_vtk_particles<2>(folder / "a.vtp", sim.particles().position,
                             {vtk_field("pressure", at_particles(sim, [&](const auto& n) {
                                          return sim.pressure(n);
                                        }))});
    };
    const StepReport first = sim.step();
    CHECK(first.solve.status == SolveStatus::converged);
    CHECK(first.cones == 0);
    CHECK(sim.time() == 2e-3);
    save_and_go_on();

    for (int round = 0; round < 2; ++round) {
      auto state = sim.state();
      fill_box(state.particles, sim.grid(), {0, 0}, {0.1, 0.12}, {.per_axis = 2});
      state.particles.add({0.2, 0.19}, {0, 0}, 1e-5); // the last to leave
      const std::size_t filled = state.particles.size();
      sim.restore(state);
      save_and_go_on();
      std::size_t out = 0;
      while (sim.particles().size() > 1)
        out += sim.step().outflow;
      save_and_go_on(); // one left
      while (!sim.particles().empty())
        out += sim.step().outflow;
      CHECK(out == filled);
      CHECK(state.particles.next_id == filled * static_cast<std::size_t>(round + 1));
      save_and_go_on();
    }
  }
}

TEST_CASE("material may be taken out, all of it") {
  Sim<> sim(box(), column(box().grid));
  advance(sim, 5);
  auto state = sim.state();
  state.particles.resize(0);
  sim.restore(state);
  CHECK(sim.step().solve.status == SolveStatus::converged);
  for (const auto& stress : sim.state().stress_impulse)
    CHECK(stress.norm() == 0);
}

TEST_CASE(
    "a body that has left neither rules the time step nor stands on anything, and is reported "
    "once") {
  const Folder folder;
  for (const bool corners : {true, false}) {
    CAPTURE(corners);
    auto params = box();
    params.cfl = 0.5;
    params.faces.upper[0] = {FaceKind::open};
    params.bodies = {ball_body<2>({0.3, 0.1}, 0.03, 2600, 0.4)};
    params.bodies[0].start.velocity = {3, 1};
    if (!corners)
      params.bodies[0].corners.clear();
    Sim<> sim(params, column(params.grid));
    std::size_t left = 0, at = 0;
    for (int n = 0; n < 400; ++n) {
      const StepReport report = sim.step();
      REQUIRE(report.completed());
      CHECK(report.time_step == sim.time_step());
      left += report.bodies_left;
      if (report.bodies_left > 0)
        at = sim.steps();
    }
    CHECK(left == 1);
    CHECK(at > 5);
    const RigidState<2> body = sim.bodies()[0];
    CHECK(body.position[1] < -1); // no floor out there
    CHECK(sim.time_step() == 2e-3);
    CHECK(sim.body_wrench(0).force.norm() == 0);
    Sim<> other(params, column(params.grid));
    write_checkpoint(folder / "a.talus", sim);
    read_checkpoint(folder / "a.talus", other);
    advance(sim, 3);
    advance(other, 3);
    CHECK(all_of(sim) == all_of(other));
  }
  // What has no bodies in it any more is the same as if there never were one.
  auto params = box();
  Sim<> without(params, column(params.grid));
  params.bodies = {ball_body<2>({0.35, 0.5}, 0.03, 2600, 0.4)}; // above, and on its way out
  params.bodies[0].start.velocity = {300, 0};
  params.faces.upper[0] = {FaceKind::open};
  Sim<> with(params, column(params.grid));
  CHECK(with.step().bodies_left == 1);
  advance(without, 1);
}

TEST_CASE("a body that crosses cells in a step does not pass a face that is not free") {
  for (const double speed : {1.0, 30.0, 1000.0})
    for (const int axis : {0, 1}) {
      CAPTURE(speed);
      CAPTURE(axis);
      auto params = box();
      params.bodies = {ball_body<2>({0.2, 0.15}, 0.03, 2600, 0.4)};
      params.bodies[0].start.velocity[axis] = -speed;
      Sim<> sim(params, {});
      for (int n = 0; n < 200; ++n) {
        CHECK(sim.step().bodies_left == 0);
        // to the solver's tolerance, of the way that it would have gone
        CHECK(sim.bodies()[0].position[axis] > 0.03 - 5e-5 * speed * 2e-3 - 1e-7);
      }
    }
}

TEST_CASE("a body that comes back into the box is not missed") {
  auto params = box();
  params.cfl = 0.2;
  params.time_step = 0.5;
  params.gravity.setZero();
  params.bodies = {ball_body<2>({0.2, 4}, 0.03, 2600, 0.4)}; // far above, downwards
  params.bodies[0].start.velocity = {0, -2};
  Sim<> sim(params, column(params.grid));
  double deepest = 4;
  for (int n = 0; n < 30; ++n) {
    advance(sim, 1);
    const double y = sim.bodies()[0].position[1];
    if (deepest > 0.23) // it enters by that share of a cell at most
      CHECK(y > 0.23 - 0.2 * 0.02 - 1e-9);
    deepest = std::min(deepest, y);
  }
  CHECK(deepest < 0.2);
  CHECK(sim.time() < 2.1);
}

TEST_CASE("what user code throws arrives, from the lowest node, and the run goes on as if nothing "
          "had been") {
  for (const std::string& which : functions) {
    CAPTURE(which);
    std::string first_message;
    for (const int threads : {1, 3}) {
      CAPTURE(threads);
      const auto params = moody_box(which, threads);
      mood = Mood::fine;
      Sim<Moody> sim(params, column(params.grid)), twin(params, column(params.grid));
      advance(sim, 20);
      advance(twin, 20);
      const std::vector<double> before = all_of(sim);
      const std::string particles = sorted_checksum(sim.particles());
      mood = Mood::throws;
      const std::string message = message_of<std::runtime_error>([&] { (void)sim.step(); });
      mood = Mood::fine;
      CHECK(contains(message, "no "));
      if (threads == 1)
        first_message = message;
      CHECK(message == first_message);
      CHECK(all_of(sim) == before);
      CHECK(sorted_checksum(sim.particles()) == particles);
      advance(sim, 10);
      advance(twin, 10);
      CHECK(state_checksum(sim.particles()) == state_checksum(twin.particles()));
      CHECK(all_of(sim) == all_of(twin));
    }
  }
}

TEST_CASE("what is called before the solve may throw, too") {
  Sim<> sim(box(), column(box().grid)), twin(box(), column(box().grid));
  advance(sim, 3);
  const std::vector<double> before = all_of(sim);
  CHECK_THROWS_AS((void)sim.step([](const auto&) { throw std::runtime_error("stop"); }),
                  std::runtime_error);
  CHECK(all_of(sim) == before);
  advance(sim, 3);
  advance(twin, 6);
  CHECK(state_checksum(sim.particles()) == state_checksum(twin.particles()));
}

TEST_CASE(
    "NaN of a user's function is refused at once, by the function's name, and changes nothing") {
  const std::vector<std::string> words{"rheology.friction(I)",
                                       "m: |normal| is",
                                       "|velocity|",
                                       "m: friction is nan",
                                       "obstacle 0: open_fraction",
                                       "a shape's distance at x = (",
                                       "shape_obstacle.motion's velocity",
                                       "a shape's distance at x = ("};
  for (std::size_t k = 0; k < functions.size(); ++k) {
    CAPTURE(functions[k]);
    const auto params = moody_box(functions[k], 1);
    mood = Mood::fine;
    Sim<Moody> sim(params, column(params.grid)), twin(params, column(params.grid));
    advance(sim, 5);
    advance(twin, 10);
    const std::vector<double> before = all_of(sim);
    mood = Mood::not_a_number;
    std::string message;
    try {
      const StepReport report = sim.step();
      CHECK_FALSE(report.completed());
      message = report.why();
    } catch (const std::invalid_argument& error) {
      message = error.what();
    }
    mood = Mood::fine;
    CHECK(contains(message, words[k]));
    CHECK(all_of(sim) == before);
    advance(sim, 5);
    CHECK(state_checksum(sim.particles()) == state_checksum(twin.particles()));
  }
}

TEST_CASE("a failed run can be saved, measured and gone on with under another law") {
  const Folder folder;
  const auto params = moody_box("law", 1);
  mood = Mood::fine;
  Sim<Moody> sim(params, column(params.grid));
  advance(sim, 8);
  mood = Mood::not_a_number;
  const StepReport report = sim.step();
  mood = Mood::fine;
  CHECK(report.invalid_friction > 0);
  CHECK_FALSE(report.completed());
  CHECK(volume_under_surface(sim) > 0.01);
  write_checkpoint(folder / "a.talus", sim);
  Sim<Moody> same(params, column(params.grid));
  read_checkpoint(folder / "a.talus", same);
  advance(same, 5);
  advance(sim, 5);
  CHECK(state_checksum(sim.particles()) == state_checksum(same.particles()));

  auto plain = box();
  plain.cfl = params.cfl;
  plain.faces = params.faces;
  Sim<> other(plain, {});
  read_checkpoint(folder / "a.talus", other);
  advance(other, 5);
}

TEST_CASE("a solve that ran out of sweeps can be saved and gone on with") {
  const Folder folder;
  auto params = box();
  params.solver.max_sweeps = 2;
  Sim<> sim(params, column(params.grid)), other(params, {});
  CHECK(sim.step().solve.status == SolveStatus::not_converged);
  write_checkpoint(folder / "a.talus", sim);
  read_checkpoint(folder / "a.talus", other);
  advance(sim, 5);
  advance(other, 5);
  CHECK(state_checksum(sim.particles()) == state_checksum(other.particles()));
}

TEST_CASE("a time step so small that time stands still is refused, and the state can be saved") {
  const Folder folder;
  auto params = box();
  params.cfl = 0.5;
  Sim<> sim(params, column(params.grid));
  advance(sim, 2);
  auto state = sim.state();
  state.particles.velocity[0] = {1e18, 0};
  sim.restore(state);
  const double time = sim.time(), time_step = sim.time_step();
  const StepReport report = sim.step();
  CHECK_FALSE(report.completed());
  CHECK(contains(std::string(report.why()), "too small to change the time"));
  CHECK(sim.time() == time);
  CHECK(sim.time_step() == time_step);
  write_checkpoint(folder / "a.talus", sim);
  Sim<> other(params, {});
  read_checkpoint(folder / "a.talus", other);
  CHECK_FALSE(other.step().completed());
  state.particles.velocity[0].setZero();
  sim.restore(state);
  advance(sim, 2);
}

namespace {

/// A transfer that throws half way.
struct MoodyTransfer {
  struct Params {};
  static constexpr ParticleField field = ParticleField::constant;
  MoodyTransfer() = default;
  explicit MoodyTransfer(const Params&) {}
  template <int Dim>
  void update(const GridSample<Dim>& sample, VelocityField<Dim>& p) const {
    p.velocity = sample.velocity * moody(1);
  }
};

} // namespace

namespace {

/// A solver that may leave what is not a number and be content.
struct MoodySolver {
  using Params = GaussSeidel<>::Params;
  template <int Dim>
  using Workspace = GaussSeidel<>::Workspace<Dim>;
  explicit MoodySolver(const Params& params) : solver(params) {}
  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                    const Execution& execution) const {
    const SolveReport report = solver.solve(problem, workspace, execution);
    problem.velocity[static_cast<std::size_t>(problem.node.back())][0] *= moody(1);
    return report;
  }
  GaussSeidel<> solver;
};

} // namespace

TEST_CASE("velocities that are not finite are refused, whatever the solver says") {
  using Transformed = Simulation<2, ConstantFriction, Apic, MoodySolver>;
  mood = Mood::fine;
  Transformed sim(box<Transformed>(), column(box().grid));
  advance(sim, 3);
  const std::vector<double> before = all_of(sim);
  mood = Mood::not_a_number;
  CHECK_FALSE(sim.step().completed());
  mood = Mood::throws;
  CHECK_THROWS_AS((void)sim.step(), std::runtime_error);
  mood = Mood::fine;
  CHECK(all_of(sim) == before);
  advance(sim, 3);
}

TEST_CASE("an update of the particles that is broken off needs a restore") {
  using Torn = Sim<ConstantFriction, MoodyTransfer>;
  for (const int threads : {1, 3}) {
    auto params = box<Torn>();
    params.threads = threads;
    mood = Mood::fine;
    Torn sim(params, column(params.grid)), twin(params, column(params.grid));
    advance(sim, 3);
    advance(twin, 6);
    const auto state = sim.state();
    mood = Mood::throws;
    CHECK_THROWS_AS((void)sim.step(), std::runtime_error);
    mood = Mood::fine;
    for (int n = 0; n < 2; ++n)
      CHECK(contains(message_of<std::invalid_argument>([&] { (void)sim.step(); }),
                     "allowed: restore()"));
    CHECK_THROWS_AS((void)sim.state(), std::invalid_argument);
    sim.restore(state);
    advance(sim, 3);
    CHECK(state_checksum(sim.particles()) == state_checksum(twin.particles()));
  }
}

TEST_CASE(
    "fields and forces belong to the last step: none before the first, none after a restore") {
  const Folder folder;
  auto params = box();
  params.obstacles = {make_obstacle<Gate<2>>({.position = 0.1, .friction = 0.3})};
  params.bodies = {ball_body<2>({0.3, 0.1}, 0.03, 2600, 0.4)};
  Sim<> sim(params, column(params.grid));
  const auto all_refused = [](const Sim<>& s) {
    const Index<2> node{1, 1};
    const auto refused = [&](const char* name, const auto& get) {
      CHECK(contains(message_of<std::invalid_argument>(get), std::string(name) + "()"));
    };
    refused("volume_fraction", [&] { (void)s.volume_fraction(node); });
    refused("velocity", [&] { (void)s.velocity(node); });
    refused("stress", [&] { (void)s.stress(node); });
    refused("stress", [&] { (void)s.pressure(node); });
    refused("inertial_number", [&] { (void)s.inertial_number(node); });
    refused("face_wrench", [&] { (void)s.face_wrench(1, false); });
    refused("obstacle_wrench", [&] { (void)s.obstacle_wrench(0); });
    refused("body_wrench", [&] { (void)s.body_wrench(0); });
    refused("problem", [&] { (void)s.problem(); });
    refused("volume_fraction", [&] { (void)measure_profile(s); });
  };
  all_refused(sim);
  advance(sim, 5);
  write_checkpoint(folder / "a.talus", sim);
  Sim<> fresh(params, {}), used(params, column(params.grid));
  advance(used, 2);
  for (Sim<>* other : {&fresh, &used}) {
    read_checkpoint(folder / "a.talus", *other);
    all_refused(*other);
    CHECK(other->time() == sim.time());
    CHECK(other->time_step() == sim.time_step());
  }
  advance(sim, 1);
  for (Sim<>* other : {&fresh, &used}) {
    advance(*other, 1);
    CHECK(all_of(*other) == all_of(sim));
  }
}

TEST_CASE("the report tells the Courant number and how full the fullest node is") {
  auto params = box();
  params.gravity.setZero();
  Particles<2> sand = column(params.grid);
  for (auto& v : sand.velocity)
    v = {1, 0};
  params.faces.lower[1] = {FaceKind::free_slip};
  params.packing = {.slack = 0.02, .dilatancy = 0};
  Sim<> sim(params, sand);
  const StepReport report = sim.step();
  CHECK(report.courant == about(2e-3 / 0.02, 0.05));
  CHECK(report.largest_fraction > 0.95);
  CHECK(report.largest_fraction < 1.15);
  for (double& volume : sand.volume)
    volume *= 2;
  params.packing.densest = std::numeric_limits<double>::infinity();
  Sim<> full(params, sand);
  CHECK(full.step().largest_fraction > 1.9);
}

TEST_CASE("a scene with a place filled twice is refused with the place and how full it is") {
  auto params = box();
  params.grid = {.size = {0.4, 0.2}, .cells = {20, 10}};
  const Grid<2> grid(params.grid);
  const auto scene = [&](Seeding::Pattern pattern, double jitter) {
    Particles<2> sand;
    fill_box(sand, grid, Vec<2>(0, 0), Vec<2>(0.4, 0.1),
             {.per_axis = 3, .pattern = pattern, .jitter = jitter});
    return sand;
  };
  const auto refused = [&](const Particles<2>& sand) {
    return message_of<std::invalid_argument>([&] { const Sim<> sim(params, sand); });
  };
  for (const auto pattern : {Seeding::Pattern::jittered, Seeding::Pattern::random})
    for (const double jitter : {0.0, 1.0}) {
      Particles<2> sand = scene(pattern, jitter);
      CHECK(refused(sand) == "(nothing thrown)");
      Particles<2> more; // 4 by 3 cells, away from the faces
      fill_box(more, grid, Vec<2>(0.2, 0.02), Vec<2>(0.28, 0.08), {.per_axis = 3});
      for (const Vec<2>& x : more.position)
        sand.add(x, Vec<2>::Zero(), more.volume[0]);
      const std::string why = refused(sand);
      CAPTURE(why);
      CHECK(contains(why, "packing.densest"));
      CHECK(contains(why, "x = (0.2"));
      params.packing.densest = 3;
      CHECK(refused(sand) == "(nothing thrown)");
      params.packing.densest = 1.5;
    }
  params.packing.densest = 0;
  CHECK(contains(refused(scene(Seeding::Pattern::jittered, 0)), "packing.densest is 0"));
}

TEST_CASE("with cfl an obstacle does not jump into the material, and matters only in the box") {
  auto params = box(); // cells of 0.02 m
  params.time_step = 0.01;
  params.cfl = 0.25;
  params.gravity.setZero();
  RigidState<2> start;
  start.velocity = {20, 0}; // 10 cells in the longest step
  const auto plate = [&](double x) {
    start.position = {x, 0.1};
    return make_obstacle<ShapeObstacle<2>>({.shape = shapes::Box<2>({-0.03, -0.2}, {0.03, 0.2}),
                                            .friction = 0,
                                            .motion = steady_motion<2>(start)});
  };
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0.2, 0}, {0.3, 0.1}, {.per_axis = 2});
  params.obstacles = {plate(0.06)};
  Sim<> sim(params, sand);
  advance(sim, 1);
  CHECK(sim.time_step() == about(0.25 * 0.02 / 20));
  while (sim.time() < 9e-3) // the plate's front is at 0.27 m
    advance(sim, 1);
  std::size_t behind = 0;
  for (const Vec<2>& x : sim.particles().position)
    behind += x[0] < 0.03 + 20 * sim.time() ? 1 : 0;
  CHECK(behind == 0);
  params.obstacles = {plate(5)};
  Sim<> gone(params, sand);
  advance(gone, 1);
  CHECK(gone.time_step() == about(0.01));
}

TEST_CASE("with cfl an obstacle that starts within a step does not jump, either") {
  auto params = box(); // cells of 0.02 m
  params.time_step = 0.01;
  params.cfl = 0.25;
  params.gravity.setZero();
  const auto front = [](double time) { return 0.15 + 20 * std::max(0.0, time - 6e-3); };
  params.obstacles = {make_obstacle<ShapeObstacle<2>>(
      {.shape = shapes::Box<2>({-0.1, -0.2}, {0, 0.2}), .friction = 0, .motion = [&](double time) {
         RigidState<2> state;
         state.position = {front(time), 0.1};
         state.velocity = {time < 6e-3 ? 0.0 : 20.0, 0};
         return state;
       }})};
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0.2, 0}, {0.3, 0.1}, {.per_axis = 2});
  Sim<> sim(params, sand);
  while (sim.time() < 9e-3) {
    const double last = sim.time();
    advance(sim, 1);
    CHECK(front(sim.time()) - front(last) < 1.02 * 0.25 * 0.02);
  }
  for (const Vec<2>& x : sim.particles().position)
    CHECK(x[0] > front(sim.time()) - 0.02);
}

TEST_CASE("nodes, faces, obstacles, bodies and materials that are not there are refused by name") {
  const auto params = box();
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.2, 0.2}, {.per_axis = 2});
  Sim<> sim(params, sand);
  REQUIRE(sim.step().completed());
  const auto refused = [](const auto& call) {
    return message_of<std::invalid_argument>([&] { static_cast<void>(call()); });
  };
  CHECK(refused([&] { return sim.pressure({45, 1}); }) == "node.x is 45; allowed: 0 to 20");
  CHECK(refused([&] { return sim.volume_fraction({0, -2}); }) == "node.y is -2; allowed: 0 to 10");
  CHECK(sim.volume_fraction({1, 1}) > 0.9);
  CHECK(refused([&] { return sim.face_wrench(2, false); }) ==
        "face_wrench: axis is 2; allowed: 0 to 1");
  CHECK(refused([&] { return sim.obstacle_wrench(0); }) ==
        "obstacle_wrench: obstacle is 0; allowed: none: there is not one");
  CHECK(refused([&] { return sim.body_wrench(3); }) ==
        "body_wrench: body is 3; allowed: none: there is not one");
  CHECK(refused([&] { return sim.density(1); }) == "density: material is 1; allowed: 0 to 0");
  CHECK(refused([&] {
          return sim.material_fraction({1, 1}, -1);
        }) == "material_fraction: material is -1; allowed: 0 to 0");
}

} // namespace test_states
