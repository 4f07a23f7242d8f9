// SPDX-License-Identifier: MIT
// Material that is poured: the slope of the heap, and the level of a hopper that is refilled.

#include "../support/about.hpp"
#include "scenes.hpp"

#include "talus/boundary/floor.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/scene/source.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

namespace test_pour {

using namespace talus;

TEST_CASE("a wedge that is poured slowly has the slope of the angle of friction") {
  // 8 cells high. Within 3°: a slope under a stream is up to 2° steeper, and moves.
  for (const double friction : {0.3, 0.45}) {
    CAPTURE(friction);
    const double cell = 0.01, heap = 0.08, seconds = 3, half = 1.4 * heap / friction;
    auto params =
        scenes::box<2>({half, 0, 0.12}, {static_cast<int>(half / cell), 1, 12}, 0, friction);
    params.faces.upper[0].kind = FaceKind::open;
    params.time_step = 1.6e-3;
    params.exchange =
        make_source<2>(Grid<2>(params.grid), {.lower = {0, 0.1},
                                              .upper = {0.015, 0.1},
                                              .velocity = {0, -0.4},
                                              .flux = heap * heap / friction / 2 / seconds,
                                              .time = {.end = seconds}});
    scenes::Sim<2> sim(params, {});
    double in = 0, out = 0, angle = 0, count = 0;
    while (sim.time() < seconds) {
      const StepReport report = sim.step();
      REQUIRE(report.completed());
      in += report.inflow_volume;
      out += report.outflow_volume;
      if (sim.time() < 0.6 * seconds || sim.steps() % 20 != 0)
        continue;
      const auto slope = profile_beyond(measure_profile(sim), 0.03);
      const double top = slope.height.front();
      const auto line = fit_line_between(slope.x, slope.height, 0.2 * top, 0.9 * top);
      angle += std::atan(-line.slope);
      ++count;
    }
    CHECK(in == support::about(heap * heap / friction / 2));
    CHECK(total_volume(sim.particles()) + out == support::about(in));
    const double degree = std::atan(1.0) / 45;
    CAPTURE(angle / count / degree);
    CHECK(std::abs(angle / count - std::atan(friction)) < 3 * degree);
  }
}

TEST_CASE("a hopper that is refilled keeps its level, and empties at a steady rate") {
  const double width = 0.15, height = 0.15;
  auto params = scenes::box<2>({width, 0, height + 0.03}, {15, 1, 18}, 0, 0.44);
  params.time_step = 1.6e-3;
  params.faces.lower[0] = params.faces.upper[0] = {FaceKind::frictional, 0.23};
  params.faces.lower[1].kind = FaceKind::open;
  params.obstacles = {
      make_obstacle<Floor<2>>({.centre = {width / 2, 0}, .opening = 0.07, .friction = 0.23})};
  const Grid<2> grid(params.grid);
  params.exchange =
      make_source<2>(grid, {.lower = {0, height}, .upper = {width, height}, .velocity = {0, -0.8}});
  Particles<2> sand;
  fill_box<2>(sand, grid, {0, 0}, {width, height}, {});
  scenes::Sim<2> sim(params, sand);
  std::vector<double> rates, levels;
  double out = 0;
  while (sim.time() < 2.1) {
    const StepReport report = sim.step();
    REQUIRE(report.completed());
    if (sim.time() > 0.5)
      out += report.outflow_volume;
    if (sim.time() > 0.5 + 0.5 * static_cast<double>(rates.size() + 1)) {
      rates.push_back(out / 0.5);
      levels.push_back(total_volume(sim.particles()) / width);
      out = 0;
    }
  }
  for (std::size_t k = 0; k < rates.size(); ++k) {
    CAPTURE(rates[k]);
    CAPTURE(levels[k]);
    CHECK(rates[k] == support::about(rates[0], 0.1));
    CHECK(levels[k] == support::about(height, 0.05));
  }
}

} // namespace test_pour
