// SPDX-License-Identifier: MIT
// Tensors, exact sums, grid, shape functions, seeding.

#include "talus/core/exact_sum.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/scene/fill.hpp"

#include "../support/multilinear.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace test_vocabulary {

using namespace talus;

namespace {

template <int Dim>
Mat<Dim> random_symmetric(Random& random) {
  Mat<Dim> m;
  for (int i = 0; i < Dim; ++i)
    for (int j = 0; j < Dim; ++j)
      m(i, j) = random.uniform() - 0.5;
  return m + m.transpose();
}

template <int Dim>
void check_tensors() {
  Random random(1);
  for (int k = 0; k < 100; ++k) {
    const Mat<Dim> a = random_symmetric<Dim>(random), b = random_symmetric<Dim>(random);
    const auto va = symmetric_to_vector<Dim, double>(a), vb = symmetric_to_vector<Dim, double>(b);
    CHECK((vector_to_symmetric<Dim, double>(va) - a).norm() < 1e-14);
    CHECK(va.dot(vb) == doctest::Approx(0.5 * (a.cwiseProduct(b)).sum()).epsilon(1e-13));
    CHECK(va[0] == doctest::Approx(a.trace() / std::sqrt(2.0 * Dim)));
    const Mat<Dim> deviator = a - a.trace() / Dim * Mat<Dim>::Identity();
    CHECK(va.template tail<symmetric_size<Dim> - 1>().norm() ==
          doctest::Approx(std::sqrt(0.5) * deviator.norm()));
    CHECK(mean_from_normal<Dim>(va[0]) == doctest::Approx(a.trace() / Dim));
    CHECK(normal_from_mean<Dim>(a.trace() / Dim) == doctest::Approx(va[0]));
  }
  // The yield condition |Dev τ| = μ Tr τ/d is the edge of the cone of opening μ̃.
  Mat<Dim> edge = Mat<Dim>::Identity() * 3.0;
  edge(0, 1) = edge(1, 0) = 0.44 * 3.0;
  const auto v = symmetric_to_vector<Dim, double>(edge);
  CHECK(v.template tail<symmetric_size<Dim> - 1>().norm() ==
        doctest::Approx(cone_friction<Dim>(0.44) * v[0]));
}

template <int Dim>
Grid<Dim> some_grid() {
  GridParams<Dim> params;
  for (int a = 0; a < Dim; ++a) {
    params.origin[a] = 0.1 * a - 0.3;
    params.size[a] = 1.0 + a;
    params.cells[a] = 4 + 3 * a;
  }
  return Grid<Dim>(params);
}

template <int Dim>
void check_grid() {
  const Grid<Dim> grid = some_grid<Dim>();
  double volume = 0;
  int nodes = 0;
  for (int n = 0; n < grid.node_count(); ++n) {
    const Index<Dim> index = grid.node_index(n);
    CHECK(grid.node(index) == n);
    bool inside = true;
    for (int a = 0; a < Dim; ++a)
      inside = inside && index[a] >= 0 && index[a] <= grid.cells(a);
    if (inside) {
      volume += grid.node_volume(index);
      ++nodes;
    }
  }
  CHECK(nodes == (Dim == 2 ? 5 * 8 : 5 * 8 * 11));
  CHECK(volume == doctest::Approx(grid.size().prod()));
  for (int c = 0; c < grid.cell_count(); ++c) {
    const Index<Dim> index = grid.cell_index(c);
    CHECK(grid.cell(index) == c);
    CHECK(grid.cell_at(grid.node_position(index) + 0.5 * grid.spacing()) == index);
  }
  Index<Dim> last;
  for (int a = 0; a < Dim; ++a)
    last[a] = grid.cells(a) - 1;
  CHECK(grid.cell_at(grid.upper()) == last);
  CHECK(grid.neighbour_offset(grid.neighbours / 2) == 0);
  CHECK(grid.neighbour_offset(grid.neighbours - 1) == -grid.neighbour_offset(0));
}

template <int Dim>
void check_shape_functions() {
  const Grid<Dim> grid = some_grid<Dim>();
  Random random(2);
  for (int k = 0; k < 200; ++k) {
    Vec<Dim> xi;
    for (int a = 0; a < Dim; ++a)
      xi[a] = k == 0 ? 0.0 : k == 1 ? 1.0 : random.uniform();
    const auto n = Multilinear<Dim>::values(xi);
    const auto dn = Multilinear<Dim>::gradients(xi, grid.inverse_spacing());
    double sum = 0;
    Vec<Dim> position = Vec<Dim>::Zero(), gradient_sum = Vec<Dim>::Zero();
    Mat<Dim> jacobian = Mat<Dim>::Zero(); // gradient of the position: the identity
    for (int c = 0; c < Grid<Dim>::corners; ++c) {
      Vec<Dim> corner;
      for (int a = 0; a < Dim; ++a)
        corner[a] = Grid<Dim>::corner_bit(c, a) * grid.spacing()[a];
      const std::size_t s = static_cast<std::size_t>(c);
      sum += n[s];
      position += n[s] * corner;
      gradient_sum += dn[s];
      jacobian += corner * dn[s].transpose();
    }
    CHECK(sum == doctest::Approx(1).epsilon(1e-14));
    CHECK((position - xi.cwiseProduct(grid.spacing())).norm() < 1e-14);
    CHECK(gradient_sum.norm() < 1e-12);
    CHECK((jacobian - Mat<Dim>::Identity()).norm() < 1e-13);
    // against finite differences
    const double step = 1e-6;
    for (int a = 0; a < Dim; ++a) {
      Vec<Dim> there = xi;
      there[a] += step;
      const auto n2 = Multilinear<Dim>::values(there);
      for (std::size_t c = 0; c < n.size(); ++c)
        CHECK((n2[c] - n[c]) / step * grid.inverse_spacing()[a] ==
              doctest::Approx(dn[c][a]).epsilon(1e-6));
    }
  }
}

} // namespace

