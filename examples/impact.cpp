// SPDX-License-Identifier: MIT
//
// A ball drops on a bed of sand: its depth against time, and the final one against the fit of
// Uehara, Ambroso, Ojha & Durian, Phys. Rev. Lett. 90, 194301 (2003) to their experiments.

#include "support/run_picture.hpp"
#include "support/scene_options.hpp"

#include "talus/boundary/body.hpp"

#include <cmath>
#include <vector>

int main(int argc, char** argv) {
  constexpr double gravity = 9.81;                                      // m/s²
  double diameter = 0.06, density = 2500, drop = 0.2, bed_depth = 0.12; // m, kg/m³
  support::SceneOptions options;
  options.wall_friction = 0.3;
  options.run.end_time = 0.2;
  options.run.sample_interval = 0.002;
  options.run.snapshot_interval = 0.02;
  CLI::App app("A ball drops on a bed of sand.");
  app.add_option("--diameter", diameter, "Of the ball, m")->capture_default_str();
  app.add_option("--ball-density", density, "kg/m³")->capture_default_str();
  app.add_option("--drop", drop, "Height that it has fallen, m")->capture_default_str();
  app.add_option("--bed", bed_depth, "Depth of the sand, m")->capture_default_str();
  support::add_scene_options(app, options, "out/impact");
  app.remove_option(app.get_option("--dim"));
  return support::run_program(app, argc, argv, [&] {
    const double width = 4 * diameter;
    auto params = support::box_params<3>(options, {width, width, bed_depth + diameter});
    auto ball = talus::ball_body<3>({width / 2, width / 2, bed_depth + diameter / 2}, diameter / 2,
                                    density, options.wall_friction);
    ball.start.velocity[2] = -std::sqrt(2 * gravity * drop);
    params.bodies = {ball};
    talus::Particles<3> sand;
    talus::fill_box<3>(sand, talus::Grid<3>(params.grid), {0, 0, 0}, {width, width, bed_depth},
                       options.seeding);
    support::SceneSimulation<3> sim(params, sand);

    auto inputs = support::scene_inputs<3>(options, sim);
    inputs.update({{"diameter_m", diameter},
                   {"ball_density", density},
                   {"drop_m", drop},
                   {"bed_m", bed_depth}});
    options.run.section_row = sim.grid().cells(1) / 2;
    support::Run run(sim, "impact", options.run, inputs);
    if (run.finished())
      return 0;
    auto& table = run.table("depth.csv", {"time_s", "depth_m", "speed_m_s", "force_N"});
    std::vector<double> time{0}, depth{0};
    run.keep("time", time);
    run.keep("depth", depth);
    while (run.advance())
      if (run.sample_due()) {
        const auto& now = sim.bodies()[0];
        time.push_back(run.time());
        depth.push_back(ball.start.position[2] - now.position[2]);
        table.row(time.back(), depth.back(), -now.velocity[2], sim.body_wrench(0).force[2]);
      }
    double uehara = 0; // d = 0.14/μ (ρ/ρ_c)^{1/2} D^{2/3} (drop + d)^{1/3}, by fixed point
    for (int k = 0; k < 30; ++k)
      uehara = 0.14 / options.friction * std::sqrt(density / options.density) *
               std::cbrt(diameter * diameter * (drop + uehara));
    run.write_summary(
        {{"measured", {{"depth_m", depth.back()}, {"depth_uehara_m", uehara}}},
         {"picture", support::picture("Impact",
                                      support::text("depth %.3f m; Uehara et al. 2003: %.3f m",
                                                    depth.back(), uehara),
                                      "time (s)", time, "depth (m)", depth)}});
    return run.finish("plot_run.py");
  });
}
