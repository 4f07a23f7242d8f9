// SPDX-License-Identifier: MIT
//
// The friction at which a 2-D run without side walls has the final height of a 3-D run in a
// channel (Rousseau et al. 2023): linear in height over width.

#include "support/sweep.hpp"

#include "talus/diagnostics/find_root.hpp"
#include "talus/diagnostics/fits.hpp"

namespace {

using support::text;

const std::vector<std::string> column = {"--column-length", "0.12", "--column-height", "0.12"};
constexpr double height = 0.12; // m
constexpr double friction = 0.44;

std::vector<std::string> set_up(double inclination) {
  std::vector<std::string> arguments = {"--case", "B00", "--inclination", text(inclination)};
  arguments.insert(arguments.end(), column.begin(), column.end());
  return arguments;
}

support::Job job_2d(double inclination, double mu, const std::string& solver) {
  // The upstream wall keeps its friction.
  auto arguments = set_up(inclination);
  char digits[32]; // the folder's name says all of it
  std::snprintf(digits, sizeof digits, "%.6f", mu);
  arguments.insert(arguments.end(), {"--dim", "2", "--friction", digits, "--solver", solver});
  return {"2d_" + text(inclination) + "deg_mu" + digits, arguments};
}

support::StudyResults study(support::Sweep& sweep, const support::StudyOptions& options,
                            const std::string& solver) {
  const std::vector<double> widths = options.reference()
                                         ? std::vector<double>{0.004, 0.01, 0.02, 0.04, 0.08, 0.2}
                                         : std::vector<double>{0.01, 0.02, 0.04, 0.1};
  const support::Values frictions = {0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2};
  const support::Values slopes = {0, 15}; // degrees
  std::vector<support::Job> jobs;
  for (const double slope : slopes) {
    for (const double width : widths) {
      auto arguments = set_up(slope);
      const auto channel = options.channel(width);
      arguments.insert(arguments.end(), channel.begin(), channel.end());
      jobs.push_back({"3d_" + text(slope) + "deg_" + text(100 * width) + "cm", arguments});
    }
    for (const double mu : frictions)
      jobs.push_back(job_2d(slope, mu, solver));
  }
  const auto height_final = [](const nlohmann::json& summary) {
    return summary.at("measured").at("height_final_m").get<double>();
  };
  const auto summaries = sweep.run(jobs, "equivalent_friction");
  auto summary = summaries.begin(); // in the order of the jobs
  support::StudyResults results;
  results.title = "Equivalent 2-D friction, a = 1";
  results.columns = {"inclination_deg", "H0_over_W", "height_final_m",
                     "mu_2D",           "bracket",   "mu_2D_per_mm"};
  support::Panel panel({.title = "μ_2D of equal H_f", .x = "H_0/W", .y = "μ_2D"});
  support::Panel heights({.title = "2-D", .x = "μ", .y = "H_f (m)"});
  for (const double slope : slopes) {
    const std::string label = "i = " + text(slope) + "°";
    support::Values channel_heights, trial_heights, x, y, y_error;
    for (std::size_t i = 0; i < widths.size(); ++i)
      channel_heights.push_back(height_final(*summary++));
    for (std::size_t i = 0; i < frictions.size(); ++i)
      trial_heights.push_back(height_final(*summary++));
    heights.add("points", label, frictions, trial_heights);
    for (std::size_t i = 0; i < widths.size(); ++i) {
      const double wanted = channel_heights[i];
      const auto excess = [&](double mu) { // each friction has its folder: none is run twice
        const support::Job job = job_2d(slope, mu, solver);
        return height_final(sweep.run({job}, job.name)[0]) - wanted;
      };
      // The first crossing: with much friction the column slides off the wall as a block, and its
      // height there falls again.
      const auto above = std::ranges::find_if(trial_heights, [&](double h) { return h >= wanted; });
      const auto k = static_cast<std::size_t>(above - trial_heights.begin());
      talus::Root root;
      if (k > 0 && k < frictions.size())
        root = talus::find_root(excess, frictions[k - 1], frictions[k], 2e-3, 2e-4);
      std::vector<std::string> row = {text(slope), text(height / widths[i]), text(wanted)};
      if (root.found) {
        x.push_back(height / widths[i]);
        y.push_back(root.x);
        // what a millimetre of H_f, a part of a cell, makes of it
        y_error.push_back(1e-3 * (frictions[k] - frictions[k - 1]) /
                          (trial_heights[k] - trial_heights[k - 1]));
        row.insert(row.end(), {text(root.x), text(root.high - root.low), text(y_error.back())});
      } else {
        row.insert(row.end(), {"none", "", ""});
      }
      results.rows.push_back(row);
    }
    panel.add("points", label, x, y, y_error);
    if (x.size() < 3)
      continue;
    const talus::LineFit fit = talus::fit_line(x, y);
    results.measured[text(slope) + " deg"] = {{"k", fit.slope},
                                              {"k_error", fit.slope_error},
                                              {"intercept", fit.intercept},
                                              {"intercept_error", fit.intercept_error},
                                              {"points", fit.points}};
    const double end = *std::max_element(x.begin(), x.end());
    panel.add("dashed",
              label + ": " + text(fit.intercept).substr(0, 5) + " + " +
                  text(fit.slope).substr(0, 6) + " H_0/W",
              {0, end}, {fit(0), fit(end)});
  }
  results.measured["friction_3d"] = friction;
  results.panels = {panel, heights};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  std::string solver = "sweeps-then-interior-point";
  CLI::App app("Equivalent 2-D friction of side walls (Rousseau et al. 2023).");
  app.add_option("--solver", solver, "Of the 2-D runs; gauss-seidel: less time, more misses")
      ->check(CLI::IsMember({"sweeps-then-interior-point", "gauss-seidel"}))
      ->capture_default_str();
  support::add_study_options(app, options, "equivalent_friction");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "equivalent_friction",
                              [&](support::Sweep& sweep) { return study(sweep, options, solver); });
  });
}
