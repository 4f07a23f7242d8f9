// SPDX-License-Identifier: MIT
//
// Run B15 of Rousseau et al. 2023 with four friction laws: the constant avalanche friction, the
// constant stopping friction, mu(I) and hysteresis.

#include "support/compare_laws.hpp"

#include <vector>

namespace {

const std::vector<support::Law> laws = {
    {"μ_a = 0.44", {"constant", {"--rheology", "constant"}}},
    {"μ_stop = 0.38", {"stop", {"--rheology", "stop"}}},
    {"μ(I)", {"mu_of_i", {"--rheology", "mu-i"}}},
    {"hysteretic", {"hysteretic", {"--rheology", "hysteretic"}}},
};

} // namespace

int main(int argc, char** argv) {
  support::StudyOptions options;
  CLI::App app("Run B15 with four friction laws (Rousseau et al. 2023).");
  support::add_study_options(app, options, "rheology_comparison");
  return support::run_program(app, argc, argv, [&] {
    return support::run_study(options, "rheology_comparison", [&](support::Sweep& sweep) {
      return support::compare_laws(sweep, laws, "rheology_comparison",
                                   "B15 with four friction laws");
    });
  });
}
