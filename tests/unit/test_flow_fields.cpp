// SPDX-License-Identifier: MIT
// Strain rate at the nodes and flux through a section, against motions that are known.

#include "talus/boundary/faces.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/section_flux.hpp"
#include "talus/diagnostics/strain_rate.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>

namespace test_flow_fields {

using namespace talus;
using support::contains, support::message_of;

namespace {

template <int Dim>
using Sim = Simulation<Dim, ConstantFriction, PolyPic, GaussSeidel<>>;

/// A box of 1 m with 10 cells along each axis, without gravity.
template <int Dim>
typename Sim<Dim>::Params weightless(FaceKind kind = FaceKind::open) {
  typename Sim<Dim>::Params params;
  params.grid.size.setOnes();
  for (int a = 0; a < Dim; ++a)
    params.grid.cells[a] = 10;
  params.gravity = Vec<Dim>::Zero();
  params.time_step = 1e-3;
  params.material.density = 1500;
  params.rheology.mu = 0.4;
  params.faces = Faces<Dim>::all({kind});
  return params;
}

/// Material in a box that moves with the velocity `at_origin` + gradient x after one step.
template <int Dim>
Sim<Dim> moving(const typename Sim<Dim>::Params& params, const Vec<Dim>& lower,
                const Vec<Dim>& upper, const Vec<Dim>& at_origin, const Mat<Dim>& gradient,
                double jitter = 0) {
  Particles<Dim> particles;
  fill_box<Dim>(particles, Grid<Dim>(params.grid), lower, upper, {.per_axis = 2, .jitter = jitter});
  for (std::size_t p = 0; p < particles.size(); ++p) {
    particles.velocity[p] = at_origin + gradient * particles.position[p];
    particles.affine[p] = gradient;
  }
  Sim<Dim> sim(params, particles);
  REQUIRE(sim.step().completed());
  return sim;
}

template <int Dim>
void check_strain_rate(bool even) {
  Mat<Dim> gradient = Mat<Dim>::Zero();            // spreads in all directions, shears and turns
  gradient.diagonal().setConstant(even ? 5 : 0.5); // faster than what is overpacked
  gradient(0, 1) = 3;
  gradient(1, 0) = -1;
  auto params = weightless<Dim>();
  params.packing.even = even;
  const auto sim = moving<Dim>(params, Vec<Dim>::Constant(0.2), Vec<Dim>::Constant(0.8),
                               Vec<Dim>::Zero(), gradient, even ? 1 : 0);
  const StrainRate strain_rate(sim);
  const Mat<Dim> expected = (gradient + gradient.transpose()) / 2;
  Index<Dim> inside, surface, outside;
  for (int a = 0; a < Dim; ++a) {
    inside[a] = 5;
    surface[a] = a == 0 ? 2 : 5;
    outside[a] = 9;
  }
  CHECK((strain_rate(inside) - expected).norm() < 1e-9);
  CHECK((strain_rate(surface) - expected).norm() < 1e-9);
  CHECK(strain_rate(outside).norm() == 0);
  CHECK(strain_rate.norm(inside) == doctest::Approx(expected.norm() / std::sqrt(2.0)));
}

} // namespace

TEST_CASE("the strain rate of a linear velocity") {
  for (const bool even : {false, true}) {
    check_strain_rate<2>(even);
    check_strain_rate<3>(even);
  }
}

TEST_CASE("the flux of a block that moves as one") {
  const auto flat = moving<2>(weightless<2>(), {0, 0.2}, {0.8, 0.6}, {2, 0.5}, Mat<2>::Zero());
  for (const double x : {0.0, 0.1, 0.33, 0.5, 0.7}) // away from its front
    CHECK(section_flux(flat, 0, x) == doctest::Approx(0.4 * 2));
  CHECK(section_flux(flat, 1, 0.4) == doctest::Approx(0.8 * 0.5));
  CHECK(section_flux(flat, 0, 0.95) == 0);

  const auto solid =
      moving<3>(weightless<3>(), {0.2, 0, 0.3}, {0.8, 1, 0.5}, {-2, 0, 0}, Mat<3>::Zero());
  CHECK(section_flux(solid, 0, 0.44) == doctest::Approx(-2 * 0.2));
  CHECK(section_flux(solid, 1, 0.5) == doctest::Approx(0));
}

TEST_CASE("the flux through the seam of a periodic box") {
  auto params = weightless<2>();
  params.faces.lower[0] = params.faces.upper[0] = {FaceKind::periodic};
  const auto sim = moving<2>(params, {0, 0.2}, {1, 0.6}, {2, 0}, Mat<2>::Zero());
  for (const double x : {0.0, 0.04, 0.5, 0.96, 1.0})
    CHECK(section_flux(sim, 0, x) == doctest::Approx(0.4 * 2));
}

TEST_CASE("what flows past a section is missing on its other side") {
  auto params = weightless<2>();
  params.gravity = {3, -9.81};
  params.faces.lower[1] = {FaceKind::free_slip};
  // a half-space under the material takes a part of its lowest nodes' volume
  params.obstacles.push_back(make_obstacle<ShapeObstacle<2>>(
      {.shape = shapes::HalfSpace<2>({0, 0.13}, {0, 1}), .friction = 0}));
  Particles<2> particles;
  fill_box<2>(particles, Grid<2>(params.grid), {0.1, 0.13}, {0.5, 0.4}, {});
  Sim<2> sim(params, particles);
  constexpr double section = 0.4; // a cell behind the front: the flux is a mean over its neighbours
  const auto beyond = [&] {       // m²
    double volume = 0;
    for (std::size_t p = 0; p < sim.particles().size(); ++p)
      if (sim.particles().position[p][0] > section)
        volume += sim.particles().volume[p];
    return volume;
  };
  const double before = beyond();
  double passed = 0; // m²
  while (sim.time() < 0.3) {
    REQUIRE(sim.step().completed());
    passed += sim.time_step() * section_flux(sim, 0, section);
  }
  REQUIRE(passed > 0.03);
  CHECK(std::abs(passed - (beyond() - before)) < 0.05 * passed);
}

TEST_CASE("sections that are not there are refused, and fields without a step") {
  const auto sim = moving<2>(weightless<2>(), {0.2, 0.2}, {0.8, 0.6}, {1, 0}, Mat<2>::Zero());
  CHECK(contains(message_of<std::invalid_argument>([&] { section_flux(sim, 0, 1.5); }),
                 "section_flux: position is 1.5; allowed: a place in the box, 0 to 1 m"));
  CHECK(contains(message_of<std::invalid_argument>([&] { section_flux(sim, 2, 0.5); }),
                 "section_flux: axis is 2; allowed: 0 to 1"));
  const Sim<2> fresh(weightless<2>(), Particles<2>{});
  CHECK_THROWS_AS(StrainRate<2>{fresh}, std::invalid_argument);
  CHECK_THROWS_AS(section_flux(fresh, 0, 0.5), std::invalid_argument);
}

} // namespace test_flow_fields
