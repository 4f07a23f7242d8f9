// SPDX-License-Identifier: MIT
//
// The collapses B00 to B20 and G00 to G15 of Rousseau et al. 2023, beside the published values:
// what differs is told in units of their half widths.

#include "support/sweep.hpp"

#include <cmath>
#include <limits>

namespace {

using nlohmann::json;
using support::text;
using support::Values;

const std::vector<std::string> sources = {"sim", "exp"};
const std::vector<std::string> source_labels = {"authors' simulation", "experiment"};

struct Quantity {
  std::string name, unit, label;
};
const std::vector<Quantity> quantities = {{"runout", "_m", "run-out (m)"},
                                          {"height_final", "_m", "H_f (m)"},
                                          {"rest_time", "_s", "rest time (s)"}};

struct Published {
  double value = std::numeric_limits<double>::quiet_NaN(), half_width = value;
};

Published published(const json& summary, const Quantity& quantity, const std::string& source) {
  const json& all = summary.at("published");
  const std::string of = quantity.name + "_" + source;
  if (!all.contains(of + quantity.unit))
    return {};
  const std::string own = of + "_pm" + quantity.unit; // or one for both sources
  return {all.at(of + quantity.unit),
          all.contains(own) ? all.at(own) : all.at(quantity.name + "_pm" + quantity.unit)};
}

/// The runs of one material: their deposits, and each quantity against the slope.
std::vector<support::Panel> panels(const std::string& material, const support::Sweep& sweep,
                                   const std::vector<support::Job>& jobs,
                                   const std::vector<json>& summaries) {
  std::vector<support::Panel> result = {support::Panel({.title = material + ", deposits",
                                                        .x = "x, down the slope (m)",
                                                        .y = "height above the floor (m)"})};
  for (const support::Job& job : jobs)
    support::add_final_profile(result[0], job.name.substr(0, 3), sweep.folder(job));
  for (const Quantity& quantity : quantities) {
    support::Panel panel({.title = material, .x = "slope (degrees)", .y = quantity.label});
    Values slopes, values;
    for (const json& summary : summaries) {
      slopes.push_back(summary.at("inputs").at("inclination_deg"));
      values.push_back(summary.at("measured").at(quantity.name + quantity.unit));
      for (std::size_t s = 0; s < sources.size(); ++s) {
        const Published of = published(summary, quantity, sources[s]);
        if (std::isfinite(of.value))
          panel.published(source_labels[s], slopes.back(), 0, of.value, of.half_width);
      }
    }
    result.push_back(panel.add("points", "talus", slopes, values));
  }
  return result;
}

support::StudyResults study(support::Sweep& sweep, const std::string& preset) {
  std::vector<support::Job> jobs;
  for (const char* name : {"B00", "B05", "B10", "B15", "B20", "G00", "G05", "G10", "G15"})
    jobs.push_back({std::string(name) + "_" + preset, {"--case", name, "--preset", preset}});
  const auto summaries = sweep.run(jobs, "collapses");

  support::StudyResults results;
  results.title = "Collapses, " + preset + " preset";
  results.inputs["preset"] = preset;
  results.columns = {"run"};
  for (const Quantity& quantity : quantities) {
    results.columns.push_back(quantity.name + quantity.unit);
    for (const std::string& source : sources)
      results.columns.push_back(quantity.name + "_off_" + source);
  }
  results.columns.push_back("volume_loss");
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const json& measured = summaries[i].at("measured");
    results.measured[jobs[i].name] = measured;
    std::vector<std::string> row = {jobs[i].name};
    for (const Quantity& quantity : quantities) {
      const double value = measured.at(quantity.name + quantity.unit);
      row.push_back(text(value));
      for (const std::string& source : sources) {
        const Published of = published(summaries[i], quantity, source);
        const double off = (value - of.value) / of.half_width; // in half widths
        row.push_back(std::isfinite(off) ? text(off) : "");
        if (std::isfinite(off))
          results.measured[jobs[i].name]["off_by_half_widths"][quantity.name + "_" + source] = off;
      }
    }
    row.push_back(text(measured.at("volume_loss")));
    results.rows.push_back(row);
  }
  const auto part = [&](std::size_t from, std::size_t to) {
    const auto slice = [&](const auto& all) {
      return std::vector(all.begin() + static_cast<std::ptrdiff_t>(from),
                         all.begin() + static_cast<std::ptrdiff_t>(to));
    };
    return panels(from == 0 ? "Beads" : "Granules", sweep, slice(jobs), slice(summaries));
  };
  const auto beads = part(0, 5), granules = part(5, jobs.size());
  for (std::size_t row = 0; row < beads.size(); ++row) {
    results.panels.push_back(beads[row]);
    results.panels.push_back(granules[row]);
  }
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  std::string preset = "paper";
  CLI::App app("All collapses beside the published values (Rousseau et al. 2023).");
  app.add_option("--preset", preset, "Set-up: the paper's text or its authors' scripts")
      ->check(CLI::IsMember({"paper", "repository"}))
      ->capture_default_str();
  support::add_study_options(app, options, "collapses");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "collapses",
                              [&](support::Sweep& sweep) { return study(sweep, preset); });
  });
}
