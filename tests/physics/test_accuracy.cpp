// SPDX-License-Identifier: MIT
// Flows with a known answer: errors do not depend on the time step and fall with the cell.

#include "../support/about.hpp"
#include "../support/accuracy.hpp"

#include <doctest/doctest.h>

#include <cmath>

namespace test_accuracy {

using namespace talus;

namespace {

template <class Transfer = PolyPic>
accuracy::Setting<Transfer> setting(double cell, double time_step) {
  accuracy::Setting<Transfer> s;
  s.cell = cell;
  s.time_step = time_step;
  return s;
}

} // namespace

TEST_CASE("a vortex keeps its energy whatever the time step, and its loss falls with the cell") {
  const double coarse = accuracy::vortex_loss(setting(0.01, 1e-3));
  const double short_steps = accuracy::vortex_loss(setting(0.01, 5e-4));
  const double fine = accuracy::vortex_loss(setting(0.005, 1e-3));
  CHECK(coarse < 0.4); // 1/s
  CHECK(short_steps < 1.15 * coarse);
  CHECK(fine < coarse / 2); // first order at least
  // the reason why: what APIC loses goes as 1/δt
  const double apic = accuracy::vortex_loss(setting<Apic>(0.01, 1e-3));
  CHECK(apic > 2 * coarse);
  CHECK(accuracy::vortex_loss(setting<Apic>(0.01, 5e-4)) > 1.5 * apic);
}

TEST_CASE("a layer slides over its own bed as a block does, also if it is thin") {
  const double exact = -1.630; // m/s²
  for (const double time_step : {1e-3, 5e-4}) {
    CAPTURE(time_step);
    for (const double layer : {0.006, 0.01, 0.02, 0.04}) {
      CAPTURE(layer);
      CHECK(accuracy::sliding_layer(setting(0.01, time_step), layer) ==
            support::about(exact, 0.06));
    }
  }
}

TEST_CASE("a block that lands leaves no gap, does not rebound and comes to rest") {
  for (const double jitter : {0.0, 0.5, 1.0}) {
    CAPTURE(jitter);
    auto s = setting(0.01, 1e-3);
    s.jitter = jitter;
    const accuracy::Landing landing = accuracy::block_lands(s);
    CHECK(std::abs(landing.gap) < 0.03 * 0.1); // the slack, 2 %, and the noise of the packing
    CHECK(landing.rebound < 0.02);
    CHECK(landing.rest < 0.5);   // s, below 1 mm/s
    CHECK(landing.noise < 5e-4); // m/s
  }
}

TEST_CASE("a slab that hits a column shares its momentum with it") {
  const accuracy::Collision falling = accuracy::slab_hits_column(setting(0.01, 1e-3));
  CHECK(std::abs(falling.momentum) < 1e-12);
  CHECK(falling.spread < 0.01);
  // Rates in units of sqrt(g/h) damp nothing without gravity; the error falls with the cell only.
  const accuracy::Collision coarse = accuracy::slab_hits_column(setting(0.01, 1e-3), 0);
  const accuracy::Collision fine = accuracy::slab_hits_column(setting(0.005, 5e-4), 0);
  CHECK(std::abs(coarse.momentum) < 1e-12);
  CHECK(coarse.spread < 0.15);
  CHECK(fine.spread < 0.9 * coarse.spread);
}

} // namespace test_accuracy
