// SPDX-License-Identifier: MIT
// Particles to grid and back: moments, couplings, momentum, affine fields.

#include "talus/core/grid.hpp"
#include "talus/scene/fill.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/grid_to_particles.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/multilinear.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

using namespace talus;

namespace {

template <int Dim>
struct Cloud {
  Grid<Dim> grid;
  Particles<Dim> particles, unordered;
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
    unordered = particles;
    order.update(particles, grid, 1);
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
void check_order(const CellOrder<Dim>& order, const Particles<Dim>& particles,
                 const Grid<Dim>& grid) {
  std::vector<char> seen(particles.size(), 0);
  for (int c = 0; c < grid.cell_count(); ++c)
    for (std::size_t k = order.begin(c); k < order.begin(c + 1); ++k) {
      const std::size_t p = order.particle(k);
      CHECK(grid.cell(grid.cell_at(particles.position[p])) == c);
      ++seen[particles.id[p]];
    }
  for (const char count : seen)
    CHECK(count == 1);
}

/// In disorder, in order, and with one particle out of place; with one thread and with three.
template <int Dim>
void check_orders() {
  Cloud<Dim> cloud(true);
  const Particles<Dim>& initial = cloud.unordered;
  const auto in_memory_order = [&] {
    for (std::size_t k = 0; k < cloud.particles.size(); ++k)
      if (cloud.order.particle(k) != k)
        return false;
    return true;
  };
  check_order(cloud.order, cloud.particles, cloud.grid);
  CHECK(in_memory_order());
  for (std::size_t p = 0; p < initial.size(); ++p) // a particle keeps all that is its own
    for (std::size_t q = 0; q < initial.size(); ++q)
      if (initial.id[p] == cloud.particles.id[q]) {
        CHECK(initial.position[p] == cloud.particles.position[q]);
        CHECK(initial.velocity[p] == cloud.particles.velocity[q]);
        CHECK(initial.affine[p] == cloud.particles.affine[q]);
        CHECK(initial.volume[p] == cloud.particles.volume[q]);
      }

  cloud.particles.position[0] = cloud.grid.upper();
  const Particles<Dim> moved = cloud.particles;
  cloud.order.update(cloud.particles, cloud.grid, 1);
  check_order(cloud.order, cloud.particles, cloud.grid);
  CHECK_FALSE(in_memory_order()); // not worth moving the others for
  CHECK(cloud.particles.id == moved.id);

  CellOrder<Dim> by_threads;
  Particles<Dim> same = cloud.particles;
  by_threads.update(same, cloud.grid, 3);
  for (std::size_t k = 0; k < same.size(); ++k)
    CHECK(by_threads.particle(k) == cloud.order.particle(k));
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

/// Remembers all that the grid says, and moves nothing of it into v and C.
struct Record {
  struct Params {};
  static constexpr bool affine = true;
  Record() = default;
  explicit Record(const Params&) {}
  template <int Dim>
  void update(const GridSample<Dim>& sample, Vec<Dim>& v, Mat<Dim>& c) const {
    v = sample.velocity - sample.velocity_before;
    c = sample.gradient;
  }
};

/// Velocities, gradients and new positions against plain sums over the corners.
template <int Dim>
void check_samples() {
  Cloud<Dim> cloud(true);
  const Grid<Dim>& grid = cloud.grid;
  Random random(11);
  std::vector<Vec<Dim>> u(static_cast<std::size_t>(grid.node_count())), before(u.size());
  for (std::size_t j = 0; j < u.size(); ++j)
    for (int a = 0; a < Dim; ++a) {
      u[j][a] = random.uniform() - 0.5;
      before[j][a] = random.uniform() - 0.5;
    }
  const double dt = 0.1;
  const Vec<Dim> lower = grid.origin(),
                 upper = Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
  Particles<Dim> after = cloud.particles;
  grid_to_particles(after, cloud.order, grid, Record(), u, before, {}, dt, lower, upper, 2);
  for (std::size_t p = 0; p < after.size(); ++p) {
    const Vec<Dim> x = cloud.particles.position[p];
    const Index<Dim> cell = grid.cell_at(x);
    const auto n = Multilinear<Dim>::values(grid.local(x, cell));
    const auto dn = Multilinear<Dim>::gradients(grid.local(x, cell), grid.inverse_spacing());
    Vec<Dim> now = Vec<Dim>::Zero(), then = Vec<Dim>::Zero();
    Mat<Dim> gradient = Mat<Dim>::Zero();
    for (int c = 0; c < Grid<Dim>::corners; ++c) {
      const std::size_t s = static_cast<std::size_t>(c);
      const std::size_t j = static_cast<std::size_t>(grid.first_node(cell) + grid.corner_offset(c));
      now += n[s] * u[j];
      then += n[s] * before[j];
      gradient += u[j] * dn[s].transpose();
    }
    CHECK((after.velocity[p] - (now - then)).norm() < 1e-14);
    CHECK((after.affine[p] - gradient).norm() < 1e-13);
    CHECK((after.position[p] - (x + dt * now).cwiseMax(lower)).norm() < 1e-14);
    CHECK((after.position[p].array() >= lower.array()).all());
  }
}

/// Overpacked material spreads by the documented shift, capped, where no node forbids it.
template <int Dim>
void check_spreading() {
  const Cloud<Dim> cloud(true);
  const Grid<Dim>& grid = cloud.grid;
  Random random(12);
  const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
  std::vector<Vec<Dim>> u(nodes);
  Spreading spreading{std::vector<double>(nodes), 5};
  for (std::size_t j = 0; j < nodes; ++j) {
    for (int a = 0; a < Dim; ++a)
      u[j][a] = random.uniform() - 0.5;
    spreading.excess[j] = random.uniform();
  }
  Index<Dim> inner;
  for (int a = 0; a < Dim; ++a)
    inner[a] = 1;
  const std::size_t forbidden = static_cast<std::size_t>(grid.node(inner));
  spreading.excess[forbidden] = -1;
  const double dt = 0.02;
  const Vec<Dim> everywhere = Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
  Particles<Dim> after = cloud.particles;
  grid_to_particles(after, cloud.order, grid, Record(), u, u, spreading, dt, Vec<Dim>(-everywhere),
                    everywhere, 1);
  int capped = 0, free = 0, held = 0;
  for (std::size_t p = 0; p < after.size(); ++p) {
    const Vec<Dim> x = cloud.particles.position[p];
    const Index<Dim> cell = grid.cell_at(x);
    const auto n = Multilinear<Dim>::values(grid.local(x, cell));
    const auto dn = Multilinear<Dim>::gradients(grid.local(x, cell), grid.inverse_spacing());
    Vec<Dim> expected = x, slope = Vec<Dim>::Zero();
    Mat<Dim> gradient = Mat<Dim>::Zero();
    bool spreads = true;
    for (int c = 0; c < Grid<Dim>::corners; ++c) {
      const std::size_t s = static_cast<std::size_t>(c);
      const std::size_t j = static_cast<std::size_t>(grid.first_node(cell) + grid.corner_offset(c));
      expected += dt * n[s] * u[j];
      gradient += u[j] * dn[s].transpose();
      slope += spreading.excess[j] * dn[s];
      spreads = spreads && j != forbidden;
    }
    const Mat<Dim> rate = 0.5 * (gradient + gradient.transpose());
    const double share = spreading.rate * dt * std::sqrt(0.5 * rate.squaredNorm());
    if (spreads)
      expected -= std::min(share, 0.1) * grid.spacing().cwiseAbs2().cwiseProduct(slope);
    ++(!spreads ? held : share > 0.1 ? capped : free);
    CHECK((after.position[p] - expected).norm() < 1e-14);
  }
  CHECK(capped > 0);
  CHECK(free > 0);
  CHECK(held > 0);
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
  check_orders<2>();
  check_orders<3>();
}

TEST_CASE("moments give the same volumes, momenta and couplings as sums over particles") {
  check_sums<2>(true);
  check_sums<2>(false);
  check_sums<3>(true);
  check_sums<3>(false);
}

TEST_CASE("grid to particles gives the same samples as sums over corners") {
  check_samples<2>();
  check_samples<3>();
}

TEST_CASE("overpacked material spreads, nowhere faster than a step allows") {
  check_spreading<2>();
  check_spreading<3>();
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
