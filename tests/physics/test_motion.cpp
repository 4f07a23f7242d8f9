// SPDX-License-Identifier: MIT
// Free fall, rotation, sliding, the gate, and runs that must be the same.

#include "../support/about.hpp"
#include "../support/collapse.hpp"
#include "scenes.hpp"

#include "talus/boundary/gate.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/scene/collapse.hpp"

#include <doctest/doctest.h>

namespace test_motion {

using namespace talus;

namespace {

template <int Dim, class Transfer>
void free_fall() {
  typename scenes::Sim<Dim, Transfer>::Params params;
  Particles<Dim> particles = scenes::block_in_the_air<Dim, Transfer>(params);
  Vec<Dim> v0 = Vec<Dim>::Constant(0.1);
  for (auto& v : particles.velocity)
    v = v0;
  scenes::Sim<Dim, Transfer> sim(params, particles);
  const auto x0 = centre_of_mass(sim.particles());
  constexpr int steps = 100;
  for (int n = 0; n < steps; ++n)
    CHECK(sim.step().solve.status == SolveStatus::converged);
  const double t = steps * params.time_step;
  const Vec<Dim> v = mean_velocity(sim.particles()), g = params.gravity;
  CHECK((v - v0 - t * g).norm() < 1e-12);
  // symplectic Euler: x = x0 + v0 t + g t (t + δt)/2
  CHECK(
      (centre_of_mass(sim.particles()) - x0 - t * v0 - t * (t + params.time_step) / 2 * g).norm() <
      1e-12);
}

/// Angular momentum of the grid about the box's origin, from velocities u or u*.
template <class S, class Velocity>
double angular_momentum(const S& sim, const Velocity& velocity) {
  constexpr int dim = S::dimension;
  double sum = 0;
  for (int n = 0; n < sim.grid().node_count(); ++n) {
    const Index<dim> index = sim.grid().node_index(n);
    bool inside = true;
    for (int a = 0; a < dim; ++a)
      inside = inside && index[a] >= 0 && index[a] <= sim.grid().cells(a);
    if (!inside)
      continue;
    const double mass = 1500 * sim.volume_fraction(index) * sim.grid().node_volume(index);
    const Vec<dim> x = sim.grid().node_position(index), u = velocity(index);
    sum += mass * (x[0] * u[1] - x[1] * u[0]);
  }
  return sum;
}

/// Turns a blob for 200 steps; bound: of the relative change of its angular momentum.
template <int Dim>
void rotation(double time_step, double bound) {
  auto params = scenes::box<Dim>({1, 1, 1}, {10, 10, 10}, 0, 0.44);
  params.gravity.setZero();
  params.time_step = time_step;
  Particles<Dim> particles;
  fill_box(particles, Grid<Dim>(params.grid), Vec<Dim>(Vec<Dim>::Constant(0.33)),
           Vec<Dim>(Vec<Dim>::Constant(0.67)), {.per_axis = 2, .jitter = 0});
  const double omega = 2;
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const Vec<Dim> r = particles.position[p] - Vec<Dim>::Constant(0.5);
    particles.velocity[p][0] = -omega * r[1];
    particles.velocity[p][1] = omega * r[0];
    particles.affine[p](0, 1) = -omega;
    particles.affine[p](1, 0) = omega;
  }
  scenes::Sim<Dim> sim(params, particles);
  double first = 0;
  for (int n = 0; n < 200; ++n) {
    CHECK(sim.step().completed());
    const double now = angular_momentum(sim, [&](const Index<Dim>& i) { return sim.velocity(i); });
    if (n == 0)
      first = now;
    CHECK(std::abs(now - first) < bound * std::abs(first));
  }
  CHECK(std::abs(first) > 0);
  CHECK(mean_velocity(sim.particles()).norm() < 1e-12);
}

/// A block on a frictional floor whose own friction is higher: it slides as a whole.
template <int Dim>
scenes::Sim<Dim> sliding_block(double angle_deg, double wall_friction, double speed) {
  auto params = scenes::box<Dim>({0.8, 0.04, 0.08}, {40, 2, 8}, angle_deg, 1);
  params.packing.surfaces = false; // at such a friction the solver misses single steps with it
  params.faces.lower[up_axis<Dim>] = {FaceKind::frictional, wall_friction};
  auto particles = scenes::block<Dim>(params.grid, 0.1, 0.3, 0, 0.04);
  for (auto& v : particles.velocity)
    v[0] = speed;
  return scenes::Sim<Dim>(params, particles);
}

template <int Dim>
void block_slides(double angle_deg, double mu, double speed, double seconds) {
  auto sim = sliding_block<Dim>(angle_deg, mu, speed);
  Vec<Dim> impulse = Vec<Dim>::Zero();
  while (sim.time() < seconds) {
    CHECK(sim.step().solve.status == SolveStatus::converged);
    for (const auto& contact : sim.problem().contacts)
      impulse += contact.impulse;
  }
  const int up = up_axis<Dim>;
  // the floor's friction over its normal force, and the acceleration g (sin θ − μ cos θ)
  CHECK(-impulse[0] / impulse[up] == support::about(mu, 0.01));
  const Vec<Dim> g = sim.gravity();
  const Vec<Dim> v = mean_velocity(sim.particles());
  const double t = sim.time(), acceleration = (v[0] - speed) / t;
  CHECK(acceleration == support::about(g[0] + mu * g[up], 0.026)); // its ends slump a little
  CHECK(acceleration == support::about(g[0] + mu * (g[up] - v[up] / t), 0.01));
}

CollapseSetup small_collapse() {
  CollapseSetup setup;
  setup.inclination_deg = 10;
  setup.column_length = 0.1;
  setup.column_height = 0.06;
  setup.bed_depth = 0.02;
  setup.length = 0.4;
  setup.width = 0.04;
  setup.height = 0.1;
  setup.wall_friction = 0.2;
  setup.gate_friction = 0.2;
  return setup;
}

template <int Dim>
scenes::Sim<Dim> make_collapse(const CollapseSetup& setup, int threads = 1) {
  auto params = support::collapse_params<scenes::Sim<Dim>>(setup, {0.02, 0.02, 0.01}, 1e-3);
  params.threads = threads;
  return scenes::Sim<Dim>(params, setup.particles<Dim>(Grid<Dim>(params.grid), {.per_axis = 2}));
}

template <int Dim>
std::string checksum_of_run(int threads) {
  auto sim = make_collapse<Dim>(small_collapse(), threads);
  for (int n = 0; n < 60; ++n)
    CHECK(sim.step().completed());
  return state_checksum(sim.particles());
}

} // namespace

