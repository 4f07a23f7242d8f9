// SPDX-License-Identifier: MIT
//
// Run B15 of Rousseau et al. 2023 with the hysteretic law, as a ramp (the paper's text) and as a
// step (its authors' scripts), between the constant frictions of its two ends.

#include "support/compare_laws.hpp"

#include <vector>

namespace {

const std::vector<support::Law> laws = {
    {"ramp, 0.38 + 0.16 (1 − I/I_*)", {"ramp", {"--rheology", "hysteretic"}}},
    {"step, 0.38 + 0.16 below I_*", {"step", {"--rheology", "hysteretic-step"}}},
    {"constant 0.38", {"flowing", {"--friction", "0.38"}}},
    {"constant 0.54", {"static", {"--friction", "0.54"}}},
};

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app(
      "Run B15 with the hysteretic law and the constants it lies between (Rousseau et al. 2023).");
  support::add_study_options(app, options, "hysteresis");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "hysteresis", [&](support::Sweep& sweep) {
      return support::compare_laws(sweep, laws, "hysteresis", "B15 with the hysteretic law");
    });
  });
}
