// SPDX-License-Identifier: MIT
//
// A wedge-shaped hopper that starts empty and is refilled at a steady level: a source at its top
// lets in what leaves through the opening below, and holds back the rest.

#include "support/scene.hpp"

#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/scene/source.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace {

/// Volume a second between two samples of a column.
double rate_between(const support::Series& series, const std::string& name, std::size_t from,
                    std::size_t to) {
  return (series[name][to] - series[name][from]) / (series["time_s"][to] - series["time_s"][from]);
}

} // namespace

int main(int argc, char** argv) {
  double opening = 0.04, level = 0.25, width = 0.25, steepness = 60, speed = 0.5; // m, °, m/s
  support::Scene scene("hopper", "A hopper that is refilled at a steady level.");
  scene.cell = 0.005;
  scene.run.end_time = 4;
  scene.without({"seeding"}); // a source pours a lattice
  scene.option("--opening", opening, "opening_m", "Between the walls at the bottom, m");
  scene.option("--level", level, "level_m", "Of the source above the opening, m");
  scene.option("--width", width, "width_m", "Of the box, m");
  scene.option("--steepness", steepness, "steepness_deg",
               "Of the walls to the horizontal, degrees");
  scene.option("--refill-speed", speed, "refill_speed_m_s", "At which material may come in, m/s");
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    talus::require_positive("--level", level);
    talus::require_positive("--refill-speed", speed);
    if (!(opening > 0 && opening < width))
      talus::throw_invalid("--opening", opening, "> 0, and less than --width");
    if (!(steepness > 0 && steepness < 90))
      talus::throw_invalid("--steepness", steepness, "degrees, between 0 and 90");
    auto params = scene.box<dim>({width, opening, level + 2 * scene.cell});
    params.faces.lower[dim - 1] = {talus::FaceKind::open};
    const double angle = steepness * std::numbers::pi / 180;
    for (const double side : {-1.0, 1.0}) {
      talus::Vec<dim> foot = talus::Vec<dim>::Zero(), normal = talus::Vec<dim>::Zero();
      foot[0] = (width + side * opening) / 2;
      normal[0] = -side * std::sin(angle);
      normal[dim - 1] = std::cos(angle);
      params.obstacles.push_back(talus::make_obstacle<talus::ShapeObstacle<dim>>(
          {.shape = talus::shapes::HalfSpace<dim>(foot, normal), .friction = scene.wall_friction}));
    }
    const talus::Grid<dim> grid(params.grid);
    typename talus::Source<dim>::Params refill;
    refill.lower.setZero();
    refill.upper = params.grid.size;
    refill.lower[dim - 1] = refill.upper[dim - 1] = level;
    const double half = std::min(width, opening + 2 * level / std::tan(angle)) / 2;
    refill.lower[0] = width / 2 - half;
    refill.upper[0] = width / 2 + half;
    refill.velocity[dim - 1] = -speed;
    refill.seeding = scene.seeding;
    params.exchange = talus::make_source<dim>(grid, refill);
    support::SceneSimulation<dim> sim(params, {});
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    double in = 0;
    run.keep("volume_in", in);
    auto& flow = run.series("flow.csv", {"time_s", "volume_in", "volume_out", "volume_inside"});
    while (run.advance()) {
      in += run.report().inflow_volume;
      if (run.sample_due())
        flow.row(run.time(), in, run.outflow_volume(), talus::total_volume(sim.particles()));
    }

    // The second half of the run, and its two halves; none without a row near where one begins.
    const std::vector<double>& time = flow["time_s"];
    const auto row = [&](double share) -> std::optional<std::size_t> {
      const double wanted = share * time.back();
      const auto off = [&](double t) { return std::abs(t - wanted); };
      const auto nearest = std::ranges::min_element(time, {}, off);
      if (off(*nearest) > 0.05 * time.back())
        return {};
      return static_cast<std::size_t>(nearest - time.begin());
    };
    const auto rate = [&](const std::string& name, double from, double to) -> nlohmann::json {
      const auto first = row(from), last = row(to);
      return first && last ? nlohmann::json(rate_between(flow, name, *first, *last))
                           : nlohmann::json();
    };
    const double inside = talus::total_volume(sim.particles());
    const double balance = in > 0 ? (in - run.outflow_volume() - inside) / in : 0;
    const auto rate_in = rate("volume_in", 0.5, 1), rate_out = rate("volume_out", 0.5, 1);
    const char* unit = dim == 2 ? "m²" : "m³";
    return run.finish(
        {{"volume_in", in},
         {"volume_out", run.outflow_volume()},
         {"volume_inside", inside},
         {"volume_balance", balance},
         {"rate_in", rate_in},
         {"rate_out", rate_out},
         {"rate_out_early", rate("volume_out", 0.5, 0.75)},
         {"rate_out_late", rate("volume_out", 0.75, 1)}},
        support::picture("A hopper is refilled",
                         rate_in.is_null()
                             ? "no rates: no sample near the middle of the run"
                             : support::text("in %.4g, out %.4g %s/s in the second half of the run",
                                             support::value_or_nan(rate_in),
                                             support::value_or_nan(rate_out), unit),
                         "time (s)", flow["time_s"], support::text("volume inside (%s)", unit),
                         flow["volume_inside"]));
  });
}
