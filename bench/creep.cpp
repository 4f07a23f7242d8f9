// SPDX-License-Identifier: MIT
// How fast a bed creeps that ought to be at rest, against the solver's tolerance: prints CSV.
//   creep > creep.csv

#include "scenes.hpp"

#include "talus/diagnostics/profile.hpp"

#include <algorithm>
#include <cstdio>

int main() {
  std::printf("angle_deg,tolerance,speed_max_m_s,speed_rms_m_s,sweeps_mean\n");
  for (const double angle : {15.0, 22.0})
    for (const double tolerance : {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5}) {
      auto sim = scenes::bed(angle, 0.44, tolerance);
      double largest = 0, sum2 = 0;
      long sweeps = 0, samples = 0;
      while (sim.time() < 0.6) {
        const talus::StepReport report = sim.step();
        if (!report.completed())
          return 1;
        if (sim.time() < 0.4) // it compacts a little at first
          continue;
        const double speed = talus::largest_speed(sim);
        largest = std::max(largest, speed);
        sum2 += speed * speed;
        sweeps += report.solve.iterations;
        ++samples;
      }
      std::printf("%g,%g,%.4g,%.4g,%.1f\n", angle, tolerance, largest,
                  std::sqrt(sum2 / static_cast<double>(samples)),
                  static_cast<double>(sweeps) / static_cast<double>(samples));
      std::fflush(stdout);
    }
  return 0;
}
