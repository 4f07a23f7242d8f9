// SPDX-License-Identifier: MIT
//
// Heavy material lies on light one in a closed box, and the interface is a wave: it turns over
// (Rayleigh-Taylor) as fast as theory has it where there is no friction. Light on heavy it goes to
// and fro.

#include "support/scene.hpp"

#include "talus/core/error.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/rheology/materials.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

namespace {

using Fluids = support::OnRanks<talus::Simulation<2, talus::Materials<talus::ConstantFriction>,
                                                  talus::PolyPic, talus::GaussSeidel<>>>;

} // namespace

int main(int argc, char** argv) {
  double width = 1, height = 0.5, amplitude = 0.02; // m
  double lower_density = 1000, density = 2000;      // kg/m³
  support::Scene scene("overturn", "Heavy material on light one turns over.");
  scene.cell = 0.02;
  scene.time_step = 0.005; // s
  scene.friction = 0;
  scene.without({"wall-friction"}); // the walls are smooth
  scene.run.end_time = 2;
  scene.run.snapshot_interval = 0.1;
  scene.seeding.per_axis = 6;
  scene.seeding.jitter = 0;
  scene.packing.even = true; // what has no friction is sheared without end
  scene.option("--width", width, "width_m", "Of the box, half a wave, m");
  scene.option("--height", height, "height_m", "Of the box, two layers, m");
  scene.option("--amplitude", amplitude, "amplitude_m", "Of the wave at the start, m");
  scene.option("--lower-density", lower_density, "lower_density", "kg/m³");
  scene.option("--density", density, "density", "Of the upper material, kg/m³");
  return scene.main<2>(argc, argv, [&] {
    talus::require_positive("--width", width);
    talus::require_positive("--height", height);
    auto params = scene.box<2, Fluids>({width, 0, height});
    params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
    params.rheology.list = {{.density = lower_density, .law = {.mu = scene.friction}},
                            {.density = density, .law = {.mu = scene.friction}}};
    const double k = std::numbers::pi / width;
    talus::Particles<2> sand;
    fill_box(sand, talus::Grid<2>(params.grid), {0, 0}, {width, height}, scene.seeding);
    const double least = height / params.grid.cells[1] / scene.seeding.per_axis / 2;
    if (!(amplitude > least && amplitude < height / 2))
      talus::throw_invalid("--amplitude", amplitude,
                           "more than half of the distance of two particles, " +
                               talus::text_of(least) + " m, and less than half of --height");
    sand.resize_material(sand.size());
    for (std::size_t p = 0; p < sand.size(); ++p) {
      const auto& x = sand.position[p];
      sand.material[p] = x[1] > height / 2 + amplitude * std::cos(k * x[0]) ? 1 : 0;
    }
    Fluids sim(params, sand);
    // ∫ cos(k x) of the interface's height, as an amplitude
    const auto wave = [&](const talus::Particles<2>& particles) {
      return 2 / width * talus::volume_sum(particles, [&](std::size_t p) {
               return particles.material[p] == 0 ? std::cos(k * particles.position[p][0]) : 0;
             });
    };
    const double start = wave(sand);
    // Lamb, Hydrodynamics, §231
    const double rate2 = 9.81 * k * (density - lower_density) / (density + lower_density) *
                         std::tanh(k * height / 2);
    const auto theory = [&](double t) {
      const double rate = std::sqrt(std::abs(rate2));
      return start * (rate2 > 0 ? std::cosh(rate * t) : std::cos(rate * t));
    };
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& waves = run.series("wave.csv", {"time_s", "amplitude_m", "theory_m"});
    while (run.advance())
      if (run.sample_due())
        waves.row(run.time(), wave(sim.particles()), theory(run.time()));

    // as long as the wave is flat, k a < 0.2
    std::vector<double> time, linear;
    double error = 0;
    for (std::size_t i = 0; i < waves["time_s"].size(); ++i) {
      const double a = waves["theory_m"][i];
      if (std::abs(a) > 0.2 / k)
        break;
      time.push_back(waves["time_s"][i]);
      linear.push_back(a);
      error = std::max(error, std::abs(waves["amplitude_m"][i] - a));
    }
    double most = 0;
    for (const double a : linear)
      most = std::max(most, std::abs(a));
    nlohmann::json relative, until; // null without a time at which it is flat
    std::string fact = "the wave is too steep for linear theory from the start";
    if (!linear.empty()) {
      relative = error / most;
      until = time.back();
      fact = support::text("amplitude within %.1f %% of linear theory up to %.2f s",
                           100 * error / most, time.back());
    }
    auto picture =
        support::picture(density > lower_density ? "Heavy on light" : "Light on heavy", fact);
    const auto curve = [](const char* kind, const char* label, const auto& x, const auto& y) {
      return nlohmann::json{{"kind", kind}, {"label", label}, {"x", x}, {"y", y}};
    };
    picture["panels"] = {{{"x", "time (s)"},
                          {"y", "amplitude (m)"},
                          {"curves",
                           {curve("line", "talus", waves["time_s"], waves["amplitude_m"]),
                            curve("dashed", "linear theory", time, linear)}}}};
    return run.finish({{"amplitude_m", wave(sim.particles())},
                       {"rate_1_s", std::sqrt(std::abs(rate2))},
                       {"error_of_linear_theory", relative},
                       {"linear_until_s", until}},
                      picture);
  });
}
