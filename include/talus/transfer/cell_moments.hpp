// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/particle_lanes.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace talus {

/// All that the grid needs to know of the particles in a cell.
///
/// Products of two multilinear shape functions, or of one with a gradient of another, are
/// polynomials of degree ≤ 2 per axis. With the quadratic Bernstein products B_0 = (1−ξ)²,
/// B_1 = ξ(1−ξ), B_2 = ξ² (l_a l_b = B_{a+b}, l_a = B_a + B_{a+1}), the 3^d moments
/// T_abc = Σ_p V_p B_a(ξ) B_b(η) B_c(ζ) give every integral over the cell by additions alone, and
/// all terms are positive: nothing cancels.
template <int Dim>
struct CellMoments {
  SmallArray<double, ipow(3, Dim)> volume{}; ///< T, m^d
  /// T as stress sees it, m^d: the same, or see even_volume()
  SmallArray<double, ipow(3, Dim)> stress_volume{};
  /// Σ_p V_p N_c(x_p) u_p(x_c) for each corner c, u_p the velocity field of the particle,
  /// m^d · m/s; times ρ_p (kg/m³) if there are several materials.
  SmallArray<Vec<Dim>, ipow(2, Dim)> momentum{};
};

template <int Dim>
double corner_volume(const SmallArray<double, ipow(3, Dim)>& moments, int corner);

/// The moments that stress acts on. In a full cell they are those of material that fills it evenly,
/// \f$∫ B_a B_b B_c\f$. Sums over particles jump when one of them goes from cell to cell; times the
/// pressure of all that lies above, that stirs whatever is sheared over more than a cell. Cells
/// with a corner that has less than 0.4 of what an even filling gives it keep the sums over their
/// particles, from 0.7 on they are full; in between, a blend. For points in full cells see also
/// Al-Kafaji, PhD thesis, Stuttgart 2013.
template <int Dim>
void even_volume(double cell_volume, CellMoments<Dim>& m) {
  double least = corner_volume<Dim>(m.volume, 0);
  for (int c = 1; c < Grid<Dim>::corners; ++c)
    least = std::min(least, corner_volume<Dim>(m.volume, c));
  const double share = least * Grid<Dim>::corners / cell_volume;
  const double t = std::clamp((share - 0.4) / 0.3, 0.0, 1.0);
  const double even = t * t * (3 - 2 * t);
  for (int k = 0; k < m.volume.size(); ++k) {
    double full = cell_volume;
    int rest = k;
    for (int a = 0; a < Dim; ++a, rest /= 3)
      full *= rest % 3 == 1 ? 1.0 / 6 : 1.0 / 3;
    m.stress_volume[k] = m.volume[k] + even * (full - m.volume[k]);
  }
}

/// Sums the moments of the particles of one cell, several side by side.
template <int Dim, ParticleField Field>
class CellMomentSum {
 private:
  static constexpr std::size_t dim = static_cast<std::size_t>(Dim);
  static constexpr std::size_t corners = static_cast<std::size_t>(Grid<Dim>::corners);
  static constexpr std::size_t terms = Field == ParticleField::constant ? 1
                                       : Field == ParticleField::affine ? corners / 2 + 1
                                                                        : corners;

 public:
  /// Particles side by side. A lane without a particle has no volume, so weighs nothing.
  struct Pack {
    ParticleLanes volume;
    VecLanes<Dim> position;
    std::array<VecLanes<Dim>, terms> field; ///< derivatives by the set of axes; 0: the velocity

