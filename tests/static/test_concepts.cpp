// SPDX-License-Identifier: MIT
// Concepts accept the library's models and a user's own, and refuse what lacks a piece: most of it
// is checked when this file compiles.

#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/secular.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

#include <vector>

using namespace talus;

static_assert(Rheology<ConstantFriction> && Rheology<MuOfI> && Rheology<HystereticFriction>);
static_assert(TransferScheme<Apic, 2> && TransferScheme<Apic, 3> && TransferScheme<Pic, 3> &&
              TransferScheme<Flip, 3>);
static_assert(LocalSolver<SecularSolver, CoulombLaw, 6> &&
              LocalSolver<SecularSolver, AssociatedLaw, 3>);
static_assert(LocalSolver<FischerBurmeisterNewton, CoulombLaw, 2> &&
              LocalSolver<FischerBurmeisterNewton, AssociatedLaw, 6>);
static_assert(Solver<GaussSeidel<SecularSolver>, 2> && Solver<GaussSeidel<SecularSolver>, 3> &&
              Solver<GaussSeidel<FischerBurmeisterNewton, CoulombLaw>, 3>);

namespace {

/// A friction law of a user's own: five lines.
struct Linear {
  struct Params {
    double mu = 0.3;
  };
  static constexpr bool rate_dependent = false;
  explicit Linear(const Params& params) : mu(params.mu) {}
  double friction(double) const { return mu; }
  double mu;
};
static_assert(Rheology<Linear>);

struct NoFriction : Linear {
  double friction(double) const = delete;
};
static_assert(!Rheology<NoFriction>);

struct RateDependentWithoutInertialNumber : Linear {
  static constexpr bool rate_dependent = true;
  using Linear::Linear;
};
static_assert(!Rheology<RateDependentWithoutInertialNumber>);

template <class F>
concept MakesAFrictionLaw = requires {
  typename FrictionLaw<F>;
};

/// A function of the inertial number is enough.
struct Line {
  double mu = 0.3;
  double operator()(double I) const { return mu + 0.1 * I; }
};
struct LineOfAnInteger {
  double operator()(int* I) const { return *I; }
};
struct Words {
  const char* operator()(double) const { return "rough"; }
};
struct NotConst {
  double operator()(double I) { return I; }
};
using Lambda = decltype([](double I) { return 0.3 + 0.1 * I; });
static_assert(FrictionFunction<Line> && FrictionFunction<Lambda> && FrictionFunction<MuOfICurve>);
static_assert(Rheology<FrictionLaw<Line>> && Rheology<FrictionLaw<Lambda>>);
static_assert(MakesAFrictionLaw<Line> && MakesAFrictionLaw<Lambda>);
static_assert(!MakesAFrictionLaw<LineOfAnInteger> && !MakesAFrictionLaw<Words> &&
              !MakesAFrictionLaw<NotConst> && !MakesAFrictionLaw<double> &&
              !MakesAFrictionLaw<MuOfI>);
static_assert(!Rheology<Line>); // not yet: it says nothing about I

template <class R>
concept MakesASimulation = requires {
  typename Simulation<2, R, Apic, GaussSeidel<>>;
};
static_assert(MakesASimulation<FrictionLaw<Line>> && !MakesASimulation<Line> &&
              !MakesASimulation<NoFriction> && !MakesASimulation<double>);

struct NotAScheme {
  struct Params {};
  static constexpr ParticleField field = ParticleField::constant;
  explicit NotAScheme(const Params&) {}
};
static_assert(!TransferScheme<NotAScheme, 2>);
static_assert(!Solver<SecularSolver, 3>);
static_assert(!LocalSolver<Apic, CoulombLaw, 6>);

} // namespace

namespace {

template <class Law>
std::vector<Vec<2>> positions_after_steps() {
  typename Simulation<2, Law, Apic, GaussSeidel<>>::Params params;
  params.grid = {.size = {0.4, 0.2}, .cells = {8, 4}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 2e-3;
  params.rheology.mu = 0.3;
  params.faces = Faces<2>::all({FaceKind::no_slip});
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.1, 0.15}, {});
  Simulation<2, Law, Apic, GaussSeidel<>> sim(params, sand);
  for (int n = 0; n < 5; ++n)
    CHECK(sim.step().completed());
  CHECK(sim.particles().position != sand.position);
  return sim.particles().position;
}

} // namespace

TEST_CASE("a friction law of a user's own makes the same steps as the library's") {
  CHECK(positions_after_steps<Linear>() == positions_after_steps<ConstantFriction>());
}
