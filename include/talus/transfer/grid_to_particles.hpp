// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/parallel.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/particle_lanes.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace talus {

/// A multilinear field of `Components` numbers in one cell as a polynomial, u = Σ_S a_S Π_{b ∈ S}
/// ξ_b over the subsets S of the axes: a third of the work of sums over corners, and exact for
/// uniform fields.
template <int Dim, int Components = Dim>
class CellField {
 public:
  static constexpr std::size_t corners = static_cast<std::size_t>(Grid<Dim>::corners);

  /// corner: the values at the corners of the cell.
  explicit CellField(const std::array<Vec<Components>, corners>& corner) : coefficient_(corner) {
    for (std::size_t bit = 1; bit < corners; bit *= 2) // differences along one axis after another
      for (std::size_t c = 0; c < corners; ++c)
        if (c & bit)
          coefficient_[c] -= coefficient_[c ^ bit];
  }

  /// Component a of u at ξ.
  ParticleLanes value(std::size_t a, const VecLanes<Dim>& xi) const {
    if constexpr (Dim == 2)
      return at(0, a) + at(1, a) * xi[1] + slope(0, a, xi) * xi[0];
    else
      return at(0, a) + at(1, a) * xi[2] + (at(2, a) + at(3, a) * xi[2]) * xi[1] +
             slope(0, a, xi) * xi[0];
  }

  /// ∂u_a/∂ξ_b at ξ.
  ParticleLanes slope(std::size_t b, std::size_t a, const VecLanes<Dim>& xi) const {
    const std::size_t own = corners >> (b + 1); // the bit of axis b
    if constexpr (Dim == 2) {
      return at(own, a) + at(3, a) * xi[1 - b];
    } else {
      const std::size_t i = b == 0 ? 1 : 0, j = b == 2 ? 1 : 2;
      const std::size_t bit_i = corners >> (i + 1), bit_j = corners >> (j + 1);
      return at(own, a) + at(own + bit_i, a) * xi[i] +
             (at(own + bit_j, a) + at(7, a) * xi[i]) * xi[j];
    }
  }

 private:
  double at(std::size_t subset, std::size_t a) const { return coefficient_[subset].data()[a]; }

  std::array<Vec<Components>, corners> coefficient_;
};

/// How overpacked material spreads: see Packing.
struct Spreading {
  std::vector<double> excess; ///< e_i, #nodes; < 0: nothing is moved in the cells of this node
  double rate = 0;            ///< κ, per unit of strain

  /// Largest share of the difference between nodes that one step evens out: diffusion is stable
  /// below a half, and without overshoot below a quarter.
  static constexpr double largest_share = 0.1;
};

/// ‖D‖ with ‖D‖² = D:D/2 of each particle. gradient: ∇u by columns, 1/s.
template <int Dim>
ParticleLanes
strain_rate_norm(const std::array<VecLanes<Dim>, static_cast<std::size_t>(Dim)>& gradient) {
  ParticleLanes sum = ParticleLanes::Zero(); // D:D
  for (std::size_t a = 0; a < static_cast<std::size_t>(Dim); ++a) {
    sum += gradient[a][a] * gradient[a][a];
    for (std::size_t b = 0; b < a; ++b) {
      const ParticleLanes shear = gradient[b][a] + gradient[a][b];
      sum += 0.5 * shear * shear;
    }
  }
  return (0.5 * sum).sqrt();
}

