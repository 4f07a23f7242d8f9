// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include <cstddef>

#ifdef TALUS_EXAMPLES_MPI
#include "vtk_frame.hpp"

#include "talus/diagnostics/strain_rate.hpp"
#include "talus/distributed/shared.hpp"
#include "talus/distributed/vtk.hpp"

#include <mpi.h>

#include <string>
#include <utility>
#endif

/// \file
/// The same programs on one process or several: rank 0 runs the program, the others serve its
/// simulation (see talus::distributed::Shared). Without TALUS_EXAMPLES_MPI there is nothing of MPI.

namespace support {

#ifdef TALUS_EXAMPLES_MPI

/// The simulation of a program. call(particles + '\n' + grid) has all ranks write their pieces of
/// these two files.
template <class Sim>
class OnRanks : public talus::distributed::Shared<Sim> {
 public:
  OnRanks(typename Sim::Params params, typename Sim::ParticleData particles)
      : talus::distributed::Shared<Sim>(std::move(params), std::move(particles), {}, write_vtk) {}

 private:
  static void write_vtk(const Sim& part, const std::string& paths) {
    const std::size_t end = paths.find('\n');
    write_vtk_frame(talus::distributed::ParallelVtk(part), part, talus::StrainRate(part),
                    paths.substr(0, end), paths.substr(end + 1));
  }
};

/// MPI from here to the end of the program.
class RanksOfProgram {
 public:
  RanksOfProgram() { MPI_Init(nullptr, nullptr); }
  ~RanksOfProgram() { MPI_Finalize(); }
  RanksOfProgram(const RanksOfProgram&) = delete;
  RanksOfProgram& operator=(const RanksOfProgram&) = delete;

  /// Is this the rank that reads, writes and speaks?
  static bool first() {
    int rank = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    return rank == 0;
  }
  static int count() {
    int size = 1;
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    return size;
  }
};

using Served = talus::distributed::Served;

/// What summary.json says of ranks; messages and bytes are those of rank 0.
template <class Sim>
nlohmann::json ranks_json(const Sim& sim) {
  const double steps = sim.steps() > 0 ? static_cast<double>(sim.steps()) : 1;
  const auto& counted = sim.mpi().counted;
  return {{"count", sim.mpi().size()},
          {"imbalance", sim.ranks().imbalance()},
          {"times_dealt", sim.ranks().times_dealt()},
          {"messages_per_step", static_cast<double>(counted.messages) / steps},
          {"bytes_per_step", static_cast<double>(counted.bytes) / steps},
          {"reductions_per_step", static_cast<double>(counted.reductions) / steps}};
}

#else

template <class Sim>
using OnRanks = Sim;

struct RanksOfProgram {
  static bool first() { return true; }
  static int count() { return 1; }
};

struct Served {};

template <class Sim>
nlohmann::json ranks_json(const Sim&) {
  return {{"count", 1}};
}

#endif

} // namespace support
