// SPDX-License-Identifier: MIT
// Particles that keep their velocities in single precision.

#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/io/vtk.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <stdexcept>
#include <type_traits>

namespace test_particle_data {

using namespace talus;

namespace {

template <class Real>
using Sim = Simulation<2, ConstantFriction, PolyPic, GaussSeidel<>, Real>;

template <class Real>
Sim<Real> column() {
  typename Sim<Real>::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.12}, .cells = {20, 6}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = Faces<2>::all({FaceKind::free_slip});
  params.faces.lower[1] = {FaceKind::no_slip};
  Particles<2, Real> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.1, 0.1}, {});
  return Sim<Real>(params, sand);
}

template <class S>
void run(S& sim, int steps) {
  for (int n = 0; n < steps; ++n)
    REQUIRE(sim.step().completed());
}

} // namespace

TEST_CASE("single precision particles: a column collapses alike") {
  static_assert(sizeof(decltype(Particles<3, float>{}.affine)::value_type) == 36);
  auto one = column<double>();
  auto other = column<float>();
  run(one, 150);
  run(other, 150);
  const double front = front_position(measure_profile(one), 0.01);
  CHECK(front > 0.12);
  CHECK(front_position(measure_profile(other), 0.01) == support::about(front, 2e-3));
  CHECK(volume_under_surface(other) == support::about(volume_under_surface(one), 1e-3));
  CHECK(largest_speed(other) == support::about(largest_speed(one), 1e-2));
  CHECK(farthest_at_rest(other.particles(), 1) == support::about(front, 0.05));
  CHECK(state_checksum(one.particles()) != state_checksum(other.particles()));
}

TEST_CASE("single precision particles: checkpoint and files") {
  const support::Folder folder;
  const auto file = folder / "state.talus";
  auto sim = column<float>();
  run(sim, 20);
  write_checkpoint(file, sim);
  run(sim, 20);
  auto again = column<float>();
  read_checkpoint(file, again);
  run(again, 20);
  CHECK(state_checksum(again.particles()) == state_checksum(sim.particles()));
  auto wider = column<double>();
  CHECK_THROWS_AS(read_checkpoint(file, wider), std::runtime_error);
  CHECK(vtk_field("velocity", sim.particles().velocity).components == 3);
}

} // namespace test_particle_data
