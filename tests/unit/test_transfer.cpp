// SPDX-License-Identifier: MIT
// Particles to grid and back: moments, couplings, momentum, affine fields.

#include "../support/nodes.hpp"

#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/streaming.hpp"
#include "talus/packing.hpp"
#include "talus/scene/fill.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/grid_to_particles.hpp"
#include "talus/transfer/schemes.hpp"
#include "talus/transfer/shifting.hpp"

#include "../support/about.hpp"
#include "../support/multilinear.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace test_transfer {

using namespace talus;

namespace {

template <int Dim>
struct Cloud {
  Grid<Dim> grid;
  Particles<Dim> particles, unordered;
  CellOrder<Dim> order;
  Array<CellMoments<Dim>> moments;

  explicit Cloud(ParticleField field, double volume = 1) {
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
      particles.add(x, v, volume * (0.5 + random.uniform()));
      for (int i = 0; i < Dim * Dim; ++i)
        particles.affine.back().data()[i] = random.uniform() - 0.5;
    }
    particles.position[0] = grid.upper(); // on faces and corners
    particles.position[1] = grid.origin();
    if (field == ParticleField::multilinear) {
      particles.resize_mixed(particles.size());
      for (auto& mixed : particles.mixed)
        for (Eigen::Index i = 0; i < mixed.size(); ++i)
          mixed.data()[i] = random.uniform() - 0.5;
    }
    unordered = particles;
    order.update(particles, grid, Execution());
    gather(field);
  }

  void gather(ParticleField field) {
    if (field == ParticleField::constant)
      all_cell_moments<ParticleField::constant>(particles, order, grid, Execution(), moments);
    else if (field == ParticleField::affine)
      all_cell_moments<ParticleField::affine>(particles, order, grid, Execution(), moments);
    else
      all_cell_moments<ParticleField::multilinear>(particles, order, grid, Execution(), moments);
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

/// Calls visit(number of the node) for the nodes of the box.
template <int Dim, class Visit>
void for_each_node(const Grid<Dim>& grid, const Visit& visit) {
  nodes::for_each(grid, [&](const Index<Dim>& index) { visit(grid.node(index)); });
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
  Cloud<Dim> cloud(ParticleField::multilinear);
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
        CHECK(initial.mixed[p] == cloud.particles.mixed[q]);
        CHECK(initial.volume[p] == cloud.particles.volume[q]);
      }

  cloud.particles.position[0] = cloud.grid.upper();
  const Particles<Dim> moved = cloud.particles;
  cloud.order.update(cloud.particles, cloud.grid, Execution());
  check_order(cloud.order, cloud.particles, cloud.grid);
  CHECK_FALSE(in_memory_order()); // not worth moving the others for
  CHECK(cloud.particles.id == moved.id);

  CellOrder<Dim> by_threads;
  Particles<Dim> same = cloud.particles;
  by_threads.update(same, cloud.grid, Execution(3));
  for (std::size_t k = 0; k < same.size(); ++k)
    CHECK(by_threads.particle(k) == cloud.order.particle(k));
}

/// Volumes, momenta and g_ij against plain sums over the particles.
template <int Dim>
void check_sums(ParticleField field) {
  const Cloud<Dim> cloud(field, 1e-3); // no cell is full
  const Grid<Dim>& grid = cloud.grid;
  const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
  Array<double> volume(nodes, 0);
  Array<Vec<Dim>> momentum(nodes, Vec<Dim>::Zero());
  std::vector<GradientWeights<Dim>> coupling(nodes, GradientWeights<Dim>::Zero());
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
      const Vec<Dim> r = grid.node_position(node) - x;
      if (field != ParticleField::constant)
        at_node += cloud.particles.affine[p] * r;
      if (field == ParticleField::multilinear) {
        if constexpr (Dim == 2) {
          at_node += r[0] * r[1] * cloud.particles.mixed[p];
        } else {
          const Vec<4> products(r[1] * r[2], r[0] * r[2], r[0] * r[1], r[0] * r[1] * r[2]);
          at_node += cloud.particles.mixed[p] * products;
        }
      }
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
    GradientWeights<Dim> g = GradientWeights<Dim>::Zero();
    cloud.at_node(node, [&](const CellMoments<Dim>& moments, int corner) {
      sum += corner_volume(moments, corner);
      m += moments.momentum[static_cast<std::size_t>(corner)];
      add_coupling(moments, corner, grid.inverse_spacing(), g);
    });
    CHECK(sum == doctest::Approx(volume[i]).epsilon(1e-12));
    CHECK((m - momentum[i]).norm() < 1e-14);
    CHECK((g - coupling[i]).norm() < 1e-14);
    // a constant velocity has no strain rate
    CHECK(g.rowwise().sum().norm() < 1e-14);
  });
}

