// SPDX-License-Identifier: MIT
//
// A drum half full of sand turns slowly: the angle of its surface against the angle of friction.

#include "support/run_picture.hpp"
#include "support/scene_options.hpp"

#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

int main(int argc, char** argv) {
  double radius = 0.15, rate = 0.3; // m, rad/s
  support::SceneOptions options;
  options.wall_friction = 0.6;
  options.seeding.per_axis = 6; // with fewer, their noise stirs sand that never rests
  options.run.end_time = 8;
  CLI::App app("A drum half full of sand turns slowly.");
  app.add_option("--radius", radius, "Of the drum, m")->capture_default_str();
  app.add_option("--rate", rate, "Of its rotation, rad/s")->capture_default_str();
  support::add_scene_options(app, options, "out/drum");
  app.remove_option(app.get_option("--dim"));
  return support::run_program(app, argc, argv, [&] {
    const double edge = 2 * radius + 4 * options.cell;
    auto params = support::box_params<2>(options, {edge, 0, edge});
    const talus::RigidState<2> motion{.position = {edge / 2, edge / 2},
                                      .angular_velocity = talus::Spin<2>(rate)};
    const talus::shapes::Ball<2> hollow({0, 0}, radius);
    params.obstacles = {std::make_shared<talus::ShapeObstacle<2>>(
        talus::ShapeObstacle<2>::Params{.shape = talus::shapes::Complement(hollow),
                                        .friction = options.wall_friction,
                                        .motion = talus::steady_motion(motion)})};
    const talus::shapes::Intersection half(hollow, talus::shapes::HalfSpace<2>({0, 0}, {0, 1}));
    talus::Particles<2> sand;
    fill(sand, talus::Grid<2>(params.grid), talus::shapes::translated(half, motion.position),
         options.seeding);
    support::SceneSimulation<2> sim(params, sand);

    auto inputs = support::scene_inputs<2>(options, sim);
    inputs.update({{"radius_m", radius}, {"rate_rad_s", rate}});
    support::Run run(sim, "drum", options.run, inputs);
    if (run.finished())
      return 0;
    auto& table = run.table("angle.csv", {"time_s", "angle_deg", "torque_N"});
    std::vector<double> time, angle;
    run.keep("time", time);
    run.keep("angle", angle);
    constexpr double degree = std::numbers::pi / 180;
    while (run.advance())
      if (run.sample_due()) {
        // The centre of mass is below the axis, at right angles to a flat surface.
        talus::Vec<2> arm = talus::Vec<2>::Zero();
        for (std::size_t p = 0; p < sim.particles().size(); ++p)
          arm += sim.particles().volume[p] * (sim.particles().position[p] - motion.position);
        time.push_back(run.time());
        angle.push_back(std::atan2(arm[0], -arm[1]) / degree);
        table.row(time.back(), angle.back(),
                  sim.obstacle_wrench(0).torque_about(motion.position)[0]);
      }
    double steady = 0; // mean over the second half of the run
    for (std::size_t i = angle.size() / 2; i < angle.size(); ++i)
      steady += angle[i] / static_cast<double>(angle.size() - angle.size() / 2);
    const double friction_angle = std::atan(options.friction) / degree;
    run.write_summary(
        {{"measured", {{"angle_deg", steady}, {"friction_angle_deg", friction_angle}}},
         {"picture", support::picture("Drum",
                                      support::text("surface at %.1f°, friction angle %.1f°",
                                                    steady, friction_angle),
                                      "time (s)", time, "angle of the surface (°)", angle)}});
    return run.finish("plot_run.py");
  });
}
