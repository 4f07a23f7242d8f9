// SPDX-License-Identifier: MIT
//
// Sand runs out below a plate that is lifted slowly, until a heap in front of it closes the gap:
// the slope of the heap against the angle of friction. The floor is rough.

#include "support/scene.hpp"

#include "talus/boundary/gate.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/solver/sweeps_then_interior_point.hpp"

#include <algorithm>
#include <cmath>

int main(int argc, char** argv) {
  double length = 0.1, height = 0.2, gap = 0.08, lift_speed = 0.01; // m, m/s
  support::Scene scene("heap", "Sand runs out below a plate that is lifted, and forms a heap.");
  scene.run.end_time = 10;
  scene.option("--column-length", length, "column_length_m", "m");
  scene.option("--column-height", height, "column_height_m", "m");
  scene.option("--gap", gap, "gap_m", "Below the plate in the end, m");
  scene.option("--lift-speed", lift_speed, "lift_speed_m_s", "Of the plate, m/s");
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    using Sim = support::SceneSimulation<dim, talus::SweepsThenInteriorPoint>;
    auto params = scene.box<dim, Sim>({0.5, 0.05, 0.22});
    for (std::size_t a = 0; a + 1 < dim; ++a) // no friction at the sides
      params.faces.lower[a] = params.faces.upper[a] = {talus::FaceKind::free_slip};
    params.obstacles = {talus::make_obstacle<talus::Gate<dim>>(
        {.position = length,
         .friction = scene.wall_friction,
         .motion = {.terminal_speed = lift_speed, .time_constant = 0, .rise = gap}})};
    const auto column = [&](const talus::Vec<dim>& x) {
      return x[0] < length && x[dim - 1] < height;
    };
    talus::Particles<dim> sand;
    fill(sand, talus::Grid<dim>(params.grid), column, scene.seeding);
    Sim sim(params, sand); // much friction: sweeps alone do not arrive in every step
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    while (run.advance()) {
    }

    const auto outside = talus::profile_beyond(talus::measure_profile(sim), length);
    const double top = *std::ranges::max_element(outside.height);
    const auto line = talus::fit_line_between(outside.x, outside.height, 0.2 * top, 0.8 * top);
    const double angle = support::degrees(std::atan(-line.slope));
    const double friction_angle = support::degrees(std::atan(scene.friction));
    const double speed = talus::largest_speed(sim);
    std::string fact = support::text("slope %.1f°, friction angle %.1f°, height %.3f m", angle,
                                     friction_angle, top);
    if (speed > 0.01)
      fact += support::text(", still moving at up to %.3f m/s", speed);
    if (sim.time() < gap / lift_speed)
      fact += ", and the plate still rises";
    return run.finish({{"angle_deg", angle},
                       {"friction_angle_deg", friction_angle},
                       {"height_m", top},
                       {"speed_max_m_s", speed}},
                      support::picture("Heap", fact));
  });
}
