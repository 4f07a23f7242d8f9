// SPDX-License-Identifier: MIT
// How fast a bed creeps that ought to be at rest, as CSV: against the solver's tolerance, and for
// jittered particles against what is done about packing.
//   creep tolerance | packing

#include "scenes.hpp"

#include "talus/diagnostics/profile.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace {

struct Creep {
  double largest = 0, rms = 0, sweeps = 0; ///< m/s, m/s, mean a step
};

/// Over the time from `start` to `end`, s: the bed compacts a little at first.
Creep measure(scenes::Sim<2> sim, double start, double end) {
  Creep creep;
  double sum2 = 0, steps = 0;
  while (sim.time() < end) {
    const talus::StepReport report = sim.step();
    if (sim.time() < start)
      continue;
    const double speed = talus::largest_speed(sim);
    creep.largest = std::max(creep.largest, speed);
    sum2 += speed * speed;
    creep.sweeps += report.solve.iterations;
    ++steps;
  }
  creep.rms = std::sqrt(sum2 / steps);
  creep.sweeps /= steps;
  return creep;
}

void against_tolerance() {
  std::printf("angle_deg,tolerance,speed_max_m_s,speed_rms_m_s,sweeps_mean\n");
  for (const double angle : {15.0, 22.0})
    for (const double tolerance : {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5}) {
      const Creep creep = measure(scenes::bed(angle, 0.44, tolerance), 0.4, 0.6);
      std::printf("%g,%g,%.4g,%.4g,%.1f\n", angle, tolerance, creep.largest, creep.rms,
                  creep.sweeps);
    }
}

void against_packing() {
  std::printf("jitter,slack,dilatancy,surfaces,speed_max_m_s,speed_rms_m_s,sweeps_mean\n");
  for (const double jitter : {0.0, 0.5, 1.0})
    for (const talus::Packing& packing :
         {talus::Packing{.slack = 0, .dilatancy = 0, .surfaces = false},
          {.slack = 0},
          {.dilatancy = 0},
          {.surfaces = false},
          {}}) {
      const Creep creep = measure(scenes::bed(15, 0.44, 5e-5, jitter, packing), 1.5, 2);
      std::printf("%g,%g,%g,%d,%.4g,%.4g,%.1f\n", jitter, packing.slack, packing.dilatancy,
                  packing.surfaces, creep.largest, creep.rms, creep.sweeps);
    }
}

} // namespace

int main(int argc, char** argv) {
  const std::string_view what = argc == 2 ? argv[1] : "";
  if (what == "tolerance")
    against_tolerance();
  else if (what == "packing")
    against_packing();
  else {
    std::fprintf(stderr, "usage: %s tolerance | packing\n", argv[0]);
    return 2;
  }
  return 0;
}