TEST_CASE("free fall is exact, with every transfer") {
  free_fall<2, PolyPic>();
  free_fall<2, Pic>();
  free_fall<2, Flip>();
  free_fall<3, PolyPic>();
}

TEST_CASE("with cfl, steps shorten as a block falls, and grow again at rest") {
  for (const bool even : {false, true}) {
    CAPTURE(even);
    auto params = scenes::box<2>({0.2, 0, 0.4}, {10, 1, 20}, 0, 0.44);
    params.time_step = 0.01;
    params.cfl = 0.2;
    params.packing.even = even;
    Particles<2> block; // at such a step a lattice of 2 × 2 would not come to rest
    fill_box<2>(block, Grid<2>(params.grid), {0, 0.2}, {0.2, 0.3}, {.per_axis = 3, .jitter = 0});
    scenes::Sim<2> sim(params, block);
    const double h = 0.02, falls_until = std::sqrt(2 * 0.2 / 9.81);
    double shortest = 1;
    while (sim.time() < 1.5) {
      std::vector<Vec<2>> before(sim.particles().size());
      for (std::size_t p = 0; p < before.size(); ++p)
        before[sim.particles().id[p]] = sim.particles().position[p];
      const double time = sim.time();
      const StepReport report = sim.step();
      CHECK(report.solve.status == SolveStatus::converged);
      CHECK(sim.time() - time == doctest::Approx(sim.time_step()));
      shortest = std::min(shortest, sim.time_step());
      for (std::size_t p = 0; p < before.size(); ++p)
        CHECK((sim.particles().position[p] - before[sim.particles().id[p]]).cwiseAbs().maxCoeff() <=
              params.cfl * h * 1.05); // an impact can add to the speed that δt was chosen for
      if (sim.time() < 0.9 * falls_until) {
        CHECK(mean_velocity(sim.particles())[1] == doctest::Approx(-9.81 * sim.time()));
        if (sim.time_step() < params.time_step)
          CHECK(report.courant == support::about(params.cfl, 1e-6));
      }
    }
    CHECK(shortest < 1.05 * 0.2 * h / (9.81 * falls_until));
    CHECK(sim.time_step() == doctest::Approx(0.01));
    CHECK(largest_speed(sim) < 1e-3); // m/s
    // The floor carries the weight. Stresses of single nodes, or rows of them, are not determined.
    CHECK(sim.face_wrench(1, false).force[1] == support::about(-1500 * 9.81 * 0.2 * 0.1, 0.005));
  }
}

