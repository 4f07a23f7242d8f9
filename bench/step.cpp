// SPDX-License-Identifier: MIT
// The whole step of run B15, phase by phase; JSON on standard output.

#include "../examples/support/whole_numbers.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/profile.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include <iostream>
#include <string>

using namespace talus;

namespace {

struct Options {
  int dim = 3, per_axis = 3, threads = 1, skip = 20, steps = 20;
  double finer = 1, tolerance = 5e-5;
  std::string particle_data = "double";
};

/// Largest resident memory of this process so far, bytes.
double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

template <int Dim, class ParticleReal = double>
nlohmann::json measure(const Options& options) {
  auto sim = scenes::collapse_b15<Dim, ParticleReal>(options.finer, options.tolerance,
                                                     options.per_axis, options.threads);
  for (int i = 0; i < options.skip; ++i)
    static_cast<void>(sim.step());
  PhaseSeconds sum;
  double cones = 0, cone_sweeps = 0, sweeps = 0, worst = 0;
  for (int i = 0; i < options.steps; ++i) {
    const StepReport report = sim.step();
    sum.to_grid += report.seconds.to_grid / options.steps;
    sum.assembly += report.seconds.assembly / options.steps;
    sum.solve += report.seconds.solve / options.steps;
    sum.to_particles += report.seconds.to_particles / options.steps;
    const double n = static_cast<double>(report.cones), k = report.solve.iterations;
    cones += n / options.steps;
    sweeps += k / options.steps;
    cone_sweeps += n * k / options.steps;
    worst = std::max(worst, report.solve.residual.l2);
  }
  const double particles = static_cast<double>(sim.particles().size());
  return {{"dim", Dim},
          {"particle_data", sizeof(ParticleReal) == sizeof(double) ? "double" : "float"},
          {"finer", options.finer},
          {"threads", options.threads},
          {"cells", sim.grid().cell_count()},
          {"particles", sim.particles().size()},
          {"cones", cones},
          {"sweeps", sweeps},
          {"residual_max", worst},
          {"time_s", sim.time()},
          {"seconds",
           {{"to_grid", sum.to_grid},
            {"assembly", sum.assembly},
            {"solve", sum.solve},
            {"to_particles", sum.to_particles},
            {"step", sum.total()}}},
          {"to_grid_ns_per_particle", sum.to_grid / particles * 1e9},
          {"to_particles_ns_per_particle", sum.to_particles / particles * 1e9},
          {"assembly_ns_per_cone", sum.assembly / cones * 1e9},
          {"solve_ns_per_cone_and_sweep", sum.solve / cone_sweeps * 1e9},
          {"front_m", front_position(measure_profile(sim, 0), 0.022)},
          {"volume_under_surface_m3", volume_under_surface(sim)},
          {"memory_peak_bytes", peak_memory()},
          {"state_checksum", state_checksum(sim.particles())}};
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"One step of run B15, phase by phase: means over --steps steps."};
  app.add_option("--dim", options.dim, "2 or 3")->check(CLI::IsMember({2, 3}));
  app.add_option("--finer", options.finer, "1: cells of 2 x 2 x 1 cm; 2: the paper's resolution")
      ->check(CLI::PositiveNumber);
  app.add_option("--per-axis", options.per_axis, "particles a cell and axis")
      ->check(CLI::PositiveNumber);
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber);
  app.add_option("--skip", options.skip, "steps before the measured ones")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--steps", options.steps, "measured steps")->check(CLI::PositiveNumber);
  app.add_option("--tolerance", options.tolerance)->check(CLI::PositiveNumber);
  app.add_option("--particle-data", options.particle_data, "double, or float (3-D only)")
      ->check(CLI::IsMember({"double", "float"}));
  support::check_numbers(app);
  CLI11_PARSE(app, argc, argv);
  nlohmann::json measured;
  if (options.dim == 2)
    measured = measure<2>(options);
  else if (options.particle_data == "float")
    measured = measure<3, float>(options);
  else
    measured = measure<3>(options);
  std::cout << measured.dump(1) << '\n';
}