TEST_CASE("symmetric tensors keep inner products as vectors") {
  check_tensors<2>();
  check_tensors<3>();
}

TEST_CASE("exact sums are rounded once, to nearest, whatever the exponents") {
  const auto sum = [](const std::vector<double>& terms, int exponent = 0) {
    ExactSum all;
    for (const double x : terms)
      all.add(std::ldexp(x, exponent));
    return all.value();
  };
  constexpr double next = 1 + 0x1p-52;
  for (int e = -900; e < 900; ++e) {
    const auto shifted = [&](double x) { return std::ldexp(x, e); };
    CHECK(sum({1, 0x1p-53}, e) == shifted(1)); // ties to even
    CHECK(sum({next, 0x1p-53}, e) == shifted(1 + 0x1p-51));
    CHECK(sum({1, 0x1p-53, 0x1p-120}, e) == shifted(next));
    CHECK(sum({1, 0x1p-53, -0x1p-120}, e) == shifted(1));
    CHECK(sum({-1, -0x1p-53, -0x1p-120}, e) == shifted(-next));
    CHECK(sum({1, 0x1p70, 0x1p-100, -0x1p70, -1}, e) == shifted(0x1p-100));
  }
  constexpr double least = std::numeric_limits<double>::denorm_min();
  CHECK(sum({}) == 0);
  CHECK(sum({1, -1}) == 0);
  CHECK(sum({least, least, -0.0}) == 2 * least);
  CHECK(sum({std::numeric_limits<double>::min(), -least}) ==
        std::numeric_limits<double>::min() - least);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  CHECK(sum({std::numeric_limits<double>::max(), std::numeric_limits<double>::max()}) == infinity);
  CHECK(sum({1, -infinity}) == -infinity);
  CHECK(std::isnan(sum({infinity, -infinity})));
  Random random(3);
  std::vector<double> terms;
  for (int k = 0; k < 1000; ++k)
    terms.push_back((random.uniform() - 0.5) * std::ldexp(1.0, k % 40));
  for (int e = 1; e < 64; ++e)
    CHECK(sum(terms, e) == std::ldexp(sum(terms), e));
}

TEST_CASE("grid: numbers, volumes and neighbours agree") {
  check_grid<2>();
  check_grid<3>();
}

TEST_CASE("grid: wrong parameters are refused by name") {
  GridParams<2> params{.origin = Vec<2>::Zero(), .size = {1, 1}, .cells = {4, 4}};
  CHECK_NOTHROW(Grid<2>{params});
  auto bad = params;
  bad.size[1] = 0;
  CHECK_THROWS_WITH_AS(Grid<2>{bad}, "grid.size.y is 0; allowed: a finite number > 0",
                       std::invalid_argument);
  bad = params;
  bad.cells[0] = 0;
  CHECK_THROWS_WITH_AS(Grid<2>{bad}, "grid.cells.x is 0; allowed: an integer in 1..2^30",
                       std::invalid_argument);
  bad.cells[0] = std::numeric_limits<int>::max(); // with its ghosts it would wrap around
  CHECK_THROWS_WITH_AS(Grid<2>{bad}, "grid.cells.x is 2147483647; allowed: an integer in 1..2^30",
                       std::invalid_argument);
  bad = params;
  bad.origin[0] = std::nan("");
  CHECK_THROWS_AS(Grid<2>{bad}, std::invalid_argument);
  bad = params;
  bad.cells = {1 << 20, 1 << 20};
  CHECK_THROWS_AS(Grid<2>{bad}, std::invalid_argument);
}

TEST_CASE("shape functions: partition of unity, linear reproduction, gradients") {
  check_shape_functions<2>();
  check_shape_functions<3>();
}

TEST_CASE("fill_box: volume, place, reproducible") {
  const Grid<3> grid = some_grid<3>();
  const Vec<3> lower = grid.origin() + Vec<3>(0.1, 0.2, 0.3),
               upper = lower + Vec<3>(0.33, 0.5, 0.7);
  for (const auto pattern : {Seeding::Pattern::jittered, Seeding::Pattern::random}) {
    Seeding seeding;
    seeding.pattern = pattern;
    seeding.jitter = 1;
    Particles<3> a, b;
    const std::size_t count = fill_box(a, grid, lower, upper, seeding);
    fill_box(b, grid, lower, upper, seeding);
    CHECK(count == a.size());
    double volume = 0;
    for (std::size_t p = 0; p < a.size(); ++p) {
      volume += a.volume[p];
      CHECK((a.position[p].array() >= lower.array()).all());
      CHECK((a.position[p].array() <= upper.array()).all());
      CHECK(a.position[p] == b.position[p]);
    }
    CHECK(volume == doctest::Approx((upper - lower).prod()).epsilon(1e-12));
    seeding.seed = 2;
    Particles<3> c;
    fill_box(c, grid, lower, upper, seeding);
    CHECK(c.position[0] != a.position[0]);
  }
  Particles<3> none;
  CHECK_THROWS_AS(fill_box(none, grid, upper, lower, {}), std::invalid_argument);
  CHECK_THROWS_AS(fill_box(none, grid, lower, Vec<3>(100, 100, 100), {}), std::invalid_argument);
  Seeding bad;
  bad.per_axis = 0;
  CHECK_THROWS_AS(fill_box(none, grid, lower, upper, bad), std::invalid_argument);
  bad = {};
  bad.jitter = -0.1;
  CHECK_THROWS_AS(fill_box(none, grid, lower, upper, bad), std::invalid_argument);
}

} // namespace test_vocabulary
