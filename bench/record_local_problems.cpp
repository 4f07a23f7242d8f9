// SPDX-License-Identifier: MIT
// Records local problems of real steps: the coarse B15 collapse at t = 0.3 s, when most of it
// flows.
//   record_local_problems FILE_3D FILE_2D
// One line a problem: mu, b (N numbers), W (lower triangle by rows), the stress of the step before
// (the warm start). Every number with 17 digits, so that it reads back equal.

#include "scenes.hpp"

#include "talus/dual/operator.hpp"

#include <cstddef>
#include <cstdio>
#include <map>
#include <vector>

namespace {

template <int Dim>
bool record(const char* path) {
  auto sim = scenes::collapse_b15<Dim>(1, 1e-6);
  while (sim.time() < 0.3)
    if (!sim.step().completed())
      return false;
  std::map<int, talus::Vec<talus::symmetric_size<Dim>>> before; // by node
  for (std::size_t i = 0; i < sim.problem().cones(); ++i)
    before[sim.problem().node[i]] = sim.problem().stress_impulse[i];
  if (!sim.step().completed())
    return false;

  std::FILE* file = std::fopen(path, "w");
  if (!file)
    return false;
  constexpr int n = talus::symmetric_size<Dim>;
  std::fprintf(file, "# mu, b (%d), W lower triangle by rows (%d), start (%d)\n", n,
               n * (n + 1) / 2, n);
  const auto& problem = sim.problem();
  const talus::Stencil<Dim> stencil(problem.grid);
  const std::size_t every = problem.cones() / 128 > 0 ? problem.cones() / 128 : 1;
  for (std::size_t i = 0; i < problem.cones(); i += every) {
    const talus::Mat<n> w = talus::diagonal_block(problem, stencil, i);
    talus::Vec<n> gamma = talus::integrated_strain_rate(problem, stencil, i);
    gamma[0] += problem.free_volume_rate[i];
    const talus::Vec<n> b = gamma - w * problem.stress_impulse[i];
    const auto found = before.find(problem.node[i]);
    const talus::Vec<n> start =
        found == before.end() ? talus::Vec<n>(talus::Vec<n>::Zero()) : found->second;
    std::fprintf(file, "%.17g", problem.opening[i]);
    for (int k = 0; k < n; ++k)
      std::fprintf(file, ",%.17g", b[k]);
    for (int k = 0; k < n; ++k)
      for (int l = 0; l <= k; ++l)
        std::fprintf(file, ",%.17g", w(k, l));
    for (int k = 0; k < n; ++k)
      std::fprintf(file, ",%.17g", start[k]);
    std::fprintf(file, "\n");
  }
  return std::fclose(file) == 0;
}

} // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s FILE_3D FILE_2D\n", argv[0]);
    return 2;
  }
  if (!record<3>(argv[1]) || !record<2>(argv[2])) {
    std::fprintf(stderr, "could not write %s or %s, or a step failed\n", argv[1], argv[2]);
    return 1;
  }
  return 0;
}