/// In full cells g_ij is the integral over the cells, wherever the particles are.
template <int Dim>
void check_full_cells() {
  Cloud<Dim> cloud(ParticleField::constant);
  const Grid<Dim>& grid = cloud.grid;
  cloud.particles = {};
  fill_box<Dim>(cloud.particles, grid, grid.origin(), grid.upper(), {.per_axis = 3, .jitter = 1});
  cloud.order.update(cloud.particles, grid, Execution());
  all_cell_moments<ParticleField::constant>(cloud.particles, cloud.order, grid, Execution(),
                                            cloud.moments, true);
  GradientWeights<Dim> g = GradientWeights<Dim>::Zero();
  Index<Dim> middle;
  for (int a = 0; a < Dim; ++a)
    middle[a] = 1;
  cloud.at_node(grid.node(middle), [&](const CellMoments<Dim>& moments, int corner) {
    add_coupling(moments, corner, grid.inverse_spacing(), g);
  });
  for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
    std::array<int, std::size_t{Dim}> offset{};
    for (int a = Dim - 1, rest = k; a >= 0; --a, rest /= 3)
      offset[static_cast<std::size_t>(a)] = rest % 3 - 1;
    for (int a = 0; a < Dim; ++a) {
      double exact = 1; // ∫ N_i ∂_a N_j: ±1/2 along a, h (1/6, 2/3, 1/6) along the others
      for (int b = 0; b < Dim; ++b) {
        const int at = offset[static_cast<std::size_t>(b)];
        exact *= b == a ? at / 2.0 : grid.spacing()[b] * (at == 0 ? 2.0 / 3 : 1.0 / 6);
      }
      CHECK(g(a, k) == doctest::Approx(exact).epsilon(1e-13));
    }
  }
}

template <int Dim>
void check_shifting() {
  GridParams<Dim> params;
  for (int a = 0; a < Dim; ++a) {
    params.size[a] = 1;
    params.cells[a] = 4;
  }
  const Grid<Dim> grid(params);
  Particles<Dim> particles;
  for (int p = 0; p < 1000; ++p) {
    Vec<Dim> x;
    for (int a = 0; a < Dim; ++a)
      x[a] = std::fmod(0.5 + p * (a + 1) * 0.137, 1.0);
    particles.add(x, Vec<Dim>::Constant(0.3), 1e-3);
  }
  CellOrder<Dim> order;
  order.update(particles, grid, Execution());
  Array<double> excess(static_cast<std::size_t>(grid.node_count()), not_inside);
  Array<double> strains(excess.size(), 0);
  const auto set = [&](double slope, double strain) { // φ grows along x; the upper half is outside
    for_each_node(grid, [&](int node) {
      const Vec<Dim> x = grid.node_position(node);
      if (x[Dim - 1] < 0.6)
        excess[static_cast<std::size_t>(node)] = 0.05 + slope * x[0];
      strains[static_cast<std::size_t>(node)] = strain;
    });
  };
  const auto shifted = [&](double rate, double steepest = 1) {
    Particles<Dim> after = particles;
    shift_particles(after, grid, excess, strains, rate, steepest, grid.origin(), grid.upper(),
                    Execution());
    return after;
  };
  set(0, 0.01);
  Particles<Dim> after = shifted(3);
  for (std::size_t p = 0; p < after.size(); ++p) // evenly dense: nothing to even out
    CHECK((after.position[p] - particles.position[p]).norm() < 1e-15);
  set(0.2, 0);
  after = shifted(3);
  for (std::size_t p = 0; p < after.size(); ++p) // not sheared
    CHECK(after.position[p] == particles.position[p]);
  for (const double strain : {0.01, 1.0, 2.0}) { // and the bounds: of the share and of h ∂φ
    const double slope = strain > 1 ? -0.2 : 0.2, steepest = strain > 1 ? 0.02 : 1;
    set(slope, strain);
    after = shifted(3, steepest);
    const double by =
        std::min(0.1, 3 * strain) * std::clamp(slope / 4, -steepest, steepest) / 4; // h² ∂φ
    std::size_t inside = 0;
    for (std::size_t p = 0; p < after.size(); ++p) {
      const Vec<Dim> x = particles.position[p];
      Vec<Dim> expected = x;
      if (x[Dim - 1] < 0.5) {
        expected[0] = std::clamp(x[0] - by, 0.0, 1.0);
        ++inside;
      }
      CHECK((after.position[p] - expected).norm() < 1e-14);
      CHECK(after.velocity[p] == particles.velocity[p]);
    }
    CHECK(inside > 300);
  }
}

