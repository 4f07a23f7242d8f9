// SPDX-License-Identifier: MIT
// Particles to grid and back, part by part: nanoseconds a particle, one thread.

#include "talus/scene/fill.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/grid_to_particles.hpp"
#include "talus/transfer/schemes.hpp"

#include <benchmark/benchmark.h>

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

using namespace talus;

namespace {

/// Particles in a box of 32 × 32 (2-D) or 32 × 8 × 16 cells, a lattice with full jitter.
template <int Dim>
struct Cloud {
  Grid<Dim> grid;
  Particles<Dim> particles;
  CellOrder<Dim> order;
  Array<CellMoments<Dim>> moments;
  Array<Vec<4>> velocity, before;

  explicit Cloud(int per_axis) {
    GridParams<Dim> params;
    params.size = Vec<Dim>::Ones();
    params.cells = [] {
      if constexpr (Dim == 2)
        return Index<2>{32, 32};
      else
        return Index<3>{32, 8, 16};
    }();
    grid = Grid<Dim>(params);
    fill_box<Dim>(particles, grid, Vec<Dim>::Zero(), Vec<Dim>::Ones(),
                  {.per_axis = per_axis, .jitter = 1});
    Random random(3);
    for (std::size_t p = 0; p < particles.size(); ++p) {
      for (int a = 0; a < Dim; ++a)
        particles.velocity[p][a] = random.uniform();
      for (Eigen::Index i = 0; i < Dim * Dim; ++i)
        particles.affine[p].data()[i] = random.uniform();
    }
    particles.resize_mixed(particles.size());
    const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
    velocity.assign(nodes, Vec<4>::Constant(0.1));
    before = velocity;
    order.update(particles, grid, Execution());
    all_cell_moments<ParticleField::multilinear>(particles, order, grid, Execution(), moments);
  }

  void count(benchmark::State& state) const {
    state.counters["ns_per_particle"] = benchmark::Counter(
        static_cast<double>(particles.size()) * 1e-9,
        benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  }
};

template <int Dim>
void list(benchmark::State& state) {
  Cloud<Dim> cloud(static_cast<int>(state.range(0)));
  for (auto _ : state)
    cloud.order.update(cloud.particles, cloud.grid, Execution());
  cloud.count(state);
}

/// From disorder: every particle is moved.
template <int Dim>
void reorder(benchmark::State& state) {
  Cloud<Dim> cloud(static_cast<int>(state.range(0)));
  Random random(4);
  Particles<Dim> disorder = cloud.particles;
  for (std::size_t p = 0; p < disorder.size(); ++p)
    disorder.copy(
        p, cloud.particles,
        static_cast<std::size_t>(random.uniform() * static_cast<double>(disorder.size())));
  for (auto _ : state) {
    state.PauseTiming();
    cloud.particles = disorder;
    state.ResumeTiming();
    cloud.order.update(cloud.particles, cloud.grid, Execution());
  }
  cloud.count(state);
}

template <int Dim, class Transfer>
void to_cells(benchmark::State& state) {
  Cloud<Dim> cloud(static_cast<int>(state.range(0)));
  for (auto _ : state)
    all_cell_moments<Transfer::field>(cloud.particles, cloud.order, cloud.grid, Execution(),
                                      cloud.moments);
  cloud.count(state);
}

template <int Dim, class Transfer>
void to_particles(benchmark::State& state) {
  Cloud<Dim> cloud(static_cast<int>(state.range(0)));
  const Array<double> divergence(cloud.velocity.size(), 0.01);
  const Vec<Dim> lower = cloud.grid.origin(), upper = cloud.grid.upper();
  for (auto _ : state) // a time step of 0: every repetition finds the same
    grid_to_particles(cloud.particles, cloud.order, cloud.grid, Transfer(), cloud.velocity,
                      cloud.before, divergence, cloud.moments, 0.0, lower, upper, Execution());
  cloud.count(state);
}

template <int Dim>
void add() {
  const std::string dim = std::to_string(Dim) + "D/";
  const auto run = [&](const std::string& name, void (*function)(benchmark::State&)) {
    benchmark::RegisterBenchmark((dim + name).c_str(), function)
        ->ArgName("per_axis")
        ->Arg(2)
        ->Arg(3)
        ->Arg(6)
        ->Unit(benchmark::kMicrosecond);
  };
  run("list", list<Dim>);
  run("reorder", reorder<Dim>);
  run("to_cells/polypic", to_cells<Dim, PolyPic>);
  run("to_cells/apic", to_cells<Dim, Apic>);
  run("to_cells/flip", to_cells<Dim, Flip>);
  run("to_particles/apic", to_particles<Dim, Apic>);
  run("to_particles/polypic", to_particles<Dim, PolyPic>);
  run("to_particles/pic", to_particles<Dim, Pic>);
  run("to_particles/flip", to_particles<Dim, Flip>);
}

} // namespace

int main(int argc, char** argv) {
  add<2>();
  add<3>();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv))
    return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
