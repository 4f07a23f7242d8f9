// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/solver/held_nodes.hpp"
#include "talus/solver/solver.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace talus {

/// What the viscous part of a step did.
struct [[nodiscard]] ViscousReport {
  SolveStatus status = SolveStatus::converged;
  int iterations = 0;
  double residual = 0; ///< as ViscousParams::tolerance measures it
};

/// How exactly a step takes the viscous stress.
struct ViscousParams {
  /// Of the velocities: root mean square error over the step's velocity scale, see ViscousSolver.
  double tolerance = 1e-6;
  int max_iterations = 1000;

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    require_positive("viscous.tolerance", tolerance);
    if (max_iterations < 1)
      throw_invalid("viscous.max_iterations", max_iterations, "an integer >= 1");
  }
};

/// By how much more than its volume the viscous stress of a node in a solid must count, of which
/// the share `open` < 1/2 is outside. Only the part a = sqrt(2 open) of the cell between it and the
/// next node holds material, which is at rest at the surface, a h from that node, not at the
/// solid's node, h from it. It resists that node's velocity u with η u/(a h). Without the weight f
/// it would with (f a²/2 + a − a²/2) η u/h, the parts of both nodes.
inline double strip_weight(double open) {
  if (!(open < 0.5))
    return 1;
  const double a = std::sqrt(2 * open), lower = a * a / 2;
  return (1 / a - (a - lower)) / lower;
}

/// Takes the viscous stress 2 η D implicitly: from the velocities u of a problem, all other
/// impulses included, to u' with
/// \f[ (M + δt\, K)\, u' = M u, \quad
///     (K u')_j = \sum_i \frac{2 η f_i}{V_i} \,\mathrm{sym}\Bigl( \sum_k u'_k ⊗ g_{ik} \Bigr)
///     g_{ij}, \f]
/// f_i: 1, or strip_weight. The solver of the dual problem goes on from u'. As u contains the
/// stresses of the last step, a steady flow is one of viscous and plastic stresses together,
/// without an error of splitting.
///
/// Contacts that bore something in the last step hold their nodes, see HeldNodes, and take up what
/// that costs, so that a wall stops all that hangs together at once, and a free body, whose
/// velocities are unknowns, too, moves with what clings to it. The dual problem then lets go what
/// Coulomb's law does not bear.
///
/// Conjugate gradients, matrix-free, preconditioned with the diagonal; components with no inverse
/// mass (sticking, slipping) stay as they are. The residual r counts as the velocities M⁻¹ r that
/// it leaves out, sqrt(Σ r²/m / Σ m), over the problem's velocity scale, or over those of the first
/// r if that is 0. These are put in at the end, so that u' − u is the effect of a stress and
/// conserves momentum to rounding. The result does not depend on the number of threads.
template <int Dim>
class ViscousSolver {
 public:
  /// stress_volume: V_i, that stress acts on, #nodes, m^d; open_fraction: of a node's volume, what
  /// no solid takes, #nodes; eta: η, Pa s; time_step: δt, s.
  ViscousReport solve(DualProblem<Dim>& problem, const Array<double>& stress_volume,
                      const Array<double>& open_fraction, double eta, const ViscousParams& params,
                      double time_step, const Execution& execution) {
    ViscousReport report;
    if (eta == 0)
      return report;
    weight_.resize(problem.cones());
    execution.for_each(std::ssize(weight_), [&](std::ptrdiff_t i) {
      const int node = problem.node[i];
      weight_[i] = 2 * eta * time_step * strip_weight(open_fraction[node]) / stress_volume[node];
    });
    held_.hold(problem, execution);
    start(problem, execution);
    Array<Padded>& u = problem.velocity;

    // r = −δt K u, z = D⁻¹ r, p = z
    multiply(problem, u, execution);
    Sums sums = sum(problem, execution, [&](int j, const Padded& inverse_mass) {
      residual_[j] = -held_.free(problem, j, product_[j]);
      direction_[j] = preconditioned(problem, j);
      return Sums{residual_[j].dot(direction_[j]), squared_velocity(residual_[j], inverse_mass),
                  inverse_mass.maxCoeff() > 0 ? 1 / inverse_mass.maxCoeff() : 0};
    });
    start_bodies(problem, sums);
    const double of_step = problem.velocity_scale * problem.velocity_scale * sums.mass;
    const double scale2 = of_step > 0 ? of_step : sums.left_out;
    for (;; ++report.iterations) {
      report.residual = sums.left_out > 0 ? std::sqrt(sums.left_out / scale2) : sums.left_out;
      if (!std::isfinite(report.residual))
        report.status = SolveStatus::not_finite;
      else if (report.residual <= params.tolerance)
        report.status = SolveStatus::converged;
      else
        report.status = SolveStatus::not_converged;
      if (report.status != SolveStatus::not_converged || report.iterations == params.max_iterations)
        break;
      multiply(problem, direction_, execution);
      const double of_bodies = multiply_bodies(problem);
      const double energy =
          of_bodies + sum(problem, execution, [&](int j, const Padded& inverse_mass) {
                        const Padded moved = direction_[j].cwiseProduct(mass_of(inverse_mass));
                        product_[j] = held_.free(problem, j, product_[j] + moved);
                        return Sums{direction_[j].dot(product_[j]), 0, 0};
                      }).product;
      const double step = sums.product / energy, last = sums.product;
      sums = sum(problem, execution, [&](int j, const Padded& inverse_mass) {
        u[j] += step * direction_[j];
        residual_[j] -= step * product_[j];
        return Sums{residual_[j].dot(preconditioned(problem, j)),
                    squared_velocity(residual_[j], inverse_mass), 0};
      });
      step_bodies(problem, step, sums);
      const double keep = sums.product / last;
      for_each(problem, execution,
               [&](int j) { direction_[j] = preconditioned(problem, j) + keep * direction_[j]; });
      turn_bodies(problem, keep);
    }
    multiply(problem, u, execution);
    for_each(problem, execution,
             [&](int j) { u[j] += residual_[j].cwiseProduct(problem.inverse_mass[j]); });
    finish_bodies(problem);
    HeldNodes<Dim>::share(problem, execution, u);
    held_.keep(problem, product_);
    return report;
  }