/// Takes v_p, C_p from the grid by `transfer` and moves
///   x_p += δt Σ_i N_i(x_p) u_i − min(κ ‖D‖ δt, 0.1) Σ_i e_i h² ∇N_i(x_p),
/// h² by axis, held between `lower` and `upper` (m; infinite where particles may leave the box).
/// velocity, before: u and u* at the nodes, m/s, #nodes × at least d; time_step: δt, s.
template <int Dim, class Real, TransferScheme<Dim> Transfer, class NodeVelocity>
void grid_to_particles(Particles<Dim, Real>& particles, const CellOrder<Dim>& order,
                       const Grid<Dim>& grid, const Transfer& transfer,
                       const std::vector<NodeVelocity>& velocity,
                       const std::vector<NodeVelocity>& before, const Spreading& spreading,
                       double time_step, const Vec<Dim>& lower, const Vec<Dim>& upper,
                       int threads) {
  constexpr std::size_t dim = static_cast<std::size_t>(Dim);
  const auto field = [&](const std::vector<NodeVelocity>& nodes, int first) {
    std::array<Vec<Dim>, CellField<Dim>::corners> u;
    for (int c = 0; c < Grid<Dim>::corners; ++c)
      u[static_cast<std::size_t>(c)] =
          nodes[static_cast<std::size_t>(first + grid.corner_offset(c))].template head<Dim>();
    return CellField<Dim>(u);
  };
  std::array<double, dim> spacing;
  for (std::size_t a = 0; a < dim; ++a)
    spacing[a] = grid.spacing()[static_cast<Eigen::Index>(a)];
  constexpr std::size_t batch = particle_packs * particle_lanes;
  struct Pack {
    VecLanes<Dim> position, velocity, before, shift;
    std::array<VecLanes<Dim>, dim> gradient; // columns
  };
  const auto update_cell = [&](int cell_number) {
    std::array<Pack, particle_packs> packs;
    for (Pack& pack : packs)
      pack.position.fill(ParticleLanes::Zero()); // also where there is no particle
    const Index<Dim> cell = grid.cell_index(cell_number);
    const int first_node = grid.first_node(cell);
    const CellField<Dim> now = field(velocity, first_node), then = field(before, first_node);
    std::array<Vec<1>, CellField<Dim>::corners> corner_excess;
    bool spreads = spreading.rate > 0, overpacked = false;
    for (int c = 0; spreads && c < Grid<Dim>::corners; ++c) {
      const double e =
          spreading.excess[static_cast<std::size_t>(first_node + grid.corner_offset(c))];
      corner_excess[static_cast<std::size_t>(c)][0] = e;
      spreads = e >= 0;
      overpacked = overpacked || e > 0;
    }
    spreads = spreads && overpacked;
    if (!spreads)
      corner_excess.fill(Vec<1>::Zero());
    const CellField<Dim, 1> excess(corner_excess);
    const std::size_t end = order.begin(cell_number + 1);
    for (std::size_t first = order.begin(cell_number); first < end; first += batch) {
      const std::size_t count = std::min(batch, end - first);
      for (std::size_t l = 0; l < count; ++l)
        set_lane<Dim>(packs[l / particle_lanes].position, l % particle_lanes,
                      particles.position[order.particle(first + l)].data());
      for (std::size_t k = 0; k * particle_lanes < count; ++k) {
        Pack& pack = packs[k];
        const VecLanes<Dim> xi = local_lanes<Dim>(grid, cell, pack.position);
        for (std::size_t a = 0; a < dim; ++a) {
          pack.velocity[a] = now.value(a, xi);
          pack.before[a] = then.value(a, xi);
          for (std::size_t b = 0; b < dim; ++b)
            pack.gradient[b][a] =
                now.slope(b, a, xi) * grid.inverse_spacing()[static_cast<Eigen::Index>(b)];
        }
        if (!spreads)
          continue;
        const ParticleLanes share =
            (spreading.rate * time_step * strain_rate_norm<Dim>(pack.gradient))
                .min(Spreading::largest_share);
        for (std::size_t a = 0; a < dim; ++a)
          pack.shift[a] = share * excess.slope(a, 0, xi) * -spacing[a];
      }
      for (std::size_t l = 0; l < count; ++l) {
        const Pack& pack = packs[l / particle_lanes];
        const Eigen::Index lane = static_cast<Eigen::Index>(l % particle_lanes);
        GridSample<Dim> sample;
        for (std::size_t a = 0; a < dim; ++a) {
          sample.velocity.data()[a] = pack.velocity[a][lane];
          sample.velocity_before.data()[a] = pack.before[a][lane];
          for (std::size_t b = 0; b < dim; ++b)
            sample.gradient.data()[b * dim + a] = pack.gradient[b][a][lane];
        }
        const std::size_t p = order.particle(first + l);
        if constexpr (std::is_same_v<Real, double>) {
          transfer.update(sample, particles.velocity[p], particles.affine[p]);
        } else {
          Vec<Dim> v = particles.velocity[p].template cast<double>();
          Mat<Dim> c = particles.affine[p].template cast<double>();
          transfer.update(sample, v, c);
          particles.velocity[p] = v.template cast<Real>();
          particles.affine[p] = c.template cast<Real>();
        }
        Vec<Dim>& x = particles.position[p];
        Vec<Dim> change = time_step * sample.velocity;
        if (spreads)
          for (std::size_t a = 0; a < dim; ++a)
            change.data()[a] += pack.shift[a][lane];
        x = (x + change).cwiseMax(lower).cwiseMin(upper);
      }
    }
  };
  parallel_chunks(threads, grid.cell_count(), 16, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (int c = static_cast<int>(begin); c < end; ++c)
      if (!order.empty(c))
        update_cell(c);
  });
}

} // namespace talus
