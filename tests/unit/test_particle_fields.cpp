// SPDX-License-Identifier: MIT
// Nodal fields at the particles: multilinear functions are met exactly, on the faces of the box,
// too.

#include "talus/core/grid.hpp"
#include "talus/diagnostics/particle_fields.hpp"
#include "talus/particles.hpp"

#include <doctest/doctest.h>

namespace test_particle_fields {

using namespace talus;

namespace {

template <int Dim>
struct Flow {
  static constexpr int dimension = Dim;
  const Grid<Dim>& grid() const { return grid_; }
  const Particles<Dim>& particles() const { return particles_; }
  Grid<Dim> grid_;
  Particles<Dim> particles_;
};

} // namespace

TEST_CASE("a multilinear field is met at the particles") {
  Flow<3> flow{Grid<3>({.origin = {-1, 0, 2}, .size = {2, 1, 3}, .cells = {5, 2, 4}}), {}};
  const std::vector<Vec<3>> positions{{-1, 0, 2}, {1, 1, 5}, {0.3, 0.5, 2.2}, {-0.2, 0.99, 4.999}};
  for (const Vec<3>& x : positions)
    flow.particles_.add(x, Vec<3>::Zero(), 1);
  const auto f = [](const Vec<3>& x) { return 2 - x[0] + 3 * x[1] * x[2] + x[0] * x[1] * x[2]; };
  const auto values =
      at_particles(flow, [&](const Index<3>& node) { return f(flow.grid_.node_position(node)); });
  REQUIRE(values.size() == positions.size());
  for (std::size_t p = 0; p < positions.size(); ++p)
    CHECK(values[p] == doctest::Approx(f(positions[p])).epsilon(1e-14));
}

TEST_CASE("tensors at the particles") {
  Flow<2> flow{Grid<2>({.origin = {0, 0}, .size = {1, 1}, .cells = {3, 3}}), {}};
  flow.particles_.add({0.4, 0.9}, Vec<2>::Zero(), 1);
  const auto f = [](const Vec<2>& x) -> Mat<2> {
    Mat<2> m;
    m << x[0], x[1], -x[1], x[0] * x[1];
    return m;
  };
  const auto values =
      at_particles(flow, [&](const Index<2>& node) { return f(flow.grid_.node_position(node)); });
  REQUIRE(values.size() == 1);
  CHECK((values[0] - f({0.4, 0.9})).norm() < 1e-15);
}

TEST_CASE("no particles, no values") {
  const Flow<2> flow{Grid<2>({.origin = {0, 0}, .size = {1, 1}, .cells = {3, 3}}), {}};
  CHECK(at_particles(flow, [](const Index<2>&) { return 1.0; }).empty());
}

} // namespace test_particle_fields
