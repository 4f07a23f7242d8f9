// SPDX-License-Identifier: MIT
// Records the dual problem of the B15 collapse at t = 0.2 s, with its warm start, at several
// resolutions:
//   record_global_problems FOLDER
// leaves FOLDER/b15_{2d,3d}_h{1,2,4}.talus (3-D: h1 and h2). Takes a few minutes.

#include "scenes.hpp"

#include "talus/io/problem_file.hpp"

#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

namespace {

template <int Dim>
void record(const std::filesystem::path& folder, int finer) {
  auto sim = scenes::collapse_b15<Dim>(finer, 1e-4);
  while (sim.time() < 0.2)
    if (!sim.step().completed())
      throw std::runtime_error("a step failed");
  const auto path =
      folder / ("b15_" + std::to_string(Dim) + "d_h" + std::to_string(finer) + ".talus");
  const auto report = sim.step(
      [&](const talus::DualProblem<Dim>& problem) { talus::write_problem(path, problem); });
  std::printf("%s: %zu cones\n", path.c_str(), report.cones);
  std::fflush(stdout);
}

} // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  try {
    for (const int finer : {1, 2, 4})
      record<2>(argv[1], finer);
    for (const int finer : {1, 2})
      record<3>(argv[1], finer);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
