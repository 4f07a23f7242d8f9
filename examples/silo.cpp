// SPDX-License-Identifier: MIT
//
// Sand leaves a silo through an orifice in its floor, round or in 2-D a slot, at a rate that hardly
// depends on how much is left (Beverloo, Leniger & van de Velde 1961).

#include "support/scene.hpp"

#include "talus/boundary/floor.hpp"
#include "talus/core/error.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/totals.hpp"

#include <cmath>
#include <numbers>
#include <string>

int main(int argc, char** argv) {
  double opening = 0.055, height = 0.3, width = 0.3, share_out = 0.7; // m
  support::Scene scene("silo", "Sand leaves a silo through an orifice.");
  scene.cell = 0.005;
  scene.run.end_time = 10;
  scene.option(
      "--opening", opening, "opening_m",
      "Width of the orifice, m; whole nodes are open: see opening_effective_m in summary.json");
  scene.option("--height", height, "fill_height_m", "Of the filling, m");
  scene.option("--width", width, "width_m", "Of the silo, m");
  scene.option("--share-out", share_out, "share_out",
               "Of the filling that leaves before the run ends");
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    talus::require_positive("--width", width);
    talus::require_positive("--height", height);
    if (!(opening > 0 && opening < width))
      talus::throw_invalid("--opening", opening, "> 0, and less than --width");
    if (!(share_out > 0 && share_out <= 1))
      talus::throw_invalid("--share-out", share_out, "a number > 0, at most 1");
    auto params = scene.box<dim>({width, width, 1.1 * height});
    params.faces.lower[dim - 1] = {talus::FaceKind::open};
    params.obstacles = {talus::make_obstacle<talus::Floor<dim>>(
        {.centre = params.grid.size / 2, .opening = opening, .friction = scene.wall_friction})};
    const talus::Grid<dim> grid(params.grid);
    // The floor holds whole nodes: what belongs to the others is open.
    double area = 0; // of the opening, m^(d-1)
    talus::Index<dim> node{};
    for (node[0] = 0; node[0] <= grid.cells(0); ++node[0])
      for (node[1] = 0; node[1] <= (dim == 3 ? grid.cells(1) : 0); ++node[1])
        if (!params.obstacles[0]->contact(grid.node_position(node), grid.spacing(), 0))
          area += grid.spacing().prod() / grid.spacing()[dim - 1];
    const double effective = dim == 2 ? area : std::sqrt(4 * area / std::numbers::pi);
    talus::Particles<dim> sand;
    talus::fill_bed(sand, grid, height, scene.seeding);
    const double all_out = share_out * talus::total_volume(sand); // m^d
    support::SceneSimulation<dim> sim(params, sand);
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& flow = run.series("flow.csv", {"time_s", "volume_out"});
    while (run.advance()) {
      if (run.outflow_volume() > all_out)
        run.stop();
      if (run.sample_due())
        flow.row(run.time(), run.outflow_volume());
    }

    // Slopes of the volume against time after the first seventh, and in both halves of that.
    // None if so much did not leave before the run ended, or between two samples.
    const auto rate = [&](double from, double to) -> nlohmann::json {
      if (!(run.outflow_volume() >= to * all_out))
        return nullptr;
      const double slope =
          talus::fit_line_between(flow["time_s"], flow["volume_out"], from * all_out, to * all_out)
              .slope;
      return std::isfinite(slope) ? nlohmann::json(slope) : nlohmann::json(); // too few rows
    };
    const char* unit = dim == 2 ? "m²" : "m³";
    const auto mean_rate = rate(1.0 / 7, 1);
    std::string fact = support::text("opening %.4g m: ", effective);
    if (!mean_rate.is_null())
      fact += support::text("rate %.4g %s/s", support::value_or_nan(mean_rate), unit);
    else if (run.outflow_volume() >= all_out)
      fact += "no rate: too few samples while it left";
    else
      fact +=
          support::text("no rate: only %.4g of %.4g %s left", run.outflow_volume(), all_out, unit);
    return run.finish({{"opening_effective_m", effective},
                       {"volume_out", run.outflow_volume()},
                       {"rate", mean_rate},
                       {"rate_early", rate(1.0 / 7, 4.0 / 7)},
                       {"rate_late", rate(4.0 / 7, 1)}},
                      support::picture("Silo", fact, "time (s)", flow["time_s"],
                                       support::text("volume that left (%s)", unit),
                                       flow["volume_out"]));
  });
}
