// SPDX-License-Identifier: MIT
//
// Sand runs out below a plate that is lifted slowly, and forms a heap: its slope against the angle
// of friction. One half of it, beyond a plane of symmetry; the floor is rough.

#include "support/scene_options.hpp"

#include "talus/boundary/gate.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

namespace {

struct Options {
  support::SceneOptions scene{.run = {.end_time = 7}};
  double column_length = 0.1, column_height = 0.2, lift_speed = 0.05;
};

template <int Dim>
int heap(const Options& options) {
  auto params = support::box_params<Dim>(options.scene, {0.5, 0.05, 0.22});
  for (std::size_t a = 0; a + 1 < Dim; ++a) // no friction at the sides and in the middle
    params.faces.lower[a] = params.faces.upper[a] = {talus::FaceKind::slip};
  params.obstacles.push_back(std::make_shared<talus::Gate<Dim>>(typename talus::Gate<Dim>::Params{
      .position = options.column_length,
      .friction = options.scene.wall_friction,
      .motion = {.terminal_speed = options.lift_speed, .time_constant = 0}}));
  const talus::Grid<Dim> grid(params.grid);
  talus::Particles<Dim> sand;
  fill(
      sand, grid,
      [&](const talus::Vec<Dim>& x) {
        return x[0] < options.column_length && x[Dim - 1] < options.column_height;
      },
      options.scene.seeding);
  support::SceneSimulation<Dim> sim(params, sand);

  auto inputs = support::scene_inputs<Dim>(options.scene, sim);
  inputs.update({{"column_length_m", options.column_length},
                 {"column_height_m", options.column_height},
                 {"lift_speed_m_s", options.lift_speed}});
  support::Run run(sim, "heap", options.scene.run, inputs);
  if (run.finished())
    return 0;
  while (run.advance()) {
  }

  // A line through the surface between a fifth and four fifths of its height.
  const talus::Profile profile = talus::measure_profile(sim);
  const double top = *std::ranges::max_element(profile.height);
  std::vector<double> x, height;
  for (std::size_t i = 0; i < profile.x.size(); ++i)
    if (profile.height[i] > 0.2 * top && profile.height[i] < 0.8 * top) {
      x.push_back(profile.x[i]);
      height.push_back(profile.height[i]);
    }
  const double degree = std::numbers::pi / 180;
  const double angle = std::atan(-talus::fit_line(x, height).slope) / degree;
  const double friction_angle = std::atan(options.scene.friction) / degree;
  char fact[96];
  std::snprintf(fact, sizeof fact, "slope %.1f°, friction angle %.1f°, height %.3f m", angle,
                friction_angle, top);
  run.write_summary({{"measured",
                      {{"angle_deg", angle},
                       {"friction_angle_deg", friction_angle},
                       {"height_m", top},
                       {"speed_max_m_s", talus::largest_speed(sim)}}},
                     {"picture", {{"title", "Heap"}, {"facts", {fact}}}}});
  if (!options.scene.run.common.quiet)
    std::printf("%s\n", fact);
  return run.finish("plot_run.py");
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Sand runs out below a plate that is lifted, and forms a heap.");
  app.add_option("--column-length", options.column_length, "m")->capture_default_str();
  app.add_option("--column-height", options.column_height, "m")->capture_default_str();
  app.add_option("--lift-speed", options.lift_speed, "Of the plate, m/s")->capture_default_str();
  support::add_scene_options(app, options.scene, "out/heap");
  return support::run_program(app, argc, argv, [&] {
    return options.scene.dimension == 2 ? heap<2>(options) : heap<3>(options);
  });
}
