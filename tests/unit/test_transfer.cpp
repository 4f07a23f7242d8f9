// SPDX-License-Identifier: MIT
// Particles to grid and back: moments, couplings, momentum, affine fields.

#include "talus/core/grid.hpp"
#include "talus/scene/fill.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/multilinear.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

using namespace talus;

namespace {

template <int Dim>
struct Cloud {
  Grid<Dim> grid;
  Particles<Dim> particles;
  CellOrder<Dim> order;
  std::vector<CellMoments<Dim>> moments;

  explicit Cloud(bool affine) {
    GridParams<Dim> params;
    for (int a = 0; a < Dim; ++a) {
      params.size[a] = 1.0 + 0.5 * a;
      params.cells[a] = 3 + a;
    }
    grid = Grid<Dim>(params);
    Random random(5);
    for (int p = 0; p < 200; ++p) {
      Vec<Dim> x, v;
      for (int a = 0; a < Dim; ++a) {
        x[a] = random.uniform() * params.size[a];
        v[a] = random.uniform() - 0.5;
      }
      particles.add(x, v, 0.5 + random.uniform());
      for (int i = 0; i < Dim * Dim; ++i)
        particles.affine.back().data()[i] = random.uniform() - 0.5;
    }
    particles.position[0] = grid.upper(); // on faces and corners
    particles.position[1] = grid.origin();
    order.sort(particles, grid, 1);
    all_cell_moments(particles, order, grid, affine, 1, moments);
  }

  /// Sum over the cells of a node.
  template <class Visit>
  void at_node(int node, const Visit& visit) const {
    for_each_cell_of_node(grid, grid.node_index(node), [&](int cell, int corner) {
      if (!order.empty(cell))
        visit(moments[static_cast<std::size_t>(cell)], corner);
    });
  }
};

/// Calls visit(index of the node in the box).
template <int Dim, class Visit>
void for_each_node(const Grid<Dim>& grid, const Visit& visit) {
  for (int n = 0; n < grid.node_count(); ++n) {
    const Index<Dim> index = grid.node_index(n);
    bool inside = true;
    for (int a = 0; a < Dim; ++a)
      inside = inside && index[a] >= 0 && index[a] <= grid.cells(a);
    if (inside)
      visit(n);
  }
}

template <int Dim>
void check_order() {
  const Cloud<Dim> cloud(true);
  std::vector<char> seen(cloud.particles.size(), 0);
  for (int c = 0; c < cloud.grid.cell_count(); ++c)
    for (std::size_t p = cloud.order.begin(c); p < cloud.order.begin(c + 1); ++p) {
      CHECK(cloud.grid.cell(cloud.grid.cell_at(cloud.particles.position[p])) == c);
      ++seen[cloud.particles.id[p]];
    }
  for (const char count : seen)
    CHECK(count == 1);
}

/// Volumes, momenta and g_ij against plain sums over the particles.
template <int Dim>
void check_sums(bool affine) {
  const Cloud<Dim> cloud(affine);
  const Grid<Dim>& grid = cloud.grid;
  const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
  std::vector<double> volume(nodes, 0);
  std::vector<Vec<Dim>> momentum(nodes, Vec<Dim>::Zero());
  std::vector<Coupling<Dim>> coupling(nodes, Coupling<Dim>::Zero());
  for (std::size_t p = 0; p < cloud.particles.size(); ++p) {
    const Vec<Dim> x = cloud.particles.position[p];
    const Index<Dim> cell = grid.cell_at(x);
    const Vec<Dim> xi = grid.local(x, cell);
    const auto n = Multilinear<Dim>::values(xi);
    const auto dn = Multilinear<Dim>::gradients(xi, grid.inverse_spacing());
    const double v = cloud.particles.volume[p];
    for (int c = 0; c < Grid<Dim>::corners; ++c) {
      const std::size_t s = static_cast<std::size_t>(c);
      const int node = grid.first_node(cell) + grid.corner_offset(c);
      const std::size_t i = static_cast<std::size_t>(node);
      volume[i] += v * n[s];
      Vec<Dim> at_node = cloud.particles.velocity[p];
      if (affine)
        at_node += cloud.particles.affine[p] * (grid.node_position(node) - x);
      momentum[i] += v * n[s] * at_node;
      for (int d = 0; d < Grid<Dim>::corners; ++d)
        for (int k = 0; k < Grid<Dim>::neighbours; ++k)
          if (grid.neighbour_offset(k) == grid.corner_offset(d) - grid.corner_offset(c))
            coupling[i].col(k) += v * n[s] * dn[static_cast<std::size_t>(d)];
    }
  }
  for_each_node(grid, [&](int node) {
    const std::size_t i = static_cast<std::size_t>(node);
    double sum = 0;
    Vec<Dim> m = Vec<Dim>::Zero();
    Coupling<Dim> g = Coupling<Dim>::Zero();
    cloud.at_node(node, [&](const CellMoments<Dim>& moments, int corner) {
      sum += corner_volume(moments, corner);
      m += moments.momentum[static_cast<std::size_t>(corner)];
      add_coupling(moments, corner, grid.inverse_spacing(), g);
    });
    CHECK(sum == doctest::Approx(volume[i]).epsilon(1e-12));
    CHECK((m - momentum[i]).norm() < 1e-12);
    CHECK((g - coupling[i]).norm() < 1e-11);
    // a constant velocity has no strain rate
    CHECK(g.rowwise().sum().norm() < 1e-11);
  });
}

template <int Dim>
void check_momentum_kept() {
  const Cloud<Dim> cloud(true);
  Vec<Dim> on_particles = Vec<Dim>::Zero(), on_grid = Vec<Dim>::Zero();
  double volume = 0, grid_volume = 0;
  for (std::size_t p = 0; p < cloud.particles.size(); ++p) {
    on_particles += cloud.particles.volume[p] * cloud.particles.velocity[p];
    volume += cloud.particles.volume[p];
  }
  for_each_node(cloud.grid, [&](int node) {
    cloud.at_node(node, [&](const CellMoments<Dim>& moments, int corner) {
      on_grid += moments.momentum[static_cast<std::size_t>(corner)];
      grid_volume += corner_volume(moments, corner);
    });
  });
  CHECK(grid_volume == doctest::Approx(volume).epsilon(1e-13));
  CHECK((on_grid - on_particles).norm() < 1e-12 * volume);
}

/// APIC gives an affine velocity field to the grid exactly, and takes it back.
template <int Dim>
void check_affine() {
  Cloud<Dim> cloud(true);
  Mat<Dim> gradient;
  for (int i = 0; i < Dim * Dim; ++i)
    gradient.data()[i] = 0.3 * i - 0.7;
  const Vec<Dim> constant = Vec<Dim>::Constant(0.4);
  for (std::size_t p = 0; p < cloud.particles.size(); ++p) {
    cloud.particles.affine[p] = gradient;
    cloud.particles.velocity[p] = constant + gradient * cloud.particles.position[p];
  }
  all_cell_moments(cloud.particles, cloud.order, cloud.grid, true, 1, cloud.moments);
  for_each_node(cloud.grid, [&](int node) {
    double volume = 0;
    Vec<Dim> momentum = Vec<Dim>::Zero();
    cloud.at_node(node, [&](const CellMoments<Dim>& moments, int corner) {
      volume += corner_volume(moments, corner);
      momentum += moments.momentum[static_cast<std::size_t>(corner)];
    });
    if (volume > 0)
      CHECK((momentum / volume - constant - gradient * cloud.grid.node_position(node)).norm() <
            1e-12);
  });
}

} // namespace

