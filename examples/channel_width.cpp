// SPDX-License-Identifier: MIT
//
// Width of the channel (Rousseau et al. 2023): a level collapse of aspect ratio 1 in channels of
// 1 and 4 cm, and run B15 in channels of 1 to 20 cm.

#include "support/sweep.hpp"

namespace {

using support::text;

support::Job job(const std::string& name, std::vector<std::string> arguments, double width,
                 const support::StudyOptions& options) {
  const auto channel = options.channel(width);
  arguments.insert(arguments.end(), channel.begin(), channel.end());
  return {name, arguments};
}

support::StudyResults study(support::Sweep& sweep, const support::StudyOptions& options) {
  const std::vector<double> level_widths = {0.01, 0.04};
  const std::vector<double> widths = options.reference()
                                         ? std::vector<double>{0.01, 0.02, 0.04, 0.06, 0.1, 0.2}
                                         : std::vector<double>{0.01, 0.02, 0.06, 0.2};
  std::vector<support::Job> jobs;
  for (const double width : level_widths)
    jobs.push_back(job("level_" + text(100 * width) + "cm",
                       {"--case", "B00", "--column-length", "0.12", "--column-height", "0.12"},
                       width, options));
  for (const double width : widths)
    jobs.push_back(job("B15_" + text(100 * width) + "cm", {"--case", "B15"}, width, options));
  const auto summaries = sweep.run(jobs, "channel_width");

  support::StudyResults results;
  results.title = "Width of the channel";
  results.columns = {"run", "width_m", "runout_m", "height_final_m", "rest_time_s"};
  const support::Panel::Axes axes{
      .title = "i = 0°, a = 1", .x = "x (m)", .y = "height above the floor (m)"};
  auto slope_axes = axes;
  slope_axes.title = "B15";
  support::Panel level(axes), slope(slope_axes);
  support::Values heights, runouts;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const bool is_level = i < level_widths.size();
    const double width = is_level ? level_widths[i] : widths[i - level_widths.size()];
    const auto& measured = summaries[i].at("measured");
    results.measured[jobs[i].name] = measured;
    results.rows.push_back({jobs[i].name, text(width), text(measured.at("runout_m")),
                            text(measured.at("height_final_m")), text(measured.at("rest_time_s"))});
    support::add_final_profile(is_level ? level : slope, "W = " + text(100 * width) + " cm",
                               sweep.folder(jobs[i]));
    if (!is_level) {
      heights.push_back(measured.at("height_final_m"));
      runouts.push_back(measured.at("runout_m"));
    }
  }
  support::Panel lengths({.title = "B15: run-out and height at the wall",
                          .x = "width (m)",
                          .y = "length (m)",
                          .log = true});
  lengths.add("points", "run-out", widths, runouts).add("points", "H_f", widths, heights);
  results.panels = {level, slope, lengths};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app("Collapses in narrow and wide channels (Rousseau et al. 2023).");
  support::add_study_options(app, options, "channel_width");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "channel_width",
                              [&](support::Sweep& sweep) { return study(sweep, options); });
  });
}
