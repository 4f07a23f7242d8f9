// SPDX-License-Identifier: MIT
//
// Sand runs out below a plate that is lifted slowly, until a heap in front of it closes the gap:
// the slope of the heap against the angle of friction. The floor is rough.

#include "support/scene.hpp"

#include "talus/boundary/gate.hpp"
#include "talus/core/error.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/solver/sweeps_then_interior_point.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

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
    constexpr double box_length = 0.5, box_height = 0.22; // m
    if (!(length > 0 && length < box_length))
      talus::throw_invalid("--column-length", length,
                           "> 0, and less than that of the box, " + talus::text_of(box_length));
    if (!(height > 0 && height <= box_height))
      talus::throw_invalid("--column-height", height,
                           "> 0, at most that of the box, " + talus::text_of(box_height));
    talus::require_positive("--gap", gap);
    talus::require_positive("--lift-speed", lift_speed);
    auto params = scene.box<dim, Sim>({box_length, 0.05, box_height});
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
    // A slope takes some nodes.
    const bool is_heap = top > 3 * sim.grid().spacing()[dim - 1] && std::isfinite(line.slope);
    const double angle = support::degrees(std::atan(-line.slope));
    const double friction_angle = support::degrees(std::atan(scene.friction));
    const double speed = talus::largest_speed(sim);
    const std::string slope = is_heap ? support::text("%.1f°", angle) : std::string("none");
    std::string fact = support::text("slope %s, friction angle %.1f°, height %.3f m", slope.c_str(),
                                     friction_angle, top);
    if (speed > 0.01)
      fact += support::text(", still moving at up to %.3f m/s", speed);
    if (sim.time() < gap / lift_speed)
      fact += ", and the plate still rises";
    return run.finish({{"angle_deg", is_heap ? nlohmann::json(angle) : nlohmann::json()},
                       {"friction_angle_deg", friction_angle},
                       {"height_m", top},
                       {"speed_max_m_s", speed}},
                      support::picture("Heap", fact));
  });
}