template <int Dim>
void check_momentum_kept() {
  const Cloud<Dim> cloud(ParticleField::multilinear);
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

/// Remembers all that the grid says, in v, C and m.
struct Record {
  struct Params {};
  static constexpr ParticleField field = ParticleField::multilinear;
  Record() = default;
  explicit Record(const Params&) {}
  template <int Dim>
  void update(const GridSample<Dim>& sample, VelocityField<Dim>& p) const {
    p.velocity = sample.velocity - sample.velocity_before;
    p.gradient = sample.gradient;
    p.gradient(0, 0) += 1000 * sample.divergence_error; // both are told apart below
    p.mixed = sample.mixed;
  }
};

/// Velocities, gradients and new positions against plain sums over the corners.
template <int Dim>
void check_samples() {
  Cloud<Dim> cloud(ParticleField::multilinear);
  const Grid<Dim>& grid = cloud.grid;
  Random random(11);
  Array<Vec<Dim>> u(static_cast<std::size_t>(grid.node_count())), before(u.size());
  for (std::size_t j = 0; j < u.size(); ++j)
    for (int a = 0; a < Dim; ++a) {
      u[j][a] = random.uniform() - 0.5;
      before[j][a] = random.uniform() - 0.5;
    }
  const double dt = 0.1;
  const Vec<Dim> lower = grid.origin(),
                 upper = Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
  Particles<Dim> after = cloud.particles;
  Array<double> divergence(u.size());
  for (double& d : divergence)
    d = random.uniform();
  grid_to_particles(after, cloud.order, grid, Record(), u, before, divergence, cloud.moments, dt,
                    lower, upper, Execution(2));
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
    // the divergence in the middle of the cell, less the mean of its nodes' own
    const Vec<Dim> half = Vec<Dim>::Constant(0.5);
    const auto middle = Multilinear<Dim>::gradients(half, grid.inverse_spacing());
    double error = 0;
    for (int c = 0; c < Grid<Dim>::corners; ++c) {
      const std::size_t s = static_cast<std::size_t>(c);
      const std::size_t j = static_cast<std::size_t>(grid.first_node(cell) + grid.corner_offset(c));
      error += u[j].dot(middle[s]) - divergence[j] / Grid<Dim>::corners;
    }
    gradient(0, 0) += 1000 * error;
    CHECK((after.affine[p] - gradient).norm() < 1e-10);
    // the polynomial about the particle gives the corners' velocities
    for (int c = 0; c < Grid<Dim>::corners; ++c) {
      const std::size_t j = static_cast<std::size_t>(grid.first_node(cell) + grid.corner_offset(c));
      const Vec<Dim> r = grid.node_position(static_cast<int>(j)) - x;
      Vec<Dim> value = now + after.affine[p] * r;
      value[0] -= 1000 * error * r[0];
      if constexpr (Dim == 2)
        value += r[0] * r[1] * after.mixed[p];
      else
        value += after.mixed[p] * Vec<4>(r[1] * r[2], r[0] * r[2], r[0] * r[1], r.prod());
      CHECK((value - u[j]).norm() < 1e-10);
    }
    CHECK((after.position[p] - (x + dt * now).cwiseMax(lower)).norm() < 1e-14);
    CHECK((after.position[p].array() >= lower.array()).all());
  }
}