TEST_CASE("a rotating blob keeps its angular momentum") {
  // The transfers keep it exactly. Between them a particle's share C_p D_p, D_p = Σ N_i (x_i − x_p)
  // (x_i − x_p)ᵀ, changes as it moves through its cell: D_p depends on the place for multilinear N.
  rotation<2>(1e-13, 1e-11);
  rotation<3>(1e-13, 1e-11);
  // Here from 0.1875 h² on the lattice to a mean of h²/6 per axis: 2.2 % of the angular momentum.
  rotation<2>(1e-3, 0.03);
  rotation<3>(1e-3, 0.03);
}

TEST_CASE("a block slides on a frictional floor as on Coulomb's plane") {
  block_slides<2>(30, 0.3, 0, 0.2);
  block_slides<3>(30, 0.3, 0, 0.1);
  block_slides<2>(0, 0.3, 0.5, 0.1); // slows down
}

TEST_CASE("a block stops after v^2 / (2 mu g)") {
  auto sim = sliding_block<2>(0, 0.3, 0.5);
  const double start = centre_of_mass(sim.particles())[0];
  while (sim.time() < 0.5)
    CHECK(sim.step().completed());
  CHECK(centre_of_mass(sim.particles())[0] - start ==
        support::about(0.25 / (2 * 0.3 * 9.81), 0.036));
  CHECK(mean_velocity(sim.particles()).norm() < 2e-3);
}

TEST_CASE("the gate's motion") {
  const GateMotion motion{.opening_time = 0.1, .terminal_speed = 0.7, .time_constant = 0.13};
  CHECK(motion.speed(0.05) == 0);
  CHECK(motion.travel(0.1) == 0);
  CHECK(motion.speed(0.1 + 0.13) == doctest::Approx(0.7 * (1 - std::exp(-1.0))));
  double travel = 0; // against a sum of its speed
  for (int n = 0; n < 10000; ++n)
    travel += motion.speed(0.1 + (n + 0.5) * 1e-4) * 1e-4;
  CHECK(motion.travel(1.1) == support::about(travel, 1e-6));
  const GateMotion sudden{.opening_time = 0, .terminal_speed = 0.5, .time_constant = 0};
  CHECK(sudden.speed(1) == 0.5);
  CHECK(sudden.travel(2) == doctest::Approx(1));
  const GateMotion stopping{.terminal_speed = 0.5, .time_constant = 0, .rise = 0.3};
  CHECK(stopping.travel(0.5) == doctest::Approx(0.25));
  CHECK(stopping.speed(0.5) == 0.5);
  CHECK(stopping.travel(2) == 0.3);
  CHECK(stopping.speed(2) == 0);
  CHECK_THROWS_WITH_AS(Gate<2>({.friction = 0, .motion = {.rise = -0.1}}),
                       "gate.motion.rise is -0.1; allowed: 0 or more, or infinity",
                       std::invalid_argument);
}

TEST_CASE("a closed gate holds the column, wherever it stands between nodes") {
  for (const double shift : {0.0, 0.004, 0.01, 0.013}) {
    CollapseSetup setup = small_collapse();
    setup.column_length += shift;
    setup.gate.opening_time = 10;
    auto sim = make_collapse<2>(setup);
    for (int n = 0; n < 100; ++n)
      CHECK(sim.step().completed());
    int leaked = 0;
    for (const auto& x : sim.particles().position)
      leaked += x[1] > setup.bed_depth + 0.01 && x[0] > setup.column_length + 0.012;
    INFO("gate shifted by ", shift);
    CHECK(leaked == 0);
    CHECK(sim.volume_fraction({2, 7}) > 0.9);
  }
}

TEST_CASE("an open gate lets the column go, and the front advances") {
  auto sim = make_collapse<2>(small_collapse());
  double fastest = 0;
  while (sim.time() < 0.4) {
    CHECK(sim.step().completed());
    for (const auto& v : sim.particles().velocity)
      fastest = std::max(fastest, v.norm());
  }
  // From H_0 + bed: nothing may be pushed through the gate and be thrown out by it.
  CHECK(fastest < std::sqrt(2 * 9.81 * 0.08));
  CHECK(front_position(measure_profile(sim), 0.022) > 0.16);
}