  /// What the viscous stress of the last solve gave to a node, −δt K u', N s (per metre in 2-D): to
  /// what holds it, if it is held.
  Vec<Dim> impulse(int node) const {
    if (product_.empty())
      return Vec<Dim>::Zero();
    return -product_[node].template head<Dim>();
  }

 private:
  using Padded = NodeVec<Dim>;
  using Motion = typename HeldNodes<Dim>::Motion;
  static constexpr int motion_size = Dim + spin_size<Dim>;

  struct Sums {
    double product = 0;  ///< r · z, or p · A p
    double left_out = 0; ///< Σ r²/m
    double mass = 0;     ///< Σ m
  };

  // The part of the bodies. What they have is the same on all ranks.

  /// As for the nodes: r, z, p and their sums. product_: δt K u.
  void start_bodies(const DualProblem<Dim>& problem, Sums& sums) {
    if (!held_.bodies())
      return;
    held_.gather(problem, product_, body_residual_);
    for (Motion& residual : body_residual_)
      residual = scaled<motion_size>(-1, residual);
    add_sums(sums);
    body_direction_ = preconditioned_;
    held_.carry(problem, preconditioned_, direction_);
  }
  /// Sets A p of the bodies; returns p · A p. product_: δt K p of the nodes.
  double multiply_bodies(const DualProblem<Dim>& problem) {
    double energy = 0;
    if (!held_.bodies())
      return energy;
    held_.gather(problem, product_, body_product_);
    for (std::size_t b = 0; b < body_product_.size(); ++b) {
      body_product_[b] =
          plus<motion_size>(body_product_[b], held_.impulse_of(b, body_direction_[b]));
      energy += dot<motion_size>(body_direction_[b], body_product_[b]);
    }
    return energy;
  }
  void step_bodies(DualProblem<Dim>& problem, double step, Sums& sums) {
    if (!held_.bodies())
      return;
    held_.move(problem, step, body_direction_);
    for (std::size_t b = 0; b < body_residual_.size(); ++b)
      body_residual_[b] = plus_scaled<motion_size>(body_residual_[b], -step, body_product_[b]);
    add_sums(sums);
  }
  /// The next direction. direction_: of the nodes, but for what preconditioned_ adds.
  void turn_bodies(const DualProblem<Dim>& problem, double keep) {
    if (!held_.bodies())
      return;
    for (std::size_t b = 0; b < body_direction_.size(); ++b)
      body_direction_[b] = plus_scaled<motion_size>(preconditioned_[b], keep, body_direction_[b]);
    held_.carry(problem, preconditioned_, direction_);
  }
  /// Puts what is left of the residual in.
  void finish_bodies(DualProblem<Dim>& problem) {
    if (!held_.bodies())
      return;
    for (std::size_t b = 0; b < body_residual_.size(); ++b)
      preconditioned_[b] = held_.motion_by(b, body_residual_[b]);
    held_.move(problem, 1, preconditioned_);
    held_.carry(problem, preconditioned_, problem.velocity);
  }
  /// Sets z = D⁻¹ r and adds its sums.
  void add_sums(Sums& sums) {
    preconditioned_.resize(body_residual_.size());
    for (std::size_t b = 0; b < body_residual_.size(); ++b) {
      const Motion& residual = body_residual_[b];
      preconditioned_[b] = held_.precondition(b, residual);
      sums.product += dot<motion_size>(residual, preconditioned_[b]);
      sums.left_out += dot<motion_size>(residual, held_.motion_by(b, residual));
    }
  }

