// SPDX-License-Identifier: MIT
// The trends that the studies of the paper report, on the smallest grids that show them.

#include "../support/about.hpp"
#include "../support/collapse.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/find_root.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/quantiles.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/tilted_box.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace test_studies {

using namespace talus;

namespace {

struct Deposit {
  double runout, height; // m
};

template <class Sim>
Deposit deposit(const Sim& sim, const CollapseSetup& setup) {
  const Profile profile = measure_profile(sim, 0); // at the side wall, as the paper
  return {front_position(profile, setup.bed_depth + 0.002) - setup.column_length,
          profile.height.front() - setup.bed_depth};
}

/// A collapse that has run for `seconds`. cell: along, across and up, m.
template <int Dim, class Rheology = ConstantFriction>
auto collapsed(const CollapseSetup& setup, const Vec<3>& cell, double time_step, double seconds,
               const typename Rheology::Params& rheology = {.mu = 0.44}) {
  using Sim = Simulation<Dim, Rheology, PolyPic, GaussSeidel<>>;
  auto params = support::collapse_params<Sim>(setup, cell, time_step);
  params.rheology = rheology;
  Sim sim(params, setup.particles<Dim>(Grid<Dim>(params.grid), {.per_axis = 5 - Dim}));
  while (sim.time() < seconds)
    CHECK(sim.step().completed());
  return sim;
}

template <class Rheology = ConstantFriction>
Deposit b15_deposit(const typename Rheology::Params& rheology) {
  const CollapseSetup setup = support::b15();
  return deposit(collapsed<2, Rheology>(setup, {0.04, 0.04, 0.02}, 3e-3, 1.5, rheology), setup);
}

} // namespace

TEST_CASE("the less friction, the longer and flatter the deposit") {
  const Deposit stop = b15_deposit({0.38}), avalanche = b15_deposit({0.44});
  const Deposit rest = b15_deposit({0.54});
  CHECK(stop.runout > avalanche.runout + 0.02);
  CHECK(avalanche.runout > rest.runout + 0.02);
  CHECK(stop.height < avalanche.height - 0.002);
  CHECK(avalanche.height < rest.height - 0.002);
}

TEST_CASE("mu(I) runs farther than the avalanche friction, hysteresis less far") {
  const InertialNumber beads{.grain_diameter = 0.5e-3, .density = 1470, .strain_factor = 1};
  const HystereticCurve curve{.mu = 0.38, .mu_excess = 0.16, .I_star = 0.04};
  HystereticCurve step = curve;
  step.shape = HystereticCurve::Shape::step;
  const Deposit mu_of_i = b15_deposit<MuOfI>(
      {.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279}, .inertial = beads});
  const Deposit ramp = b15_deposit<HystereticFriction>({.law = curve, .inertial = beads});
  const Deposit stepped = b15_deposit<HystereticFriction>({.law = step, .inertial = beads});
  const Deposit flowing = b15_deposit({0.38}), avalanche = b15_deposit({0.44});
  const Deposit resting = b15_deposit({0.54}); // hysteresis at rest
  CHECK(flowing.runout > mu_of_i.runout);
  CHECK(mu_of_i.runout > avalanche.runout);
  CHECK(mu_of_i.height < avalanche.height);
  CHECK(avalanche.runout > ramp.runout);
  CHECK(ramp.runout > stepped.runout); // its friction falls sooner
  CHECK(stepped.runout > resting.runout - 0.01);
}

TEST_CASE("a narrow channel keeps the deposit higher at the wall, and shorter") {
  const auto in_channel = [](double width) {
    CollapseSetup setup = support::b15();
    setup.inclination_deg = 0;
    setup.column_length = setup.column_height = 0.12;
    setup.length = 0.6;
    setup.width = width;
    return deposit(collapsed<3>(setup, {0.02, width / 2, 0.01}, 3e-3, 0.7), setup);
  };
  const Deposit narrow = in_channel(0.01), wide = in_channel(0.04);
  CHECK(narrow.height > wide.height + 0.005);
  CHECK(narrow.runout < wide.runout - 0.02);
}

