// SPDX-License-Identifier: MIT
//
// A granular column collapses over an inclined erodible bed when a gate rises: the experiments of
// Rousseau et al., J. Fluid Mech. 2023. Prints the measured deposit beside the published one and
// leaves summary.json, tables, ParaView files and a picture.

#include "support/any_solver.hpp"
#include "support/command_line.hpp"
#include "support/policies.hpp"
#include "support/published.hpp"
#include "support/resolution.hpp"
#include "support/run.hpp"

#include "talus/boundary/gate.hpp"
#include "talus/diagnostics/deposit.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/quantiles.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/io/csv.hpp"
#include "talus/io/csv_table.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/scene/collapse.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using nlohmann::json;

constexpr double rest_speed = 0.01;        // m/s: below it the paper calls a run at rest
constexpr double threshold_height = 0.002; // m above the bed: what the paper counts as deposit
constexpr double rest_hold = 0.1;          // s without motion that end a run

struct Options {
  std::string case_name = "B15", preset = "paper", resolution = "coarse",
              solver = "sweeps-then-interior-point";
  std::string seeding = "jittered";
  int dimension = 3;
  support::PolicyOptions policies;
  std::optional<double> friction, wall_friction, gate_friction, end_time, time_step;
  std::optional<double> inclination, column_length, column_height, bed_depth, length, width, height;
  bool no_gate = false;
  std::optional<int> per_axis;
  std::vector<std::size_t> record_problems;
  std::vector<double> cell;
  double jitter = talus::Seeding{}.jitter, max_time = 6;
  std::uint64_t seed = 1;
  double tolerance = talus::GaussSeidel<>::Params{}.tolerance;
  int max_sweeps = talus::GaussSeidel<>::Params{}.max_sweeps;
  int friction_updates = 1;
  double extrapolation = talus::GaussSeidel<>::Params{}.extrapolation;
  double cfl = 0;
  talus::Packing packing;
  bool until_rest = false;
  double static_threshold = 0.01; // m/s: what the paper calls flowing
  std::string profile_row = "wall";
  std::vector<std::string> compare; // files
  support::RunOptions run{.vtk = "all", .section_row = "that of --profile-row"};
};

/// A run of the paper: what is to be simulated and what is published of it.
struct Case {
  talus::CollapseSetup setup;
  support::GrainMaterial material;
  json material_values, published = nullptr;
};

Case load_case(const Options& options) {
  const support::Toml file = support::load_case_file(options.case_name);
  const std::string material_name = file.text("material");
  const support::Toml materials = support::load_case_file("materials");
  const support::Toml material = materials.table(material_name);
  const support::Toml preset = file.table(options.preset);
  file.only({"material", "inclination_deg", "paper", "repository", "published"});
  preset.only({"column_length", "column_height", "bed_depth", "length", "width", "height"});

  Case run;
  run.material = support::grain_material(material_name, material);
  run.material_values = material.to_json();
  talus::CollapseSetup& setup = run.setup;
  setup.inclination_deg = options.inclination.value_or(file.number("inclination_deg"));
  setup.column_length = options.column_length.value_or(preset.number("column_length"));
  setup.column_height = options.column_height.value_or(preset.number("column_height"));
  setup.bed_depth = options.bed_depth.value_or(preset.number("bed_depth"));
  setup.length = options.length.value_or(preset.number("length"));
  setup.width = options.width.value_or(preset.number("width"));
  setup.height = options.height.value_or(preset.number("height"));
  setup.gate.terminal_speed = material.number("gate_speed");
  setup.gate.time_constant = material.number("gate_time");
  setup.wall_friction = options.wall_friction.value_or(run.material.mu_wall);
  setup.gate_friction = options.gate_friction.value_or(setup.wall_friction);
  if (options.preset == "repository") {
    // The authors' scripts: the side walls are rigid, one cell thick, walls and gate act with
    // sqrt(3/2) of their friction in 3-D, the end wall sticks, the gate opens after the material
    // has settled.
    if (options.dimension == 3) {
      setup.side_wall_cells = 1;
      setup.wall_friction *= std::sqrt(1.5);
      setup.gate_friction *= std::sqrt(1.5);
    }
    setup.downstream_sticks = true;
    setup.gate.opening_time = 0.2;
    if (material.has("repository")) {
      setup.gate.terminal_speed = material.table("repository").number("gate_speed");
      setup.gate.time_constant = material.table("repository").number("gate_time");
    }
  }
  if (file.has("published")) {
    const support::Toml published = file.table("published");
    published.only({"rest_time_exp_s", "rest_time_exp_pm_s", "rest_time_sim_s",
                    "rest_time_sim_pm_s", "rest_time_pm_s", "height_final_exp_m",
                    "height_final_exp_pm_m", "height_final_sim_m", "height_final_sim_pm_m",
                    "height_final_pm_m", "runout_exp_m", "runout_exp_pm_m", "runout_sim_m",
                    "runout_sim_pm_m", "runout_pm_m"});
    run.published = published.to_json();
  }
  return run;
}

