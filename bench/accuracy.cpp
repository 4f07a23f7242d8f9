// SPDX-License-Identifier: MIT
// Errors of flows with a known answer, against cell and time step, for each transfer: a table of
// comma-separated values on standard output. Half a minute a row on a quiet machine. Arguments: the
// names of rows, if not all.

#include "../tests/support/accuracy.hpp"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

namespace {

using namespace talus;

std::vector<std::string> wanted; // all, if empty

template <class Transfer>
void rows(const char* name, const typename Transfer::Params& transfer = {}) {
  if (!wanted.empty() && std::ranges::find(wanted, name) == wanted.end())
    return;
  for (const double cell : {0.01, 0.005})
    for (const double share : {1.0, 0.5, 0.25}) {
      accuracy::Setting<Transfer> s;
      s.cell = cell;
      s.time_step = 0.1 * cell * share; // s: 1 ms at 1 cm
      s.transfer = transfer;
      std::printf("%s,%g,%g,%.3f", name, cell, s.time_step, accuracy::vortex_loss(s));
      const accuracy::Rotation rotation = accuracy::disc_turns(s);
      std::printf(",%.1e,%.1e", rotation.energy, rotation.angular_momentum);
      for (const double layers : {0.15, 0.3, 0.6, 1.0, 2.0, 4.0})
        std::printf(",%.3f", accuracy::sliding_layer(s, layers * cell));
      const accuracy::Collision collision = accuracy::slab_hits_column(s);
      s.jitter = 0.5;
      const accuracy::Landing landing = accuracy::block_lands(s);
      std::printf(",%.4f,%.1e,%.5f,%.4f,%.3f,%.1e\n", collision.spread, collision.momentum,
                  landing.gap, landing.rebound, landing.rest, landing.noise);
      std::fflush(stdout);
    }
}

const std::vector<std::string> names = {"polypic",     "polypic_c0", "polypic_c4",
                                        "polypic_c40", "polypic_b0", "polypic_b0.1",
                                        "apic",        "flip",       "pic"};

} // namespace

int main(int argc, char** argv) {
  wanted.assign(argv + 1, argv + argc);
  for (const std::string& name : wanted)
    if (std::ranges::find(names, name) == names.end()) {
      std::fprintf(stderr, "no transfer is called \"%s\"; allowed:", name.c_str());
      for (const std::string& allowed : names)
        std::fprintf(stderr, " %s", allowed.c_str());
      std::fprintf(stderr, "\n");
      return 2;
    }
  std::printf("transfer,cell_m,time_step_s,vortex_loss_1_s,"
              "rotation_energy,rotation_angular_momentum,"
              "layer_0.15_m_s2,layer_0.3_m_s2,layer_0.6_m_s2,"
              "layer_1_m_s2,layer_2_m_s2,layer_4_m_s2,"
              "collision_spread,collision_momentum,"
              "landing_gap_m,landing_rebound,landing_rest_s,landing_noise_m_s\n");
  rows<PolyPic>("polypic");
  for (const double damping : {0.0, 4.0, 40.0}) // how the defaults were chosen: docs/accuracy.md
    rows<PolyPic>(damping == 0   ? "polypic_c0"
                  : damping == 4 ? "polypic_c4"
                                 : "polypic_c40",
                  {.damping = damping});
  rows<PolyPic>("polypic_b0", {.thin_damping = 0});
  rows<PolyPic>("polypic_b0.1", {.thin_damping = 0.1});
  rows<Apic>("apic");
  rows<Flip>("flip");
  rows<Pic>("pic");
}
