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
  CHECK(coarse < 0.4); // 1/s
  for (const double shorter : {5e-4, 2.5e-4})
    CHECK(accuracy::vortex_loss(setting(0.01, shorter)) < 1.15 * coarse);
  CHECK(accuracy::vortex_loss(setting(0.005, 5e-4)) < coarse / 2.5); // order 1.3
  // the reason why: what APIC loses goes as 1/δt
  const double apic = accuracy::vortex_loss(setting<Apic>(0.01, 1e-3));
  CHECK(apic > 2 * coarse);
  CHECK(accuracy::vortex_loss(setting<Apic>(0.01, 5e-4)) > 1.5 * apic);
}

TEST_CASE("a disc that turns keeps energy and angular momentum, to second order in the cell") {
  const accuracy::Rotation coarse = accuracy::disc_turns(setting(0.01, 1e-3));
  CHECK(std::abs(coarse.energy) < 1e-3);
  CHECK(std::abs(coarse.angular_momentum) < 1e-3);
  for (const double shorter : {5e-4, 2.5e-4}) {
    const accuracy::Rotation other = accuracy::disc_turns(setting(0.01, shorter));
    CHECK(other.energy == support::about(coarse.energy, 0.05));
    CHECK(other.angular_momentum == support::about(coarse.angular_momentum, 0.05));
  }
  const accuracy::Rotation fine = accuracy::disc_turns(setting(0.005, 5e-4));
  CHECK(std::abs(fine.energy) < std::abs(coarse.energy) / 3.5);
  CHECK(std::abs(fine.angular_momentum) < std::abs(coarse.angular_momentum) / 3.5);
}

TEST_CASE("a layer slides over its own bed as a block does, also if it is thin") {
  const double exact = -1.630; // m/s²
  for (const double layer : {0.006, 0.01, 0.02, 0.04}) {
    CAPTURE(layer);
    const double coarse = accuracy::sliding_layer(setting(0.01, 1e-3), layer);
    CHECK(coarse == support::about(exact, 0.06));
    CHECK(accuracy::sliding_layer(setting(0.01, 5e-4), layer) == support::about(coarse, 0.005));
  }
  // What is thinner than a cell is off; halving the cell takes away more than half of that.
  for (const double layer : {0.003, 0.006}) {
    CAPTURE(layer);
    const double coarse = accuracy::sliding_layer(setting(0.01, 1e-3), layer);
    const double off = std::abs(coarse - exact);
    CHECK(off < 0.15 * std::abs(exact));
    CHECK(accuracy::sliding_layer(setting(0.01, 2.5e-4), layer) == support::about(coarse, 0.005));
    CHECK(std::abs(accuracy::sliding_layer(setting(0.005, 5e-4), layer) - exact) < off / 2);
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
  auto fine = setting(0.005, 5e-4);
  fine.jitter = 0.5;
  const accuracy::Landing landing = accuracy::block_lands(fine);
  CHECK(std::abs(landing.gap) < 0.03 * 0.1 / 2);
  CHECK(landing.rebound < 0.02);
}

TEST_CASE("a slab that hits a column shares its momentum with it") {
  for (const double time_step : {1e-3, 5e-4}) { // shorter ones meet early: docs/accuracy.md
    const accuracy::Collision falling = accuracy::slab_hits_column(setting(0.01, time_step));
    CHECK(std::abs(falling.momentum) < 1e-12);
    CHECK(falling.spread < 0.01);
  }
  // Rates in units of sqrt(g/h) damp nothing without gravity; the error falls with the cell only.
  const accuracy::Collision coarse = accuracy::slab_hits_column(setting(0.01, 1e-3), 0);
  CHECK(std::abs(coarse.momentum) < 1e-12);
  CHECK(coarse.spread < 0.15);
  CHECK(accuracy::slab_hits_column(setting(0.005, 5e-4), 0).spread < 0.9 * coarse.spread);
  CHECK(accuracy::slab_hits_column(setting(0.0025, 2.5e-4), 0).spread < 0.65 * coarse.spread);
}

} // namespace test_accuracy