/// The nodal velocities that the particles give, 0 where there are none.
template <int Dim>
Array<Vec<Dim>> nodal_velocities(const Cloud<Dim>& cloud) {
  Array<Vec<Dim>> u(static_cast<std::size_t>(cloud.grid.node_count()), Vec<Dim>::Zero());
  for_each_node(cloud.grid, [&](int node) {
    double volume = 0;
    Vec<Dim> momentum = Vec<Dim>::Zero();
    cloud.at_node(node, [&](const CellMoments<Dim>& moments, int corner) {
      volume += corner_volume(moments, corner);
      momentum += moments.momentum[static_cast<std::size_t>(corner)];
    });
    if (volume > 0)
      u[static_cast<std::size_t>(node)] = momentum / volume;
  });
  return u;
}

/// APIC gives an affine velocity field to the grid exactly, and takes it back.
template <int Dim>
void check_affine() {
  Cloud<Dim> cloud(ParticleField::affine);
  Mat<Dim> gradient;
  for (int i = 0; i < Dim * Dim; ++i)
    gradient.data()[i] = 0.3 * i - 0.7;
  const Vec<Dim> constant = Vec<Dim>::Constant(0.4);
  for (std::size_t p = 0; p < cloud.particles.size(); ++p) {
    cloud.particles.affine[p] = gradient;
    cloud.particles.velocity[p] = constant + gradient * cloud.particles.position[p];
  }
  cloud.gather(ParticleField::affine);
  const auto u = nodal_velocities(cloud);
  for_each_node(cloud.grid, [&](int node) {
    const Vec<Dim>& at = u[static_cast<std::size_t>(node)];
    if (!at.isZero(0))
      CHECK((at - constant - gradient * cloud.grid.node_position(node)).norm() < 1e-12);
  });
}

/// Grid → particles → grid with nothing moving: the share of a random nodal field that is lost.
template <int Dim, class Transfer>
double round_trip_loss(Transfer transfer, double time_step) {
  Cloud<Dim> cloud(Transfer::field);
  cloud.particles.resize_mixed(cloud.particles.size());
  const Grid<Dim>& grid = cloud.grid;
  Random random(13);
  Array<Vec<Dim>> u(static_cast<std::size_t>(grid.node_count()));
  for (Vec<Dim>& v : u)
    for (int a = 0; a < Dim; ++a)
      v[a] = random.uniform() - 0.5;
  const Array<double> divergence(u.size(), 0);
  const Vec<Dim> everywhere = Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
  if constexpr (requires { transfer.prepare(TransferStep{}); })
    transfer.prepare({time_step, 30});
  grid_to_particles(cloud.particles, cloud.order, grid, transfer, u, u, divergence, cloud.moments,
                    0.0, Vec<Dim>(-everywhere), everywhere, Execution(2));
  cloud.gather(Transfer::field);
  const auto after = nodal_velocities(cloud);
  double lost = 0, all = 0;
  for_each_node(grid, [&](int node) {
    const std::size_t j = static_cast<std::size_t>(node);
    if (after[j].isZero(0))
      return;
    lost += (after[j] - u[j]).squaredNorm();
    all += u[j].squaredNorm();
  });
  return std::sqrt(lost / all);
}

/// Particles of a random field, those with an id that leaves no rest among `share`, get the fields
/// of random nodes. Returns them in the order of their ids.
template <class Real>
Particles<3, Real> after_transfer(std::size_t count, std::size_t share) {
  GridParams<3> params;
  params.size = Vec<3>::Ones();
  params.cells = {8, 8, 8};
  const Grid<3> grid(params);
  Random random(7);
  const auto draw = [&] { return Vec<3>(random.uniform(), random.uniform(), random.uniform()); };
  Particles<3, Real> particles;
  for (std::size_t p = 0; p < count; ++p)
    if (const Vec<3> x = draw(); p % share == 0)
      particles.add(x, Vec<3>::Zero(), 1e-6);
  particles.resize_mixed(particles.size());
  Array<NodeVec<3>> u(static_cast<std::size_t>(grid.node_count()), NodeVec<3>::Zero());
  for (NodeVec<3>& v : u)
    v.template head<3>() = draw();
  const Array<double> divergence(u.size(), 0.1);
  const Execution execution(2);
  CellOrder<3> order;
  order.update(particles, grid, execution);
  Array<CellMoments<3>> moments(static_cast<std::size_t>(grid.cell_count()));
  PolyPic transfer;
  transfer.prepare({1e-3, 30});
  grid_to_particles(particles, order, grid, transfer, u, u, divergence, moments, 1e-3,
                    Vec<3>(grid.origin()), grid.upper(), execution);
  Particles<3, Real> sorted = particles;
  for (std::size_t p = 0; p < particles.size(); ++p)
    sorted.copy(particles.id[p], particles, p);
  return sorted;
}

} // namespace

