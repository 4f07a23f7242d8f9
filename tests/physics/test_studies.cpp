// SPDX-License-Identifier: MIT
// The trends that the studies of the paper report, on the smallest grids that show them.

#include "../support/collapse.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/quantiles.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/tilted_box.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

using namespace talus;

namespace {

struct Deposit {
  double runout, height; // m
};

template <class Sim>
Deposit deposit(const Sim& sim, const CollapseSetup& setup) {
  const Profile profile = measure_profile(sim);
  return {front_position(profile, setup.bed_depth + 0.002) - setup.column_length,
          profile.height.front() - setup.bed_depth};
}

/// A collapse that has run for `seconds`. cell: along, across and up, m.
template <int Dim>
scenes::Sim<Dim> collapsed(const CollapseSetup& setup, const Vec<3>& cell, double time_step,
                           double seconds, double mu = 0.44) {
  auto params = support::collapse_params<scenes::Sim<Dim>>(setup, cell, time_step);
  params.rheology.mu = mu;
  scenes::Sim<Dim> sim(params, setup.particles<Dim>(Grid<Dim>(params.grid), {.per_axis = 5 - Dim}));
  while (sim.time() < seconds)
    CHECK(sim.step().completed());
  return sim;
}

Deposit b15_deposit(double mu) {
  const CollapseSetup setup = support::b15();
  return deposit(collapsed<2>(setup, {0.04, 0.04, 0.02}, 3e-3, 1.5, mu), setup);
}

} // namespace

TEST_CASE("the less friction, the longer and flatter the deposit") {
  const Deposit stop = b15_deposit(0.38), avalanche = b15_deposit(0.44), rest = b15_deposit(0.54);
  CHECK(stop.runout > avalanche.runout + 0.02);
  CHECK(avalanche.runout > rest.runout + 0.02);
  CHECK(stop.height < avalanche.height - 0.002);
  CHECK(avalanche.height < rest.height - 0.002);
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

TEST_CASE("a tall column runs out in proportion to its aspect ratio, and sinks more") {
  const auto with_ratio = [](double ratio) { // run-out over L_0, H_0 over H_f
    CollapseSetup setup;
    setup.column_length = 0.1;
    setup.column_height = 0.1 * ratio;
    setup.length = 1.2;
    setup.height = setup.column_height + 0.05;
    const Deposit d = deposit(collapsed<2>(setup, {0.02, 0.02, 0.01}, 1.5e-3, 1.5), setup);
    return Deposit{d.runout / setup.column_length, setup.column_height / d.height};
  };
  const Deposit low = with_ratio(1), tall = with_ratio(4);
  CHECK(tall.runout / low.runout == doctest::Approx(4).epsilon(0.25)); // 2.0 a in the paper
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
  CHECK(rough.height == doctest::Approx(smooth.height).epsilon(0.05));
  CHECK(rough.runout == doctest::Approx(smooth.runout).epsilon(0.05));
}

TEST_CASE("the inertial number of B15 is of the order of a hundredth") {
  using Sim = Simulation<2, MuOfI, Apic, GaussSeidel<>>;
  const CollapseSetup setup = support::b15();
  auto params = support::collapse_params<Sim>(setup, {0.02, 0.02, 0.01}, 1.66e-3);
  params.rheology.inertial.grain_diameter = 0.5e-3;
  params.rheology.inertial.density = params.material.density;
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
  CHECK(surface_angle(20) == doctest::Approx(20).epsilon(0.005));
  CHECK(surface_angle(30) < 24.5);
}