/// Time series of what the front does.
class Measurement {
 public:
  template <class Sim>
  void sample(const Sim& sim, const talus::CollapseSetup& setup, const talus::Profile& profile,
              double now) {
    const double last_front = front, last_time = time;
    front = talus::front_position(profile, setup.bed_depth + threshold_height);
    time = now;
    speed = (front - last_front) / (time - last_time);
    height_wall = profile.height.front() - setup.bed_depth;
    volume = talus::volume_under_surface(sim, setup.side_wall_cells);
  }
  double front = 0, height_wall = 0, volume = 0;
  double time = std::numeric_limits<double>::quiet_NaN(), speed = 0; // NaN: no sample before
};

/// Profiles of one instant across a 3-D channel, by the names that tables give them.
template <class Sim>
std::vector<std::pair<std::string, talus::Profile>>
profiles_across(const Sim& sim, const talus::CollapseSetup& setup, double static_speed) {
  const int margin = setup.side_wall_cells;
  return {{"wall", talus::measure_profile(sim, margin, static_speed)},
          {"middle", talus::measure_profile(sim, talus::middle_row, static_speed)},
          {"mean", talus::mean_profile(sim, margin, static_speed)}};
}

/// A file of --compare: profiles (x_m, height_m; at choice time_s, else the deposit, and
/// static_height_m) or the front (time_s; front_m or runout_m or both), with the columns of
/// profiles.csv and front.csv.
json load_measured(const std::string& path) {
  const talus::CsvTable table = talus::read_csv(path);
  const auto has = [&](const char* name) {
    return std::ranges::find(table.names, name) != table.names.end();
  };
  const bool profile = has("x_m") && has("height_m");
  if (!profile && !(has("time_s") && (has("front_m") || has("runout_m"))))
    throw std::invalid_argument("--compare " + path +
                                ": it has neither the columns x_m and height_m nor time_s and "
                                "front_m or runout_m");
  const std::vector<std::string> allowed =
      profile ? std::vector<std::string>{"time_s", "x_m", "height_m", "static_height_m"}
              : std::vector<std::string>{"time_s", "front_m", "runout_m"};
  json measured = {{"file", std::filesystem::path(path).filename().string()}};
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    const std::string& name = table.names[c];
    if (std::ranges::find(allowed, name) == allowed.end())
      throw std::invalid_argument(
          "--compare " + path + ": no column \"" + name + "\" is known beside " + allowed[1] +
          "; allowed: " +
          (profile ? "time_s, x_m, height_m, static_height_m" : "time_s, front_m, runout_m"));
    measured[name] = table.columns[c];
  }
  if (table.columns.front().empty())
    throw std::invalid_argument("--compare " + path + ": it has no rows");
  return measured;
}

/// One line of the table: a measured value beside the published ones, where there are any.
void print_beside(const char* what, const json& measured, const json& published,
                  const std::string& key, const std::string& unit) {
  const auto value = [&](const std::string& source) -> std::string {
    const auto of = support::published_value(published, key, source, unit);
    if (!of)
      return "-";
    char text[32];
    std::snprintf(text, sizeof text, "%.3f +- %.3f", of->value, of->half_width);
    return text;
  };
  char text[32] = "-";
  if (!measured.is_null())
    std::snprintf(text, sizeof text, "%.3f", measured.get<double>());
  std::printf("%-18s %8s %21s %17s\n", what, text, value("sim").c_str(), value("exp").c_str());
}

