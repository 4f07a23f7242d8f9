// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/problem.hpp"

#include <cstddef>

/// \file
/// The operators B (strain rate of the velocities around a cone), its transpose and the diagonal
/// blocks of W, matrix-free on the compact g_ij: 3 numbers per pair of nodes in 3-D, not 18.

namespace talus {

/// Offsets of a node's 3^d neighbours, by rows of three nodes that follow each other in memory.
template <int Dim>
class Stencil {
 public:
  static constexpr int rows = ipow(3, Dim - 1);
  Stencil() = default;
  explicit Stencil(const Grid<Dim>& grid) {
    for (int r = 0; r < rows; ++r)
      row_[r] = grid.neighbour_offset(3 * r);
  }
  /// Offset of the first node of row r from the node in the middle.
  int row(int r) const { return row_[r]; }

 private:
  SmallArray<int, rows> row_{};
};

/// Velocity gradient sum L = Σ_j u_j ⊗ g_j: column b is Σ_j u_j g_j,b.
/// u points at the velocity of the node in the middle.
template <int Dim>
RectMat<NodeVec<Dim>::RowsAtCompileTime, Dim>
gather_gradient(const NodeVec<Dim>* u, const Stencil<Dim>& stencil, const GradientWeights<Dim>& g) {
  using Padded = NodeVec<Dim>;
  // One partial sum per place in a row: the additions of the three don't wait for each other.
  SmallArray<SmallArray<Padded, Dim>, 3> sum;
  for (auto& s : sum)
    for (auto& column : s)
      column.setZero();
  for (int r = 0; r < Stencil<Dim>::rows; ++r) {
    const Padded* row = u + stencil.row(r);
    for (int k = 0; k < 3; ++k)
      for (int b = 0; b < Dim; ++b)
        sum[k][b] += row[k] * g(b, 3 * r + k);
  }
  RectMat<Padded::RowsAtCompileTime, Dim> gradient;
  for (int b = 0; b < Dim; ++b)
    gradient.col(b) = sum[0][b] + sum[1][b] + sum[2][b];
  return gradient;
}

/// B_i u = vec(sym Σ_j u_j ⊗ g_ij), m^d/s.
template <int Dim>
Vec<symmetric_size<Dim>> integrated_strain_rate(const DualProblem<Dim>& problem,
                                                const Stencil<Dim>& stencil, std::size_t cone) {
  const auto gradient = gather_gradient<Dim>(problem.velocity.data() + problem.node[cone], stencil,
                                             problem.gradient_weights[cone]);
  return symmetric_to_vector<Dim, double>(gradient.template topRows<Dim>());
}

/// u_j += M_j⁻¹ Λ g_ij for all neighbours j: what the stress impulse λ of a cone does.
template <int Dim>
void scatter_stress(DualProblem<Dim>& problem, const Stencil<Dim>& stencil, std::size_t cone,
                    const Vec<symmetric_size<Dim>>& lambda) {
  using Padded = NodeVec<Dim>;
  RectMat<Padded::RowsAtCompileTime, Dim> tensor;
  tensor.setZero();
  tensor.template topRows<Dim>() = vector_to_symmetric<Dim, double>(lambda);
  const GradientWeights<Dim>& g = problem.gradient_weights[cone];
  Padded* u = problem.velocity.data() + problem.node[cone];
  const Padded* inverse_mass = problem.inverse_mass.data() + problem.node[cone];
  for (int r = 0; r < Stencil<Dim>::rows; ++r) {
    Padded* row = u + stencil.row(r);
    const Padded* mass_row = inverse_mass + stencil.row(r);
    for (int k = 0; k < 3; ++k) {
      const int j = 3 * r + k;
      Padded force = tensor.col(0) * g(0, j) + tensor.col(1) * g(1, j);
      if constexpr (Dim == 3)
        force += tensor.col(2) * g(2, j);
      row[k] += mass_row[k].cwiseProduct(force);
    }
  }
  if (problem.copies.near_copy(problem.node[cone]))
    for (int k = 0; k < ipow(3, Dim); ++k)
      if (!g.col(k).isZero(0)) // what did not change may be an old copy of what did
        problem.copies.share(problem.velocity,
                             problem.node[cone] + problem.grid.neighbour_offset(k));
}

/// W_ii = B_i M⁻¹ B_iᵀ (symmetric, positive semi-definite), with B_iᵀ λ = Λ g. m^(2d-2)/kg.
template <int Dim>
Mat<symmetric_size<Dim>> diagonal_block(const DualProblem<Dim>& problem,
                                        const Stencil<Dim>& stencil, std::size_t cone) {
  constexpr int n = symmetric_size<Dim>;
  // A_a = Σ_j g_j g_jᵀ / m_j,a: all that W needs of the neighbours, since row a of a velocity
  // gradient u ⊗ g only feels the mass of component a.
  SmallArray<Mat<Dim>, Dim> second;
  for (auto& m : second)
    m.setZero();
  const GradientWeights<Dim>& g = problem.gradient_weights[cone];
  const NodeVec<Dim>* inverse_mass = problem.inverse_mass.data() + problem.node[cone];
  for (int r = 0; r < Stencil<Dim>::rows; ++r)
    for (int k = 0; k < 3; ++k) {
      const NodeVec<Dim>& w = inverse_mass[stencil.row(r) + k];
      const double* gj = &g(0, 3 * r + k);
      for (int b = 0; b < Dim; ++b)
        for (int c = 0; c < Dim; ++c) {
          const double outer = gj[c] * gj[b];
          for (int a = 0; a < Dim; ++a)
            second[a](c, b) += w[a] * outer;
        }
    }
  Mat<n> block;
  for (int c = 0; c < n; ++c) {
    Vec<n> unit = Vec<n>::Zero();
    unit[c] = 1;
    const Mat<Dim> tensor = vector_to_symmetric<Dim, double>(unit);
    Mat<Dim> gradient; // row a: Σ_j (Λ g_j)_a g_jᵀ / m_j,a
    for (int a = 0; a < Dim; ++a)
      for (int b = 0; b < Dim; ++b) {
        gradient(a, b) = 0;
        for (int k = 0; k < Dim; ++k)
          gradient(a, b) += tensor(a, k) * second[a](k, b);
      }
    block.col(c) = symmetric_to_vector<Dim, double>(gradient);
  }
  for (int r = 0; r < n; ++r) // symmetric to the last bit
    for (int c = 0; c < r; ++c)
      block(r, c) = block(c, r) = 0.5 * (block(r, c) + block(c, r));
  return block;
}

/// Adds the impulses of all stresses and contacts to the velocities: from u_free to u.
template <int Dim>
void apply_impulses(DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                    const Execution& execution) {
  for_each_cone(problem, execution, problem.velocity, [&](std::size_t i) {
    if (!problem.stress_impulse[i].isZero(0))
      scatter_stress(problem, stencil, i, problem.stress_impulse[i]);
  });
  for (const Contact<Dim>& contact : problem.contacts) {
    const int j = contact.node;
    for (int a = 0; a < Dim; ++a)
      problem.velocity[j][a] += problem.inverse_mass[j][a] * contact.impulse[a];
    share_velocity(problem, contact.node);
  }
  share_touched(problem, problem.velocity);
  for (const BodyContact<Dim>& contact : problem.body_contacts)
    apply_impulse(problem, contact, contact.impulse);
  problem.copies.copy(problem.velocity, execution);
}

/// Takes all stresses and impulses out of the velocities and sets them to zero: from u to u_free, a
/// cold start.
template <int Dim>
void remove_impulses(DualProblem<Dim>& problem, const Stencil<Dim>& stencil) {
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    scatter_stress(problem, stencil, i, Vec<symmetric_size<Dim>>(-problem.stress_impulse[i]));
    problem.stress_impulse[i].setZero();
  }
  for (Contact<Dim>& contact : problem.contacts) {
    const int j = contact.node;
    problem.velocity[j].template head<Dim>() -=
        problem.inverse_mass[j].template head<Dim>().cwiseProduct(contact.impulse);
    share_velocity(problem, contact.node);
    contact.impulse.setZero();
  }
  for (BodyContact<Dim>& contact : problem.body_contacts) {
    apply_impulse<Dim>(problem, contact, -contact.impulse);
    contact.impulse.setZero();
  }
}

} // namespace talus
