// SPDX-License-Identifier: MIT
//
// Silos: the pressure on the floor against the height of the filling (Janssen 1895), and the rate
// of discharge against the opening and the height (Beverloo, Leniger & van de Velde 1961).

#include "support/run_picture.hpp"
#include "support/sweep.hpp"

#include "talus/diagnostics/fits.hpp"

namespace {

using support::text;
using support::Values;

/// What is changed in a set of runs, and what all of them share.
struct Set {
  std::string name, program, option;
  Values values; ///< of the option, m
  std::vector<std::string> arguments;
};

const std::vector<Set> sets = {
    {"pressure",
     "janssen",
     "--height",
     {0.1, 0.2, 0.4, 0.8},
     {"--cell", "0.01", "--width", "0.1", "--wall-friction", "0.4", "--end-time", "0.6"}},
    {"opening_2d",
     "silo",
     "--opening",
     {0.07, 0.09, 0.11, 0.15, 0.19},
     {"--cell", "0.01", "--width", "0.8", "--height", "0.5", "--share-out", "0.25"}},
    {"opening_3d",
     "silo",
     "--opening",
     {0.05, 0.07, 0.09},
     {"--dim", "3", "--cell", "0.01", "--width", "0.2", "--height", "0.12", "--share-out", "0.2",
      "--particles-per-edge", "2"}},
    {"height",
     "silo",
     "--height",
     {0.2, 0.4},
     {"--cell", "0.005", "--width", "0.2", "--opening", "0.055"}}};

std::vector<support::Job> jobs() {
  std::vector<support::Job> all;
  for (const Set& set : sets)
    for (const double value : set.values) {
      support::Job job{set.name + "_" + text(value), set.arguments, set.program};
      job.arguments.insert(job.arguments.end(), {set.option, text(value)});
      all.push_back(job);
    }
  return all;
}

support::StudyResults study(support::Sweep& sweep) {
  const std::vector<support::Job> all = jobs();
  const auto summaries = sweep.run(all, "silo_study");
  support::StudyResults results;
  results.title = "Silos";
  results.columns = {"run", "opening_or_height_m", "rate_or_pressure"};
  // a measured value of all runs of a set
  const auto measured = [&](const Set& set, const std::string& key) {
    Values values;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all[i].name.starts_with(set.name + "_"))
        values.push_back(support::value_or_nan(summaries[i].at("measured").at(key)));
    return values;
  };
  for (const Set& set : sets) {
    const bool pressure = set.program == "janssen", fitted = set.option == "--opening";
    const std::string unit = set.name == "opening_3d" ? "m³/s" : "m²/s";
    support::Panel panel(
        {.title = pressure ? "Pressure on a floor that sinks" : "Discharge",
         .x = (fitted ? "opening in whole nodes (m)" : "height of the filling (m)"),
         .y = pressure ? "pressure (Pa)" : "rate (" + unit + ")",
         .log = fitted});
    const Values x = fitted ? measured(set, "opening_effective_m") : set.values;
    const Values y = measured(set, pressure ? "floor_pressure_Pa" : "rate");
    panel.add("points", "talus", x, y);
    if (pressure) {
      panel.add("line", "Janssen with the measured K", x, measured(set, "janssen_Pa"));
      panel.add("dashed", "hydrostatic", x, measured(set, "hydrostatic_Pa"));
    }
    if (fitted) {
      const talus::PowerLawFit fit = talus::fit_power_law(x, y);
      results.measured[set.name] = {{"exponent", fit.exponent},
                                    {"exponent_error", fit.exponent_error},
                                    {"coefficient", fit.coefficient}};
      Values line;
      for (const double opening : x)
        line.push_back(fit(opening));
      panel.add("dashed", text("exponent %.2f ± %.2f", fit.exponent, fit.exponent_error), x, line);
    }
    for (std::size_t i = 0; i < y.size(); ++i)
      results.rows.push_back({set.name, text(x[i]), text(y[i])});
    results.panels.push_back(panel);
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    results.measured["runs"][all[i].name] = summaries[i].at("measured");
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options{.resolution = {}};
  CLI::App app("Pressure in silos and rate of their discharge.");
  support::add_study_options(app, options, "silo_study");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "silo_study",
                              [&](support::Sweep& sweep) { return study(sweep); });
  });
}