template <int Dim>
int run(const Options& options, const Case& collapse) {
  json compare; // before anything is simulated
  for (const std::string& file : options.compare)
    compare.push_back(load_measured(file));
  using Sim = support::OnRanks<
      talus::Simulation<Dim, support::AnyRheology, support::AnyTransfer, support::AnySolver>>;
  const support::Resolution& resolution = support::resolution_of(options.resolution);
  talus::CollapseSetup setup = collapse.setup;
  setup.validate();
  talus::Vec<3> cell(resolution.along, resolution.across, resolution.up);
  if (!options.cell.empty()) {
    if (Dim == 3 && options.cell.size() == 2)
      talus::throw_invalid("--cell", "2 edges", "3 of them in 3-D: along, across, up");
    cell = talus::Vec<3>(options.cell.front(), options.cell[1], options.cell.back());
  }
  if (options.preset == "repository")
    setup.gate_thickness = 2 * cell[0];

  typename Sim::Params params;
  params.grid = setup.grid<Dim>(cell);
  params.material.density = collapse.material.density;
  params.gravity = setup.gravity_vector<Dim>();
  params.time_step = options.time_step.value_or(resolution.time_step);
  params.cfl = options.cfl;
  params.faces = setup.faces<Dim>();
  const auto gate = setup.make_gate<Dim>();
  if (!options.no_gate)
    params.obstacles.push_back(gate);
  for (const auto& wall : setup.make_side_walls<Dim>())
    params.obstacles.push_back(wall);
  params.rheology = support::rheology_params(options.policies, collapse.material, options.friction,
                                             options.preset == "repository");
  params.friction_updates = options.friction_updates;
  params.transfer = support::transfer_params(options.policies);
  params.solver.tolerance = options.tolerance;
  params.solver.max_sweeps = options.max_sweeps;
  params.solver.extrapolation = options.extrapolation;
  params.solver.name = options.solver;
  params.packing = options.packing;
  params.threads = options.run.common.threads;
  support::watch_budget<Sim>(options.run, params);

  talus::Seeding seeding;
  seeding.per_axis = options.per_axis.value_or(resolution.per_axis);
  seeding.jitter = options.jitter;
  seeding.seed = options.seed;
  seeding.pattern = options.seeding == "random" ? talus::Seeding::Pattern::random
                                                : talus::Seeding::Pattern::jittered;
  const talus::Grid<Dim> grid(params.grid);
  int profile_row = 0; // of nodes across
  json profile_y = nullptr;
  if constexpr (Dim == 3) {
    profile_row = support::channel_row("--profile-row", options.profile_row, grid.cells(1),
                                       setup.side_wall_cells);
    profile_y = grid.node_position({0, profile_row, 0})[1];
  }
  Sim sim(params, setup.particles<Dim>(grid, seeding));
  double material_volume = 0;
  for (const double v : sim.particles().volume)
    material_volume += v;

  json domain = json::array();
  for (int a = 0; a < Dim; ++a)
    domain.push_back(params.grid.size[a]);
  json cells = json::array();
  for (int a = 0; a < Dim; ++a)
    cells.push_back(params.grid.cells[a]);
  const json inputs = {{"case", options.case_name},
                       {"preset", options.preset},
                       {"resolution", options.cell.empty() ? options.resolution : "custom"},
                       {"dimension", Dim},
                       {"rheology", options.policies.rheology},
                       {"friction_updates", options.friction_updates},
                       {"friction", options.friction ? json(*options.friction) : json(nullptr)},
                       {"transfer", options.policies.transfer},
                       {"solver", options.solver},
                       {"tolerance", options.tolerance},
                       {"max_sweeps", options.max_sweeps},
                       {"packing_slack", options.packing.slack},
                       {"packing_dilatancy", options.packing.dilatancy},
                       {"packing_even", options.packing.even},
                       {"packing_surfaces", options.packing.surfaces},
                       {"material", collapse.material.name},
                       {"material_values", collapse.material_values},
                       {"inclination_deg", setup.inclination_deg},
                       {"column_length_m", setup.column_length},
                       {"column_height_m", setup.column_height},
                       {"bed_depth_m", setup.bed_depth},
                       {"domain_m", domain},
                       {"cells", cells},
                       {"particles", sim.particles().size()},
                       {"particles_per_cell_edge", seeding.per_axis},
                       {"seeding", options.seeding},
                       {"jitter", seeding.jitter},
                       {"seed", seeding.seed},
                       {"wall_friction", setup.wall_friction},
                       {"gate", !options.no_gate},
                       {"gate_friction", setup.gate_friction},
                       {"gate_opening_time_s", setup.gate.opening_time},
                       {"gate_speed_m_s", setup.gate.terminal_speed},
                       {"gate_time_constant_s", setup.gate.time_constant},
                       {"gate_thickness_m", setup.gate_thickness},
                       {"time_step_s", params.time_step},
                       {"cfl", params.cfl},
                       {"static_threshold_m_s", options.static_threshold},
                       {"profile_y_m", profile_y}};

  // All input is known to be good: from here on files are written.
  support::RunOptions run_options = options.run;
  run_options.time_zero = setup.gate.opening_time;
  run_options.end_time = options.end_time.value_or(options.max_time);
  run_options.section_row = options.profile_row;
  run_options.side_wall_cells = setup.side_wall_cells;
  support::Run run(sim, "collapse", run_options, inputs, "collapse " + options.case_name);
  if (run.finished())
    return 0;
  std::vector<std::string> front_columns{"time_s",        "front_m",        "runout_m",
                                         "height_wall_m", "speed_max_m_s",  "volume_m3",
                                         "gate_height_m", "front_speed_m_s"};
  std::vector<std::string> profile_columns{"time_s", "x_m", "height_m", "static_height_m"};
  if (Dim == 3)
    for (const std::string place : {"wall", "middle", "mean"}) {
      front_columns.push_back("front_" + place + "_m");
      profile_columns.push_back("height_" + place + "_m");
      profile_columns.push_back("static_height_" + place + "_m");
    }
  talus::CsvWriter& front = run.table("front.csv", front_columns);
  talus::CsvWriter& profiles = run.table("profiles.csv", profile_columns);
  const auto across = [&] {
    if constexpr (Dim == 3)
      return profiles_across(sim, setup, options.static_threshold);
    else
      return std::vector<std::pair<std::string, talus::Profile>>();
  };
  const auto measure = [&] {
    return talus::measure_profile(sim, profile_row, options.static_threshold);
  };
  run.on_snapshot = [&](double time) {
    const talus::Profile profile = measure();
    const auto rows = across();
    for (std::size_t i = 0; i < profile.x.size(); ++i) {
      std::vector<double> line{time, profile.x[i], profile.height[i], profile.static_height[i]};
      for (const auto& [place, of] : rows)
        line.insert(line.end(), {of.height[i], of.static_height[i]});
      profiles.row(line);
    }
  };
  talus::CsvWriter& inertial =
      run.table("inertial.csv", {"time_s", "I_30", "I_median", "I_70", "nodes"});
  talus::RestDetector rest(rest_speed, rest_hold);
  run.keep(
      "last_motion", [&] { return json(rest.last_motion()); },
      [&](const json& time) { rest.update(time, std::numeric_limits<double>::infinity()); });
  Measurement now;
  run.keep("front", now.front);
  run.keep(
      "front_time", [&] { return json(now.time); },
      [&](const json& time) { now.time = support::value_or_nan(time); });
  run.keep("height_wall", now.height_wall);
  run.keep("volume", now.volume);

  const auto record = [&](const auto& problem) {
    const std::size_t number = sim.steps() + 1;
    if (std::ranges::find(options.record_problems, number) != options.record_problems.end())
      talus::write_problem(run.folder() / ("problem_" + std::to_string(number) + ".talus"),
                           problem);
  };
  while (run.advance(record)) {
    const double speed = talus::largest_speed(sim);
    // The gate may set in motion again what it stands in.
    const bool driven = !options.no_gate && !gate->done(sim.time(), talus::highest_particle(sim));
    rest.update(std::max(0.0, run.time()),
                driven ? std::numeric_limits<double>::infinity() : speed);
    if (!options.end_time && run.time() > 0 && rest.at_rest())
      run.stop();
    if (run.sample_due()) {
      // The fields of the step are those at its start, before the particles moved on.
      now.sample(sim, setup, measure(), run.time_before());
      std::vector<double> line{run.time_before(),
                               now.front,
                               now.front - setup.column_length,
                               now.height_wall,
                               speed,
                               now.volume,
                               options.no_gate
                                   ? std::numeric_limits<double>::infinity()
                                   : gate->bottom(setup.gate.opening_time + run.time_before()),
                               now.speed};
      for (const auto& [place, of] : across())
        line.push_back(talus::front_position(of, setup.bed_depth + threshold_height));
      front.row(line);
      const talus::InertialQuantiles numbers = talus::inertial_quantiles(sim);
      inertial.row(run.time_before(), numbers.low, numbers.median, numbers.high, numbers.nodes);
    }
    char text[96];
    std::snprintf(text, sizeof text, "t = %.3f s, fastest %.3f m/s, run-out %.3f m, %d sweeps",
                  run.time(), speed, now.front - setup.column_length,
                  run.report().solve.iterations);
    run.text = text;
  }
  if (run.status == "completed" && !options.end_time && !rest.at_rest())
    run.status = "not at rest after " + std::to_string(options.max_time) + " s";
  for (const std::size_t number : options.record_problems)
    if (number > sim.steps())
      std::fprintf(stderr, "--record-problem %zu: the run ended after %zu steps\n", number,
                   sim.steps());

  const json rest_time = rest.at_rest() ? json(rest.last_motion()) : json(nullptr);
  const double speed_end = talus::largest_speed(sim);
  const double volume_loss = 1 - now.volume / material_volume;
  const double runout = now.front - setup.column_length;
  json measured = {{"runout_m", runout},
                   {"height_final_m", now.height_wall},
                   {"rest_time_s", rest_time}, // null: it still moves
                   {"speed_end_m_s", speed_end},
                   {"volume_loss", volume_loss},
                   {"material_volume", material_volume},
                   {"end_time_s", run.time()}};
  // The front may be thinner than a cell: how far the run-out hangs on the threshold.
  const talus::Profile deposit = measure();
  const auto measure_above = [&](const std::string& name, double height) {
    measured["runout_by_threshold_m"][name] =
        talus::front_position(deposit, setup.bed_depth + height) - setup.column_length;
  };
  for (int mm = 1; mm <= 5; ++mm)
    measure_above(std::to_string(mm) + " mm", 1e-3 * mm);
  for (const int grains : {2, 4, 6, 8})
    measure_above(std::to_string(grains) + " grains", grains * collapse.material.grain_diameter);
  measure_above("half a cell", grid.spacing()[Dim - 1] / 2);
  for (const auto& [place, of] : across()) {
    measured["runout_" + place + "_m"] =
        talus::front_position(of, setup.bed_depth + threshold_height) - setup.column_length;
    measured["height_final_" + place + "_m"] = of.height.front() - setup.bed_depth;
  }
  // and measures without one
  const talus::Vec<Dim> centre = talus::centre_of_mass(sim.particles());
  measured["centre_of_mass_m"] = std::vector<double>(centre.begin(), centre.end());
  for (const int percent : {95, 99})
    measured["runout_" + std::to_string(percent) + "_m"] =
        talus::volume_quantile(sim.particles(), percent / 100.0, setup.column_length,
                               setup.bed_depth) -
        setup.column_length;
  measured["potential_energy_J"] = // in 2-D: J/m
      talus::potential_energy<Dim>(sim.particles(), params.material.density, params.gravity);
  measured["kinetic_energy_J"] = talus::kinetic_energy(sim.particles(), params.material.density);
  if (setup.bed_depth == 0) // on a bed the column's particles are not told from the bed's
    measured["farthest_at_rest_m"] = talus::farthest_at_rest(sim.particles(), rest_speed);
  json results = {{"measured", measured}, {"published", collapse.published}};
  if (!compare.empty())
    results["compare"] = compare;
  run.write_summary(results);

  if (!options.run.common.quiet) {
    std::printf("%s, %s preset, %s, %d-D, %zu particles: %s\n", options.case_name.c_str(),
                options.preset.c_str(), options.resolution.c_str(), Dim, sim.particles().size(),
                run.status.c_str());
    std::printf("%-18s %8s %21s %17s\n", "", "talus", "authors' simulation", "experiment");
    print_beside("run-out (m)", runout, collapse.published, "runout", "_m");
    print_beside("final height (m)", now.height_wall, collapse.published, "height_final", "_m");
    print_beside("rest time (s)", rest_time, collapse.published, "rest_time", "_s");
    if (rest_time.is_null())
      std::printf(
          "it still moves, at up to %.3f m/s: no rest time, and no final run-out or height\n",
          speed_end);
    std::printf("%-18s %7.2f%%\n", "volume loss", 100 * volume_loss);
  }
  return run.finish("plot_collapse.py");
}

