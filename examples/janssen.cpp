// SPDX-License-Identifier: MIT
//
// Sand in a silo presses on the floor with less than its weight, as the walls carry a part of it
// (Janssen 1895): all that friction lets them carry, above a floor that sinks slowly.

#include "support/scene.hpp"

#include "talus/boundary/floor.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/silo.hpp"

int main(int argc, char** argv) {
  double height = 0.4, width = 0.1, sink_speed = 0.05; // m, m/s
  support::Scene scene("janssen", "Sand in a silo presses on a floor that sinks slowly.");
  scene.run.sample_interval = 0.001; // each step
  scene.option("--height", height, "fill_height_m", "Of the filling, m");
  scene.option("--width", width, "width_m", "Of the silo, m");
  scene.option("--sink-speed", sink_speed, "sink_speed_m_s", "Of the floor, m/s");
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    auto params = scene.box<dim>({width, width, 1.1 * height});
    params.faces.lower[dim - 1] = {talus::FaceKind::open};
    params.obstacles = {talus::make_obstacle<talus::Floor<dim>>(
        {.friction = scene.wall_friction, .sink_speed = sink_speed})};
    talus::Particles<dim> sand;
    talus::fill_bed(sand, talus::Grid<dim>(params.grid), height, scene.seeding);
    support::SceneSimulation<dim> sim(params, sand);
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& series = run.series("load.csv", {"time_s", "depth_m", "floor_Pa", "wall_normal_Pa",
                                           "wall_shear_Pa", "vertical_Pa"});
    while (run.advance())
      if (run.sample_due()) {
        const talus::SiloLoad now = talus::silo_load(sim);
        series.row(run.time(), now.depth, now.floor, now.wall_normal, now.wall_shear, now.vertical);
      }

    const auto mean = [&](const char* column) { return series.late_mean(column); };
    const talus::SiloLoad load{mean("depth_m"), mean("floor_Pa"), mean("wall_normal_Pa"),
                               mean("wall_shear_Pa"), mean("vertical_Pa")};
    const double hydrostatic = scene.density * params.gravity.norm() * load.depth;
    const double janssen = talus::janssen_pressure(
        load, hydrostatic, talus::hydraulic_diameter(sim.grid()), scene.wall_friction);
    const auto fact = support::text("floor %.0f Pa, hydrostatic %.0f Pa, Janssen %.0f Pa",
                                    load.floor, hydrostatic, janssen);
    return run.finish({{"depth_m", load.depth},
                       {"stress_ratio_K", load.wall_normal / load.vertical},
                       {"mobilised_friction", load.wall_shear / load.wall_normal},
                       {"floor_pressure_Pa", load.floor},
                       {"hydrostatic_Pa", hydrostatic},
                       {"janssen_Pa", janssen},
                       {"surface_height_m", talus::mean_surface_height(sim)},
                       {"speed_max_m_s", talus::largest_speed(sim)}},
                      support::picture("Janssen", fact, "time (s)", series["time_s"],
                                       "pressure on the floor (Pa)", series["floor_Pa"]));
  });
}
