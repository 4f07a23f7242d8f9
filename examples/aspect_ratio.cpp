// SPDX-License-Identifier: MIT
//
// Deposits of level columns on a bare floor against their aspect ratio, in a wide channel (2-D)
// and in one of 1 cm (Rousseau et al. 2023).

#include "support/sweep.hpp"

#include "talus/diagnostics/fits.hpp"

#include <cmath>
#include <optional>

namespace {

using support::text;

constexpr double length = 0.05; // L_0, m

/// The column is released at once: a gate of 0.7 m/s would hold back a tall one.
support::Job job(double a, bool wide, const support::StudyOptions& options) {
  const double cell = length / (options.reference() ? (wide ? 20 : 10) : (wide ? 10 : 5));
  const double reach = length * (1 + 1.6 * (a < 7 ? 2.0 * a : 3.4 * std::pow(a, 0.65)) + 1);
  std::vector<std::string> arguments = {"--case",
                                        "B00",
                                        "--no-gate",
                                        "--bed-depth",
                                        "0",
                                        "--column-length",
                                        text(length),
                                        "--column-height",
                                        text(a * length),
                                        "--length",
                                        text(reach),
                                        "--height",
                                        text(1.1 * a * length + 4 * cell),
                                        "--time-step",
                                        text(0.2 * cell),
                                        "--cfl",
                                        "0.5",
                                        "--max-time",
                                        "4",
                                        "--cell",
                                        text(cell),
                                        text(0.01 / (options.reference() ? 4 : 2)),
                                        text(options.resolution == "medium" ? cell / 2 : cell)};
  if (wide)
    arguments.insert(arguments.end(), {"--dim", "2", "--wall-friction", "0"});
  else
    arguments.insert(arguments.end(), {"--width", "0.01"});
  return {(wide ? "wide_" : "narrow_") + text(a), arguments};
}

support::StudyResults study(support::Sweep& sweep, const support::StudyOptions& options, int count,
                            const std::string& channels) {
  std::vector<double> ratios;
  for (int k = 0; k < count; ++k)
    ratios.push_back(std::pow(20.0, k / (count - 1.0)));
  std::vector<bool> kinds; // wide or not
  for (const bool wide : {true, false})
    if (channels != (wide ? "narrow" : "wide"))
      kinds.push_back(wide);
  std::vector<support::Job> jobs;
  for (const bool wide : kinds)
    for (const double a : ratios)
      jobs.push_back(job(a, wide, options));
  const auto summaries = sweep.run(jobs, "aspect_ratio");
  auto summary = summaries.begin(); // in the order of the jobs

  support::StudyResults results;
  results.title = "Level columns on a bare floor";
  results.inputs["values"] = count;
  results.inputs["channel"] = channels;
  results.columns = {"channel", "a", "runout_over_L0", "deposit_over_L0", "H0_over_Hf"};
  support::Panel runouts({.title = "Run-out of the farthest particle at rest",
                          .x = "a = H_0/L_0",
                          .y = "(L_f − L_0)/L_0",
                          .log = true});
  // Not the paper's measure: single grains lie far ahead of the deposit.
  support::Panel deposits({.title = "Run-out of the surface above 2 mm",
                           .x = "a = H_0/L_0",
                           .y = "(L_f − L_0)/L_0",
                           .log = true});
  support::Panel heights(
      {.title = "Height at the wall", .x = "a = H_0/L_0", .y = "H_0/H_f", .log = true});
  for (const bool wide : kinds) {
    const std::string channel = wide ? "wide" : "narrow";
    support::Values runout, deposit, height;
    for (std::size_t k = 0; k < ratios.size(); ++k) {
      const auto& measured = (summary++)->at("measured");
      runout.push_back(measured.at("farthest_at_rest_m").get<double>() / length - 1);
      deposit.push_back(measured.at("runout_m").get<double>() / length);
      height.push_back(ratios[k] * length / measured.at("height_final_m").get<double>());
      results.rows.push_back({channel, text(ratios[k]), text(runout.back()), text(deposit.back()),
                              text(height.back())});
    }
    runouts.add("points", channel, ratios, runout);
    deposits.add("points", channel, ratios, deposit);
    heights.add("points", channel, ratios, height);
    const auto fit = [&](support::Panel& panel, const std::string& name, const support::Values& y,
                         double from, double to) {
      support::Values x_part, y_part;
      for (std::size_t k = 0; k < ratios.size(); ++k)
        if (ratios[k] >= 0.999 * from && ratios[k] <= 1.001 * to) {
          x_part.push_back(ratios[k]);
          y_part.push_back(y[k]);
        }
      const talus::PowerLawFit law = talus::fit_power_law(x_part, y_part);
      results.measured[channel + ", " + name + ", a " + text(from) + " to " + text(to)] = {
          {"coefficient", law.coefficient},
          {"coefficient_error", law.coefficient_error},
          {"exponent", law.exponent},
          {"exponent_error", law.exponent_error},
          {"points", law.points}};
      char label[64];
      std::snprintf(label, sizeof label, "%s: %.2f a^%.2f", channel.c_str(), law.coefficient,
                    law.exponent);
      panel.add("dashed", label, {from, to}, {law(from), law(to)});
    };
    fit(runouts, "(Lf-L0)/L0", runout, 1, 7);
    fit(runouts, "(Lf-L0)/L0", runout, 7, 20);
    fit(deposits, "deposit/L0", deposit, 1, 7);
    fit(deposits, "deposit/L0", deposit, 7, 20);
    fit(heights, "H0/Hf", height, 1, 7);
  }
  const support::Values low = {1, 7}, high = {7, 20};
  for (support::Panel* panel : {&runouts, &deposits}) {
    panel->add("reference", "published, wide", low, {2, 14});
    panel->add("reference", "", high, {3.4 * std::pow(7, 0.65), 3.4 * std::pow(20, 0.65)});
  }
  heights.add("reference", "published, wide", low, {1.3, 1.3 * std::pow(7, 0.67)});
  results.panels = {runouts, heights, deposits};
  return results;
}

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  std::optional<int> values;
  std::string channels = "both";
  CLI::App app("Deposits against the aspect ratio of the column (Rousseau et al. 2023).");
  app.add_option("--values", values,
                 "Aspect ratios from 1 to 20; without: 8, or 20 at the reference")
      ->check(CLI::Range(7, 1000));
  app.add_option("--channel", channels,
                 "wide: 2-D; narrow: 3-D, 1 cm across, many hours at the reference")
      ->check(CLI::IsMember({"both", "wide", "narrow"}))
      ->capture_default_str();
  support::add_study_options(app, options, "aspect_ratio");
  return support::run_program(app, argc, argv, [&] {
    const int count = values.value_or(options.reference() ? 20 : 8);
    return support::run_study(options, "aspect_ratio", [&](support::Sweep& sweep) {
      return study(sweep, options, count, channels);
    });
  });
}
