// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/parallel.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/multilinear.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace talus {

/// g_ij of one node i, one column (d numbers, m²) for each of its 3^d neighbours j.
template <int Dim>
using Coupling = Eigen::Matrix<double, Dim, ipow(3, Dim)>;

/// All that the grid needs to know of the particles in a cell.
///
/// Products of two multilinear shape functions, or of one with a gradient of another, are
/// polynomials of degree ≤ 2 per axis. With the quadratic Bernstein products B_0 = (1−ξ)²,
/// B_1 = ξ(1−ξ), B_2 = ξ² (l_a l_b = B_{a+b}, l_a = B_a + B_{a+1}), the 3^d moments
/// T_abc = Σ_p V_p B_a(ξ) B_b(η) B_c(ζ) give every integral over the cell by additions alone, and
/// all terms are positive: nothing cancels.
template <int Dim>
struct CellMoments {
  std::array<double, static_cast<std::size_t>(ipow(3, Dim))> volume{}; ///< T, m^d
  /// Σ_p V_p N_c(x_p) (v_p + C_p (x_c − x_p)) for each corner c, m^d · m/s.
  std::array<Vec<Dim>, static_cast<std::size_t>(ipow(2, Dim))> momentum{};
};

/// Sums the moments of the particles begin..end−1, all of them in `cell`.
/// `affine`: do the particles carry C_p?
template <int Dim>
CellMoments<Dim> cell_moments(const Particles<Dim>& particles, std::size_t begin, std::size_t end,
                              const Grid<Dim>& grid, const Index<Dim>& cell, bool affine) {
  using G = Grid<Dim>;
  CellMoments<Dim> m;
  for (auto& v : m.momentum)
    v.setZero();
  for (std::size_t p = begin; p < end; ++p) {
    const Vec<Dim> xi = grid.local(particles.position[p], cell);
    const double volume = particles.volume[p];

    std::array<std::array<double, 3>, static_cast<std::size_t>(Dim)> bernstein;
    for (int a = 0; a < Dim; ++a) {
      const double l1 = xi[a], l0 = 1 - l1;
      bernstein[static_cast<std::size_t>(a)] = {l0 * l0, l0 * l1, l1 * l1};
    }
    std::size_t k = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double bi = volume * bernstein[0][i];
      for (std::size_t j = 0; j < 3; ++j) {
        const double bij = bi * bernstein[1][j];
        if constexpr (Dim == 2) {
          m.volume[k++] += bij;
        } else {
          for (std::size_t l = 0; l < 3; ++l)
            m.volume[k++] += bij * bernstein[2][l];
        }
      }
    }

    const auto n = Multilinear<Dim>::values(xi);
    if (affine) {
      // v_p + C_p (x_c − x_p) is linear in the corner's bits: from corner 0, one column per axis.
      Mat<Dim> step = particles.affine[p];
      for (int a = 0; a < Dim; ++a)
        step.col(a) *= grid.spacing()[a];
      const Vec<Dim> at_first = particles.velocity[p] - step * xi;
      for (int c = 0; c < G::corners; ++c) {
        Vec<Dim> v = at_first;
        for (int a = 0; a < Dim; ++a)
          if (G::corner_bit(c, a))
            v += step.col(a);
        m.momentum[static_cast<std::size_t>(c)] += (volume * n[static_cast<std::size_t>(c)]) * v;
      }
    } else {
      const Vec<Dim> momentum = volume * particles.velocity[p];
      for (int c = 0; c < G::corners; ++c)
        m.momentum[static_cast<std::size_t>(c)] += n[static_cast<std::size_t>(c)] * momentum;
    }
  }
  return m;
}

/// The moments of every cell that holds particles. `moments`: #cells, workspace of the caller.
template <int Dim>
void all_cell_moments(const Particles<Dim>& particles, const CellOrder<Dim>& order,
                      const Grid<Dim>& grid, bool affine, int threads,
                      std::vector<CellMoments<Dim>>& moments) {
  moments.resize(static_cast<std::size_t>(grid.cell_count()));
  parallel_chunks(threads, grid.cell_count(), 16, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (int c = static_cast<int>(begin); c < end; ++c)
      if (!order.empty(c))
        moments[static_cast<std::size_t>(c)] = cell_moments(
            particles, order.begin(c), order.begin(c + 1), grid, grid.cell_index(c), affine);
  });
}

/// Calls visit(cell, corner) for each cell of the box that node `index` is a corner of, in a fixed
/// order; `corner` says which one.
template <int Dim, class Visit>
void for_each_cell_of_node(const Grid<Dim>& grid, const Index<Dim>& index, const Visit& visit) {
  using G = Grid<Dim>;
  for (int k = 0; k < G::corners; ++k) {
    Index<Dim> cell = index;
    bool inside = true;
    for (int a = 0; a < Dim; ++a) {
      int& i = cell[a];
      i -= 1 - G::corner_bit(k, a);
      inside = inside && i >= 0 && i < grid.cells(a);
    }
    if (inside)
      visit(grid.cell(cell), G::corners - 1 - k);
  }
}

/// Σ_p V_p N_c(x_p) at one corner of a cell, m^d.
template <int Dim>
double corner_volume(const CellMoments<Dim>& m, int corner) {
  using G = Grid<Dim>;
  const std::size_t i = static_cast<std::size_t>(G::corner_bit(corner, 0)),
                    j = static_cast<std::size_t>(G::corner_bit(corner, 1));
  double sum = 0;
  for (std::size_t a = i; a <= i + 1; ++a)
    for (std::size_t b = j; b <= j + 1; ++b) {
      if constexpr (Dim == 2) {
        sum += m.volume[3 * a + b];
      } else {
        const std::size_t k = static_cast<std::size_t>(G::corner_bit(corner, 2));
        sum += m.volume[9 * a + 3 * b + k] + m.volume[9 * a + 3 * b + k + 1];
      }
    }
  return sum;
}

/// Adds one cell's share of g_ij = Σ_p V_p N_i ∇N_j, i being corner `corner` of the cell.
template <int Dim>
void add_coupling(const CellMoments<Dim>& m, int corner, const Vec<Dim>& inverse_spacing,
                  Coupling<Dim>& g) {
  using G = Grid<Dim>;
  constexpr std::array<int, 3> stride = Dim == 2 ? std::array{3, 1, 0} : std::array{9, 3, 1};
  int first = 0; // T of the lowest product N_i N_j
  for (int a = 0; a < Dim; ++a)
    first += G::corner_bit(corner, a) * stride[static_cast<std::size_t>(a)];
  for (int other = 0; other < G::corners; ++other) {
    int neighbour = 0;
    for (int a = 0; a < Dim; ++a)
      neighbour = 3 * neighbour + G::corner_bit(other, a) - G::corner_bit(corner, a) + 1;
    for (int a = 0; a < Dim; ++a) {
      // along a: N_i ∂N_j = ± (B_i + B_{i+1}) / h; along the others: N_i N_j = B_{i+j}
      int t = first;
      for (int b = 0; b < Dim; ++b)
        if (b != a)
          t += G::corner_bit(other, b) * stride[static_cast<std::size_t>(b)];
      const double integral =
          m.volume[static_cast<std::size_t>(t)] +
          m.volume[static_cast<std::size_t>(t + stride[static_cast<std::size_t>(a)])];
      g(a, neighbour) +=
          G::corner_bit(other, a) ? integral * inverse_spacing[a] : -integral * inverse_spacing[a];
    }
  }
}

} // namespace talus