TEST_CASE("cell order: each particle once, in its own cell") {
  check_order<2>();
  check_order<3>();
}

TEST_CASE("moments give the same volumes, momenta and couplings as sums over particles") {
  check_sums<2>(true);
  check_sums<2>(false);
  check_sums<3>(true);
  check_sums<3>(false);
}

TEST_CASE("particles to grid keeps mass and momentum") {
  check_momentum_kept<2>();
  check_momentum_kept<3>();
}

TEST_CASE("APIC reproduces affine fields") {
  check_affine<2>();
  check_affine<3>();
}

TEST_CASE("transfer schemes update a particle as they say") {
  const GridSample<2> sample{{1, 2}, {0.5, 1}, Mat<2>::Identity()};
  Vec<2> v(10, 20);
  Mat<2> c = Mat<2>::Zero();
  Apic().update(sample, v, c);
  CHECK(v == Vec<2>(1, 2));
  CHECK(c == Mat<2>::Identity());
  v = {10, 20};
  c.setZero();
  Pic().update(sample, v, c);
  CHECK(v == Vec<2>(1, 2));
  CHECK(c == Mat<2>::Zero());
  v = {10, 20};
  Flip({.ratio = 1}).update(sample, v, c);
  CHECK(v == Vec<2>(10.5, 21));
  v = {10, 20};
  Flip({.ratio = 0}).update(sample, v, c);
  CHECK(v == Vec<2>(1, 2));
  CHECK_THROWS_AS(Flip({.ratio = 1.5}), std::invalid_argument);
}
