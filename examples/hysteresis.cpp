// SPDX-License-Identifier: MIT
//
// Run B15 of Rousseau et al. 2023 with the hysteretic law, as a ramp (the paper's text) and as a
// step (its authors' scripts), between the constant frictions of its two ends.

#include "support/sweep.hpp"

namespace {

using support::text;

struct Law {
  std::string label;
  support::Job job;
};

const std::vector<Law> laws = {
    {"ramp, 0.38 + 0.16 (1 − I/I_*)", {"ramp", {"--rheology", "hysteretic"}}},
    {"step, 0.38 + 0.16 below I_*", {"step", {"--rheology", "hysteretic-step"}}},
    {"constant 0.38", {"flowing", {"--friction", "0.38"}}},
    {"constant 0.54", {"static", {"--friction", "0.54"}}},
};

support::StudyResults study(support::Sweep& sweep) {
  std::vector<support::Job> jobs;
  for (const Law& law : laws)
    jobs.push_back(law.job);
  const auto summaries = sweep.run(jobs, "hysteresis");
  support::StudyResults results;
  results.title = "B15 with the hysteretic law";
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
  CLI::App app(
      "Run B15 with the hysteretic law and the constants it lies between (Rousseau et al. 2023).");
  support::add_study_options(app, options, "hysteresis");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "hysteresis",
                              [&](support::Sweep& sweep) { return study(sweep); });
  });
}
