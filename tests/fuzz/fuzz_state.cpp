// SPDX-License-Identifier: MIT
// Checkpoints and problem files from bytes that nobody wrote: an error that names the file, or a
// simulation that can make a step and a problem that can be solved. The first byte says which
// reader.

#include "input_file.hpp"

#include "talus/boundary/gate.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

namespace {

using Sim = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;

Sim make_simulation() {
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.3}, .cells = {4, 3}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 1e-3;
  params.solver.max_sweeps = 20;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::frictional, 0.5};
  params.faces.upper[1] = {talus::FaceKind::open};
  params.obstacles.push_back(
      std::make_shared<talus::Gate<2>>(talus::Gate<2>::Params{.position = 0.2, .friction = 0.2}));
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0}, {0.1, 0.1}, {.per_axis = 2});
  return Sim(params, sand);
}

void expect(bool fine) {
  if (!fine)
    std::abort();
}

void read_checkpoint(std::string_view bytes) {
  Sim sim = make_simulation();
  try {
    talus::read_checkpoint(fuzz::write_sealed("checkpoint", bytes), sim);
  } catch (const std::runtime_error& error) {
    expect(std::string_view(error.what()).find("cannot read") == 0);
    expect(sim.steps() == 0);
    return;
  }
  for (int n = 0; n < 2; ++n)
    if (!sim.step().completed())
      return;
  for (const auto& x : sim.particles().position)
    expect(std::isfinite(x[0]) && std::isfinite(x[1]));
}

template <int Dim>
void read_problem(std::string_view bytes) {
  try {
    talus::DualProblem<Dim> problem =
        talus::read_problem<Dim>(fuzz::write_sealed("problem", bytes));
    typename talus::GaussSeidel<>::Workspace<Dim> workspace;
    const auto report =
        talus::GaussSeidel<>({.max_sweeps = 3}).solve(problem, workspace, talus::Execution());
    expect(report.iterations <= 3);
  } catch (const std::runtime_error& error) {
    expect(std::string_view(error.what()).find("cannot read") == 0);
  }
}

/// Two steps of a real run, without the fingerprints.
void write_seeds(const fuzz::fs::path& folder) {
  Sim sim = make_simulation();
  const auto save = [&](const char* name, char kind, const fuzz::fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::string bytes(std::istreambuf_iterator<char>(in), {});
    bytes.resize(bytes.size() - 8);
    std::ofstream(folder / name, std::ios::binary) << kind << bytes;
  };
  const auto problem = fuzz::folder() / "seed";
  const auto first = sim.step();
  const auto second = sim.step([&](const auto& p) { talus::write_problem(problem, p); });
  expect(first.completed() && second.completed());
  save("problem", 'p', problem);
  talus::write_checkpoint(fuzz::folder() / "state", sim, "notes");
  save("checkpoint", 'c', fuzz::folder() / "state");
}

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (const char* seeds = std::getenv("TALUS_FUZZ_SEEDS")) {
    write_seeds(seeds);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1)
    return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] == 'p') {
    read_problem<2>(bytes);
    read_problem<3>(bytes);
  } else {
    read_checkpoint(bytes);
  }
  return 0;
}
