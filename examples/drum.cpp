// SPDX-License-Identifier: MIT
//
// A drum half full of sand turns slowly: the angle of its surface against the angle of friction.

#include "support/scene.hpp"

#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/totals.hpp"

#include <cmath>

int main(int argc, char** argv) {
  double radius = 0.15, rate = 0.3; // m, rad/s
  support::Scene scene("drum", "A drum half full of sand turns slowly.");
  scene.wall_friction = 0.6;
  scene.seeding.per_axis = 6; // with fewer, their noise stirs sand that never rests
  scene.run.end_time = 8;
  scene.option("--radius", radius, "radius_m", "Of the drum, m");
  scene.option("--rate", rate, "rate_rad_s", "Of its rotation, rad/s");
  return scene.main<2>(argc, argv, [&] {
    const double edge = 2 * radius + 4 * scene.cell;
    auto params = scene.box<2>({edge, 0, edge});
    const talus::RigidState<2> motion{.position = {edge / 2, edge / 2},
                                      .angular_velocity = talus::Spin<2>(rate)};
    const talus::shapes::Ball<2> hollow({0, 0}, radius);
    params.obstacles = {
        talus::make_obstacle<talus::ShapeObstacle<2>>({.shape = talus::shapes::Complement(hollow),
                                                       .friction = scene.wall_friction,
                                                       .motion = talus::steady_motion(motion)})};
    const talus::shapes::Intersection half(hollow, talus::shapes::HalfSpace<2>({0, 0}, {0, 1}));
    talus::Particles<2> sand;
    fill(sand, talus::Grid<2>(params.grid), talus::shapes::translated(half, motion.position),
         scene.seeding);
    support::SceneSimulation<2> sim(params, sand);
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& surface = run.series("angle.csv", {"time_s", "angle_deg", "torque_N"});
    while (run.advance())
      if (run.sample_due()) {
        // The centre of mass is below the axis, at right angles to a flat surface.
        const talus::Vec<2> arm = talus::centre_of_mass(sim.particles()) - motion.position;
        surface.row(run.time(), support::degrees(std::atan2(arm[0], -arm[1])),
                    sim.obstacle_wrench(0).torque_about(motion.position)[0]);
      }
    const double angle = surface.late_mean("angle_deg");
    const double friction_angle = support::degrees(std::atan(scene.friction));
    return run.finish(
        {{"angle_deg", angle}, {"friction_angle_deg", friction_angle}},
        support::picture(
            "Drum", support::text("surface at %.1f°, friction angle %.1f°", angle, friction_angle),
            "time (s)", surface["time_s"], "angle of the surface (°)", surface["angle_deg"]));
  });
}
