// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/streaming.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/particle_lanes.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace talus {

/// A multilinear velocity field in one cell as a polynomial, u = Σ_S a_S Π_{b ∈ S}
/// ξ_b over the subsets S of the axes: a third of the work of sums over corners, and exact for
/// uniform fields.
template <int Dim>
class CellField {
 public:
  static constexpr std::size_t corners = static_cast<std::size_t>(Grid<Dim>::corners);

  /// corner: the values at the corners of the cell.
  explicit CellField(const SmallArray<Vec<Dim>, Grid<Dim>::corners>& corner)
      : coefficient_(corner) {
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

  /// The derivative of u_a by the axes of column m of MixedDerivatives, in units of the cell.
  ParticleLanes mixed(std::size_t m, std::size_t a, const VecLanes<Dim>& xi) const {
    const std::size_t term = mixed_terms<Dim>[m];
    if (term == corners - 1)
      return ParticleLanes::Constant(at(term, a));
    return at(term, a) + at(corners - 1, a) * xi[m]; // column m < d leaves out axis m
  }

  /// ∂u_a/∂ξ_b in the middle of the cell.
  double mean_slope(std::size_t b, std::size_t a) const {
    const std::size_t own = corners >> (b + 1);
    double sum = 0;
    for (std::size_t c = own; c < corners; ++c)
      if (c & own) {
        std::size_t others = 0;
        for (std::size_t rest = c ^ own; rest != 0; rest &= rest - 1)
          ++others;
        sum += at(c, a) / static_cast<double>(std::size_t{1} << others);
      }
    return sum;
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

  SmallArray<Vec<Dim>, Grid<Dim>::corners> coefficient_;
};

/// Takes the particles' velocity fields from the grid by `transfer` and moves
/// x_p += δt Σ_i N_i(x_p) u_i, held between `lower` and `upper` (m; infinite where particles may
/// leave the box) and moved by whole boxes where the box is periodic. velocity, before: u and u* at
/// the nodes, m/s, #nodes × at least d; divergence: the nodes' mean tr ∇u, #nodes, 1/s, used if the
/// particles' fields are multilinear; time_step: δt, s.
template <int Dim, class Real, TransferScheme<Dim> Transfer, class NodeVelocity>
void grid_to_particles(Particles<Dim, Real>& particles, const CellOrder<Dim>& order,
                       const Grid<Dim>& grid, const Transfer& transfer,
                       const Array<NodeVelocity>& velocity, const Array<NodeVelocity>& before,
                       const Array<double>& divergence, const Array<CellMoments<Dim>>& moments,
                       double time_step, const Vec<Dim>& lower, const Vec<Dim>& upper,
                       const Execution& execution) {
  constexpr std::size_t dim = static_cast<std::size_t>(Dim);
  constexpr bool multilinear = Transfer::field == ParticleField::multilinear;
  constexpr std::size_t mixed_count = multilinear ? mixed_terms<Dim>.size() : 0;
  const auto field = [&](const Array<NodeVelocity>& nodes, int first) {
    SmallArray<Vec<Dim>, Grid<Dim>::corners> u;
    for (int c = 0; c < Grid<Dim>::corners; ++c)
      u[c] = nodes[first + grid.corner_offset(c)].template head<Dim>();
    return CellField<Dim>(u);
  };
  std::array<double, mixed_terms<Dim>.size()> per_edges; // 1/(edges along the axes of a column)
  for (std::size_t m = 0; m < per_edges.size(); ++m) {
    per_edges[m] = 1;
    for (std::size_t a = 0; a < dim; ++a)
      if (mixed_terms<Dim>[m] & axis_term<Dim>(a))
        per_edges[m] *= grid.inverse_spacing()[static_cast<Eigen::Index>(a)];
  }
  constexpr bool has_gradient = Transfer::field != ParticleField::constant;
  constexpr std::size_t numbers = dim * (1 + (has_gradient ? dim : 0) + mixed_count);
  bool replaces = false;
  if constexpr (requires { transfer.replaces(); })
    replaces = transfer.replaces();
  // a line that has been read is in the cache already, and would have to be driven out
  const bool past_cache = replaces && particles.size() * numbers * sizeof(Real) > stream_from;
  const auto put = [&]<class Value>(Value& to, const auto& from) {
    const Value value = from.template cast<Real>();
    if (past_cache)
      stream(to.data(), value.data(), value.size());
    else
      to = value;
  };
  constexpr std::size_t batch = particle_packs * particle_lanes;
  struct Pack {
    VecLanes<Dim> position, velocity, before;
    std::array<VecLanes<Dim>, dim> gradient; // columns
    std::array<VecLanes<Dim>, mixed_count> mixed;
  };
  const auto update_cell = [&](int cell_number) {
    std::array<Pack, particle_packs> packs;
    for (Pack& pack : packs)
      pack.position.fill(ParticleLanes::Zero()); // also where there is no particle
    const Index<Dim> cell = grid.cell_index(cell_number);
    const int first_node = grid.first_node(cell);
    const CellField<Dim> now = field(velocity, first_node), then = field(before, first_node);
    double divergence_error = 0, fill = 0;
    if constexpr (multilinear) {
      for (int c = 0; c < Grid<Dim>::corners; ++c)
        fill += corner_volume(moments[cell_number], c);
      fill /= grid.cell_volume();
      for (std::size_t a = 0; a < dim; ++a)
        divergence_error +=
            now.mean_slope(a, a) * grid.inverse_spacing()[static_cast<Eigen::Index>(a)];
      for (int c = 0; c < Grid<Dim>::corners; ++c)
        divergence_error -= divergence[first_node + grid.corner_offset(c)] / Grid<Dim>::corners;
    }
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
          for (std::size_t m = 0; m < mixed_count; ++m)
            pack.mixed[m][a] = now.mixed(m, a, xi) * per_edges[m];
        }
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
          for (std::size_t m = 0; m < mixed_count; ++m)
            sample.mixed.data()[m * dim + a] = pack.mixed[m][a][lane];
        }
        sample.divergence_error = divergence_error;
        sample.cell_fill = fill;
        const std::size_t p = order.particle(first + l);
        VelocityField<Dim> own{Vec<Dim>::Zero(), Mat<Dim>::Zero(), MixedDerivatives<Dim>::Zero()};
        if (!replaces) {
          own.velocity = particles.velocity[p].template cast<double>();
          if constexpr (has_gradient)
            own.gradient = particles.affine[p].template cast<double>();
          if constexpr (multilinear)
            own.mixed = particles.mixed[p].template cast<double>();
        }
        transfer.update(sample, own);
        put(particles.velocity[p], own.velocity);
        if constexpr (has_gradient)
          put(particles.affine[p], own.gradient);
        if constexpr (multilinear)
          put(particles.mixed[p], own.mixed);
        Vec<Dim>& x = particles.position[p];
        x = grid.wrapped((x + time_step * sample.velocity).cwiseMax(lower).cwiseMin(upper));
      }
    }
    if (past_cache)
      end_stream();
  };
  for_each_filled_cell(execution, order, grid, update_cell);
}

} // namespace talus