int run_collapse(const Options& options) {
  if (options.until_rest && options.end_time)
    throw std::invalid_argument("--until-rest and --end-time exclude each other");
  if (options.dimension == 2 && options.width)
    throw std::invalid_argument("--width goes with --dim 3, not 2");
  if (options.dimension == 2 && options.profile_row != Options{}.profile_row)
    throw std::invalid_argument("--profile-row goes with --dim 3, not 2");
  talus::require_non_negative("--static-threshold", options.static_threshold);
  if (options.end_time && !(*options.end_time > 0 && std::isfinite(*options.end_time)))
    talus::throw_invalid("--end-time", *options.end_time, "a finite number > 0");
  talus::require_positive("--max-time", options.max_time);
  if (!options.record_problems.empty() && support::RanksOfProgram::count() > 1)
    throw std::invalid_argument("--record-problem goes with one rank");
  for (const std::size_t number : options.record_problems)
    if (number < 1)
      talus::throw_invalid("--record-problem", number, "the number of a step, >= 1");
  const Case collapse = load_case(options);
  return options.dimension == 2 ? run<2>(options, collapse) : run<3>(options, collapse);
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("A granular column collapses over an inclined erodible bed (Rousseau et al. 2023).");
  app.add_option("--case", options.case_name, "Run of the paper: " + support::case_names())
      ->capture_default_str();
  app.add_option("--preset", options.preset, "Set-up: the paper's text or its authors' scripts")
      ->check(CLI::IsMember({"paper", "repository"}))
      ->capture_default_str();
  app.add_option("--resolution", options.resolution,
                 "Grid, time step and particles per cell; medium: as coarse, cells half as high; "
                 "reference: the paper's")
      ->check(CLI::IsMember(support::resolution_names()))
      ->capture_default_str();
  app.add_option("--dim", options.dimension, "Dimension")
      ->check(CLI::Range(2, 3))
      ->capture_default_str();
  support::add_resume_options(app, options.run.resume);
  support::add_policy_options(app, options.policies);
  app.add_option(
         "--solver", options.solver,
         "sweeps-then-interior-point: accelerated sweeps, one projected step a cone, and interior "
         "points in steps that they do not solve, with up to 12000 cones; gauss-seidel: "
         "sweeps alone; gauss-seidel-secular: sweeps with exact local solutions; "
         "gauss-seidel-newton: the paper's, on the non-associated law, which may not converge")
      ->check(CLI::IsMember({"gauss-seidel", "gauss-seidel-secular", "gauss-seidel-newton",
                             "sweeps-then-interior-point"}))
      ->capture_default_str();
  app.add_option("--tolerance", options.tolerance,
                 "Solver: relative residual at which a step is solved")
      ->capture_default_str();
  app.add_option("--max-sweeps", options.max_sweeps, "Solver: most sweeps in a step")
      ->capture_default_str();
  app.add_option("--friction-updates", options.friction_updates,
                 "Most times that a step takes the friction from the law, for laws of the inertial "
                 "number; 1: from the last step, as the paper")
      ->capture_default_str();
  app.add_option("--packing-slack", options.packing.slack,
                 "Share of its volume by which a node may miss dense and count as dense")
      ->capture_default_str();
  app.add_option("--packing-dilatancy", options.packing.dilatancy,
                 "How fast denser material expands, per unit of strain")
      ->capture_default_str();
  app.add_option("--packing-even", options.packing.even,
                 "For flows sheared by many times their height, see talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-surfaces", options.packing.surfaces,
                 "Does dense material with a free surface count as dense? false with no slack and "
                 "no dilatancy: the paper's method, which loses volume")
      ->capture_default_str();
  app.add_flag("--until-rest", options.until_rest,
               "Run until nothing moves faster than 0.01 m/s (default)");
  app.add_option("--end-time", options.end_time,
                 "Run for so many seconds after the gate's opening");
  app.add_option("--max-time", options.max_time, "Stop here if there is no rest, s")
      ->capture_default_str();
  app.add_option("--friction", options.friction, "Friction coefficient instead of the material's");
  app.add_option("--wall-friction", options.wall_friction,
                 "Wall friction instead of the material's");
  app.add_option("--gate-friction", options.gate_friction, "Gate friction instead of the walls'");
  app.add_flag("--no-gate", options.no_gate, "The column is released at once")
      ->excludes("--gate-friction");
  app.add_option("--inclination", options.inclination, "Slope instead of the case's, degrees");
  app.add_option("--column-length", options.column_length, "Instead of the case's, m");
  app.add_option("--column-height", options.column_height, "Above the bed, m");
  app.add_option("--bed-depth", options.bed_depth, "0: the column stands on the floor, m");
  app.add_option("--length", options.length, "Channel length instead of the case's, m");
  app.add_option("--width", options.width, "Channel width instead of the case's, m");
  app.add_option("--height", options.height, "Channel height instead of the case's, m");
  app.add_option("--cell", options.cell,
                 "Cell edges along, across, up (2-D: along, up) instead of the resolution's, m")
      ->expected(2, 3);
  app.add_option("--time-step", options.time_step, "Time step instead of the resolution's, s");
  app.add_option("--cfl", options.cfl,
                 "Shorten steps so that nothing crosses more of a cell; 0: fixed steps")
      ->capture_default_str();
  app.add_option("--particles-per-edge", options.per_axis, "Particles along a cell's edge");
  app.add_option("--seeding", options.seeding, "Initial positions: on a jittered lattice or random")
      ->check(CLI::IsMember({"jittered", "random"}))
      ->capture_default_str();
  app.add_option("--jitter", options.jitter, "Of the lattice, 0 to 1")->capture_default_str();
  app.add_option("--seed", options.seed, "Of the random numbers")
      ->check([](const std::string& text) { // a negative one would be taken modulo 2^64
        return text.starts_with('-') ? "allowed: an integer >= 0" : "";
      })
      ->capture_default_str();
  app.add_option("--static-threshold", options.static_threshold,
                 "Slower than this counts as static in profiles.csv, m/s")
      ->capture_default_str();
  app.add_option(
         "--profile-row", options.profile_row,
         "Row of nodes across that profile and front are read from in 3-D: wall, middle, or "
         "a number from the wall")
      ->capture_default_str();
  app.add_option("--compare", options.compare,
                 "Draw what was measured into the picture: CSV files with x_m, height_m and, at "
                 "choice, time_s (else: the deposit) and static_height_m, or with time_s and "
                 "front_m or runout_m; as in profiles.csv and front.csv");
  support::add_snapshot_options(app, options.run);
  app.add_option(
      "--record-problem", options.record_problems,
      "Save the dual problem of step N (1 is the first) as problem_N.talus; may be given "
      "more than once");
  support::add_common_options(app, options.run.common, "out/collapse");
  return support::run_program(app, argc, argv, [&] { return run_collapse(options); });
}
