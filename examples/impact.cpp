// SPDX-License-Identifier: MIT
//
// A ball drops on a bed of sand: its depth against time, and the final one against the fit of
// Uehara, Ambroso, Ojha & Durian, Phys. Rev. Lett. 90, 194301 (2003) to their experiments.

#include "support/scene.hpp"

#include "talus/boundary/body.hpp"
#include "talus/core/error.hpp"

#include <cmath>
#include <string>

int main(int argc, char** argv) {
  double diameter = 0.06, density = 2500, drop = 0.2, bed = 0.12; // m, kg/m³
  support::Scene scene("impact", "A ball drops on a bed of sand.");
  scene.wall_friction = 0.3;
  scene.run.end_time = 0.2;
  scene.run.sample_interval = 0.002;
  scene.run.snapshot_interval = 0.02;
  scene.option("--diameter", diameter, "diameter_m", "Of the ball, m");
  scene.option("--ball-density", density, "ball_density", "kg/m³");
  scene.option("--drop", drop, "drop_m", "Height that it has fallen, m");
  scene.option("--bed", bed, "bed_m", "Depth of the sand, m");
  return scene.main<3>(argc, argv, [&] {
    talus::require_positive("--diameter", diameter);
    talus::require_positive("--ball-density", density);
    talus::require_non_negative("--drop", drop);
    talus::require_positive("--bed", bed);
    talus::require_positive("--friction", scene.friction); // Uehara's formula divides by it
    const double width = 4 * diameter;
    auto params = scene.box<3>({width, width, bed + diameter});
    auto ball = talus::ball_body<3>({width / 2, width / 2, bed + diameter / 2}, diameter / 2,
                                    density, scene.wall_friction);
    ball.start.velocity = std::sqrt(2 * drop * params.gravity.norm()) * -talus::Vec<3>::UnitZ();
    params.bodies = {ball};
    talus::Particles<3> sand;
    talus::fill_bed(sand, talus::Grid<3>(params.grid), bed, scene.seeding);
    support::SceneSimulation<3> sim(params, sand);
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& motion = run.series("depth.csv", {"time_s", "depth_m", "speed_m_s", "force_N"});
    while (run.advance())
      if (run.sample_due())
        motion.row(run.time(), ball.start.position[2] - sim.bodies()[0].position[2],
                   -sim.bodies()[0].velocity[2], sim.body_wrench(0).force[2]);

    const double depth = motion["depth_m"].back();
    const bool on_floor = depth > bed - sim.grid().spacing()[2]; // the ball, but for the last cell
    // d = 0.14/μ (ρ/ρ_c)^{1/2} D^{2/3} (drop + d)^{1/3}, by fixed point; not from 0, which is one
    // for a ball that is set down.
    double uehara = diameter;
    for (int k = 0; k < 30; ++k)
      uehara = 0.14 / scene.friction * std::sqrt(density / scene.density) *
               std::cbrt(diameter * diameter * (drop + uehara));
    std::string fact = support::text("depth %.3f m; Uehara et al. 2003: %.3f m", depth, uehara);
    if (on_floor)
      fact += "; the ball has reached the floor";
    return run.finish({{"depth_m", depth},
                       {"reached_floor", on_floor},
                       {"speed_end_m_s", motion["speed_m_s"].back()},
                       {"depth_uehara_m", uehara}},
                      support::picture("Impact", fact, "time (s)", motion["time_s"], "depth (m)",
                                       motion["depth_m"]));
  });
}
