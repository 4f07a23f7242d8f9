// SPDX-License-Identifier: MIT
// The program of docs/how-to/materials.md: beads on granules in a column that collapses, and a
// friction that hangs on the place.

#include <talus/talus.hpp>

#include <cmath>
#include <cstdio>

/// A box for both.
template <class Sim>
typename Sim::Params box() {
  typename Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.6, 0.2}, .cells = {30, 10}}; // m
  params.gravity = {0, -9.81};                                             // m/s²
  params.time_step = 2e-3;                                                 // s
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[1] = {talus::FaceKind::open};
  return params;
}

int main() {
  // [list]
  using Two = talus::Materials<talus::ConstantFriction>;
  using Sim = talus::Simulation<2, Two, talus::PolyPic, talus::GaussSeidel<>>;
  Sim::Params params = box<Sim>(); // its material.density stays as it is
  params.rheology.list = {{.density = 1520, .law = {.mu = 0.75}},  // 0: granules
                          {.density = 1470, .law = {.mu = 0.44}}}; // 1: beads
  talus::Particles<2> column;
  const talus::Grid<2> grid(params.grid);
  talus::fill_box<2>(column, grid, {0, 0}, {0.1, 0.08}, {.material = 0});
  talus::fill_box<2>(column, grid, {0, 0.08}, {0.1, 0.16}, {.material = 1});
  Sim sim(params, column);
  // [list]
  // [look]
  while (sim.time() < 0.4)
    if (!sim.step().completed())
      return 1;
  const double beads = talus::total_volume(sim.particles(), 1); // m²; as at the start
  const double share = sim.material_fraction({2, 2}, 1);        // at a node: V_i1/V_i
  talus::write_vtk_particles<2>("particles.vtu", sim.particles().position,
                                {talus::vtk_field("material", sim.particles().material)});
  // [look]

  // [place]
  const double edge = 0.2; // m
  const auto law = [edge](const talus::FlowState<2>& at) {
    return at.position[0] > edge ? 0.8 : 0.3;
  };
  using Patchy = talus::LocalFriction<decltype(law)>;
  using PatchySim = talus::Simulation<2, Patchy, talus::PolyPic, talus::GaussSeidel<>>;
  PatchySim::Params patchy = box<PatchySim>();
  patchy.material.density = 1500;
  patchy.rheology.law = law;
  // [place]
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, grid, {0, 0}, {0.1, 0.16}, {});
  PatchySim patch(patchy, sand);
  while (patch.time() < 0.4)
    if (!patch.step().completed())
      return 1;
  std::printf(
      "beads %.6f m2, share of them at a node %.3f; with the patch the front is at %.3f m\n", beads,
      share, talus::volume_quantile(patch.particles(), 0.99));
  return std::abs(beads - 0.008) < 1e-15 && share >= 0 && share <= 1 ? 0 : 1;
}