TEST_CASE("a heap on a rough floor slumps, and every step converges") {
  // The README's first program: at t = 0.048 s extrapolation once went round in circles.
  auto params = scenes::box<2>({0.6, 0.1, 0.2}, {60, 1, 20}, 0, 0.44);
  params.faces = Faces<2>::all({FaceKind::free_slip});
  params.faces.lower[1] = {FaceKind::no_slip};
  params.faces.upper[1] = {FaceKind::open};
  params.solver.max_sweeps = 2000;
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.15, 0.15}, {.per_axis = 3});
  scenes::Sim<2> sim(params, sand);
  while (sim.time() < 0.2)
    CHECK(sim.step().solve.status == SolveStatus::converged);
}

TEST_CASE("dilatancy keeps the volume") {
  const auto loss = [](const Packing& packing) {
    const CollapseSetup setup = small_collapse();
    auto params = support::collapse_params<scenes::Sim<2>>(setup, {0.01, 0.01, 0.005}, 1e-3);
    params.packing = packing;
    const auto particles = setup.particles<2>(Grid<2>(params.grid), {.per_axis = 4});
    double volume = 0;
    for (const double v : particles.volume)
      volume += v;
    scenes::Sim<2> sim(params, particles);
    while (sim.time() < 2)
      CHECK(sim.step().completed());
    return 1 - volume_under_surface(sim) / volume;
  };
  CHECK(loss({.slack = 0, .dilatancy = 0, .surfaces = false}) > 0.01);
  CHECK(std::abs(loss({})) < 0.005);
}

TEST_CASE("two runs are the same to the last bit, with any number of threads") {
  CHECK(checksum_of_run<2>(1) == checksum_of_run<2>(1));
  CHECK(checksum_of_run<2>(1) == checksum_of_run<2>(3));
  CHECK(checksum_of_run<3>(1) == checksum_of_run<3>(2));
  CHECK(checksum_of_run<3>(1) == checksum_of_run<3>(4));
}

TEST_CASE("100 steps of B15 are the same to the last bit with 1, 2 and 4 threads") {
  const CollapseSetup setup = support::b15();
  auto params = support::collapse_params<scenes::Sim<3>>(setup, {0.02, 0.02, 0.01}, 1.66e-3);
  const auto particles = setup.particles<3>(Grid<3>(params.grid), {.per_axis = 3});
  std::string first;
  for (const int threads : {1, 2, 4}) {
    params.threads = threads;
    scenes::Sim<3> sim(params, particles);
    for (int n = 0; n < 100; ++n)
      CHECK(sim.step().solve.status == SolveStatus::converged);
    if (first.empty())
      first = state_checksum(sim.particles());
    CHECK(state_checksum(sim.particles()) == first);
  }
}

TEST_CASE("3-D without side friction is 2-D") {
  CollapseSetup setup = small_collapse();
  setup.wall_friction = setup.gate_friction = 0;
  auto flat = make_collapse<2>(setup);
  auto deep = make_collapse<3>(setup);
  while (flat.time() < 0.25) {
    CHECK(flat.step().completed());
    CHECK(deep.step().completed());
  }
  const Profile a = measure_profile(flat), b = measure_profile(deep);
  for (std::size_t i = 0; i < a.x.size(); ++i)
    CHECK(std::abs(a.height[i] - b.height[i]) < 0.005); // half a cell
}

TEST_CASE("rigid side walls hold a collapse as the box's faces do") {
  CollapseSetup setup = small_collapse();
  auto faces = make_collapse<3>(setup);
  setup.side_wall_cells = 2;
  auto walls = make_collapse<3>(setup);
  CHECK(walls.grid().cells(1) == faces.grid().cells(1) + 4);
  CHECK(walls.particles().size() == faces.particles().size());
  while (faces.time() < 0.25) {
    CHECK(faces.step().completed());
    CHECK(walls.step().completed());
  }
  for (const Vec<3>& x : walls.particles().position)
    CHECK(std::abs(x[1] - 0.02) < 0.0201);
  const Vec<3> there = centre_of_mass(faces.particles()), here = centre_of_mass(walls.particles());
  CHECK((here - there).norm() < 0.003);
  CHECK(volume_under_surface(walls, 2) == support::about(volume_under_surface(faces), 0.02));
}

