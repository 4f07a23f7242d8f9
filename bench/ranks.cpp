// SPDX-License-Identifier: MIT
// Steps of run B15 on the ranks of mpirun; JSON on standard output, from rank 0.

#include "../examples/support/whole_numbers.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/checksum.hpp"
#include "talus/distributed/mpi.hpp"
#include "talus/distributed/ranks.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include <cmath>
#include <cstdint>
#include <iostream>
#include <memory>
#include <string>

using namespace talus;

namespace {

struct Options {
  int per_axis = 3, threads = 1, skip = 20, steps = 20, wider = 1;
  double finer = 1;
  bool slices = false;
};

/// Largest resident memory of this process so far, bytes.
double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// The slice along the channel of bed and column that this rank of several makes.
Particles<3> slice(const CollapseSetup& setup, const Grid<3>& grid, const Seeding& seeding,
                   int rank, int ranks) {
  Particles<3> particles;
  const auto fill = [&](double length, double bottom, double top) {
    Vec<3> lower(length * rank / ranks, 0, bottom), upper(length * (rank + 1) / ranks, 0, top);
    lower += grid.origin();
    upper += grid.origin();
    upper[1] = grid.upper()[1];
    if (top > bottom)
      fill_box(particles, grid, lower, upper, seeding);
  };
  fill(grid.size()[0], 0, setup.bed_depth);
  fill(setup.column_length, setup.bed_depth, setup.bed_depth + setup.column_height);
  const std::size_t first = static_cast<std::size_t>(rank) << 40; // ids of all ranks differ
  for (std::size_t& id : particles.id)
    id += first;
  particles.next_id += first;
  return particles;
}

nlohmann::json measure(const Options& options) {
  using Sim = scenes::Sim<3>;
  const auto mpi = std::make_shared<distributed::Mpi>();
  const auto ranks = std::make_shared<distributed::Ranks<3>>(mpi);
  const auto most = [&](double value) { return Execution(1, mpi.get()).largest(value); };
  const auto sum = [&](std::size_t value) { return Execution(1, mpi.get()).sum(value); };

  CollapseSetup setup = support::b15();
  setup.width *= options.wider;
  auto params = support::collapse_params<Sim>(setup, Vec<3>(0.02, 0.02, 0.01) / options.finer,
                                              1.66e-3 / options.finer);
  params.threads = options.threads;
  params.ranks = ranks;
  const Grid<3> grid(params.grid);
  const Seeding seeding{.per_axis = options.per_axis};
  Sim sim(params, options.slices ? slice(setup, grid, seeding, mpi->rank(), mpi->size())
                                 : setup.particles<3>(grid, seeding));
  for (int i = 0; i < options.skip; ++i)
    static_cast<void>(sim.step());
  const auto before = mpi->counted;
  PhaseSeconds seconds;
  double cones = 0, sweeps = 0;
  for (int i = 0; i < options.steps; ++i) {
    const StepReport report = sim.step();
    seconds.to_grid += report.seconds.to_grid / options.steps;
    seconds.assembly += report.seconds.assembly / options.steps;
    seconds.solve += report.seconds.solve / options.steps;
    seconds.to_particles += report.seconds.to_particles / options.steps;
    cones += static_cast<double>(report.cones) / options.steps;
    sweeps += static_cast<double>(report.solve.iterations) / options.steps;
  }
  const auto per_sweep = [&](std::size_t now, std::size_t earlier) {
    return most(static_cast<double>(now - earlier) / (sweeps * options.steps));
  };
  auto fingerprint = static_cast<std::int64_t>(state_fingerprint(sim.particles()));
  mpi->sum(&fingerprint, 1);
  const std::size_t nodes = static_cast<std::size_t>(sim.grid().node_count());
  return {{"ranks", mpi->size()},
          {"threads", options.threads},
          {"finer", options.finer},
          {"wider", options.wider},
          {"particles", sum(sim.particles().size())},
          {"particles_of_a_rank", most(static_cast<double>(sim.particles().size()))},
          {"nodes", grid.node_count()},
          {"nodes_of_a_rank", most(static_cast<double>(nodes))},
          {"cones", cones},
          {"sweeps", sweeps},
          {"imbalance", ranks->imbalance()},
          // of the rank that has most of it
          {"messages_per_sweep", per_sweep(mpi->counted.messages, before.messages)},
          {"bytes_per_sweep", per_sweep(mpi->counted.bytes, before.bytes)},
          {"reductions_per_sweep", per_sweep(mpi->counted.reductions, before.reductions)},
          {"memory_of_a_rank_bytes", most(peak_memory())},
          {"seconds",
           {{"to_grid", most(seconds.to_grid)},
            {"assembly", most(seconds.assembly)},
            {"solve", most(seconds.solve)},
            {"to_particles", most(seconds.to_particles)},
            {"step", most(seconds.total())}}},
          {"state_checksum", checksum_text(static_cast<std::uint64_t>(fingerprint))}};
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Steps of run B15 on the ranks of mpirun.");
  app.add_option("--finer", options.finer, "1: cells of 2 cm by 1 cm, 2: half of that, ...");
  app.add_option("--wider", options.wider, "Channel widths of 6 cm: for weak scaling");
  app.add_option("--per-axis", options.per_axis, "Particles a cell and axis");
  app.add_option("--threads", options.threads, "Of each rank");
  app.add_flag("--slices", options.slices, "Each rank makes a slice of the scene, for large ones");
  app.add_option("--skip", options.skip, "Steps before the measured ones");
  app.add_option("--steps", options.steps, "Measured steps");
  CLI11_PARSE(app, argc, argv);
  MPI_Init(&argc, &argv);
  const nlohmann::json result = measure(options);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0)
    std::cout << result.dump(1) << '\n';
  MPI_Finalize();
}
