// SPDX-License-Identifier: MIT
// The trends that the studies of the paper report, on the smallest grids that show them.

#include "../support/collapse.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/scene/tilted_box.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

using namespace talus;

namespace {

struct Deposit {
  double runout, height;
};

Deposit b15_deposit(double mu) {
  const CollapseSetup setup = support::b15();
  auto params = support::collapse_params<scenes::Sim<2>>(setup, {0.04, 0.04, 0.02}, 3e-3);
  params.rheology.mu = mu;
  scenes::Sim<2> sim(params, setup.particles<2>(Grid<2>(params.grid), {.per_axis = 3}));
  while (sim.time() < 1.5)
    CHECK(sim.step().completed());
  const Profile profile = measure_profile(sim);
  return {front_position(profile, setup.bed_depth + 0.002) - setup.column_length,
          profile.height.front() - setup.bed_depth};
}

} // namespace

TEST_CASE("the less friction, the longer and flatter the deposit") {
  const Deposit stop = b15_deposit(0.38), avalanche = b15_deposit(0.44), rest = b15_deposit(0.54);
  CHECK(stop.runout > avalanche.runout + 0.02);
  CHECK(avalanche.runout > rest.runout + 0.02);
  CHECK(stop.height < avalanche.height - 0.002);
  CHECK(avalanche.height < rest.height - 0.002);
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
