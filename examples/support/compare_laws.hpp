// SPDX-License-Identifier: MIT
#pragma once

#include "sweep.hpp"

#include <string>
#include <vector>

/// \file
/// Studies that hold run B15 of Rousseau et al. 2023 with several friction laws side by side.

namespace support {

/// A friction law: how it is called in the picture, and the run that shows it.
struct Law {
  std::string label;
  Job job;
};

/// Runs all of them; name and title are those of the study.
inline StudyResults compare_laws(Sweep& sweep, const std::vector<Law>& laws,
                                 const std::string& name, const std::string& title) {
  std::vector<Job> jobs;
  for (const Law& law : laws)
    jobs.push_back(law.job);
  const auto summaries = sweep.run(jobs, name);
  StudyResults results;
  results.title = title;
  results.columns = {"law", "runout_m", "height_final_m", "rest_time_s"};
  Panel profiles({.title = "Deposits along the side wall",
                  .x = "x, down the slope (m)",
                  .y = "height above the floor (m)"});
  Panel fronts({.title = "Front against time", .x = "time (s)", .y = "run-out from the gate (m)"});
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const auto& measured = summaries[i].at("measured");
    results.measured[laws[i].job.name] = measured;
    results.rows.push_back({laws[i].job.name, text(measured.at("runout_m")),
                            text(measured.at("height_final_m")), text(measured.at("rest_time_s"))});
    add_final_profile(profiles, laws[i].label, sweep.folder(laws[i].job));
    add_front(fronts, laws[i].label, sweep.folder(laws[i].job));
  }
  add_published(fronts, summaries[0].at("published"));
  results.panels = {profiles, fronts};
  return results;
}

} // namespace support