TEST_CASE("material that passes a free face leaves, and is counted") {
  auto params = scenes::box<2>({0.4, 0, 0.2}, {8, 1, 4}, 0, 0.44);
  params.gravity.setZero();
  params.faces.upper[0].kind = FaceKind::open;
  auto particles = scenes::block<2>(params.grid, 0.3, 0.4, 0.05, 0.15);
  for (auto& v : particles.velocity)
    v[0] = 1;
  const std::size_t count = particles.size();
  scenes::Sim<2> sim(params, particles);
  std::size_t left = 0;
  for (int n = 0; n < 80; ++n)
    left += sim.step().outflow;
  CHECK(left > count / 2);
  CHECK(sim.particles().size() == count - left);
}

TEST_CASE("wrong input is refused by name and value") {
  auto params = scenes::box<2>({0.4, 0, 0.2}, {8, 1, 4}, 0, 0.44);
  const auto particles = scenes::block<2>(params.grid, 0, 0.2, 0, 0.1);
  using S = scenes::Sim<2>;
  const auto message = [&](const S::Params& p, const Particles<2>& q) -> std::string {
    try {
      S sim(p, q);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  CHECK(message(params, particles).empty());
  auto bad = params;
  bad.time_step = 0;
  CHECK(message(bad, particles) == "time_step is 0; allowed: a finite number > 0");
  bad = params;
  bad.cfl = -1;
  CHECK(message(bad, particles) == "cfl is -1; allowed: a finite number >= 0");
  bad = params;
  bad.min_relative_mass = 1;
  CHECK(message(bad, particles) == "min_relative_mass is 1; allowed: a number in (0, 1)");
  bad = params;
  bad.rheology.mu = -0.1;
  CHECK(message(bad, particles) == "rheology.mu is -0.1; allowed: a finite number >= 0");
  bad = params;
  bad.rheology.mu = std::nan("");
  CHECK(message(bad, particles).starts_with("rheology.mu is nan"));
  bad = params;
  bad.material.density = 0;
  CHECK(message(bad, particles).starts_with("material.density is 0"));
  bad = params;
  bad.solver.tolerance = 0;
  CHECK(message(bad, particles).starts_with("solver.tolerance is 0"));
  bad = params;
  bad.faces.lower[0].friction = -1;
  CHECK(message(bad, particles).starts_with("faces.lower.x.friction is -1"));
  bad = params;
  bad.threads = 0;
  CHECK(message(bad, particles).starts_with("threads is 0"));
  bad = params;
  bad.grid.cells[1] = 0;
  CHECK(message(bad, particles).starts_with("grid.cells.y is 0"));
  CHECK(message(params, {}).empty()); // a box may start empty
  auto outside = particles;
  outside.position[3][0] = 7;
  CHECK(message(params, outside).starts_with("a particle's coordinate is 7"));
  outside = particles;
  outside.position[3][0] = std::nan("");
  CHECK(message(params, outside).starts_with("a particle's coordinate is nan"));
  outside = particles;
  outside.volume[0] = 0;
  CHECK(message(params, outside).starts_with("a particle's volume is 0"));
  outside = particles;
  outside.velocity.pop_back();
  CHECK(message(params, outside).starts_with("the number of the particles' velocities is "));
  outside = particles;
  outside.affine[1](0, 1) = std::nan("");
  CHECK(message(params, outside).starts_with("a particle's affine matrix is nan"));
  CollapseSetup setup = small_collapse();
  setup.column_length = 1;
  CHECK_THROWS_AS(setup.validate(), std::invalid_argument);
  setup = small_collapse();
  setup.side_wall_cells = -1;
  CHECK_THROWS_AS(setup.validate(), std::invalid_argument);
  CHECK_THROWS_AS(Gate<2>({.friction = -1}), std::invalid_argument);
  CHECK_THROWS_AS(MuOfI({}), std::invalid_argument); // no grain diameter
}

TEST_CASE("numbers that are not finite stop a step and spoil nothing") {
  auto params = scenes::box<2>({0.4, 0, 0.2}, {8, 1, 4}, 0, 0.44);
  auto particles = scenes::block<2>(params.grid, 0, 0.2, 0, 0.1);
  for (auto& v : particles.velocity)
    v[0] = 1e300; // momentum overflows in the sums
  scenes::Sim<2> sim(params, particles);
  const StepReport report = sim.step();
  CHECK(!report.completed());
  CHECK(report.solve.status == SolveStatus::not_finite);
  CHECK(sim.time() == 0);
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const std::size_t id = sim.particles().id[p]; // steps may change the order
    CHECK(sim.particles().position[p] == particles.position[id]);
    CHECK(sim.particles().velocity[p] == particles.velocity[id]);
  }
}

} // namespace test_motion
