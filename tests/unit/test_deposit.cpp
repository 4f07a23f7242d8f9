// SPDX-License-Identifier: MIT
// Measures of a deposit against shapes whose values are known: a wedge, a layer, a box.

#include "talus/core/types.hpp"
#include "talus/diagnostics/deposit.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/particles.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>

namespace test_deposit {

using namespace talus;

namespace {

constexpr double spacing = 1e-3; // of the particles, m

/// Adds particles in from <= x < to and bottom <= z < height(x); in 3-D 4 mm wide.
template <int Dim, class Height>
void add(Particles<Dim>& sand, double from, double to, double bottom, const Height& height) {
  for (double x = from + spacing / 2; x < to; x += spacing)
    for (double z = bottom + spacing / 2; z < height(x); z += spacing)
      for (int row = 0; row < (Dim == 3 ? 4 : 1); ++row) {
        Vec<Dim> place;
        place[1] = spacing * (row + 0.5);
        place[0] = x;
        place[Dim - 1] = z;
        sand.add(place, Vec<Dim>::Zero(), std::pow(spacing, Dim));
      }
}

} // namespace

TEST_CASE_TEMPLATE("where a share of a layer's and of a wedge's volume lies", Sand, Particles<2>,
                   Particles<3>) {
  Sand sand;
  const double gate = 0.1, bed = 0.02;
  add(sand, 0, 0.6, 0,
      [&](double) { return bed; }); // neither bed nor what is behind the gate counts
  add(sand, 0, gate, bed, [&](double) { return 0.08; });
  SUBCASE("a layer") {
    add(sand, gate, 0.3, bed, [&](double) { return bed + 0.01; });
    for (const double share : {0.05, 0.5, 0.95, 0.99})
      CHECK(std::abs(volume_quantile(sand, share, gate, bed) - (gate + 0.2 * share)) < spacing);
  }
  SUBCASE("a wedge") {
    const double height = 0.1, length = 0.4;
    add(sand, gate, gate + length, bed,
        [&](double x) { return bed + height * (1 - (x - gate) / length); });
    for (const double share : {0.05, 0.5, 0.95, 0.99})
      CHECK(std::abs(volume_quantile(sand, share, gate, bed) -
                     (gate + length * (1 - std::sqrt(1 - share)))) < 2 * spacing);
  }
}

TEST_CASE("a share of the volume: by volume, not by number, of particles in any order") {
  Particles<2> sand;
  CHECK(std::isnan(volume_quantile(sand, 0.5)));
  sand.add({3, 0}, Vec<2>::Zero(), 2);
  CHECK(volume_quantile(sand, 0) == 3);
  CHECK(volume_quantile(sand, 1) == 3);
  sand.add({1, 0}, Vec<2>::Zero(), 6);
  CHECK(volume_quantile(sand, 0) == 1);
  CHECK(volume_quantile(sand, 3.0 / 8) == 1); // half of the first is before it
  CHECK(volume_quantile(sand, 5.0 / 8) == 2); // halfway to the second
  CHECK(volume_quantile(sand, 7.0 / 8) == 3);
  CHECK(volume_quantile(sand, 1) == 3);
  CHECK(volume_quantile(sand, 0.5, 2) == 3);
  CHECK(std::isnan(volume_quantile(sand, 0.5, 0, 0))); // nothing above the floor
  CHECK_THROWS_WITH_AS(volume_quantile(sand, 1.5),
                       "volume_quantile: share is 1.5; allowed: a number in [0, 1]",
                       std::invalid_argument);
  CHECK_THROWS_AS(volume_quantile(sand, std::nan("")), std::invalid_argument);
}

TEST_CASE("the run-out of a wedge above a height") {
  const double bed = 0.02, height = 0.1, length = 0.4;
  Profile wedge;
  for (int i = 0; i <= 60; ++i) {
    wedge.x.push_back(0.01 * i);
    wedge.height.push_back(bed + std::max(0.0, height * (1 - wedge.x.back() / length)));
  }
  for (const double threshold : {0.001, 0.002, 0.005, 0.05}) // exact: nodes lie on its edges
    CHECK(front_position(wedge, bed + threshold) ==
          doctest::Approx(length * (1 - threshold / height)));
}

TEST_CASE_TEMPLATE("centre of mass and energies of a box that falls", Sand, Particles<2>,
                   Particles<3>) {
  constexpr int dim = std::is_same_v<Sand, Particles<2>> ? 2 : 3;
  Sand sand;
  add(sand, 0.1, 0.3, 0.02, [](double) { return 0.12; });
  Vec<dim> gravity = Vec<dim>::Zero();
  gravity[0] = 9.81 * std::sin(0.3);
  gravity[dim - 1] = -9.81 * std::cos(0.3);
  const double density = 1500, mass = density * 0.2 * 0.1 * (dim == 3 ? 0.004 : 1);
  const Vec<dim> centre = centre_of_mass(sand);
  CHECK(centre[0] == doctest::Approx(0.2));
  CHECK(centre[dim - 1] == doctest::Approx(0.07));
  if constexpr (dim == 3)
    CHECK(centre[1] == doctest::Approx(0.002));
  CHECK(potential_energy(sand, density, gravity) ==
        doctest::Approx(mass * 9.81 * (0.07 * std::cos(0.3) - 0.2 * std::sin(0.3))));
  CHECK(kinetic_energy(sand, density) == 0);
  std::ranges::fill(sand.velocity, Vec<dim>(3 * Vec<dim>::Unit(0) - 4 * Vec<dim>::Unit(dim - 1)));
  CHECK(kinetic_energy(sand, density) == doctest::Approx(mass * 25 / 2));
  CHECK(kinetic_energy(Sand{}, density) == 0);
  CHECK(potential_energy(Sand{}, density, gravity) == 0);
}

} // namespace test_deposit
