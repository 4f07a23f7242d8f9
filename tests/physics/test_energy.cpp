// SPDX-License-Identifier: MIT
// Where the energy goes: exact cases, and a budget that closes in all others.

#include "../distributed/scenes.hpp"
#include "../support/about.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/energy_budget.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/rheology/cohesion.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>

namespace test_energy {

using namespace talus;

namespace {

template <class S>
auto watch(typename S::Params& params) {
  auto budget = std::make_shared<EnergyBudget<S::dimension, typename S::ParticleData::Scalar>>();
  params.observer = budget;
  return budget;
}

/// The largest |term|, those that are named and closure left out.
double largest_term(const EnergyTerms& terms, std::initializer_list<const char*> but) {
  double largest = 0;
  EnergyTerms::for_each(terms, [&](const char* name, double term) {
    for (const char* other : but)
      if (std::strcmp(name, other) == 0)
        return;
    if (std::strcmp(name, "closure") != 0)
      largest = std::max(largest, std::abs(term));
  });
  for (const BoundaryWork& work : terms.boundaries)
    largest =
        std::max({largest, std::abs(work.friction), std::abs(work.motion), std::abs(work.impact)});
  return largest;
}

/// Steps a scene and checks its budget: that it closes, and that the levels are the particles' own.
template <class S>
EnergyRecord budget_of(scenes::Scene<S> scene, int steps) {
  constexpr int dim = S::dimension;
  const auto budget = watch<S>(scene.params);
  S sim(scene.params, scene.particles);
  for (int k = 0; k < steps; ++k) {
    REQUIRE(sim.step().completed());
    const EnergyLevels& now = budget->record().now;
    const double density = sim.params().material.density;
    CHECK(now.kinetic == support::about(kinetic_energy(sim.particles(), density), 1e-13));
    if (!sim.grid().any_periodic())
      CHECK(now.potential ==
            support::about(potential_energy<dim>(sim.particles(), density, sim.gravity()), 1e-12));
    const MomentumTerms<dim>& momentum = budget->momentum();
    const double scale = momentum.before.norm() + momentum.after.norm() + momentum.weight.norm();
    CHECK(momentum.closure().norm() <= 1e-9 * scale);
  }
  const EnergyRecord& record = budget->record();
  CHECK(record.largest_closure < 1e-13);
  CHECK(std::abs(record.now.sum() - record.start.sum() - record.total.sum()) <
        1e-12 * std::abs(record.now.potential));
  CHECK(record.total.to_grid < 0);
  CHECK(record.total.friction <= 0);
  CHECK(record.total.outside == 0);
  for (const BoundaryWork& work : record.total.boundaries)
    CHECK(work.friction <= 0);
  return record;
}

template <int Dim, class Transfer>
void free_fall() {
  using S = scenes::Sim<Dim, Transfer>;
  typename S::Params params;
  const Particles<Dim> particles = scenes::block_in_the_air<Dim, Transfer>(params);
  const auto budget = watch<S>(params);
  S sim(params, particles);
  constexpr int steps = 100;
  for (int k = 0; k < steps; ++k)
    REQUIRE(sim.step().completed());
  const double mass = params.material.density * total_volume(sim.particles());
  const double v = 9.81 * params.time_step * steps;
  const EnergyRecord& record = budget->record();
  CHECK(record.now.kinetic == support::about(mass * v * v / 2, 1e-11));
  // Symplectic Euler: kinetic + potential + δt g·p/2 is constant
  CHECK(record.total.half_step == support::about(-mass * 9.81 * params.time_step * v / 2, 1e-11));
  CHECK(largest_term(record.total, {"half_step"}) < 1e-12 * record.now.kinetic);
  CHECK(record.largest_closure < 1e-13);
}

/// A layer without ends slides down on a floor that is smoother than it is.
template <int Dim>
void sliding_layer(double tolerance) {
  using S = scenes::Sim<Dim>;
  constexpr double mu = 0.2, speed = 0.5, angle = 25, seconds = 0.03;
  const double bound = 100 * tolerance;
  auto params = scenes::box<Dim>({0.04, 0.04, 0.08}, {4, 4, 8}, angle, 0.44);
  for (int a = 0; a < up_axis<Dim>; ++a)
    params.faces.lower[a].kind = params.faces.upper[a].kind = FaceKind::periodic;
  params.faces.lower[up_axis<Dim>] = {FaceKind::frictional, mu};
  params.solver.tolerance = tolerance;
  auto particles = scenes::block<Dim>(params.grid, 0, 0.04, 0, 0.03);
  for (auto& v : particles.velocity)
    v[0] = speed;
  const auto budget = watch<S>(params);
  S sim(params, particles);
  while (sim.time() < seconds - 1e-4)
    REQUIRE(sim.step().solve.status == SolveStatus::converged);
  const double mass = params.material.density * total_volume(sim.particles());
  const double normal = -mass * sim.gravity()[up_axis<Dim>];
  const double acceleration = sim.gravity()[0] - mu * normal / mass, t = sim.time();
  const double mean = speed + acceleration * t / 2; // m/s
  const EnergyRecord& record = budget->record();
  const BoundaryWork& floor =
      record.total.boundaries[Boundaries<Dim>::face_id(up_axis<Dim>, false)];
  CHECK(floor.sum() == support::about(-mu * normal * mean * t, bound));
  CHECK(floor.motion == 0);
  const double gained = record.now.kinetic - record.start.kinetic;
  CHECK(gained == support::about(mass * acceleration * mean * t, bound));
  CHECK(record.total.slope + record.total.half_step + floor.sum() == support::about(gained, bound));
  EnergyTerms others = record.total;
  for (BoundaryWork& work : others.boundaries)
    work = {};
  CHECK(largest_term(others, {"slope", "half_step"}) < bound * gained);
  CHECK(record.largest_closure < 1e-13);
}

/// A free body slides down the floor of an empty box.
template <int Dim>
void sliding_body() {
  using S = scenes::Sim<Dim>;
  constexpr double mu = 0.2, angle = 25;
  auto params = scenes::box<Dim>({0.8, 0.1, 0.2}, {40, 5, 10}, angle, 0.44);
  params.faces.lower[up_axis<Dim>] = {FaceKind::frictional, mu};
  params.solver.tolerance = 1e-9;
  Vec<Dim> centre = Vec<Dim>::Constant(0.05), size = Vec<Dim>::Constant(0.08);
  centre[up_axis<Dim>] = 0.04;
  auto body = block_body<Dim>(centre, size, 2000, mu);
  body.rotates = false;
  body.start.velocity[0] = 0.5;
  params.bodies.push_back(body);
  const auto budget = watch<S>(params);
  S sim(params, Particles<Dim>());
  for (int k = 0; k < 100; ++k)
    REQUIRE(sim.step().solve.status == SolveStatus::converged);
  const EnergyRecord& record = budget->record();
  const double way = sim.bodies()[0].position[0] - centre[0];
  const double normal = -body.mass * sim.gravity()[up_axis<Dim>];
  const BoundaryWork& floor =
      record.total.boundaries[Boundaries<Dim>::face_id(up_axis<Dim>, false)];
  CHECK(floor.friction == support::about(-mu * normal * way, 1e-7)); // at the end velocities
  CHECK(record.now.bodies - record.start.bodies ==
        support::about(floor.sum() + record.total.half_step, 1e-7));
  CHECK(largest_term(record.total, {"half_step"}) == -floor.friction);
  CHECK(record.largest_closure < 1e-13);
}

template <int Dim>
void at_rest() {
  using S = scenes::Sim<Dim>;
  auto params = scenes::box<Dim>({0.2, 0.04, 0.2}, {10, 2, 10}, 0, 0.44);
  const auto budget = watch<S>(params);
  S sim(params, scenes::block<Dim>(params.grid, 0, 0.2, 0, 0.16));
  for (int k = 0; k < 20; ++k)
    REQUIRE(sim.step().completed());
  const EnergyRecord& record = budget->record();
  const double mass = params.material.density * total_volume(sim.particles());
  // what it would gain in a free fall of 20 steps
  const double scale = mass * 9.81 * 9.81 * 0.02 * 0.02 / 2;
  CHECK(largest_term(record.total, {}) < 1e-4 * scale);
  CHECK(record.now.kinetic < 1e-9 * scale);
  CHECK(record.largest_closure < 1e-13);
}

} // namespace

TEST_CASE("energy: in free fall nothing is lost") {
  free_fall<2, PolyPic>();
  free_fall<2, Apic>();
  free_fall<2, Pic>();
  free_fall<2, Flip>();
  free_fall<3, PolyPic>();
}

TEST_CASE("energy: what slides loses what friction takes") {
  sliding_body<2>();
  sliding_body<3>();
  sliding_layer<2>(1e-9);
  sliding_layer<3>(1e-7);
}

TEST_CASE("energy: a column at rest loses nothing") {
  at_rest<2>();
  at_rest<3>();
}

TEST_CASE("energy: the budget closes, whatever there is") {
  SUBCASE("gate and walls") {
    const EnergyRecord record = budget_of(scenes::collapse<2>(), 40);
    const BoundaryWork& gate = record.total.boundaries.at(4);
    CHECK(gate.friction < 0);
    CHECK(gate.motion > 0); // it rises
    CHECK(gate.motion < -gate.friction);
    // what the solver left is far below what friction took
    CHECK(std::abs(record.total.solver_error) < 1e-3 * -record.total.friction);
  }
  SUBCASE("gate and walls, 3-D") {
    const EnergyRecord record = budget_of(scenes::collapse<3>(), 5);
    CHECK(record.total.boundaries.at(2).friction < 0); // the side walls, alike
    CHECK(record.total.boundaries.at(3).friction ==
          support::about(record.total.boundaries.at(2).friction, 0.2));
  }
  SUBCASE("bodies, an open face, a step that varies") {
    const EnergyRecord record = budget_of(scenes::impact<2>(), 60);
    CHECK(record.total.boundaries.at(4).friction < 0);
    CHECK(record.total.boundaries.at(5).impact < 0);
    CHECK(record.total.exchanged < 0);
    CHECK(record.now.bodies < record.start.bodies);
  }
  SUBCASE("bodies that turn, 3-D") {
    auto scene = scenes::impact<3>();
    scene.params.bodies[0].inertia(0, 0) *= 2; // three that differ
    scene.params.bodies[0].inertia(1, 1) *= 1.5;
    scene.params.bodies[0].start.angular_velocity = {20, 40, 10};
    const EnergyRecord record = budget_of(scene, 4);
    CHECK(std::abs(record.total.turning) > 1e-9 * record.now.bodies);
  }
  SUBCASE("sources and sinks") {
    CHECK(budget_of(scenes::fountain<2>(), 40).total.exchanged > 0);
  }
  SUBCASE("periodic, viscous, shifted") {
    const EnergyRecord record = budget_of(scenes::chute<2>(), 15);
    CHECK(record.total.slope > 0);
    CHECK(record.total.viscosity < 0);
    CHECK(record.total.shifting != 0);
  }
  SUBCASE("other transfers, and particles of floats") {
    using S = Simulation<2, ConstantFriction, Flip, GaussSeidel<>, float>;
    const auto plain = scenes::collapse<2>();
    S::Params params;
    params.grid = plain.params.grid;
    params.material = plain.params.material;
    params.gravity = plain.params.gravity;
    params.time_step = plain.params.time_step;
    params.faces = plain.params.faces;
    params.rheology = plain.params.rheology;
    S::ParticleData sand;
    for (const Vec<2>& x : plain.particles.position)
      sand.add(x, Vec<2>::Zero(), plain.particles.volume[0]);
    const auto budget = watch<S>(params);
    S sim(params, sand);
    for (int k = 0; k < 15; ++k)
      REQUIRE(sim.step().completed());
    CHECK(budget->record().largest_closure < 1e-13);
    CHECK(budget->record().now.kinetic > 0);
  }
  SUBCASE("cohesion") {
    using S = Simulation<2, WithCohesion<ConstantFriction>, Apic, GaussSeidel<>>;
    const auto plain = scenes::collapse<2>();
    scenes::Scene<S> scene;
    scene.params.grid = plain.params.grid;
    scene.params.material = plain.params.material;
    scene.params.gravity = plain.params.gravity;
    scene.params.time_step = plain.params.time_step;
    scene.params.faces = plain.params.faces;
    scene.params.rheology.law.mu = 0.44;
    scene.params.rheology.cohesion = 20;
    scene.particles = plain.particles;
    CHECK(budget_of(scene, 20).total.cohesion != 0);
  }
}

TEST_CASE("energy: watching changes nothing, and threads change no sum") {
  const auto run = [](int threads, bool watched) {
    auto scene = scenes::impact<2>();
    scene.params.threads = threads;
    const auto budget = watch<scenes::Sim<2>>(scene.params);
    if (!watched)
      scene.params.observer = nullptr;
    scenes::Sim<2> sim(scene.params, scene.particles);
    for (int k = 0; k < 20; ++k)
      REQUIRE(sim.step().completed());
    return std::pair{state_checksum(sim.particles()), budget->record()};
  };
  const auto [watched, one] = run(1, true);
  const auto [again, three] = run(3, true);
  CHECK(watched == run(1, false).first);
  CHECK(again == watched);
  Array<double> terms;
  EnergyTerms::for_each(one.total, [&](const char*, double term) { terms.push_back(term); });
  std::size_t k = 0;
  EnergyTerms::for_each(
      three.total, [&](const char* name, double term) { CHECK_MESSAGE(term == terms[k++], name); });
  for (std::size_t b = 0; b < one.total.boundaries.size(); ++b)
    CHECK(three.total.boundaries[b].sum() == one.total.boundaries[b].sum());
}

TEST_CASE("energy: what is done between steps is told apart, and a record goes on") {
  auto scene = scenes::collapse<2>();
  const auto budget = watch<scenes::Sim<2>>(scene.params);
  scenes::Sim<2> sim(scene.params, scene.particles);
  REQUIRE(sim.step().completed());
  const EnergyRecord before = budget->record();
  const double removed =
      sim.remove([&](std::size_t p) { return sim.particles().position[p][0] > 0.5; }).volume;
  CHECK(removed > 0);
  REQUIRE(sim.step().completed());
  const double gone = before.now.sum() + budget->record().total.outside;
  CHECK(gone == support::about(budget->record().now.sum() - budget->last().sum(), 1e-12));
  CHECK(budget->record().total.outside != 0);
  const double potential = budget->record().now.potential;
  sim.set_gravity(2 * sim.gravity());
  REQUIRE(sim.step().completed());
  CHECK(budget->last().outside == support::about(potential, 1e-12)); // as much again

  EnergyBudget<2> other;
  other.restore(budget->record());
  CHECK(other.record().total.friction == budget->record().total.friction);
  CHECK(other.record().any);
}

TEST_CASE("energy: an observer that throws") {
  class Throwing final : public StepObserver<2> {
   public:
    StepStage at = StepStage::on_grid;
    bool armed = false;
    void observe(StepStage stage, const ObservedStep<2>&) override {
      if (armed && stage == at)
        throw std::runtime_error("seen enough");
    }
  };
  auto scene = scenes::chute<2>();
  const auto observer = std::make_shared<Throwing>();
  scene.params.observer = observer;
  scenes::Chute<2> sim(scene.params, scene.particles), twin(scene.params, scene.particles);
  REQUIRE(sim.step().completed());
  REQUIRE(twin.step().completed());
  observer->armed = true;
  CHECK_THROWS_WITH_AS((void)sim.step(), "seen enough", std::runtime_error);
  observer->armed = false;
  CHECK(sim.step().completed()); // as if nothing had been
  CHECK(twin.step().completed());
  CHECK(state_checksum(sim.particles()) == state_checksum(twin.particles()));
  const auto state = sim.state();
  for (const StepStage stage :
       {StepStage::on_particles, StepStage::shifted, StepStage::forces, StepStage::end}) {
    observer->at = stage;
    observer->armed = true;
    CHECK_THROWS_WITH_AS((void)sim.step(), "seen enough", std::runtime_error);
    observer->armed = false;
    CHECK_THROWS_AS((void)sim.step(), std::invalid_argument);
    sim.restore(state);
  }
  CHECK(sim.step().completed());
  CHECK(twin.step().completed());
  CHECK(state_checksum(sim.particles()) == state_checksum(twin.particles()));
}

} // namespace test_energy
