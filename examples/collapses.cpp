// SPDX-License-Identifier: MIT
//
// The collapses B00 to B20 and G00 to G15 of Rousseau et al. 2023, beside the published values:
// what differs is told in units of their half widths.

#include "support/published.hpp"
#include "support/sweep.hpp"

#include <utility>

namespace {

using nlohmann::json;
using support::text;
using support::Values;

const std::vector<std::pair<std::string, std::string>> sources = {{"sim", "authors' simulation"},
                                                                  {"exp", "experiment"}};

struct Quantity {
  std::string name, unit, label;
};
const std::vector<Quantity> quantities = {{"runout", "_m", "run-out (m)"},
                                          {"height_final", "_m", "H_f (m)"},
                                          {"rest_time", "_s", "rest time (s)"}};

using Runs = std::vector<std::pair<support::Job, json>>; // with their summaries

/// The runs of one material: their deposits, and each quantity against the slope.
std::vector<support::Panel> panels(const std::string& material, const support::Sweep& sweep,
                                   const Runs& runs) {
  std::vector<support::Panel> result = {support::Panel({.title = material + ", deposits",
                                                        .x = "x, down the slope (m)",
                                                        .y = "height above the floor (m)"})};
  for (const auto& [job, summary] : runs)
    support::add_final_profile(result[0], job.name.substr(0, 3), sweep.folder(job));
  for (const Quantity& quantity : quantities) {
    support::Panel panel({.title = material, .x = "slope (degrees)", .y = quantity.label});
    Values slopes, values;
    for (const auto& [job, summary] : runs) {
      slopes.push_back(summary.at("inputs").at("inclination_deg"));
      values.push_back(
          support::value_or_nan(summary.at("measured").at(quantity.name + quantity.unit)));
      for (const auto& [source, label] : sources)
        if (const auto of = support::published_value(summary.at("published"), quantity.name, source,
                                                     quantity.unit))
          panel.published(label, slopes.back(), 0, of->value, of->half_width);
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
    for (const auto& [source, label] : sources)
      results.columns.push_back(quantity.name + "_off_" + source);
  }
  results.columns.push_back("volume_loss");
  Runs beads, granules;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const json& measured = summaries[i].at("measured");
    json& result = results.measured[jobs[i].name] = measured;
    std::vector<std::string> row = {jobs[i].name};
    for (const Quantity& quantity : quantities) {
      const json& value = measured.at(quantity.name + quantity.unit); // null: not measured
      row.push_back(text(value));
      for (const auto& [source, label] : sources) {
        const auto of = support::published_value(summaries[i].at("published"), quantity.name,
                                                 source, quantity.unit);
        json off;
        if (of && !value.is_null())
          off = (value.get<double>() - of->value) / of->half_width;
        row.push_back(text(off));
        if (of)
          result["off_by_half_widths"][quantity.name + "_" + source] = off;
      }
    }
    row.push_back(text(measured.at("volume_loss")));
    results.rows.push_back(row);
    (jobs[i].name[0] == 'B' ? beads : granules).emplace_back(jobs[i], summaries[i]);
  }
  const auto left = panels("Beads", sweep, beads), right = panels("Granules", sweep, granules);
  for (std::size_t row = 0; row < left.size(); ++row) {
    results.panels.push_back(left[row]);
    results.panels.push_back(right[row]);
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
