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

support::StudyResults study(support::Sweep& sweep, const support::StudyOptions& options) {
  const std::vector<double> widths = options.reference()
                                         ? std::vector<double>{0.004, 0.01, 0.02, 0.04, 0.08, 0.2}
                                         : std::vector<double>{0.01, 0.02, 0.04, 0.1};
  const double along = options.reference() ? 0.01 : 0.02;
  std::vector<support::Job> jobs;
  std::vector<double> slopes, ratios;
  for (const double inclination : {0.0, 15.0})
    for (const double width : widths) {
      auto arguments = set_up(inclination);
      arguments.insert(arguments.end(), {"--width", text(width), "--cell", text(along),
                                         text(std::min(along, width / 3)), text(along / 2)});
      jobs.push_back({"3d_" + text(inclination) + "deg_" + text(100 * width) + "cm", arguments});
      slopes.push_back(inclination);
      ratios.push_back(height / width);
    }
  const auto summaries = sweep.run(jobs, "equivalent_friction, 3-D");

  // The 2-D runs: each friction is one folder, so that none is run twice. The upstream wall keeps
  // its friction.
  const auto height_2d = [&](double inclination, double mu) {
    auto arguments = set_up(inclination);
    arguments.insert(arguments.end(), {"--dim", "2", "--friction", text(mu)});
    char name[64];
    std::snprintf(name, sizeof name, "2d_%gdeg_mu%.6f", inclination, mu);
    return sweep.run({{name, arguments}}, name)[0]
        .at("measured")
        .at("height_final_m")
        .get<double>();
  };

  support::StudyResults results;
  results.title = "Equivalent 2-D friction, a = 1";
  results.columns = {"inclination_deg", "H0_over_W", "height_final_m", "mu_2D", "bracket"};
  support::Panel panel({.title = "μ_2D of equal H_f", .x = "H_0/W", .y = "μ_2D"});
  for (const double inclination : {0.0, 15.0}) {
    support::Values x, y;
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      if (slopes[i] != inclination)
        continue;
      const double wanted = summaries[i].at("measured").at("height_final_m");
      const talus::Root root = talus::find_root(
          [&](double mu) { return height_2d(inclination, mu) - wanted; }, 0.40, 1.2, 2e-3, 2e-4);
      results.rows.push_back({text(inclination), text(ratios[i]), text(wanted),
                              root.found ? text(root.x) : "none", text(root.high - root.low)});
      if (root.found) {
        x.push_back(ratios[i]);
        y.push_back(root.x);
      }
    }
    const std::string label = "i = " + text(inclination) + "°";
    panel.add("points", label, x, y);
    if (x.size() < 3)
      continue;
    const talus::LineFit fit = talus::fit_line(x, y);
    results.measured[text(inclination) + " deg"] = {{"k", fit.slope},
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
  results.panels = {panel};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app("Equivalent 2-D friction of side walls (Rousseau et al. 2023).");
  support::add_study_options(app, options, "equivalent_friction");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "equivalent_friction",
                              [&](support::Sweep& sweep) { return study(sweep, options); });
  });
}