TEST_CASE("walls act as friction that grows with height over width") {
  const double height = 0.12; // m, with a = 1
  CollapseSetup setup = support::b15();
  setup.column_length = setup.column_height = height;
  setup.length = 0.9;
  const Vec<3> cell(0.03, 0.03, 0.015);
  const auto equivalent = [&](double width) { // μ_2D of the same H_f
    CollapseSetup channel = setup;
    channel.width = width;
    const Vec<3> across(cell[0], width / 3, cell[2]);
    const double wanted = deposit(collapsed<3>(channel, across, 4e-3, 0.9), channel).height;
    const Root root = find_root(
        [&](double mu) {
          return deposit(collapsed<2>(setup, cell, 4e-3, 0.9, {mu}), setup).height - wanted;
        },
        0.4, 0.7, 0.01, 2e-4);
    CHECK(root.found);
    return root.x;
  };
  const double narrow = equivalent(0.03), wide = equivalent(0.12);
  CHECK(wide > 0.44);
  CHECK(narrow > wide + 0.03);
  // less than μ_w H_0/W, of which Ionescu et al. 2015 take half
  CHECK(narrow < 0.44 + 0.23 / 2 * height / 0.03);
}

TEST_CASE("a tall column runs out in proportion to its aspect ratio, and sinks more") {
  const auto with_ratio = [](double ratio) { // run-out over L_0, H_0 over H_f
    CollapseSetup setup;
    setup.wall_friction = setup.gate_friction = 0;
    setup.column_length = 0.1;
    setup.column_height = 0.1 * ratio;
    setup.length = 1.2;
    setup.height = setup.column_height + 0.05;
    const Deposit d = deposit(collapsed<2>(setup, {0.02, 0.02, 0.01}, 1.5e-3, 1.5), setup);
    return Deposit{d.runout / setup.column_length, setup.column_height / d.height};
  };
  const Deposit low = with_ratio(1), tall = with_ratio(4);
  CHECK(tall.runout / low.runout == support::about(4, 0.25)); // 2.0 a in the paper
  CHECK(tall.height > 1.5 * low.height);
}

TEST_CASE("the gate's friction shows early, near the gate, and not in the deposit") {
  const auto with_gate = [](double friction, double seconds) {
    CollapseSetup setup = support::b15();
    setup.gate_friction = friction;
    return collapsed<2>(setup, {0.02, 0.02, 0.01}, 1.66e-3, seconds);
  };
  const CollapseSetup setup = support::b15();
  const auto height_at_gate = [&](double friction) {
    return measure_profile(with_gate(friction, 0.15)).height[11]; // x = 0.22 m
  };
  CHECK(std::abs(height_at_gate(1) - height_at_gate(0.18)) > 0.003);
  const Deposit rough = deposit(with_gate(1, 1.5), setup);
  const Deposit smooth = deposit(with_gate(0.18, 1.5), setup);
  CHECK(rough.height == support::about(smooth.height, 0.05));
  CHECK(rough.runout == support::about(smooth.runout, 0.05));
}

TEST_CASE("the inertial number of B15 is of the order of a hundredth") {
  using Sim = Simulation<2, MuOfI, PolyPic, GaussSeidel<>>;
  const CollapseSetup setup = support::b15();
  auto params = support::collapse_params<Sim>(setup, {0.02, 0.02, 0.01}, 1.66e-3);
  params.rheology.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279};
  params.rheology.inertial.grain_diameter = 0.5e-3;
  params.rheology.inertial.density = params.material.density;
  params.rheology.inertial.strain_factor = 1;
  Sim sim(params, setup.particles<2>(Grid<2>(params.grid), {.per_axis = 3}));
  while (sim.time() < 0.5)
    CHECK(sim.step().completed());
  const InertialQuantiles numbers = inertial_quantiles(sim);
  CHECK(numbers.nodes > 50);
  CHECK(numbers.median > 3e-3);
  CHECK(numbers.median < 5e-2);
}

TEST_CASE("a bed follows its box below the friction angle, and does not above") {
  const TiltedBoxSetup setup;
  const auto surface_angle = [&](double tilt) {
    scenes::Sim<2>::Params params;
    params.grid = setup.grid<2>({50, 1, 30});
    params.material.density = 1470;
    params.gravity = setup.gravity_vector<2>(tilt);
    params.time_step = 2e-3;
    params.faces = setup.faces<2>();
    params.rheology.mu = 0.44;
    scenes::Sim<2> sim(params,
                       setup.particles<2>(Grid<2>(params.grid), {.per_axis = 4, .jitter = 0}));
    while (sim.time() < 2)
      CHECK(sim.step().completed());
    const Profile profile = measure_profile(sim);
    std::vector<double> x, height;
    for (std::size_t i = 15; i <= 35; ++i) {
      x.push_back(profile.x[i]);
      height.push_back(profile.height[i]);
    }
    return tilt - std::atan(fit_line(x, height).slope) * 180 / std::numbers::pi;
  };
  CHECK(surface_angle(20) == support::about(20, 0.005));
  CHECK(surface_angle(30) < 24.5);
}

} // namespace test_studies
