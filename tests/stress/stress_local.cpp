// SPDX-License-Identifier: MIT
// The secular solver on as many random and adversarial problems as there is time for:
//   talus_stress_local [PROBLEMS [SEED]]
// Prints a line a kind; status 1 if a single one is missed.

#include "talus/cone/secular.hpp"

#include "../support/cone_problems.hpp"

#include <cstdint>
#include <cstdio>
#include <cstdlib>

using namespace talus;
using namespace cone_problems;

namespace {

long missed = 0, solved = 0;

template <class Law, int N>
void run(const char* law, long count, std::uint64_t seed) {
  for (int k = 0; k < kinds; ++k) {
    const Tally t = tally<SecularSolver, Law, N>(SecularSolver{}, Kind(k), count, 1e-10,
                                                 seed + static_cast<std::uint64_t>(k));
    std::printf("%-10s N = %d  %-14s %11ld problems  %ld missed (%ld unreported)  worst %.1e\n",
                law, N, kind_name[k].data(), t.problems, t.missed, t.silent, t.worst);
    std::fflush(stdout);
    missed += t.missed;
    solved += t.problems;
  }
}

} // namespace

int main(int argc, char** argv) {
  const double asked = argc > 1 ? std::atof(argv[1]) : 1e8;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  if (!(asked >= 1 && asked < 1e18)) {
    std::fprintf(stderr, "PROBLEMS is %s; it must be a number from 1 to 1e18\n", argv[1]);
    return 2;
  }
  const long count = static_cast<long>(asked / (6 * kinds)) + 1;
  run<CoulombLaw, 2>("Coulomb", count, seed);
  run<CoulombLaw, 3>("Coulomb", count, seed);
  run<CoulombLaw, 6>("Coulomb", count, seed);
  run<AssociatedLaw, 2>("associated", count, seed);
  run<AssociatedLaw, 3>("associated", count, seed);
  run<AssociatedLaw, 6>("associated", count, seed);
  std::printf("%ld problems, %ld missed\n", solved, missed);
  return missed == 0 ? 0 : 1;
}
