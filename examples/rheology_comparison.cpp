// SPDX-License-Identifier: MIT
//
// Run B15 of Rousseau et al. 2023 with four friction laws: the constant avalanche friction, the
// constant stopping friction, mu(I) and hysteresis.

#include "support/sweep.hpp"

namespace {

using support::text;

struct Law {
  std::string label;
  support::Job job;
};

const std::vector<Law> laws = {
    {"μ_a = 0.44", {"constant", {"--rheology", "constant"}}},
    {"μ_stop = 0.38", {"stop", {"--rheology", "stop"}}},
    {"μ(I)", {"mu_of_i", {"--rheology", "mu-i"}}},
    {"hysteretic", {"hysteretic", {"--rheology", "hysteretic"}}},
};

support::StudyResults study(support::Sweep& sweep) {
  std::vector<support::Job> jobs;
  for (const Law& law : laws)
    jobs.push_back(law.job);
  const auto summaries = sweep.run(jobs, "rheology_comparison");
  support::StudyResults results;
  results.title = "B15 with four friction laws";
  results.columns = {"law", "runout_m", "height_final_m", "rest_time_s"};
  support::Panel profiles({.title = "Deposits along the side wall",
                           .x = "x, down the slope (m)",
                           .y = "height above the floor (m)"});
  support::Panel fronts(
      {.title = "Front against time", .x = "time (s)", .y = "run-out from the gate (m)"});
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const auto& measured = summaries[i].at("measured");
    results.measured[laws[i].job.name] = measured;
    results.rows.push_back({laws[i].job.name, text(measured.at("runout_m")),
                            text(measured.at("height_final_m")), text(measured.at("rest_time_s"))});
    support::add_final_profile(profiles, laws[i].label, sweep.folder(laws[i].job));
    support::add_front(fronts, laws[i].label, sweep.folder(laws[i].job));
  }
  support::add_published(fronts, summaries[0].at("published"));
  results.panels = {profiles, fronts};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app("Run B15 with four friction laws (Rousseau et al. 2023).");
  support::add_study_options(app, options, "rheology_comparison");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "rheology_comparison",
                              [&](support::Sweep& sweep) { return study(sweep); });
  });
}
