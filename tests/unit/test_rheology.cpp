// SPDX-License-Identifier: MIT

#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

namespace test_rheology {

using namespace talus;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
const InertialNumber beads{.grain_diameter = 5e-4, .density = 1470, .strain_factor = 1};

/// What the exception says that `make` throws.
template <class Make>
std::string refusal(const Make& make) {
  try {
    static_cast<void>(make());
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

const MuOfICurve jop{.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279};
const HystereticCurve hysteretic{.mu = 0.38, .mu_excess = 0.16, .I_star = 0.04};

} // namespace

TEST_CASE("friction laws at their known points") {
  CHECK(ConstantFriction({.mu = 0.38}).friction(1) == 0.38);
  const MuOfI mu_i({.law = jop, .inertial = beads});
  CHECK(mu_i.friction(0) == 0.38);
  CHECK(mu_i.friction(0.279) == doctest::Approx((0.38 + 0.64) / 2));
  CHECK(mu_i.friction(infinity) == 0.64);
  const HystereticFriction ramp({.law = hysteretic, .inertial = beads});
  CHECK(ramp.friction(0) == doctest::Approx(0.54));
  CHECK(ramp.friction(0.02) == doctest::Approx(0.46));
  CHECK(ramp.friction(0.04) == doctest::Approx(0.38));
  CHECK(ramp.friction(infinity) == doctest::Approx(0.38));
  HystereticCurve sudden = hysteretic;
  sudden.shape = HystereticCurve::Shape::step;
  const HystereticFriction step({.law = sudden, .inertial = beads});
  CHECK(step.friction(0.039) == doctest::Approx(0.54));
  CHECK(step.friction(0.04) == doctest::Approx(0.38));
}

TEST_CASE("inertial number: value and limits") {
  const InertialNumber inertial{.grain_diameter = 5e-4, .density = 1470, .strain_factor = 2};
  CHECK(inertial(10, 100) == doctest::Approx(5e-4 * 2 * 10 / std::sqrt(100 / 1470.0)));
  CHECK(inertial(0, 100) == 0);
  CHECK(inertial(0, 0) == 0);
  CHECK(inertial(1, 0) == infinity);
  CHECK(inertial(1, -3) == infinity); // tension holds no grains together
  // on the way to the limits: towards them, without a jump and never NaN
  const MuOfI mu_i({.law = jop, .inertial = inertial});
  for (double small = 1; small > 1e-300; small /= 1024) {
    const double I = inertial(small, 1);
    CHECK(mu_i.friction(I) == doctest::Approx(0.38 + 0.26 * I / (I + 0.279)).epsilon(1e-12));
    CHECK(I / small == doctest::Approx(1e-3 * std::sqrt(1470)));
    const double fast = inertial(1, small);
    CHECK(fast * std::sqrt(small) == doctest::Approx(1e-3 * std::sqrt(1470)));
    CHECK(mu_i.friction(fast) ==
          doctest::Approx(0.38 + 0.26 * fast / (fast + 0.279)).epsilon(1e-12));
  }
  const double least = std::numeric_limits<double>::denorm_min();
  CHECK(inertial(least, 1) == 0);
  CHECK(mu_i.friction(inertial(1, least)) == doctest::Approx(0.64));
  CHECK(inertial(least, least) == infinity); // as without pressure
}

TEST_CASE("friction laws refuse nonsense by name and value") {
  CHECK(refusal([] { return ConstantFriction({.mu = -1}); }) ==
        "rheology.mu is -1; allowed: a finite number >= 0");
  CHECK(refusal([] {
          return MuOfI({.law = {.mu_static = 0.5, .mu_limit = 0.4, .I_0 = 0.3}, .inertial = beads});
        }) == "rheology.law.mu_limit is 0.4; allowed: a number >= rheology.law.mu_static");
  CHECK(refusal([] {
          return HystereticFriction(
              {.law = {.mu = 0.38, .mu_excess = 0.16, .I_star = 0}, .inertial = beads});
        }) == "rheology.law.I_star is 0; allowed: a finite number > 0");
  CHECK(
      refusal([] { return MuOfI({}); }).starts_with("rheology.law.mu_static is nan, not given; "));
  CHECK(refusal([] {
          return HystereticFriction({});
        }).starts_with("rheology.law.mu is nan, not given; "));
  CHECK(refusal([] { return MuOfI({.law = jop}); }) ==
        "rheology.inertial.grain_diameter is 0; allowed: a finite number > 0");
  CHECK(refusal([] { // which measure of the strain rate is not guessed
          return MuOfI({.law = jop, .inertial = {.grain_diameter = 1, .density = 1}});
        }) == "rheology.inertial.strain_factor is 0; allowed: a finite number > 0");
  CHECK(refusal([] {
          return MuOfI(
              {.law = jop, .inertial = {.grain_diameter = 1, .density = 1, .strain_factor = -2}});
        }) == "rheology.inertial.strain_factor is -2; allowed: a finite number > 0");
}

TEST_CASE("a user's law: a lambda, a struct, a function made at run time") {
  using Lambda = FrictionLaw<decltype([](double I) { return 0.4 + 0.1 * std::min(I, 1.0); })>;
  CHECK(Lambda({.inertial = beads}).friction(0.5) == doctest::Approx(0.45));
  using AtRunTime = FrictionLaw<std::function<double(double)>>;
  const double slope = 0.2;
  CHECK(AtRunTime({.law = [slope](double I) { return 0.3 + slope * std::min(I, 1.0); },
                   .inertial = beads})
            .friction(infinity) == doctest::Approx(0.5));
  // a lambda with captures, which has no default and cannot be assigned
  const auto line = [slope](double I) { return 0.3 + slope * std::min(I, 1.0); };
  using Captures = FrictionLaw<decltype(line)>;
  CHECK(Captures({.law = line, .inertial = beads}).friction(infinity) == doctest::Approx(0.5));
  Simulation<2, Captures, Apic, GaussSeidel<>>::Params params;
  params.rheology = {.law = line, .inertial = beads};
  const auto copy = params;
  CHECK(Captures(copy.rheology).friction(0.5) == doctest::Approx(0.4));
  CHECK(refusal([] { return Captures({.inertial = beads}); }) ==
        "rheology.law is not given; allowed: a function of the inertial number");
  using Pointer = FrictionLaw<double (*)(double)>;
  CHECK(Pointer({.law = [](double) { return 0.5; }, .inertial = beads}).friction(1) == 0.5);
  CHECK(refusal([] { return Pointer({.inertial = beads}); }) ==
        "rheology.law is not given; allowed: a function of the inertial number");
  CHECK(refusal([] { return AtRunTime({.inertial = beads}); }) ==
        "rheology.law is not given; allowed: a function of the inertial number");
  // what gives no friction somewhere is refused at once
  const auto refused = [](std::function<double(double)> law) {
    return refusal([&] { return AtRunTime({.law = law, .inertial = beads}); });
  };
  CHECK(refused([](double I) { return 0.4 + I; }) ==
        "rheology.law at I = inf is inf; allowed: a finite number >= 0");
  CHECK(refused([](double I) { return 0.4 - std::min(I, 1.0); }) ==
        "rheology.law at I = 1 is -0.6; allowed: a finite number >= 0");
  CHECK(refused([](double I) { return 0.4 * I / I; }).starts_with("rheology.law at I = 0 is "));
}

TEST_CASE("a law that gives no friction during a run stops the step, and the report says so") {
  // Good at all the numbers that the constructor tries.
  struct Gap {
    double bad = -0.1;
    double operator()(double I) const { return I > 0.011 && I < 0.099 ? bad : 0.4; }
  };
  using Sim = Simulation<2, FrictionLaw<Gap>, PolyPic, GaussSeidel<>>;
  for (const double bad : {-0.1, std::nan(""), infinity}) {
    Sim::Params params;
    params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {16, 8}};
    params.material.density = 1470;
    params.gravity = {0, -9.81};
    params.time_step = 2e-3;
    params.rheology = {.law = {.bad = bad}, .inertial = beads};
    params.faces = Faces<2>::all({FaceKind::free_slip});
    params.faces.lower[1] = {FaceKind::no_slip};
    params.faces.upper[1] = {FaceKind::open};
    Particles<2> particles;
    fill_box<2>(particles, Grid<2>(params.grid), {0, 0}, {0.1, 0.15}, {.per_axis = 2});
    Sim sim(params, particles);
    StepReport report;
    for (int n = 0; n < 100 && report.completed(); ++n) {
      CHECK(report.invalid_friction == 0);
      particles = sim.particles();
      report = sim.step();
    }
    CHECK(!report.completed());
    CHECK(report.solve.status == SolveStatus::not_finite);
    CHECK(report.invalid_friction > 0);
    CHECK(report.invalid_friction < report.cones);
    for (std::size_t p = 0; p < particles.size(); ++p) {
      CHECK(sim.particles().id[p] == particles.id[p]);
      CHECK(sim.particles().position[p] == particles.position[p]);
    }
  }
}

} // namespace test_rheology
