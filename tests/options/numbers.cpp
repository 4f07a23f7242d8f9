// SPDX-License-Identifier: MIT
// Numbers of two small runs, which no option of Eigen or of the compiler may change: see run.sh.

#include <talus/talus.hpp>

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>

namespace {

namespace fs = std::filesystem;

/// A block of sand that turns falls on a rough floor.
template <int Dim, class Rheology, class Transfer, class Solver>
void run(const fs::path& folder) {
  using Sim = talus::Simulation<Dim, Rheology, Transfer, Solver>;
  typename Sim::Params params;
  for (int a = 0; a < Dim; ++a) {
    params.grid.size[a] = 0.1 + 0.01 * a;
    params.grid.cells[a] = 5 + a;
  }
  params.gravity = -9.81 * talus::Vec<Dim>::Unit(Dim - 1);
  params.time_step = 2e-3;
  params.material.density = 1500;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<Dim>::all({talus::FaceKind::free_slip});
  params.faces.lower[Dim - 1] = {talus::FaceKind::no_slip};
  params.faces.upper[Dim - 1] = {talus::FaceKind::open};
  talus::Particles<Dim> sand;
  talus::fill_box<Dim>(sand, talus::Grid<Dim>(params.grid), talus::Vec<Dim>::Constant(0.01),
                       talus::Vec<Dim>::Constant(0.06), {.per_axis = 2});
  for (std::size_t p = 0; p < sand.size(); ++p) {
    sand.affine[p](0, 1) = -2;
    sand.affine[p](1, 0) = 3;
  }
  Sim sim(params, sand);
  for (int step = 0; step < 25; ++step)
    if (!sim.step().completed())
      std::puts("a step is not completed");
  const fs::path file = folder / ("state" + std::to_string(Dim));
  talus::write_checkpoint(file, sim);
  talus::read_checkpoint(file, sim);
  static_cast<void>(sim.step());
  talus::Vec<Dim> position = talus::Vec<Dim>::Zero(), velocity = position;
  talus::Mat<Dim> gradient = talus::Mat<Dim>::Zero();
  for (std::size_t p = 0; p < sim.particles().size(); ++p) {
    position += sim.particles().position[p];
    velocity += sim.particles().velocity[p];
    gradient += sim.particles().affine[p];
  }
  for (int a = 0; a < Dim; ++a) {
    std::printf("%.8g %.5g", position[a], velocity[a]);
    for (int b = 0; b < Dim; ++b)
      std::printf(" %.4g", gradient(a, b));
    std::puts("");
  }
}

} // namespace

int main(int, char** argv) {
  using namespace talus;
#ifdef IN_3D
  run<3, ConstantFriction, Apic, GaussSeidel<SecularSolver>>(argv[1]);
#else
  run<2, ConstantFriction, Apic, GaussSeidel<>>(argv[1]);
#endif
}
