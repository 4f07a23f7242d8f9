// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
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
/// Contacts that bore something in the last step hold their nodes, which move with the wall where
/// they stuck and along it where they slid, and take up what that costs, so that a wall stops all
/// that hangs together at once. A node has one such contact at most. The dual problem then lets go
/// what Coulomb's law does not bear.
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
    hold(problem);
    start(problem, execution);
    Array<Padded>& u = problem.velocity;

    // r = −δt K u, z = D⁻¹ r, p = z
    multiply(problem, u, execution);
    Sums sums = sum(problem, execution, [&](int j, const Padded& inverse_mass) {
      residual_[j] = -free(problem, j, product_[j]);
      direction_[j] = preconditioned(problem, j);
      return Sums{residual_[j].dot(direction_[j]), squared_velocity(residual_[j], inverse_mass),
                  inverse_mass.maxCoeff() > 0 ? 1 / inverse_mass.maxCoeff() : 0};
    });
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
      const double energy = sum(problem, execution, [&](int j, const Padded& inverse_mass) {
                              product_[j] = free(problem, j, product_[j]) +
                                            direction_[j].cwiseProduct(mass(inverse_mass));
                              return Sums{direction_[j].dot(product_[j]), 0, 0};
                            }).product;
      const double step = sums.product / energy, last = sums.product;
      sums = sum(problem, execution, [&](int j, const Padded& inverse_mass) {
        u[j] += step * direction_[j];
        residual_[j] -= step * product_[j];
        return Sums{residual_[j].dot(preconditioned(problem, j)),
                    squared_velocity(residual_[j], inverse_mass), 0};
      });
      const double keep = sums.product / last;
      for_each(problem, execution,
               [&](int j) { direction_[j] = preconditioned(problem, j) + keep * direction_[j]; });
    }
    multiply(problem, u, execution);
    for_each(problem, execution,
             [&](int j) { u[j] += residual_[j].cwiseProduct(problem.inverse_mass[j]); });
    problem.copies.copy(u, execution);
    for (const Held& held : held_) { // what it keeps from the viscous stress
      const Vec<Dim> kept = product_[held.node].template head<Dim>();
      Contact<Dim>& contact = problem.contacts[held.contact];
      contact.impulse +=
          held.sticks ? without_faces(problem, held.node, kept) : along(held, kept, contact.normal);
    }
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

  struct Sums {
    double product = 0;  ///< r · z, or p · A p
    double left_out = 0; ///< Σ r²/m
    double mass = 0;     ///< Σ m
  };

  /// A node that a contact holds.
  struct Held {
    int node = 0;
    std::size_t contact = 0;
    bool sticks = false;
    Vec<Dim> normal; ///< of the contact, without the components that faces hold
  };

  /// Finds the nodes that contacts hold and takes them along with the wall.
  void hold(DualProblem<Dim>& problem) {
    held_.clear();
    held_at_.assign(problem.velocity.size(), -1);
    for (std::size_t c = 0; c < problem.contacts.size(); ++c) {
      const Contact<Dim>& contact = problem.contacts[c];
      const double pressed = contact.impulse.dot(contact.normal);
      if (!(pressed > 0))
        continue;
      // one that slides is at its bound but for rounding
      const Vec<Dim> along_wall = contact.impulse - pressed * contact.normal;
      Held held{contact.node, c, along_wall.norm() < (1 - 1e-9) * contact.friction * pressed, {}};
      held.normal = without_faces(problem, contact.node, contact.normal);
      if (held.normal.squaredNorm() < 0.5) // faces hold it rather than the contact
        continue;
      int& at = held_at_[contact.node];
      if (at < 0) {
        at = static_cast<int>(held_.size());
        held_.push_back(held);
      } else if (held.sticks && !held_[at].sticks) {
        held_[at] = held;
      }
    }
    for (const Held& held : held_) {
      Contact<Dim>& contact = problem.contacts[held.contact];
      const Padded& inverse_mass = problem.inverse_mass[held.node];
      const Vec<Dim> slip =
          contact.wall_velocity - problem.velocity[held.node].template head<Dim>();
      Padded change = Padded::Zero();
      if (held.sticks)
        change.template head<Dim>() = without_faces(problem, held.node, slip);
      else
        change.template head<Dim>() =
            slip.dot(contact.normal) / held.normal.squaredNorm() * held.normal;
      problem.velocity[held.node] += change;
      const Vec<Dim> momentum = change.cwiseProduct(mass(inverse_mass)).template head<Dim>();
      contact.impulse += held.sticks ? momentum : along(held, momentum, contact.normal);
    }
  }

  /// Only what may change of a node's vector.
  Padded free(const DualProblem<Dim>& problem, int j, const Padded& value) const {
    Padded part = (problem.inverse_mass[j].array() > 0).select(value, Padded::Zero());
    if (held_at_[j] < 0)
      return part;
    const Held& held = held_[held_at_[j]];
    if (held.sticks)
      return Padded::Zero();
    const double normal = part.template head<Dim>().dot(held.normal) / held.normal.squaredNorm();
    part.template head<Dim>() -= normal * held.normal;
    return part;
  }
  /// z = D⁻¹ r of what may change.
  Padded preconditioned(const DualProblem<Dim>& problem, int j) const {
    return free(problem, j, residual_[j].cwiseProduct(inverse_diagonal_[j]));
  }
  /// The components that no face holds.
  static Vec<Dim> without_faces(const DualProblem<Dim>& problem, int j, const Vec<Dim>& value) {
    Vec<Dim> part;
    for (int a = 0; a < Dim; ++a)
      part[a] = problem.inverse_mass[j][a] > 0 ? value[a] : 0;
    return part;
  }
  /// The impulse of a contact without friction that has this part of an impulse along the free
  /// components of its normal.
  static Vec<Dim> along(const Held& held, const Vec<Dim>& impulse, const Vec<Dim>& normal) {
    return impulse.dot(held.normal) / held.normal.squaredNorm() * normal;
  }
  static Padded mass(const Padded& inverse_mass) {
    return (inverse_mass.array() > 0).select(inverse_mass.cwiseInverse(), Padded::Zero());
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
    for_each(problem, execution, [&](int j) {
      const Padded& inverse_mass = problem.inverse_mass[j];
      const Padded inverse = (inverse_diagonal_[j] + mass(inverse_mass)).cwiseInverse();
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
  Array<Held> held_;
  Array<int> held_at_; ///< index into held_ or −1, #nodes
  Array<Padded> product_, residual_, direction_, inverse_diagonal_; ///< #nodes
  Array<double> weight_;                                            ///< 2 η δt f_i/V_i, #cones
  Array<double> partials_;
};

} // namespace talus
