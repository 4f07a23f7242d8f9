// SPDX-License-Identifier: MIT
//
// Sand in a silo presses on the floor with less than its weight (Janssen 1895), and leaves through
// an orifice at a rate that does not depend on how much is left, but on the orifice's width to the
// power 3/2 (2-D) or 5/2 (3-D): Beverloo, Leniger & van de Velde 1961. Several openings or fill
// heights are run one after the other.

#include "support/scene_options.hpp"

#include "talus/boundary/obstacle.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace {

using nlohmann::json;

constexpr double gravity = 9.81; // m/s²

struct Options {
  support::SceneOptions scene{.cell = 0.005, .run = {.end_time = 10}};
  double width = 0.3, share_out = 0.7, sink_speed = 0.05;
  std::vector<double> openings{0.055}, heights{0.3};
};

/// The floor of the box with a hole in the middle: round, or a slot in 2-D. Without one (0 wide) it
/// is a piston that sinks slowly, so that the filling slides along the walls and they carry what
/// they can: Janssen's state. What they carry at rest hangs on what was before.
template <int Dim>
class Floor final : public talus::Obstacle<Dim> {
 public:
  struct Params {
    talus::Vec<Dim> middle;                           ///< m
    double opening = 0, friction = 0, sink_speed = 0; ///< m; μ_w; m/s
  };
  explicit Floor(const Params& params) : params_(params) {}

  std::optional<talus::ObstacleContact<Dim>>
  contact(const talus::Vec<Dim>& x, const talus::Vec<Dim>& spacing, double) const override {
    constexpr int up = talus::up_axis<Dim>;
    const talus::Vec<Dim> offset = x - params_.middle;
    const double across = offset.template head<up>().norm();
    if (offset[up] > spacing[up] / 2 || 2 * across < params_.opening * (1 - 1e-9))
      return std::nullopt;
    const double sink_speed = params_.opening > 0 ? 0 : params_.sink_speed;
    return talus::ObstacleContact<Dim>{talus::Vec<Dim>::Unit(up),
                                       -sink_speed * talus::Vec<Dim>::Unit(up), params_.friction};
  }

 private:
  Params params_;
};

/// Janssen's balance: what floor and walls carry, a mean over steps.
struct Balance {
  // Sums: forces on floor and walls (N), ∫ φ (m^d), ∫ σ_zz (N m), number of steps.
  double floor = 0, wall_normal = 0, wall_shear = 0, volume = 0, vertical = 0, steps = 0;

  template <class Sim>
  void add(const Sim& sim) {
    constexpr int dim = Sim::dimension, up = talus::up_axis<dim>;
    for (const auto& contact : sim.problem().contacts) {
      const talus::Vec<dim> force = contact.impulse / sim.time_step();
      if (contact.source == 2 * dim) { // the first obstacle
        floor += force[up];
      } else {
        wall_normal += force.dot(contact.normal);
        wall_shear += force[up];
      }
    }
    for (const int node : sim.problem().node) {
      const talus::Index<dim> index = sim.grid().node_index(node);
      const double node_volume = sim.grid().node_volume(index);
      volume += node_volume * std::min(1.0, sim.volume_fraction(index));
      vertical += node_volume * sim.stress(index)(up, up);
    }
    ++steps;
  }

  /// area: of the floor, perimeter: of the walls, m^(d-1) and m^(d-2); weight_density: ρ g, N/m³.
  json results(double area, double perimeter, double weight_density, double wall_friction) const {
    const double height = volume / steps / area;
    const double ratio = wall_normal / steps / (perimeter * height) / (vertical / volume); // K
    const double decays = perimeter * wall_friction * ratio * height / area;               // H/z_0
    const double janssen = decays > 0 ? -std::expm1(-decays) / decays : 1;
    return {{"depth_m", height},
            {"mobilised_friction", wall_normal > 0 ? wall_shear / wall_normal : 0},
            {"stress_ratio_K", ratio},
            {"floor_pressure_Pa", floor / steps / area},
            {"wall_share_Pa", wall_shear / steps / area},
            {"hydrostatic_Pa", weight_density * height},
            {"janssen_Pa", weight_density * height * janssen}};
  }
};

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Balance, floor, wall_normal, wall_shear, volume, vertical, steps)

struct Result {
  int status = 0;
  json measured;
};

