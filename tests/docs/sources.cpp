// SPDX-License-Identifier: MIT
// The program of docs/how-to/sources.md: sand comes through a strip, leaves into a pit, and is
// added and removed by hand.

#include <talus/scene/source.hpp>
#include <talus/talus.hpp>

#include <cstdio>

int main() {
  using Sim = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.6, 0.2}, .cells = {60, 20}}; // m
  params.material.density = 1500;                                          // kg/m³
  params.gravity = {0, -9.81};                                             // m/s²
  params.time_step = 1e-3;                                                 // s
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[1] = {talus::FaceKind::open};

  // [exchange]
  const talus::Grid<2> grid(params.grid);
  const auto chute = talus::make_source<2>(grid, {.lower = {0.05, 0.15},
                                                  .upper = {0.08, 0.15}, // flat: a strip
                                                  .velocity = {0.1, -0.3},
                                                  .flux = 5e-3, // m²/s; in 3-D m³/s
                                                  .time = {.start = 0.1, .end = 0.4}});
  const auto pit = talus::make_sink<2>(talus::shapes::Ball<2>({0.1, 0}, 0.02));
  params.exchange = talus::together<2>({chute, pit});
  Sim sim(params, {}); // nothing is there yet
  double in = 0, out = 0, held_back = 0;
  while (sim.time() < 0.5) {
    const talus::StepReport report = sim.step();
    in += report.inflow_volume;
    out += report.outflow_volume;
    held_back += report.held_back_volume;
  }
  // [exchange]
  // [by_hand]
  talus::Particles<2> more;
  talus::fill_box<2>(more, sim.grid(), {0.4, 0}, {0.5, 0.05}, {.per_axis = 3});
  sim.add(more); // with ids of their own
  const talus::Outflow removed =
      sim.remove([&](std::size_t p) { return sim.particles().position[p][0] > 0.45; });
  // [by_hand]
  const double there = talus::total_volume(sim.particles());
  std::printf("in %.6f, out %.6f, held back %.6f, removed %.6f, there %.6f m2\n", in, out,
              held_back, removed.volume, there);
  const double lost = in + talus::total_volume(more) - out - removed.volume - there;
  return lost < 1e-15 && lost > -1e-15 && in > 0 && out > 0 ? 0 : 1;
}
