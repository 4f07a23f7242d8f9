// SPDX-License-Identifier: MIT
// Checkpoints: a run goes on with the same bits, and nothing that is not one is taken for one.

#include "talus/boundary/body.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/collapse.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/collapse.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace test_checkpoint {

using namespace talus;
using support::contains, support::content, support::Folder, support::message_of;

namespace {

template <int Dim, class Law = ConstantFriction>
using Sim = Simulation<Dim, Law, PolyPic, GaussSeidel<>>;

template <int Dim>
Sim<Dim> collapse(int threads = 1, double time_step = 2e-3) {
  CollapseSetup setup = support::b15();
  setup.length = 0.5;
  auto params = support::collapse_params<Sim<Dim>>(setup, {0.02, 0.03, 0.01}, time_step);
  params.cfl = 0.05; // so that steps differ
  params.threads = threads;
  return Sim<Dim>(params, setup.particles<Dim>(Grid<Dim>(params.grid), {.per_axis = 2}));
}

template <class Simulation>
std::string checksum_after(Simulation& sim, int steps) {
  for (int n = 0; n < steps; ++n)
    CHECK(sim.step().completed());
  return state_checksum(sim.particles());
}

template <int Dim>
void goes_on_with_the_same_bits() {
  const Folder folder;
  auto run = collapse<Dim>();
  run.set_gravity(1.1 * run.gravity());
  checksum_after(run, 60); // past the gate's start, with particles out of order
  write_checkpoint(folder / "a.talus", run, "some notes\n");
  const std::string expected = checksum_after(run, 30);

  for (const int threads : {1, 3}) {
    auto restarted = collapse<Dim>(threads);
    CHECK(read_checkpoint(folder / "a.talus", restarted) == "some notes\n");
    CHECK(restarted.steps() == 60);
    CHECK(restarted.gravity() == run.gravity());
    write_checkpoint(folder / "b.talus", restarted, "some notes\n");
    CHECK(content(folder / "a.talus") == content(folder / "b.talus"));
    CHECK(checksum_after(restarted, 30) == expected);
    CHECK(restarted.time() == run.time());
  }
}

} // namespace

TEST_CASE("a run from a checkpoint goes on with the same bits") {
  goes_on_with_the_same_bits<2>();
  goes_on_with_the_same_bits<3>();
}

TEST_CASE("a run with a free body goes on with the same bits") {
  const auto make = [](double mass_factor) {
    Sim<3>::Params params;
    params.grid = {.origin = {0, 0, 0}, .size = {0.2, 0.2, 0.2}, .cells = {8, 8, 8}};
    params.material.density = 1500;
    params.gravity = {0, 0, -9.81};
    params.time_step = 1e-3;
    params.rheology.mu = 0.44;
    params.faces = Faces<3>::all({FaceKind::free_slip});
    auto ball = ball_body<3>({0.1, 0.1, 0.13}, 0.05, 3000, 0.3);
    ball.mass *= mass_factor;
    ball.start.velocity[2] = -1;
    ball.start.angular_velocity = {3, 2, 1};
    params.bodies.push_back(ball);
    Particles<3> sand;
    fill_box<3>(sand, Grid<3>(params.grid), {0, 0, 0}, {0.2, 0.2, 0.075}, {.per_axis = 2});
    return Sim<3>(params, sand);
  };
  const Folder folder;
  auto run = make(1), restarted = make(1), other = make(2);
  checksum_after(run, 10);
  CHECK(run.problem().body_contacts.size() > 0);
  write_checkpoint(folder / "a.talus", run);
  CHECK(read_checkpoint(folder / "a.talus", restarted).empty());
  CHECK(checksum_after(restarted, 10) == checksum_after(run, 10));
  CHECK(restarted.bodies()[0].position == run.bodies()[0].position);
  CHECK(restarted.bodies()[0].rotation == run.bodies()[0].rotation);
  CHECK(restarted.bodies()[0].velocity == run.bodies()[0].velocity);
  CHECK(restarted.bodies()[0].angular_velocity == run.bodies()[0].angular_velocity);
  CHECK(
      contains(message_of<std::runtime_error>([&] { read_checkpoint(folder / "a.talus", other); }),
               "its bodies.0.mass"));
}