    template <class Real>
    void set(std::size_t lane, const Particles<Dim, Real>& particles, std::size_t p) {
      volume[static_cast<Eigen::Index>(lane)] = static_cast<double>(particles.volume[p]);
      set_lane<Dim>(position, lane, particles.position[p].data());
      set_lane<Dim>(field[0], lane, particles.velocity[p].data());
      if constexpr (Field != ParticleField::constant)
        for (std::size_t b = 0; b < dim; ++b)
          set_lane<Dim>(field[axis_term<Dim>(b)], lane, particles.affine[p].data() + b * dim);
      if constexpr (Field == ParticleField::multilinear)
        for (std::size_t m = 0; m < mixed_terms<Dim>.size(); ++m)
          set_lane<Dim>(field[mixed_terms<Dim>[m]], lane, particles.mixed[p].data() + m * dim);
    }
    /// Makes the momentum of a lane that of mass.
    void weigh(std::size_t lane, double density) {
      for (VecLanes<Dim>& term : field)
        for (ParticleLanes& component : term)
          component[static_cast<Eigen::Index>(lane)] *= density;
    }
    void clear(std::size_t lane, const Grid<Dim>& grid) {
      volume[static_cast<Eigen::Index>(lane)] = 0;
      set_lane<Dim>(position, lane, grid.origin().data());
      for (VecLanes<Dim>& term : field)
        for (ParticleLanes& component : term)
          component[static_cast<Eigen::Index>(lane)] = 0;
    }
  };

  CellMomentSum(const Grid<Dim>& grid, int cell_number)
      : grid_(grid), cell_(grid.cell_index(cell_number)) {
    for (std::size_t c = 0; c < corners; ++c) {
      edges_[c] = 1;
      for (std::size_t a = 0; a < dim; ++a)
        if (c & axis_term<Dim>(a))
          edges_[c] *= grid.spacing()[static_cast<Eigen::Index>(a)];
    }
    volume_.fill(ParticleLanes::Zero());
    for (VecLanes<Dim>& sum : momentum_)
      sum.fill(ParticleLanes::Zero());
  }

  void add(const Pack& pack) {
    const VecLanes<Dim> xi = local_lanes<Dim>(grid_, cell_, pack.position);
    std::array<std::array<ParticleLanes, 2>, dim> shape; // l_0, l_1
    for (std::size_t a = 0; a < dim; ++a)
      shape[a] = {1 - xi[a], xi[a]};
    add_volume(pack.volume, shape);
    add_momentum(pack, xi, shape);
  }

  CellMoments<Dim> total() const {
    CellMoments<Dim> m;
    for (int k = 0; k < volume_.size(); ++k)
      m.volume[k] = sum_of(volume_[k]);
    for (std::size_t c = 0; c < corners; ++c)
      for (std::size_t a = 0; a < dim; ++a)
        m.momentum[c][static_cast<Eigen::Index>(a)] = sum_of(momentum_[c][a]);
    m.stress_volume = m.volume;
    return m;
  }

