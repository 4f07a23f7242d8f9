// SPDX-License-Identifier: MIT

#include "talus/rheology/laws.hpp"

#include <doctest/doctest.h>

#include <limits>

using namespace talus;

TEST_CASE("friction laws at their known points") {
  const InertialNumber inertial{.grain_diameter = 5e-4, .density = 1470, .strain_factor = 1};
  CHECK(ConstantFriction({.mu = 0.38}).friction(1) == 0.38);
  const MuOfI mu_i({.inertial = inertial});
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK(mu_i.friction(0) == doctest::Approx(0.38));
  CHECK(mu_i.friction(0.279) == doctest::Approx((0.38 + 0.64) / 2));
  CHECK(mu_i.friction(infinity) == doctest::Approx(0.64));
  const HystereticFriction ramp({.inertial = inertial});
  CHECK(ramp.friction(0) == doctest::Approx(0.54));
  CHECK(ramp.friction(0.02) == doctest::Approx(0.46));
  CHECK(ramp.friction(0.04) == doctest::Approx(0.38));
  CHECK(ramp.friction(infinity) == doctest::Approx(0.38));
  const HystereticFriction step({.shape = HystereticFriction::Shape::step, .inertial = inertial});
  CHECK(step.friction(0.039) == doctest::Approx(0.54));
  CHECK(step.friction(0.04) == doctest::Approx(0.38));
}

TEST_CASE("inertial number: value and limits") {
  const InertialNumber inertial{.grain_diameter = 5e-4, .density = 1470, .strain_factor = 2};
  CHECK(inertial(10, 100) == doctest::Approx(5e-4 * 2 * 10 / std::sqrt(100 / 1470.0)));
  CHECK(inertial(0, 100) == 0);
  CHECK(inertial(0, 0) == 0);
  CHECK(inertial(1, 0) == std::numeric_limits<double>::infinity());
}

TEST_CASE("friction laws refuse nonsense") {
  CHECK_THROWS_AS(ConstantFriction({.mu = -1}), std::invalid_argument);
  CHECK_THROWS_AS(MuOfI({.mu_static = 0.5, .mu_limit = 0.4}), std::invalid_argument);
  CHECK_THROWS_AS(HystereticFriction({.I_star = 0}), std::invalid_argument);
}