TEST_CASE("a law that depends on the last step's strain rate goes on with the same bits") {
  const auto make = [] {
    CollapseSetup setup = support::b15();
    setup.length = 0.5;
    Sim<2, MuOfI>::Params params;
    params.grid = setup.grid<2>({0.02, 0.03, 0.01});
    params.material.density = 1470;
    params.gravity = setup.gravity_vector<2>();
    params.time_step = 2e-3;
    params.faces = setup.faces<2>();
    params.rheology = {.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279},
                       .inertial = {.grain_diameter = 5e-4, .density = 1470, .strain_factor = 1}};
    return Sim<2, MuOfI>(params, setup.particles<2>(Grid<2>(params.grid), {.per_axis = 2}));
  };
  const Folder folder;
  auto run = make(), restarted = make();
  checksum_after(run, 40);
  write_checkpoint(folder / "a.talus", run);
  CHECK(read_checkpoint(folder / "a.talus", restarted).empty());
  CHECK(checksum_after(restarted, 20) == checksum_after(run, 20));
}

TEST_CASE("what is no checkpoint, damaged, or of another configuration is refused") {
  const Folder folder;
  auto run = collapse<2>();
  checksum_after(run, 3);
  const auto file = folder / "a.talus";
  write_checkpoint(file, run, "notes");
  const std::string good = content(file), before = state_checksum(run.particles());
  const auto message = [&](auto& sim) {
    return message_of<std::runtime_error>([&] { read_checkpoint(file, sim); });
  };
  const auto message_of_content = [&](const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
    return message(run);
  };
  for (std::size_t at = 0; at < good.size(); at += 997) {
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x10);
    CHECK(contains(message_of_content(bytes), "cannot read"));
    CHECK(contains(message_of_content(good.substr(0, at)), "cannot read"));
  }
  CHECK(contains(message_of_content("nonsense"), "it is no checkpoint"));
  CHECK(contains(message_of_content(good + "x"), "damaged or truncated"));
  CHECK(contains(message_of_content(good.substr(0, good.size() - 1)), "damaged or truncated"));
  CHECK(contains(message_of<std::runtime_error>([&] { read_checkpoint(folder / "none", run); }),
                 "No such file"));
  CHECK(contains(message_of<std::runtime_error>([&] { read_checkpoint(folder.path, run); }),
                 "it is a folder"));
  CHECK(state_checksum(run.particles()) == before);
  CHECK(run.steps() == 3);

  std::ofstream(file, std::ios::binary) << good;
  auto other_step = collapse<2>(1, 1e-3);
  CHECK(contains(message(other_step), "its time_step is 0.002, this simulation's is 0.001"));
  auto packed = run.params();
  packed.packing.cohesion_slack = 0.25;
  auto other_packing = std::remove_cvref_t<decltype(run)>(packed, run.particles());
  CHECK(contains(message(other_packing),
                 "its packing.cohesion_slack is 0.05, this simulation's is 0.25"));
  auto other_dimension = collapse<3>();
  CHECK(contains(message(other_dimension), "its dimension is 2, this simulation's is 3"));
  CHECK_THROWS_AS(write_checkpoint(file, run, std::string((1 << 20) + 1, 'x')),
                  std::invalid_argument);
  CHECK_THROWS_AS(write_checkpoint(folder / "no/such/folder", run), std::runtime_error);
  CHECK(content(file) == good);
}