template <int Dim>
Result run(const Options& options, double opening, double height, const std::string& out) {
  constexpr int up = talus::up_axis<Dim>;
  const support::SceneOptions& scene = options.scene;
  auto params = support::box_params<Dim>(scene, {options.width, options.width, 1.1 * height});
  const talus::Grid<Dim> grid(params.grid);
  talus::Vec<Dim> middle = grid.origin() + grid.size() / 2, top = grid.upper();
  middle[up] = 0;
  top[up] = height;
  params.faces.lower[up] = {talus::FaceKind::free};
  params.obstacles.push_back(
      std::make_shared<Floor<Dim>>(typename Floor<Dim>::Params{.middle = middle,
                                                               .opening = opening,
                                                               .friction = scene.wall_friction,
                                                               .sink_speed = options.sink_speed}));

  talus::Particles<Dim> sand;
  talus::fill_box(sand, grid, grid.origin(), top, scene.seeding);
  const double volume = sand.volume[0] * static_cast<double>(sand.size());
  support::SceneSimulation<Dim> sim(params, std::move(sand));

  json inputs = support::scene_inputs<Dim>(scene, sim);
  inputs.update({{"opening_m", opening},
                 {"fill_height_m", height},
                 {"share_out", options.share_out},
                 {"sink_speed_m_s", options.sink_speed}});
  support::RunOptions run_options = scene.run;
  run_options.common.out = out;
  run_options.section_row = Dim == 3 ? grid.cells(1) / 2 : 0;
  support::Run run(sim, "silo", run_options, inputs);
  if (run.finished())
    return {0, run.summary().at("measured")};
  auto& table = run.table("flow.csv", {"time_s", "volume_out"});
  double left = 0;
  std::vector<double> times, volumes;
  Balance balance;
  run.keep("left", left);
  run.keep("times", times);
  run.keep("volumes", volumes);
  run.keep("balance", balance);
  while (run.advance()) {
    left += run.report().outflow_volume;
    if (opening == 0 && run.time() > scene.run.end_time / 2)
      balance.add(sim);
    if (left > options.share_out * volume)
      run.stop();
    if (!run.sample_due())
      continue;
    table.row(run.time(), left);
    times.push_back(run.time());
    volumes.push_back(left);
  }

  json measured = {{"opening_m", opening}, {"fill_height_m", height}, {"volume_out", left}};
  json panels = json::array(), facts = json::array();
  char fact[96];
  if (opening > 0) {
    // Slopes of the volume against time after the first seventh, and those of both halves of that.
    const double end = options.share_out, begin = end / 7, half = (begin + end) / 2;
    const auto rate = [&](double from, double to) {
      std::vector<double> t, v;
      for (std::size_t i = 0; i < times.size(); ++i)
        if (volumes[i] >= from * volume && volumes[i] <= to * volume) {
          t.push_back(times[i]);
          v.push_back(volumes[i]);
        }
      return t.size() > 2 ? talus::fit_line(t, v).slope : 0;
    };
    measured.update({{"rate", rate(begin, end)},
                     {"rate_early", rate(begin, half)},
                     {"rate_late", rate(half, end)}});
    std::snprintf(fact, sizeof fact, "rate %.4g m%s/s", rate(begin, end), Dim == 2 ? "²" : "³");
    facts.push_back(fact);
    panels.push_back(
        {{"x", "time (s)"},
         {"y", Dim == 2 ? "volume that left (m²)" : "volume that left (m³)"},
         {"curves", {{{"kind", "line"}, {"label", "outflow"}, {"x", times}, {"y", volumes}}}}});
  } else {
    const talus::Vec<Dim>& size = grid.size();
    measured.update(
        {{"surface_height_m", talus::volume_under_surface(sim) / (size.prod() / size[up])},
         {"speed_max_m_s", talus::largest_speed(sim)}});
    measured.update(balance.results(size.prod() / size[up], Dim == 2 ? 2 : 2 * (size[0] + size[1]),
                                    gravity * scene.density, scene.wall_friction));
    std::snprintf(fact, sizeof fact, "floor %.0f Pa, hydrostatic %.0f Pa, Janssen %.0f Pa",
                  measured["floor_pressure_Pa"].get<double>(),
                  measured["hydrostatic_Pa"].get<double>(), measured["janssen_Pa"].get<double>());
    facts.push_back(fact);
  }
  char title[64];
  std::snprintf(title, sizeof title, "Silo, %d-D, %g m filled, orifice of %g m", Dim, height,
                opening);
  run.write_summary({{"measured", measured},
                     {"picture", {{"title", title}, {"facts", facts}, {"panels", panels}}}});
  if (!scene.run.common.quiet)
    std::printf("%s: %s\n", title, facts[0].get<std::string>().c_str());
  return {run.finish("plot_run.py"), measured};
}