 private:
  void add_volume(const ParticleLanes& volume,
                  const std::array<std::array<ParticleLanes, 2>, dim>& shape) {
    std::array<std::array<ParticleLanes, 3>, dim> bernstein;
    for (std::size_t a = 0; a < dim; ++a)
      bernstein[a] = {shape[a][0] * shape[a][0], shape[a][0] * shape[a][1],
                      shape[a][1] * shape[a][1]};
    std::size_t k = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const ParticleLanes bi = volume * bernstein[0][i];
      for (std::size_t j = 0; j < 3; ++j) {
        const ParticleLanes bij = bi * bernstein[1][j];
        if constexpr (Dim == 2) {
          volume_[k++] += bij;
        } else {
          for (std::size_t l = 0; l < 3; ++l)
            volume_[k++] += bij * bernstein[2][l];
        }
      }
    }
  }

  void add_momentum(const Pack& pack, const VecLanes<Dim>& xi,
                    const std::array<std::array<ParticleLanes, 2>, dim>& shape) {
    std::array<ParticleLanes, corners> weight;
    for (std::size_t c = 0; c < corners; ++c) {
      weight[c] = pack.volume;
      for (std::size_t a = 0; a < dim; ++a)
        weight[c] *= shape[a][(c & axis_term<Dim>(a)) != 0 ? 1 : 0];
    }
    for (std::size_t a = 0; a < dim; ++a) {
      std::array<ParticleLanes, corners> at_corner;
      values_at_corners(pack, xi, a, at_corner);
      for (std::size_t c = 0; c < corners; ++c)
        momentum_[c][a] += weight[c] * at_corner[c];
    }
  }

  /// Component a of the particles' fields at the corners of the cell: from coefficients about the
  /// particles to values, along one axis after the other.
  void values_at_corners(const Pack& pack, const VecLanes<Dim>& xi, std::size_t a,
                         std::array<ParticleLanes, corners>& value) const {
    value[0] = pack.field[0][a];
    for (std::size_t b = dim; b-- > 0;) { // corners below `bit` are done
      const std::size_t bit = axis_term<Dim>(b);
      const double h = grid_.spacing()[static_cast<Eigen::Index>(b)];
      if constexpr (Field == ParticleField::constant) {
        for (std::size_t c = 0; c < bit; ++c)
          value[c + bit] = value[c];
      } else if constexpr (Field == ParticleField::affine) {
        const ParticleLanes step = pack.field[bit][a] * h;
        const ParticleLanes first = step * xi[b];
        for (std::size_t c = 0; c < bit; ++c) {
          value[c] -= first;
          value[c + bit] = value[c] + step;
        }
      }
    }
    if constexpr (Field == ParticleField::multilinear) {
      for (std::size_t c = 1; c < corners; ++c)
        value[c] = pack.field[c][a] * edges_[c];
      for (std::size_t b = 0; b < dim; ++b) {
        const std::size_t bit = axis_term<Dim>(b);
        for (std::size_t c = 0; c < corners; ++c)
          if ((c & bit) == 0) {
            value[c] -= xi[b] * value[c + bit];
            value[c + bit] += value[c];
          }
      }
    }
  }

  const Grid<Dim>& grid_;
  Index<Dim> cell_;
  std::array<double, corners> edges_; ///< product of the cell's edges along each set of axes
  SmallArray<ParticleLanes, ipow(3, Dim)> volume_;
  std::array<VecLanes<Dim>, corners> momentum_;
};

/// One density for all: momenta are left without it.
struct OneDensity {};

/// The moments of the particles of one cell. Field: what they carry; density: OneDensity, or
/// density(p) → ρ_p, kg/m³.
template <ParticleField Field, int Dim, class Real, class Density = OneDensity>
CellMoments<Dim> cell_moments(const Particles<Dim, Real>& particles, const CellOrder<Dim>& order,
                              const Grid<Dim>& grid, int cell_number,
                              [[maybe_unused]] const Density& density = {}) {
  constexpr std::size_t batch = particle_packs * particle_lanes;
  CellMomentSum<Dim, Field> sum(grid, cell_number);
  std::array<typename CellMomentSum<Dim, Field>::Pack, particle_packs> packs;
  const std::size_t end = order.begin(cell_number + 1);
  for (std::size_t first = order.begin(cell_number); first < end; first += batch) {
    const std::size_t count = std::min(batch, end - first);
    for (std::size_t l = 0; l < count; ++l)
      packs[l / particle_lanes].set(l % particle_lanes, particles, order.particle(first + l));
    if constexpr (!std::is_same_v<Density, OneDensity>)
      for (std::size_t l = 0; l < count; ++l)
        packs[l / particle_lanes].weigh(l % particle_lanes, density(order.particle(first + l)));
    const std::size_t used = (count + particle_lanes - 1) / particle_lanes;
    for (std::size_t l = count; l < used * particle_lanes; ++l)
      packs[used - 1].clear(l % particle_lanes, grid);
    for (std::size_t k = 0; k < used; ++k)
      sum.add(packs[k]);
  }
  return sum.total();
}