TEST_CASE("a state that does not fit is refused and changes nothing") {
  auto run = collapse<2>();
  checksum_after(run, 2);
  const auto state = [&]() -> SimulationState<2> { return run.state(); };
  run.restore(state());
  const auto refused = [&](const SimulationState<2>& bad) {
    return message_of<std::invalid_argument>([&] { run.restore(bad); });
  };
  auto bad = state();
  bad.particles.position[0][0] = -1;
  CHECK(contains(refused(bad), "a particle's coordinate is -1"));
  bad = state();
  bad.stress_impulse.pop_back();
  CHECK(contains(refused(bad), "the number of nodes of the state"));
  bad = state();
  bad.contacts.at(0).node = 1 << 29;
  CHECK(contains(refused(bad), "the node of a contact"));
  bad = state();
  bad.contacts.at(0).boundary_id = 99;
  CHECK(contains(refused(bad), "the boundary id of a contact"));
  bad = state();
  bad.contacts.at(0).impulse[1] = std::nan("");
  CHECK(contains(refused(bad), "the impulse of a contact"));
  bad = state();
  bad.stress_impulse.at(40)[0] = std::nan("");
  CHECK(contains(refused(bad), "a node's stress of the state"));
  bad = state();
  bad.time_step = 0;
  CHECK(contains(refused(bad), "state.time_step"));
  CHECK(run.steps() == 2);
}

TEST_CASE("a file of any patch of the same minor version is read, of no other") {
  const Folder folder;
  auto run = collapse<2>(), other = collapse<2>();
  checksum_after(run, 3);
  const auto file = folder / "a.talus";
  write_checkpoint(file, run);
  const std::string good = content(file), version = std::string("version ") + TALUS_VERSION;
  const auto with_version = [&](const std::string& wanted) {
    std::string bytes = good.substr(0, good.size() - 8);
    bytes.replace(bytes.find(version), version.size(), "version " + wanted);
    Fingerprint fingerprint;
    fingerprint.add(bytes);
    detail::ByteWriter sealed;
    sealed.text(bytes);
    sealed.raw(fingerprint.value());
    std::ofstream(file, std::ios::binary) << sealed.bytes();
    return message_of<std::runtime_error>([&] { read_checkpoint(file, other); });
  };
  const std::string minor = version.substr(8, version.find_last_of('.') - 8);
  CHECK(with_version(minor + ".7") == "(nothing thrown)");
  CHECK(state_checksum(other.particles()) == state_checksum(run.particles()));
  CHECK(contains(with_version(minor + "1.0"), "its version is " + minor + "1.0, this one's is"));
  CHECK(contains(with_version("9.0.0"), "its version is 9.0.0"));
  std::ofstream(file, std::ios::binary) << "talus-checkpoint 1\n";
  CHECK(contains(message_of<std::runtime_error>([&] { read_checkpoint(file, other); }),
                 "format of another version"));
}

namespace {

/// A box with one obstacle, after three steps.
Sim<2> with_obstacle(std::shared_ptr<const Obstacle<2>> obstacle) {
  Sim<2>::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {20, 10}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = Faces<2>::all({FaceKind::free_slip});
  params.obstacles = {std::move(obstacle)};
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.1, 0.12}, {.per_axis = 2});
  Sim<2> sim(params, sand);
  checksum_after(sim, 3);
  return sim;
}

std::string message_between(const std::shared_ptr<const Obstacle<2>>& theirs,
                            const std::shared_ptr<const Obstacle<2>>& ours) {
  const Folder folder;
  auto run = with_obstacle(theirs), other = with_obstacle(ours);
  write_checkpoint(folder / "a.talus", run);
  return message_of<std::runtime_error>([&] { read_checkpoint(folder / "a.talus", other); });
}

} // namespace