/// A curve of all runs, and a power law or Janssen's formula beside it.
json sweep_picture(const Options& options, const json& runs, json& measured) {
  std::vector<double> x, y, other;
  const bool by_opening = options.openings.size() > 1;
  for (const json& run : runs) {
    x.push_back(run.at(by_opening ? "opening_m" : "fill_height_m"));
    y.push_back(run.at(run.contains("rate") ? "rate" : "floor_pressure_Pa"));
    other.push_back(run.value("janssen_Pa", 0.0));
  }
  const std::string dimension = options.scene.dimension == 2 ? "m²/s" : "m³/s";
  json curves = {{{"kind", "points"}, {"label", "talus"}, {"x", x}, {"y", y}}};
  json facts = json::array();
  if (by_opening) {
    const talus::PowerLawFit fit = talus::fit_power_law(x, y);
    measured.update({{"exponent", fit.exponent},
                     {"exponent_error", fit.exponent_error},
                     {"coefficient", fit.coefficient}});
    std::vector<double> fitted;
    for (const double opening : x)
      fitted.push_back(fit(opening));
    char label[64];
    std::snprintf(label, sizeof label, "exponent %.2f", fit.exponent);
    curves.push_back({{"kind", "dashed"}, {"label", label}, {"x", x}, {"y", fitted}});
  } else if (!runs[0].contains("rate")) {
    std::vector<double> hydrostatic;
    for (const json& run : runs)
      hydrostatic.push_back(run.at("hydrostatic_Pa"));
    curves.push_back(
        {{"kind", "line"}, {"label", "Janssen with the measured K"}, {"x", x}, {"y", other}});
    curves.push_back({{"kind", "dashed"}, {"label", "hydrostatic"}, {"x", x}, {"y", hydrostatic}});
  }
  return {{"title", "Silo, " + std::to_string(options.scene.dimension) + "-D"},
          {"facts", facts},
          {"panels",
           {{{"x", by_opening ? "opening (m)" : "fill height (m)"},
             {"y",
              runs[0].contains("rate") ? "rate (" + dimension + ")" : "pressure on the floor (Pa)"},
             {"log", by_opening},
             {"curves", curves}}}}};
}

template <int Dim>
int silo(const Options& options) {
  const std::string& out = options.scene.run.common.out;
  if (options.openings.size() * options.heights.size() == 1)
    return run<Dim>(options, options.openings[0], options.heights[0], out).status;
  json runs = json::array();
  for (const double opening : options.openings)
    for (const double height : options.heights) {
      char folder[64];
      std::snprintf(folder, sizeof folder, "/opening_%g_height_%g", opening, height);
      const Result result = run<Dim>(options, opening, height, out + folder);
      if (result.status != 0)
        return result.status;
      runs.push_back(result.measured);
    }
  json measured;
  const json picture = sweep_picture(options, runs, measured);
  support::write_json(
      support::fs::path(out) / "summary.json",
      {{"program", "silo"}, {"runs", runs}, {"measured", measured}, {"picture", picture}});
  support::draw(options.scene.run.common, "plot_run.py", out);
  return 0;
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Sand rests in a silo and leaves it through an orifice.");
  app.add_option("--opening", options.openings, "Width of the orifice, 0: closed; or several, m")
      ->capture_default_str();
  app.add_option("--height", options.heights, "Of the filling; or several, m")
      ->capture_default_str();
  app.add_option("--width", options.width, "Of the silo, m")->capture_default_str();
  app.add_option("--share-out", options.share_out, "Of the filling that leaves before the run ends")
      ->capture_default_str();
  app.add_option("--sink-speed", options.sink_speed,
                 "Of a closed floor, m/s; forces are means over the second half of the run")
      ->capture_default_str();
  support::add_scene_options(app, options.scene, "out/silo");
  return support::run_program(app, argc, argv, [&] {
    return options.scene.dimension == 2 ? silo<2>(options) : silo<3>(options);
  });
}
