// SPDX-License-Identifier: MIT
// What has no default is refused by name until it is given, and what to write is said.

#include "talus/boundary/body.hpp"
#include "talus/boundary/floor.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/scene/collapse.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace test_not_given {

using namespace talus;

namespace {

template <class Do>
std::string refusal(const Do& what) {
  try {
    what();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "(accepted)";
}

template <int Dim>
using Sim = Simulation<Dim, ConstantFriction, PolyPic, GaussSeidel<>>;

template <int Dim>
typename Sim<Dim>::Params complete() {
  typename Sim<Dim>::Params params;
  params.grid.size = Vec<Dim>::Constant(0.1);
  for (int a = 0; a < Dim; ++a)
    params.grid.cells[a] = 4;
  params.material.density = 1500;
  params.gravity = -9.81 * Vec<Dim>::Unit(Dim - 1);
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces.lower.fill({FaceKind::free_slip});
  params.faces.upper.fill({FaceKind::free_slip});
  return params;
}

template <int Dim, class Change>
std::string without(const Change& change) {
  auto params = complete<Dim>();
  const typename Sim<Dim>::Params fresh;
  change(params, fresh);
  return refusal([&] { Sim<Dim>(params, {}); });
}

template <int Dim>
void check_scene() {
  CAPTURE(Dim);
  CHECK(without<Dim>([](auto&, const auto&) {}) == "(accepted)");
  CHECK(without<Dim>([](auto& params, const auto& fresh) { params.gravity = fresh.gravity; }) ==
        "gravity.x is nan, not given; allowed: finite numbers, m/s²; it has no default: " +
            std::string(Dim == 2 ? "{0, 0}" : "{0, 0, 0}") + " for none");
  CHECK(without<Dim>([](auto& params, const auto& fresh) {
          params.gravity[1] = fresh.gravity[1];
        }).starts_with("gravity.y is nan, not given; "));
  CHECK(without<Dim>([](auto& params, const auto&) { params.gravity.setZero(); }) == "(accepted)");
  CHECK(without<Dim>([](auto& params, const auto& fresh) { params.rheology = fresh.rheology; }) ==
        "rheology.mu is nan, not given; allowed: a finite number >= 0; it has no default");
  const char axes[] = {'x', 'y', 'z'};
  for (std::size_t a = 0; a < std::size_t{Dim}; ++a) {
    CHECK(without<Dim>([a](auto& params, const auto& fresh) {
            params.faces.lower[a] = fresh.faces.lower[a];
          }) ==
          "faces.lower." + std::string(1, axes[a]) +
              " is not given; allowed: FaceKind::no_slip, free_slip, open, frictional or periodic; "
              "it has no "
              "default");
    CHECK(without<Dim>([a](auto& params, const auto&) {
            params.faces.upper[a] = {};
          }).starts_with("faces.upper." + std::string(1, axes[a]) + " is not given; "));
  }
  CHECK(without<Dim>([](auto& params, const auto&) {
          params.faces.upper[0] = {FaceKind::frictional};
        }) == "faces.upper.x.friction is nan, not given; allowed: a finite number >= 0; it has no "
              "default");
}

} // namespace

TEST_CASE("a scene without gravity, friction or a face is refused, and says what to write") {
  check_scene<2>();
  check_scene<3>();
  auto params = complete<2>();
  Sim<2> sim(params, {});
  CHECK(refusal([&] { sim.set_gravity({0, std::nan("")}); }).starts_with("gravity.y is nan"));
}

TEST_CASE("obstacles and bodies have no friction by default") {
  const std::string what = "friction is nan, not given; allowed: a finite number >= 0; it has no "
                           "default";
  CHECK(refusal([] { make_obstacle<Gate<2>>({.position = 0.1}); }) == "gate." + what);
  CHECK(refusal([] { make_obstacle<Floor<3>>({.height = 0.1}); }) == "floor." + what);
  CHECK(refusal([] {
          make_obstacle<ShapeObstacle<2>>({.shape = shapes::Ball<2>({0, 0}, 1)});
        }) == "shape_obstacle." + what);
  auto params = complete<2>();
  Body<2> body = ball_body<2>({0.05, 0.05}, 0.02, 2600, 0.3);
  body.friction = Body<2>{}.friction;
  params.bodies = {body};
  CHECK(refusal([&] { Sim<2>(params, {}); }) == "body." + what);
}

TEST_CASE("cohesion, viscosity and the frictions of a collapse have no default") {
  using Sticky = WithCohesion<ConstantFriction>;
  CHECK(refusal([] { Sticky({.law = {.mu = 0.4}}); }).starts_with("rheology.cohesion is nan, not"));
  using Slow = WithViscosity<ConstantFriction>;
  CHECK(refusal([] { Slow({.law = {.mu = 0.4}}); }).starts_with("rheology.viscosity is nan, not"));
  CollapseSetup setup;
  setup.column_length = setup.column_height = 0.1;
  setup.length = setup.height = 1;
  CHECK(refusal([&] { setup.validate(); }).starts_with("wall_friction is nan, not given"));
  setup.wall_friction = 0;
  CHECK(refusal([&] { setup.validate(); }).starts_with("gate_friction is nan, not given"));
  setup.gate_friction = 0;
  CHECK(refusal([&] { setup.validate(); }) == "(accepted)");
}

} // namespace test_not_given