TEST_CASE("cell order: each particle once, in its own cell") {
  check_orders<2>();
  check_orders<3>();
}

TEST_CASE("moments give the same volumes, momenta and couplings as sums over particles") {
  for (const ParticleField field :
       {ParticleField::constant, ParticleField::affine, ParticleField::multilinear}) {
    check_sums<2>(field);
    check_sums<3>(field);
  }
}

TEST_CASE("in full cells stress acts on the integral over the cell") {
  check_full_cells<2>();
  check_full_cells<3>();
}

TEST_CASE("shifting evens out dense sheared material, and moves nothing else") {
  check_shifting<2>();
  check_shifting<3>();
}

TEST_CASE("packing on both sides of dense by chance is dense") {
  CHECK(Packing::agreed(0.9, 1.01) == 1);
  CHECK(Packing::agreed(1.1, 0.99) == 1);
  CHECK(Packing::agreed(0.9, 0.95) == 0.95);
  CHECK(Packing::agreed(0.95, 0.9) == 0.95);
  CHECK(Packing::agreed(1.1, 1.05) == 1.05);
  CHECK(Packing::agreed(1.05, 1.1) == 1.05);
}

TEST_CASE("grid to particles gives the same samples as sums over corners") {
  check_samples<2>();
  check_samples<3>();
}

TEST_CASE_TEMPLATE("what is written past the cache is what is written through it", Real, double,
                   float) {
  const std::size_t count = stream_from / (24 * sizeof(Real)) + 101; // 24 numbers a particle
  const auto many = after_transfer<Real>(count, 1), few = after_transfer<Real>(count, 7);
  REQUIRE(many.size() == count);
  bool same = true;
  for (std::size_t k = 0; k < few.size(); ++k)
    same = same && many.velocity[7 * k] == few.velocity[k] && many.affine[7 * k] == few.affine[k] &&
           many.mixed[7 * k] == few.mixed[k] && many.position[7 * k] == few.position[k];
  CHECK(same);
  CHECK(many.velocity.back().norm() > 0);
}

TEST_CASE("particles to grid keeps mass and momentum") {
  check_momentum_kept<2>();
  check_momentum_kept<3>();
}

TEST_CASE("APIC reproduces affine fields") {
  check_affine<2>();
  check_affine<3>();
}

TEST_CASE(
    "PolyPIC loses nothing of the grid's field, APIC and PIC do in every step, however short") {
  for (const double time_step : {1e-3, 1e-6}) {
    CHECK(round_trip_loss<2>(PolyPic({.damping = 0, .thin_damping = 0}), time_step) < 1e-13);
    CHECK(round_trip_loss<3>(PolyPic({.damping = 0, .thin_damping = 0}), time_step) < 1e-13);
    CHECK(round_trip_loss<2>(Apic(), time_step) > 0.1);
    CHECK(round_trip_loss<3>(Apic(), time_step) > 0.1);
    CHECK(round_trip_loss<3>(Pic(), time_step) > round_trip_loss<3>(Apic(), time_step));
  }
  // what is damped is a rate
  const double once = round_trip_loss<3>(PolyPic({.damping = 10, .thin_damping = 0}), 1e-5);
  CHECK(once > 0);
  CHECK(round_trip_loss<3>(PolyPic({.damping = 10, .thin_damping = 0}), 2e-5) ==
        support::about(2 * once, 0.01));
}