TEST_CASE("a run does not go on with another obstacle") {
  using Any = ShapeObstacle<2>;
  const auto ball = [](double friction, double radius = 0.05) {
    return make_obstacle<Any>(
        {.shape = shapes::Ball<2>({0.25, 0.05}, radius), .friction = friction});
  };
  const std::string fine = "(nothing thrown)";
  CHECK(message_between(ball(0.3), ball(0.3)) == fine);
  CHECK(message_between(ball(0.3), ball(0.3 + 1e-15)) == fine); // as another machine has it
  CHECK(contains(message_between(ball(0.3), make_obstacle<Any>(
                                                {.shape = shapes::HalfSpace<2>({0, 0.01}, {0, 1}),
                                                 .friction = 0.9})),
                 "its obstacle.0 is another than this simulation's: the shape or motion differ"));
  CHECK(contains(message_between(ball(0.3), ball(0.31)), "the friction differ"));
  CHECK(contains(message_between(ball(0.3), ball(0.3, 0.051)), "differ"));

  const auto turning = [](double rate) {
    RigidState<2> start;
    start.position = {0.25, 0.05};
    start.angular_velocity[0] = rate;
    return make_obstacle<Any>({.shape = shapes::Ball<2>({0, 0}, 0.05),
                               .friction = 0.3,
                               .motion = steady_motion<2>(start)});
  };
  CHECK(message_between(turning(2), turning(2)) == fine);
  CHECK(contains(message_between(turning(2), turning(2.1)), "the velocities differ"));

  const auto gate = [](double opening) {
    Gate<2>::Params params{.position = 0.1, .friction = 0.2};
    params.motion.opening_time = opening;
    return make_obstacle<Gate<2>>(params);
  };
  CHECK(message_between(gate(0.5), gate(0.5)) == fine);
  CHECK(contains(message_between(gate(0.5), gate(0.6)), "differ")); // long after the checkpoint

  // A motion that ends: it may throw, or give what is no motion, beyond what the run needs.
  const auto ending = [](double end) {
    return make_obstacle<Any>({.shape = shapes::Ball<2>({0.25, 0.05}, 0.05),
                               .friction = 0.3,
                               .motion = [end](double time) {
                                 if (time > end)
                                   throw std::runtime_error("the table ends");
                                 return RigidState<2>();
                               }});
  };
  CHECK(message_between(ending(0.1), ending(0.1)) == fine);
  CHECK(contains(message_between(ending(0.1), ending(1)), "differ"));
}

TEST_CASE("a run does not go on with another body") {
  const auto make = [](const auto& change) {
    Sim<2>::Params params;
    params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {20, 10}};
    params.material.density = 1500;
    params.gravity = {0, -9.81};
    params.time_step = 1e-3;
    params.rheology.mu = 0.44;
    params.faces = Faces<2>::all({FaceKind::free_slip});
    params.bodies = {block_body<2>({0.3, 0.1}, {0.06, 0.06}, 2600, 0.3)};
    change(params.bodies[0]);
    return Sim<2>(params, {});
  };
  const Folder folder;
  auto run = make([](auto&) {});
  write_checkpoint(folder / "a.talus", run);
  const auto message = [&](const auto& change) {
    auto other = make(change);
    return message_of<std::runtime_error>([&] { read_checkpoint(folder / "a.talus", other); });
  };
  CHECK(message([](auto&) {}) == "(nothing thrown)");
  CHECK(message([](auto& body) { body.start.position[0] = 0.2; }) == "(nothing thrown)");
  CHECK(contains(message([](auto& body) {
                   body.shape = shapes::Ball<2>({0, 0}, 0.03);
                 }),
                 "its bodies.0.shape is another"));
  CHECK(contains(message([](auto& body) { body.inertia *= 2; }), "its bodies.0.inertia.00 is"));
  CHECK(contains(message([](auto& body) { body.rotates = false; }), "its bodies.0.rotates is 1"));
  CHECK(
      contains(message([](auto& body) { body.corners.pop_back(); }), "its bodies.0.corners is 4"));
  CHECK(
      contains(message([](auto& body) { body.corners[1][0] *= 0.9; }), "its bodies.0.corner.1.x"));
  CHECK(contains(message([](auto& body) { body.corner_radius = 1e-3; }),
                 "its bodies.0.corner_radius"));
  CHECK(contains(message([](auto& body) { body.friction = 0.4; }), "its bodies.0.friction is 0.3"));
}

} // namespace test_checkpoint
