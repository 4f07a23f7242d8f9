// SPDX-License-Identifier: MIT
//
// Inertial numbers in run B15 of Rousseau et al. 2023: median, 30 % and 70 % of the flowing nodes
// against time.

#include "support/sweep.hpp"

#include "talus/diagnostics/quantiles.hpp"

namespace {

using support::text;

support::StudyResults study(support::Sweep& sweep) {
  const support::Job job{"B15", {"--case", "B15"}};
  const auto summaries = sweep.run({job}, "inertial_number");
  const support::RunTable table(sweep.folder(job) / "inertial.csv");
  // While the column flows: at least 100 nodes do.
  support::Values time, low, median, high;
  for (std::size_t i = 0; i < table["time_s"].size(); ++i)
    if (table["nodes"][i] >= 100) {
      time.push_back(table["time_s"][i]);
      low.push_back(table["I_30"][i]);
      median.push_back(table["I_median"][i]);
      high.push_back(table["I_70"][i]);
    }
  if (time.empty())
    throw std::runtime_error("never did 100 nodes flow");
  support::StudyResults results;
  results.title = "Inertial numbers of run B15";
  results.columns = {"time_s", "I_30", "I_median", "I_70"};
  for (std::size_t i = 0; i < time.size(); ++i)
    results.rows.push_back({text(time[i]), text(low[i]), text(median[i]), text(high[i])});
  const double typical = talus::quantile(median, 0.5);
  results.measured = {{"median_over_time", typical},
                      {"median_smallest", talus::quantile(median, 0)},
                      {"median_largest", talus::quantile(median, 1)},
                      {"times", time.size()}};
  support::Panel panel({.title = "Nodes with I ≥ 5e-4;  I = d_g |D| / √(p/ρ), |D| = √(D:D/2)",
                        .x = "time (s)",
                        .y = "inertial number",
                        .log_y = true});
  panel.band("30 % to 70 %", time, low, high).add("line", "median", time, median);
  panel.add("reference", "1e-2", {time.front(), time.back()}, {1e-2, 1e-2});
  results.panels = {panel};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app("Inertial numbers of run B15 against time (Rousseau et al. 2023).");
  support::add_study_options(app, options, "inertial_number");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "inertial_number",
                              [&](support::Sweep& sweep) { return study(sweep); });
  });
}
