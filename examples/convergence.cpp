// SPDX-License-Identifier: MIT
//
// How far a collapse depends on cells and time step: one case with cells h, h/2, … and two time
// steps at each. From run to run one of the two is halved. Beside the differences stands what other
// random positions of the particles change.

#include "support/sweep.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

namespace {

using nlohmann::json;
using support::text;
using support::Values;

struct Options {
  std::string case_name = "B15", preset = "paper";
  int dimension = 2, levels = 2, seeds = 3;
  std::optional<int> particles_per_edge;
  // with 3 in 2-D the volume that is lost grows as the cells get smaller
  int per_axis() const { return particles_per_edge.value_or(dimension == 2 ? 4 : 3); }
};

/// A row of the table, and where a run's summary.json has it.
struct Measure {
  std::string name;
  json::json_pointer place;
  double of(const json& summary) const { return support::value_or_nan(summary.at(place)); }
};

std::vector<Measure> all_measures(int dimension) {
  std::vector<Measure> all;
  const auto add = [&](const std::string& name, const std::string& place) {
    all.push_back({name, json::json_pointer("/measured/" + place)});
  };
  for (std::string threshold : {"1 mm", "2 mm", "3 mm", "4 mm", "5 mm", "2 grains", "4 grains",
                                "6 grains", "8 grains", "half a cell"}) {
    const std::string place = "runout_by_threshold_m/" + threshold;
    std::ranges::replace(threshold, ' ', '_');
    add("runout_above_" + threshold + "_m", place);
  }
  for (const char* same : {"runout_95_m", "runout_99_m", "height_final_m", "rest_time_s",
                           "volume_loss", "potential_energy_J", "kinetic_energy_J"})
    add(same, same);
  add("centre_of_mass_x_m", "centre_of_mass_m/0");
  add("centre_of_mass_z_m", "centre_of_mass_m/" + std::to_string(dimension - 1));
  return all;
}

/// A number in the table, or nothing if there is none.
std::string rounded(const char* format, double value) {
  char digits[32] = "";
  if (std::isfinite(value))
    std::snprintf(digits, sizeof digits, format, value);
  return digits;
}

double mean(const Values& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Of a sample: by n − 1.
double standard_deviation(const Values& values) {
  const double middle = mean(values);
  double sum = 0;
  for (const double value : values)
    sum += (value - middle) * (value - middle);
  return std::sqrt(sum / (static_cast<double>(values.size()) - 1));
}

struct Run {
  std::string cell, step; ///< "h/2", "dt/4"
  std::string halved{};   ///< which of them is half of the last run's
  support::Job job{};
  json summary{};
};

/// Cells h, h/2, …; at each a time step in proportion, and half of it.
std::vector<Run> all_runs(const support::StudyOptions& study, const Options& options) {
  const auto part = [](const char* of, int divisor) {
    return divisor == 1 ? of : of + ("/" + std::to_string(divisor));
  };
  const support::Resolution& first = support::resolution_of(study.resolution);
  std::vector<Run> all;
  for (int level = 0; level < options.levels; ++level)
    for (int half = 0; half < 2; ++half) {
      const int cells = 1 << level, steps = cells << half;
      Run run{.cell = part("h", cells), .step = part("dt", steps)};
      run.halved = half == 1 ? run.step + " at " + run.cell : run.cell + " at " + run.step;
      run.job.name = "h" + std::to_string(cells) + "_dt" + std::to_string(steps);
      run.job.arguments = {"--case",
                           options.case_name,
                           "--preset",
                           options.preset,
                           "--dim",
                           std::to_string(options.dimension),
                           "--cell",
                           text(first.along / cells),
                           text(first.across / cells),
                           text(first.up / cells),
                           "--time-step",
                           text(first.time_step / steps),
                           "--particles-per-edge",
                           std::to_string(options.per_axis())};
      all.push_back(run);
    }
  return all;
}

/// Edge of a cell along an axis of a run, m.
double cell_edge(const json& summary, std::size_t axis) {
  const json& inputs = summary.at("inputs");
  return inputs.at("domain_m").at(axis).get<double>() / inputs.at("cells").at(axis).get<double>();
}

support::StudyResults study(support::Sweep& sweep, const support::StudyOptions& study_options,
                            const Options& options) {
  std::vector<Run> runs = all_runs(study_options, options);
  std::vector<Run> again; // the first one, from other places of the particles
  for (int seed = 2; seed <= options.seeds; ++seed) {
    again.push_back(runs[0]);
    again.back().job.name += "_seed" + std::to_string(seed);
    again.back().job.arguments.insert(again.back().job.arguments.end(),
                                      {"--seed", std::to_string(seed)});
  }
  std::vector<support::Job> jobs; // the longest first, so that no processor waits for it in the end
  for (auto run = runs.rbegin(); run != runs.rend(); ++run)
    jobs.push_back(run->job);
  for (const Run& run : again)
    jobs.push_back(run.job);
  const std::vector<json> summaries = sweep.run(jobs, "convergence");
  auto summary = summaries.begin();
  for (auto run = runs.rbegin(); run != runs.rend(); ++run)
    run->summary = *summary++;
  for (Run& run : again)
    run.summary = *summary++;

  support::StudyResults results;
  results.title = options.case_name + " in " + std::to_string(options.dimension) + "-D, " +
                  options.preset + " preset: cells and time steps halved";
  results.inputs = {{"case", options.case_name},
                    {"preset", options.preset},
                    {"dimension", options.dimension},
                    {"levels", options.levels},
                    {"particles_per_cell_edge", options.per_axis()},
                    {"seeds", options.seeds}};
  const std::size_t up = static_cast<std::size_t>(options.dimension) - 1;
  results.columns = {"measure"};
  for (const Run& run : runs) {
    results.columns.push_back(run.cell + " " + run.step);
    results.measured["runs"][run.job.name] = run.summary.at("measured");
  }
  for (std::size_t i = 1; i < runs.size(); ++i)
    results.columns.push_back(runs[i].halved);
  if (!again.empty())
    results.columns.push_back("scatter");
  for (const Run& run : again)
    results.measured["runs"][run.job.name] = run.summary.at("measured");
  const auto seeds = [&](const auto& value_of) {
    Values values = {value_of(runs[0].summary)};
    for (const Run& run : again)
      values.push_back(value_of(run.summary));
    return values;
  };
  const auto row = [&](const std::string& name, const auto& value_of, bool differences) {
    std::vector<std::string> cells = {name};
    for (const Run& run : runs)
      cells.push_back(rounded("%.4g", value_of(run.summary)));
    for (std::size_t i = 1; i < runs.size(); ++i) {
      const double change = value_of(runs[i].summary) - value_of(runs[i - 1].summary);
      cells.push_back(differences ? rounded("%+.2g", change) : "");
      if (differences)
        results.measured["differences"][runs[i].halved][name] = change;
    }
    if (!again.empty()) {
      const double scatter = standard_deviation(seeds(value_of));
      cells.push_back(differences ? rounded("%.2g", scatter) : "");
      if (differences)
        results.measured["scatter"][name] = scatter;
    }
    results.rows.push_back(cells);
  };
  row(
      "cell_along_m", [&](const json& run) { return cell_edge(run, 0); }, false);
  row(
      "cell_up_m", [&](const json& run) { return cell_edge(run, up); }, false);
  row(
      "time_step_s",
      [](const json& run) { return run.at("inputs").at("time_step_s").get<double>(); }, false);
  const std::vector<Measure> measures = all_measures(options.dimension);
  for (const Measure& measure : measures)
    row(
        measure.name, [&](const json& run) { return measure.of(run); }, true);

  support::Panel deposits(
      {.title = "Deposits", .x = "x, down the slope (m)", .y = "height above the floor (m)"});
  support::Panel fronts({.title = "Fronts", .x = "time (s)", .y = "run-out above 2 mm (m)"});
  constexpr double thin = 0.01; // m
  support::Panel tails({.title = "What lies thinner than 1 cm above the bed",
                        .x = "x from the gate (m)",
                        .y = "height above the bed (mm)"});
  for (const Run& run : runs) {
    const json& inputs = run.summary.at("inputs");
    char label[64];
    std::snprintf(label, sizeof label, "h = %.3g mm, δt = %.3g ms",
                  1e3 * cell_edge(run.summary, up), 1e3 * inputs.at("time_step_s").get<double>());
    const auto folder = sweep.folder(run.job);
    support::add_final_profile(deposits, label, folder);
    support::add_front(fronts, label, folder);
    const support::RunTable table(folder / "profiles.csv");
    Values x = table.at(table.last_time(), "x_m");
    Values height = table.at(table.last_time(), "height_m");
    for (double& place : x)
      place -= inputs.at("column_length_m").get<double>();
    for (double& above : height) {
      above -= inputs.at("bed_depth_m").get<double>();
      above = above < thin ? 1e3 * above : std::numeric_limits<double>::quiet_NaN();
    }
    tails.add("line", label, x, height);
  }
  // A measure against the cells' height, in units of `unit`, from `zero` on.
  const auto against_cells = [&](support::Panel& panel, const std::string& label,
                                 const std::string& name, double unit = 1, bool change = false) {
    const Measure& measure = *std::ranges::find(measures, name, &Measure::name);
    const double zero = change ? measure.of(runs[0].summary) : 0;
    for (const std::size_t half : {0u, 1u}) {
      Values edges, values;
      for (std::size_t i = half; i < runs.size(); i += 2) {
        edges.push_back(1e3 * cell_edge(runs[i].summary, up));
        values.push_back((measure.of(runs[i].summary) - zero) / unit);
      }
      panel.add(half == 1 ? "dashed" : "line", label + (half == 1 ? ":" : ""), edges, values);
    }
    if (again.empty())
      return;
    const Values first = seeds([&](const json& run) { return measure.of(run); });
    if (!std::isfinite(mean(first)))
      return;
    panel.add("points", label, {1e3 * cell_edge(runs[0].summary, up)},
              {(mean(first) - zero) / unit}, {standard_deviation(first) / unit});
  };
  const std::string edge = "height of a cell, h (mm); dashed: half the time step";
  support::Panel runouts(
      {.title = "Run-out above a height (bars: other seeds)", .x = edge, .y = "run-out (m)"});
  for (const std::string mm : {"1", "2", "3", "5"})
    against_cells(runouts, mm + " mm", "runout_above_" + mm + "_mm_m");
  support::Panel places(
      {.title = "Without a threshold: change from the first run (bars: other seeds)",
       .x = edge,
       .y = "change (mm)"});
  against_cells(places, "99 % of the volume", "runout_99_m", 1e-3, true);
  against_cells(places, "95 %", "runout_95_m", 1e-3, true);
  against_cells(places, "centre of mass, x", "centre_of_mass_x_m", 1e-3, true);
  against_cells(places, "H_f", "height_final_m", 1e-3, true);
  support::Panel times({.title = "Rest", .x = edge, .y = "rest time (s)"});
  against_cells(times, "rest time", "rest_time_s");
  results.panels = {deposits, tails, runouts, places, fronts, times};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions study_options;
  Options options;
  CLI::App app("How far a collapse depends on cells and time step: cells h, h/2, …, and at each a "
               "time step in proportion and half of it.");
  app.add_option("--case", options.case_name, "Run of the paper: " + support::case_names())
      ->capture_default_str();
  app.add_option("--preset", options.preset, "Set-up: the paper's text or its authors' scripts")
      ->check(CLI::IsMember({"paper", "repository"}))
      ->capture_default_str();
  app.add_option("--dim", options.dimension, "Dimension")
      ->check(CLI::Range(2, 3))
      ->capture_default_str();
  app.add_option("--levels", options.levels,
                 "How many cell sizes, the first that of --resolution. A level more costs 8 times "
                 "as much in 2-D, 16 times in 3-D")
      ->check(CLI::Range(2, 5))
      ->capture_default_str();
  app.add_option("--particles-per-edge", options.particles_per_edge,
                 "Along a cell's edge, in all runs; without: 4 in 2-D, 3 in 3-D")
      ->check(CLI::Range(1, 20));
  app.add_option("--seeds", options.seeds,
                 "Runs of the coarsest cells with other random positions of the particles: what "
                 "differs between them is chance")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  support::add_study_options(app, study_options, "convergence");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(study_options, "convergence", [&](support::Sweep& sweep) {
      return study(sweep, study_options, options);
    });
  });
}