/// The moments of every cell that holds particles. `moments`: #cells, workspace of the caller;
/// even: stress acts on full cells evenly; halo: how ranks share cells, if there are several;
/// density: see cell_moments.
template <ParticleField Field, int Dim, class Real, class Density = OneDensity>
void all_cell_moments(const Particles<Dim, Real>& particles, const CellOrder<Dim>& order,
                      const Grid<Dim>& grid, const Execution& execution,
                      Array<CellMoments<Dim>>& moments, bool even = false,
                      const Halo* halo = nullptr, const Density& density = {}) {
  moments.resize(static_cast<std::size_t>(grid.cell_count()));
  for_each_filled_cell(execution, order, grid, [&](int c) {
    CellMoments<Dim>& m = moments[c];
    m = cell_moments<Field>(particles, order, grid, c, density);
    if (even)
      even_volume(grid.cell_volume(), m);
  });
  if (!halo)
    return;
  CellMoments<Dim> none;
  for (Vec<Dim>& momentum : none.momentum)
    momentum.setZero();
  for (const int c : halo->border_cells())
    if (order.empty(c))
      moments[c] = none;
  halo->share_cells(moments.data(), sizeof(CellMoments<Dim>));
}

/// Calls visit(cell, corner) for each cell of the window that node `index`, an owner, is a corner
/// of, in a fixed order; `corner` says which one.
template <int Dim, class Visit>
void for_each_cell_of_node(const Grid<Dim>& grid, const Index<Dim>& index, const Visit& visit) {
  using G = Grid<Dim>;
  for (int k = 0; k < G::corners; ++k) {
    Index<Dim> cell = index;
    bool inside = true;
    for (int a = 0; a < Dim; ++a) {
      int& i = cell[a];
      i -= 1 - G::corner_bit(k, a);
      if (i < 0 && grid.periodic(a) && grid.whole(a))
        i += grid.cells(a);
      inside = inside && i >= grid.first_cell(a) && i < grid.cell_end(a);
    }
    if (inside)
      visit(grid.cell(cell), G::corners - 1 - k);
  }
}

/// Σ_p V_p N_c(x_p) at one corner of a cell, m^d, from its moments T.
template <int Dim>
double corner_volume(const SmallArray<double, ipow(3, Dim)>& moments, int corner) {
  using G = Grid<Dim>;
  const int i = G::corner_bit(corner, 0), j = G::corner_bit(corner, 1);
  double sum = 0;
  for (int a = i; a <= i + 1; ++a)
    for (int b = j; b <= j + 1; ++b) {
      if constexpr (Dim == 2) {
        sum += moments[3 * a + b];
      } else {
        const int k = G::corner_bit(corner, 2);
        sum += moments[9 * a + 3 * b + k] + moments[9 * a + 3 * b + k + 1];
      }
    }
  return sum;
}
template <int Dim>
double corner_volume(const CellMoments<Dim>& m, int corner) {
  return corner_volume<Dim>(m.volume, corner);
}

/// Σ_p V_p N_c(x_p) t at one corner of a cell, t = (x_p − x_c)/h by axis, m^d.
template <int Dim>
Vec<Dim> corner_first_moment(const CellMoments<Dim>& m, int corner) {
  using G = Grid<Dim>;
  constexpr SmallArray<int, 3> stride =
      Dim == 2 ? SmallArray<int, 3>{3, 1, 0} : SmallArray<int, 3>{9, 3, 1};
  Vec<Dim> moment;
  for (int a = 0; a < Dim; ++a) {
    // along a: N t = ± B_1; along the others: N = B_i + B_{i+1}
    int first = stride[a];
    SmallArray<int, 2> steps{};
    int others = 0;
    for (int b = 0; b < Dim; ++b)
      if (b != a) {
        first += G::corner_bit(corner, b) * stride[b];
        steps[others++] = stride[b];
      }
    double sum = 0;
    for (int i = 0; i <= 1; ++i)
      for (int j = 0; j <= Dim - 2; ++j)
        sum += m.volume[first + i * steps[0] + j * steps[1]];
    moment[a] = G::corner_bit(corner, a) ? -sum : sum;
  }
  return moment;
}