  /// z = D⁻¹ r of what may change.
  Padded preconditioned(const DualProblem<Dim>& problem, int j) const {
    return held_.free(problem, j, residual_[j].cwiseProduct(inverse_diagonal_[j]));
  }
  static double squared_velocity(const Padded& r, const Padded& inverse_mass) {
    return r.cwiseAbs2().dot(inverse_mass);
  }

  template <class Body>
  static void for_each(const DualProblem<Dim>& problem, const Execution& execution,
                       const Body& body) {
    execution.for_ranges(static_cast<std::ptrdiff_t>(problem.cones()),
                         [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                           for (std::ptrdiff_t i = begin; i < end; ++i)
                             body(problem.node[i]);
                         });
  }

  /// Σ of term(node, inverse mass) over the nodes that carry a cone.
  template <class Term>
  Sums sum(const DualProblem<Dim>& problem, const Execution& execution, const Term& term) {
    const auto of_block = [&](const Block& block, double* of) {
      Sums sums;
      for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
        const int j = problem.node[i];
        const Sums more = term(j, problem.inverse_mass[j]);
        sums.product += more.product;
        sums.left_out += more.left_out;
        sums.mass += more.mass;
      }
      of[0] = sums.product;
      of[1] = sums.left_out;
      of[2] = sums.mass;
    };
    const auto total = sum_over_blocks<3>(problem, execution, partials_, of_block);
    return {total[0], total[1], total[2]};
  }

  /// The inverse of the diagonal of M + δt K; sizes the workspace.
  void start(const DualProblem<Dim>& problem, const Execution& execution) {
    const std::size_t nodes = problem.velocity.size();
    stencil_ = Stencil<Dim>(problem.grid);
    product_.resize(nodes);
    residual_.resize(nodes);
    direction_.assign(nodes, Padded::Zero());
    inverse_diagonal_.assign(nodes, Padded::Zero());
    for_each_cone(problem, execution, inverse_diagonal_, [&](std::size_t i) {
      const int node = problem.node[i];
      for (int r = 0; r < Stencil<Dim>::rows; ++r)
        for (int k = 0; k < 3; ++k) {
          // e_a · sym(e_a ⊗ g) g = (|g|² + g_a²)/2
          const Vec<Dim> g = problem.gradient_weights[i].col(3 * r + k);
          inverse_diagonal_[node + stencil_.row(r) + k].template head<Dim>().array() +=
              weight_[i] / 2 * (g.squaredNorm() + g.array().square());
        }
      share(problem, i, inverse_diagonal_);
    });
    if (held_.bodies()) {
      HeldNodes<Dim>::share(problem, execution, inverse_diagonal_);
      held_.prepare(problem, inverse_diagonal_);
    }
    for_each(problem, execution, [&](int j) {
      const Padded& inverse_mass = problem.inverse_mass[j];
      const Padded inverse = (inverse_diagonal_[j] + mass_of(inverse_mass)).cwiseInverse();
      inverse_diagonal_[j] = (inverse_mass.array() > 0).select(inverse, Padded::Zero());
    });
  }

  /// product_ = δt K v.
  void multiply(const DualProblem<Dim>& problem, Array<Padded>& v, const Execution& execution) {
    problem.copies.copy(v, execution);
    execution.for_ranges(std::ssize(product_), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      std::fill(product_.begin() + begin, product_.begin() + end, Padded::Zero());
    });
    for_each_cone(problem, execution, product_, [&](std::size_t i) {
      const int node = problem.node[i];
      const GradientWeights<Dim>& g = problem.gradient_weights[i];
      const auto gradient = gather_gradient<Dim>(v.data() + node, stencil_, g);
      const Mat<Dim> square = gradient.template topRows<Dim>();
      const Mat<Dim> stress = weight_[i] / 2 * (square + square.transpose());
      Padded* force = product_.data() + node;
      for (int r = 0; r < Stencil<Dim>::rows; ++r)
        for (int k = 0; k < 3; ++k)
          force[stencil_.row(r) + k].template head<Dim>() += stress * g.col(3 * r + k);
      share(problem, i, product_);
    });
    if (held_.bodies())
      HeldNodes<Dim>::share(problem, execution, product_);
  }

  /// Gives all nodes of the places around a cone what it has changed there.
  static void share(const DualProblem<Dim>& problem, std::size_t cone, Array<Padded>& field) {
    const int node = problem.node[cone];
    if (!problem.copies.near_copy(node))
      return;
    for (int k = 0; k < Grid<Dim>::neighbours; ++k)
      if (!problem.gradient_weights[cone].col(k).isZero(0)) // as scatter_stress does
        problem.copies.share(field, node + problem.grid.neighbour_offset(k));
  }

  Stencil<Dim> stencil_;
  HeldNodes<Dim> held_;
  Array<Padded> product_, residual_, direction_, inverse_diagonal_; ///< #nodes
  Array<double> weight_;                                            ///< 2 η δt f_i/V_i, #cones
  Array<double> partials_;
  Array<Motion> body_residual_, body_direction_, body_product_, preconditioned_; ///< #bodies
};

} // namespace talus