TEST_CASE("transfer schemes update a particle as they say") {
  GridSample<2> sample;
  sample.velocity = {1, 2};
  sample.velocity_before = {0.5, 1};
  sample.gradient = Mat<2>::Identity();
  sample.mixed = {3, 4};
  sample.divergence_error = 0.5;
  sample.cell_fill = 0.75;
  const TransferStep step{.time_step = 0.1, .grid_rate = 2};
  const auto updated = [&](auto transfer) {
    VelocityField<2> p{{10, 20}, Mat<2>::Zero(), MixedDerivatives<2>::Zero()};
    if constexpr (requires { transfer.prepare(step); })
      transfer.prepare(step);
    transfer.update(sample, p);
    if constexpr (requires { transfer.replaces(); }) { // then what the particle had does not count
      VelocityField<2> other{{-3, 7}, Mat<2>::Zero(), MixedDerivatives<2>::Zero()};
      transfer.update(sample, other);
      CHECK(transfer.replaces());
      CHECK(other.velocity == p.velocity);
    }
    return p;
  };
  const VelocityField<2> thin = updated(PolyPic({.damping = 0, .thin_damping = 4}));
  CHECK((thin.gradient - std::exp(-0.2) * Mat<2>::Identity()).norm() < 1e-15);
  CHECK((thin.mixed - std::exp(-0.2) * sample.mixed).norm() < 1e-15);
  const VelocityField<2> poly = updated(PolyPic({.damping = 5, .thin_damping = 0})); // keeps 1/e
  CHECK(poly.velocity == Vec<2>(1, 2));
  CHECK((poly.gradient - Mat<2>::Identity() * (1 - (1 - std::exp(-1)) / 4)).norm() < 1e-15);
  CHECK((poly.mixed - std::exp(-1) * sample.mixed).norm() < 1e-15);
  CHECK(updated(Apic()).velocity == Vec<2>(1, 2));
  CHECK(updated(Apic()).gradient == Mat<2>::Identity());
  CHECK(updated(Pic()).velocity == Vec<2>(1, 2));
  CHECK(updated(Pic()).gradient == Mat<2>::Zero());
  CHECK(updated(Flip({.damping = 0})).velocity == Vec<2>(10.5, 21));
  CHECK((updated(Flip({.damping = 5})).velocity -
         (std::exp(-1) * Vec<2>(10.5, 21) + (1 - std::exp(-1)) * Vec<2>(1, 2)))
            .norm() < 1e-14);
  CHECK_THROWS_AS(Flip({.damping = -1}), std::invalid_argument);
  CHECK_THROWS_AS(PolyPic({.damping = -1}), std::invalid_argument);
  CHECK_THROWS_AS(PolyPic({.thin_damping = -1}), std::invalid_argument);
}

TEST_CASE("dense material with a free surface is dense, loose material is not") {
  const SmallArray<NodeSide, 2> inside{NodeSide::inside, NodeSide::inside};
  const SmallArray<NodeSide, 2> on_floor{NodeSide::inside, NodeSide::on_lower_face};
  CHECK(dense_fraction<2>({0, 0}, inside) == 1); // no surface
  // from the integrals over a half-space whose surface is s above the node
  for (const double s : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0}) {
    CAPTURE(s);
    const double q = 1 - s, fraction = 1 - q * q / 2, moment = q * q / 2 - q * q * q / 3;
    const double mean = -moment / fraction;
    CHECK(dense_fraction<2>({0, mean}, inside) == doctest::Approx(fraction).epsilon(1e-9));
    CHECK(dense_fraction<2>({mean, 0}, inside) == doctest::Approx(fraction).epsilon(1e-9));
    if (s > 0.3) { // less than a half counts as a half
      const double layer = (s / 2 - s * s / 3) / (1 - s / 2);
      CHECK(dense_fraction<2>({0, layer}, on_floor) == doctest::Approx(s * (2 - s)).epsilon(1e-9));
    }
  }
  CHECK(dense_fraction<2>({0, -0.9}, inside) == 0.5);
  CHECK(dense_fraction<2>({0, 0.01}, on_floor) == 0.5);

  const Packing packing{.slack = 0.02, .dilatancy = 2};
  CHECK(packing.room(0.99, 1, 0.1) == 0);
  CHECK(packing.room(0.7, 0.7, 0.1) == 0);
  CHECK(packing.room(0.7, 1, 0.1) == doctest::Approx(0.28));
  CHECK(packing.room(1.12, 1, 0) == 0);
  CHECK(packing.room(1.12, 1, 0.001) == support::about(-0.0002, 2e-3));
  double fraction = 1.12; // the same whatever the steps are
  for (int k = 0; k < 10; ++k)
    fraction += packing.room(fraction, 1, 0.03);
  CHECK(fraction == doctest::Approx(1.12 + packing.room(1.12, 1, 0.3)));
  CHECK(packing.room(3, 1, 0.01) ==
        doctest::Approx(-0.005)); // Tr D is at most half of the shear rate
}

} // namespace test_transfer