/// Adds one cell's share of g_ij, i being corner `corner` of the cell.
template <int Dim>
void add_coupling(const CellMoments<Dim>& m, int corner, const Vec<Dim>& inverse_spacing,
                  GradientWeights<Dim>& g) {
  using G = Grid<Dim>;
  constexpr SmallArray<int, 3> stride =
      Dim == 2 ? SmallArray<int, 3>{3, 1, 0} : SmallArray<int, 3>{9, 3, 1};
  int first = 0; // T of the lowest product N_i N_j
  for (int a = 0; a < Dim; ++a)
    first += G::corner_bit(corner, a) * stride[a];
  for (int other = 0; other < G::corners; ++other) {
    int neighbour = 0;
    for (int a = 0; a < Dim; ++a)
      neighbour = 3 * neighbour + G::corner_bit(other, a) - G::corner_bit(corner, a) + 1;
    for (int a = 0; a < Dim; ++a) {
      // along a: N_i ∂N_j = ± (B_i + B_{i+1}) / h; along the others: N_i N_j = B_{i+j}
      int t = first;
      for (int b = 0; b < Dim; ++b)
        if (b != a)
          t += G::corner_bit(other, b) * stride[b];
      const double integral = m.stress_volume[t] + m.stress_volume[t + stride[a]];
      g(a, neighbour) +=
          G::corner_bit(other, a) ? integral * inverse_spacing[a] : -integral * inverse_spacing[a];
    }
  }
}

/// Along a periodic axis of one or two cells two or three neighbours are the same node, which then
/// gets what all of them have. index: the node's.
template <int Dim>
void fold_neighbours(const Grid<Dim>& grid, const Index<Dim>& index, GradientWeights<Dim>& g) {
  for (int a = 0; a < Dim; ++a) {
    if (!grid.periodic(a) || grid.cells(a) > 2)
      continue;
    const int stride = ipow(3, Dim - 1 - a);
    const int kept = grid.cells(a) == 1 ? 1 : index[a] == 0 ? 2 : 0; // of −1, 0, 1
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
      const int place = k / stride % 3;
      if (place == kept || (grid.cells(a) == 2 && place == 1))
        continue;
      g.col(k + (kept - place) * stride) += g.col(k);
      g.col(k).setZero();
    }
  }
}

/// Sets the g_ij of a node i and the volume that stress acts on there, m^d, and returns
/// Σ_p V_p N_i (x_p − x_i)/h by axis, m^d, from the moments of the cells around it. index: the
/// node's.
template <int Dim>
Vec<Dim> gather_coupling(const Grid<Dim>& grid, const Index<Dim>& index,
                         const CellOrder<Dim>& order, const Array<CellMoments<Dim>>& moments,
                         GradientWeights<Dim>& g, double& stressed) {
  g.setZero();
  stressed = 0;
  Vec<Dim> first_moment = Vec<Dim>::Zero();
  for_each_cell_of_node(grid, index, [&](int cell, int corner) {
    if (order.empty(cell))
      return;
    add_coupling(moments[cell], corner, grid.inverse_spacing(), g);
    stressed += corner_volume<Dim>(moments[cell].stress_volume, corner);
    first_moment += corner_first_moment(moments[cell], corner);
  });
  fold_neighbours(grid, index, g);
  // what cancels but for rounding
  const double rounding =
      64 * std::numeric_limits<double>::epsilon() * stressed * grid.inverse_spacing().maxCoeff();
  for (double *w = g.data(), *end = w + g.size(); w != end; ++w)
    *w = std::abs(*w) <= rounding ? 0 : *w;
  return first_moment;
}

} // namespace talus
