// SPDX-License-Identifier: MIT
//
// Run B15 of Rousseau et al. 2023 with a smooth and a rough gate: the early profile near the gate
// changes, the deposit does not.

#include "support/sweep.hpp"

namespace {

using support::text;

support::StudyResults study(support::Sweep& sweep) {
  const std::vector<support::Job> jobs = {{"smooth", {"--gate-friction", "0.18"}},
                                          {"rough", {"--gate-friction", "1.0"}}};
  const std::vector<std::string> labels = {"μ_D = 0.18", "μ_D = 1.0"};
  const auto summaries = sweep.run(jobs, "gate_friction");
  support::StudyResults results;
  results.title = "B15, friction of the gate";
  results.columns = {"gate", "runout_m", "height_final_m", "rest_time_s"};
  const support::Panel::Axes axes{.x = "x, down the slope (m)", .y = "height above the floor (m)"};
  std::vector<support::Values> early, last;
  for (const double time : {0.1, 0.2, 0.3, 0.0}) { // 0: the deposit
    auto labelled = axes;
    labelled.title = time > 0 ? "t = " + text(time) + " s" : "Deposit";
    support::Panel panel(labelled);
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      const support::RunTable table(sweep.folder(jobs[i]) / "profiles.csv");
      const double at = time > 0 ? time : table.last_time();
      panel.add("line", labels[i], table.at(at, "x_m"), table.at(at, "height_m"));
      if (time == 0.2)
        early.push_back(table.at(at, "height_m"));
      if (time == 0)
        last.push_back(table.at(at, "height_m"));
    }
    results.panels.push_back(panel);
  }
  const auto largest_difference = [](const std::vector<support::Values>& heights) {
    double largest = 0;
    for (std::size_t i = 0; i < heights[0].size(); ++i)
      largest = std::max(largest, std::abs(heights[0][i] - heights[1].at(i)));
    return largest;
  };
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const auto& measured = summaries[i].at("measured");
    results.measured[jobs[i].name] = measured;
    results.rows.push_back({jobs[i].name, text(measured.at("runout_m")),
                            text(measured.at("height_final_m")), text(measured.at("rest_time_s"))});
  }
  results.measured["largest_difference_at_0.2_s_m"] = largest_difference(early);
  results.measured["largest_difference_of_deposits_m"] = largest_difference(last);
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app("Run B15 with gate friction 0.18 and 1.0 (Rousseau et al. 2023).");
  support::add_study_options(app, options, "gate_friction");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "gate_friction",
                              [&](support::Sweep& sweep) { return study(sweep); });
  });
}
