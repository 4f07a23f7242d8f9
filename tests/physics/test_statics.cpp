// SPDX-License-Identifier: MIT
// Beds that must stay at rest, and what they press on.

#include "../support/about.hpp"
#include "../support/nodes.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/profile.hpp"

#include <doctest/doctest.h>

namespace test_statics {

using namespace talus;

namespace {

template <int Dim>
void hydrostatic(int steps, double mu) {
  const double height = 0.1;
  const auto params = scenes::box<Dim>({0.1, 0.06, 0.13}, {5, 3, 13}, 0, mu);
  scenes::Sim<Dim> sim(params, scenes::block<Dim>(params.grid, 0, 0.1, 0, height));
  const auto start = centre_of_mass(sim.particles());
  double fastest = 0;
  for (int n = 0; n < steps; ++n) {
    const StepReport report = sim.step();
    CHECK(report.solve.status == SolveStatus::converged);
    fastest = std::max(fastest, largest_speed(sim));
  }
  CHECK(fastest < 1e-4); // m/s
  CHECK((centre_of_mass(sim.particles()) - start).norm() < 1e-4 * height);
  // The mean of σ_zz over a horizontal section is ρ g (H − z). With friction single values are not
  // determined, nor is the pressure, which is a mean over all directions.
  const int up = up_axis<Dim>;
  for (int k = 1; k < 9; ++k) {
    const double mean = nodes::mean_vertical_stress(sim, k, [&](const Index<Dim>& index) {
      if (mu == 0) // a fluid: the same in all directions
        CHECK(sim.pressure(index) == doctest::Approx(sim.stress(index)(up, up)));
    });
    const double weight = 1500 * 9.81 * (height - sim.grid().spacing()[up] * k);
    CHECK(mean == support::about(weight, 0.02));
  }
}

/// Largest speed of a bed whose box is tilted, after a while.
template <int Dim>
double speed_of_tilted_bed(double angle_deg, double seconds) {
  const auto params = scenes::box<Dim>({0.4, 0.04, 0.12}, {20, 2, 12}, angle_deg, 0.44);
  scenes::Sim<Dim> sim(params, scenes::block<Dim>(params.grid, 0, 0.4, 0, 0.06));
  while (sim.time() < seconds)
    static_cast<void>(sim.step().completed());
  return largest_speed(sim);
}

} // namespace

TEST_CASE("a hydrostatic column stays at rest over 10^4 steps, 2-D") {
  hydrostatic<2>(10000, 0.44);
  hydrostatic<2>(100, 0);
}
TEST_CASE("a hydrostatic column stays at rest, 3-D") {
  hydrostatic<3>(200, 0.44);
  hydrostatic<3>(100, 0);
}

TEST_CASE("a loose column falls together until it is dense, and no further") {
  const auto params = scenes::box<2>({0.1, 0, 0.13}, {5, 1, 13}, 0, 0.44);
  auto loose = scenes::block<2>(params.grid, 0, 0.1, 0, 0.1);
  for (double& volume : loose.volume)
    volume *= 0.7;
  scenes::Sim<2> sim(params, loose);
  CHECK(sim.step().completed());
  CHECK(sim.volume_fraction({2, 5}) == doctest::Approx(0.7));
  while (sim.time() < 1)
    CHECK(sim.step().completed());
  // dense but for the slack and the noise of the positions
  CHECK(sim.volume_fraction({2, 3}) > 0.97);
  const double height = measure_profile(sim).height[2];
  CHECK(height < 0.072);
  CHECK(height > 0.069);
  CHECK(largest_speed(sim) < 1e-3);
}

TEST_CASE("a bed rests below the friction angle, 23.75 degrees, and flows above it") {
  CHECK(speed_of_tilted_bed<2>(15, 0.3) < 1e-3);
  CHECK(speed_of_tilted_bed<2>(30, 0.3) > 0.05);
  CHECK(speed_of_tilted_bed<3>(15, 0.1) < 1e-3);
  CHECK(speed_of_tilted_bed<3>(30, 0.1) > 0.02);
}

TEST_CASE("a bed of jittered particles comes to rest, which it does not by the plain method") {
  const auto speed = [](auto transfer, const Packing& packing) {
    using Transfer = decltype(transfer);
    const auto box = scenes::box<2>({1, 0.1, 0.2}, {50, 1, 20}, 15, 0.44);
    typename scenes::Sim<2, Transfer>::Params params;
    params.grid = box.grid;
    params.material = box.material;
    params.gravity = box.gravity;
    params.time_step = box.time_step;
    params.rheology = box.rheology;
    params.faces = box.faces;
    params.solver = box.solver;
    params.packing = packing;
    Particles<2> particles;
    fill_box<2>(particles, Grid<2>(params.grid), {0, 0}, {1, 0.1}, {.per_axis = 3, .jitter = 0.5});
    scenes::Sim<2, Transfer> sim(params, particles);
    double fastest = 0;
    while (sim.time() < 1.5) {
      CHECK(sim.step().completed());
      if (sim.time() > 1)
        fastest = std::max(fastest, largest_speed(sim));
    }
    return fastest;
  };
  CHECK(speed(PolyPic(), {}) < 2e-4);
  CHECK(speed(Apic(), {.slack = 0, .dilatancy = 0, .surfaces = false}) > 4e-4);
}

TEST_CASE("with even packing stresses are the weight above, wherever the particles lie") {
  constexpr double height = 0.1, width = 0.2, weight = 1500 * 9.81; // of a volume, N/m³
  auto params = scenes::box<2>({width, 0, 0.13}, {20, 1, 26}, 0, 0.44);
  params.packing.even = true;
  Particles<2> particles;
  fill_box<2>(particles, Grid<2>(params.grid), {0, 0}, {width, height},
              {.per_axis = 4, .jitter = 0.5});
  scenes::Sim<2> sim(params, particles);
  while (sim.time() < 0.5)
    REQUIRE(sim.step().completed());
  CHECK(largest_speed(sim) < 1e-4); // m/s
  const double h = sim.grid().spacing()[1];
  double mean = 0;
  constexpr int rows = 16;
  for (int k = 1; k <= rows; ++k) {
    double above = 0; // of the row, with a hat's integral as weight, m
    for (std::size_t p = 0; p < sim.particles().size(); ++p) {
      const double z = std::clamp(sim.particles().position[p][1] / h - k, -1.0, 1.0);
      const double share = z < 0 ? (1 + z) * (1 + z) / 2 : 1 - (1 - z) * (1 - z) / 2;
      above += sim.particles().volume[p] * share / width;
    }
    const double stress = nodes::mean_vertical_stress(sim, k, [](const Index<2>&) {});
    CHECK(stress == support::about(weight * above, 0.01));
    mean += stress / (weight * above) / rows;
  }
  CHECK(mean == support::about(1, 0.002));
}

} // namespace test_statics
