// SPDX-License-Identifier: MIT
// Several materials, and friction that hangs on the place: statics and waves against theory.

#include "../support/about.hpp"
#include "../support/materials.hpp"
#include "../support/nodes.hpp"

#include "talus/diagnostics/profile.hpp"
#include "talus/rheology/local_friction.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace test_materials {

using namespace talus;
using support::about;

namespace {

/// Two layers of 0.05 m in a box with smooth walls stay as they are, whichever is above: the mean
/// of σ_zz over a horizontal section is Σ ρ_m g h_m of what lies above it.
template <int Dim>
void check_layers(double lower_density, double upper_density, double mu, int steps) {
  using S = scenes::Mixed<Dim>;
  constexpr int up = up_axis<Dim>;
  auto params = scenes::box_for<S>({0.1, 0.06, 0.13}, {5, 3, 13}, 0);
  params.solver.tolerance = 1e-7;
  params.rheology.list = {{.density = lower_density, .law = {.mu = mu}},
                          {.density = upper_density, .law = {.mu = mu / 2}}};
  Particles<Dim> particles;
  scenes::add_layer<Dim>(particles, params.grid, 0, 0.05, 0);
  scenes::add_layer<Dim>(particles, params.grid, 0.05, 0.1, 1);
  S sim(params, particles);
  for (int n = 0; n < steps; ++n)
    CHECK(sim.step().solve.status == SolveStatus::converged);
  CHECK(largest_speed(sim) < 1e-4);
  const double area = Dim == 3 ? 0.1 * 0.06 : 0.1, g = 9.81;
  CHECK(-sim.face_wrench(up, false).force[up] ==
        about((lower_density + upper_density) * g * 0.05 * area, 1e-6));
  for (int k = 1; k < 9; ++k) {
    const double above = std::min(0.05, 0.1 - 0.01 * k), below = 0.05 - std::min(0.05, 0.01 * k);
    CHECK(nodes::mean_vertical_stress(sim, k, [](const auto&) {}) ==
          about(g * (upper_density * above + lower_density * below), 0.02));
  }
}

/// Amplitude of the wave cos(k x), k = π/W, of the interface of two fluids (μ = 0) that fill a
/// closed box, over that at the start, by time. Each is half of the height.
struct Wave {
  static constexpr double width = 1, height = 0.5, start = 0.02; // m
  std::vector<double> time, amplitude;

  Wave(double lower_density, double upper_density, double seconds) {
    using S = scenes::Mixed<2>;
    auto params = scenes::box_for<S>({width, 0, height}, {32, 0, 16}, 0);
    params.faces = Faces<2>::all({FaceKind::free_slip});
    params.time_step = 0.01;
    params.packing.even = true; // fluids are sheared without end
    params.rheology.list = {{.density = lower_density, .law = {.mu = 0}},
                            {.density = upper_density, .law = {.mu = 0}}};
    Particles<2> particles;
    fill_box<2>(particles, Grid<2>(params.grid), {0, 0}, {width, height},
                {.per_axis = 6, .jitter = 0});
    particles.resize_material(particles.size());
    for (std::size_t p = 0; p < particles.size(); ++p) {
      const Vec<2>& x = particles.position[p];
      particles.material[p] = x[1] > height / 2 + start * std::cos(k() * x[0]) ? 1 : 0;
    }
    S sim(params, particles);
    const double first = moment(sim.particles());
    while (sim.time() < seconds) {
      CHECK(sim.step().completed());
      time.push_back(sim.time());
      amplitude.push_back(moment(sim.particles()) / first);
    }
  }

  static constexpr double k() { return std::numbers::pi / width; }
  static double moment(const Particles<2>& particles) {
    return volume_sum(particles, [&](std::size_t p) {
      return particles.material[p] == 0 ? std::cos(k() * particles.position[p][0]) : 0;
    });
  }
  /// ω² = g k (ρ₁ − ρ₂)/(ρ₁ coth k h₁ + ρ₂ coth k h₂), e.g. Lamb, Hydrodynamics, §231.
  static double omega2(double lower, double upper) {
    const double tanh = std::tanh(k() * height / 2);
    return 9.81 * k() * (lower - upper) / (lower + upper) * tanh;
  }
};

} // namespace

TEST_CASE(
    "layers: the pressure is the weight of what lies above, light on heavy or heavy on light") {
  check_layers<2>(2500, 1000, 0.44, 200);
  check_layers<2>(1000, 2500, 0.44, 200);
  check_layers<2>(2500, 1000, 0, 100);
  check_layers<3>(1000, 2500, 0.44, 60);
}

TEST_CASE("an interfacial wave has the frequency of theory") {
  const double omega = std::sqrt(Wave::omega2(2000, 1000));
  const double quarter = std::numbers::pi / 2 / omega;
  const Wave wave(2000, 1000, 2.1 * quarter);
  std::size_t n = 0;
  while (n < wave.time.size() && wave.amplitude[n] > 0)
    ++n;
  REQUIRE(n < wave.time.size());
  const double lowest = *std::min_element(wave.amplitude.begin(), wave.amplitude.end());
  MESSAGE("quarter of a period " << wave.time[n] << " s, of theory " << quarter << " s; to "
                                 << lowest);
  CHECK(wave.time[n] == about(quarter, 0.05));
  CHECK(lowest < -0.95);
  CHECK(lowest > -1.02);
}

TEST_CASE("heavy above light turns over as fast as theory has it") {
  const double sigma = std::sqrt(-Wave::omega2(1000, 2000));
  const Wave wave(1000, 2000, 1.5 / sigma);
  MESSAGE("grown by " << wave.amplitude.back() << ", of theory "
                      << std::cosh(sigma * wave.time.back()));
  CHECK(wave.amplitude.back() == about(std::cosh(sigma * wave.time.back()), 0.05));
}

TEST_CASE("a slope holds where friction is above tan(theta), and slides where it is below") {
  const auto law = [](const FlowState<2>& at) { return at.position[0] < 0.48 ? 1 : 0.2; };
  using S = Simulation<2, LocalFriction<decltype(law)>, PolyPic, GaussSeidel<>>;
  auto params = scenes::box_for<S>({0.96, 0, 0.1}, {48, 0, 5}, 25);
  params.material.density = 1500;
  params.rheology.law = law;
  params.faces.upper[0].kind = FaceKind::open; // nothing stops what slides
  S sim(params, scenes::block<2>(params.grid, 0, 0.96, 0, 0.06));
  while (sim.time() < 0.2)
    CHECK(sim.step().completed());
  double held = 0, slid = 0, count = 0;
  const auto& particles = sim.particles();
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const double x = particles.position[p][0];
    if (x < 0.24) // the edge of what holds crumbles
      held = std::max(held, particles.velocity[p].norm());
    if (x > 0.6 && x < 0.8 && particles.position[p][1] > 0.03) {
      slid += particles.velocity[p][0];
      ++count;
    }
  }
  const double angle = 25 * std::numbers::pi / 180;
  const double free = 9.81 * (std::sin(angle) - 0.2 * std::cos(angle)) * sim.time();
  MESSAGE("holds: " << held << " m/s; slides: " << slid / count << " m/s, of theory " << free);
  CHECK(held < 1e-3);
  CHECK(slid / count == about(free, 0.03));
}

} // namespace test_materials
