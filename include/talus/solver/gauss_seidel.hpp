// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/cone/projection_step.hpp"
#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/dual/residual.hpp"
#include "talus/solver/solver.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace talus {

/// Block Gauss–Seidel, matrix-free: visits the cones in turn, solves each local problem with the
/// others frozen and puts the change of its stress into the velocities at once; between two sweeps
/// it extrapolates,
/// \f[ y_k = x_k + β_k (x_k − x_{k−1}), \quad β_k = \min(\text{extrapolation}, (t_k − 1)/t_{k+1}),
/// \quad
///     t_{k+1} = \bigl( 1 + \sqrt{1 + 4 t_k^2} \bigr) / 2, \f]
/// x: the stresses, impulses and velocities after sweep k (t: Nesterov's sequence), which saves 3
/// to 10 times the sweeps. It starts over with β = 0 when a sweep changed much more than the one
/// before, and lowers the largest β when the changes no longer become less. What solve() leaves is
/// always an x: the outcome of a sweep.
///
/// Local says how a visit improves the cone: ProjectionStep (default) goes one step, SecularSolver
/// and the other models of LocalSolver go all the way. Law says to which local problem:
///   - AssociatedLaw (default): the de Saxcé term s_i = μ̃ |γ_T| is taken from the latest velocities
///     and frozen during the local solve, which then is convex.
///   - CoulombLaw: the non-associated law itself, as in Rousseau et al. 2023 (extrapolation 0), for
///     comparison.
/// Both have the same solutions.
template <class Local = ProjectionStep, class Law = AssociatedLaw>
class GaussSeidel {
 public:
  struct Params {
    double tolerance = 5e-5; ///< for the l2 residual of dual/residual.hpp
    int max_sweeps = 2000;
    int check_every = 20;       ///< most sweeps between two measurements of the residual
    double extrapolation = 0.9; ///< largest β, in [0, 1]; 0 is plain Gauss–Seidel
    typename Local::Params local{};
  };

  template <int Dim>
  requires(LocalSolver<Local, Law, symmetric_size<Dim>> ||
           LocalStep<Local, Law, symmetric_size<Dim>>) struct Workspace {
    Array<typename Local::template Prepared<Law, symmetric_size<Dim>>> prepared; ///< #cones
    Array<Mat<symmetric_size<Dim>>> diagonal; ///< W_ii, #cones; for local solvers only
    Array<double> inverse_scale;              ///< 1/w_i, w_i = tr W_ii/s, #cones
    Array<std::size_t> misses;                ///< local solves that failed, #blocks
    Array<double> change2;                    ///< Σ w_i |Δλ_i|² of the last sweep, #blocks
    double body_change2 = 0;                  ///< the same of the contacts of free bodies
    // x_{k−1}
    Array<Vec<symmetric_size<Dim>>> last_stress; ///< #cones
    Array<Vec<Dim>> last_impulse;                ///< #contacts, then #body_contacts
    Array<FreeBody<Dim>> last_body;              ///< #bodies
    Array<NodeVec<Dim>> last_velocity;           ///< #cones
    ResidualMeter<Dim> meter;
  };

  GaussSeidel() = default;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit GaussSeidel(const Params& params) : params_(params), local_(params.local) {
    require_positive("solver.tolerance", params_.tolerance);
    if (params_.max_sweeps < 1)
      throw_invalid("solver.max_sweeps", params_.max_sweeps, "an integer >= 1");
    if (params_.check_every < 1)
      throw_invalid("solver.check_every", params_.check_every, "an integer >= 1");
    if (!(params_.extrapolation >= 0 && params_.extrapolation <= 1))
      throw_invalid("solver.extrapolation", params_.extrapolation, "a number in [0, 1]");
  }

  const Params& params() const { return params_; }

  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                    const Execution& execution) const {
    const auto start = std::chrono::steady_clock::now();
    const Stencil<Dim> stencil(problem.grid);
    prepare(problem, stencil, workspace, execution);
    SolveReport report = iterate(problem, stencil, workspace, execution);
    if (report.iterations > 0)
      for (const std::size_t misses : workspace.misses)
        report.local_failures += misses;
    report.local_failures = execution.sum(report.local_failures);
    report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
  }

 private:
  /// Chooses β from the change that each sweep made, sqrt(Σ w_i |Δλ_i|²).
  class Extrapolation {
   public:
    explicit Extrapolation(double largest) : largest_(largest) {}

    double next(double change) {
      if (change > 1.25 * last_change_) // gone too far: start over
        t_ = 1;
      last_change_ = change;
      least_ = std::min(least_, change);
      if (++sweeps_ % 64 == 0) {
        if (least_ > 0.99 * least_before_) // going round in circles
          largest_ = std::max(0.0, largest_ - 0.1);
        least_before_ = least_;
        least_ = infinity;
      }
      const double t = t_;
      t_ = (1 + std::sqrt(1 + 4 * t * t)) / 2;
      return std::min(largest_, (t - 1) / t_);
    }

   private:
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    double largest_, t_ = 1, last_change_ = infinity, least_ = infinity, least_before_ = infinity;
    int sweeps_ = 0;
  };

  template <int Dim>
  void prepare(const DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
               Workspace<Dim>& workspace, const Execution& execution) const {
    constexpr int n = symmetric_size<Dim>;
    const std::size_t cones = problem.cones();
    workspace.prepared.resize(cones);
    if constexpr (LocalSolver<Local, Law, n>)
      workspace.diagonal.resize(cones);
    workspace.inverse_scale.resize(cones);
    workspace.last_stress.resize(cones);
    workspace.last_velocity.resize(cones);
    workspace.last_impulse.resize(problem.contacts.size() + problem.body_contacts.size());
    workspace.last_body.resize(problem.bodies.size());
    workspace.misses.assign(problem.blocks.size(), 0);
    workspace.change2.assign(problem.blocks.size(), 0);
    execution.for_ranges(static_cast<std::ptrdiff_t>(cones),
                         [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                           for (std::size_t i = static_cast<std::size_t>(begin);
                                i < static_cast<std::size_t>(end); ++i) {
                             const Mat<n> w = diagonal_block(problem, stencil, i);
                             const double trace = w.trace();
                             workspace.inverse_scale[i] = trace > 0 ? n / trace : 0;
                             workspace.prepared[i] = local_.prepare(Law{}, w, problem.opening[i]);
                             if constexpr (LocalSolver<Local, Law, n>)
                               workspace.diagonal[i] = w;
                           }
                         });
  }

  template <int Dim>
  SolveReport iterate(DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                      Workspace<Dim>& workspace, const Execution& execution) const {
    SolveReport report;
    const auto measure = [&] {
      report.residual = workspace.meter(problem, stencil, workspace.inverse_scale, execution);
      if (!report.residual.finite())
        report.status = SolveStatus::not_finite;
      else if (report.residual.l2 <= params_.tolerance)
        report.status = SolveStatus::converged;
      else
        report.status = SolveStatus::not_converged;
      return report.status == SolveStatus::not_converged;
    };
    // The residual goes roughly with the change of a sweep, so it is measured when that promises
    // convergence, and every so often to be sure.
    Extrapolation extrapolation(params_.extrapolation);
    double enough = 0;
    bool unsolved = measure();
    for (int since = 1; unsolved; ++since) {
      sweep(problem, stencil, workspace, execution);
      ++report.iterations;
      ExactSum change2;
      for (const double of_block : workspace.change2)
        change2.add(of_block);
      execution.join(&change2, 1);
      const double change = std::sqrt(change2.value() + workspace.body_change2);
      const bool last = report.iterations == params_.max_sweeps;
      if (since >= params_.check_every || !(change > enough) || last) {
        since = 0;
        unsolved = measure();
        enough = 0.9 * change * params_.tolerance / report.residual.l2;
      }
      if (last)
        break;
      if (unsolved && params_.extrapolation > 0)
        extrapolate(problem, workspace, execution, extrapolation.next(change));
    }
    return report;
  }

  /// One pass over all cones and contacts.
  template <int Dim>
  void sweep(DualProblem<Dim>& problem, const Stencil<Dim>& stencil, Workspace<Dim>& workspace,
             const Execution& execution) const {
    for_each_block(problem, execution, problem.velocity,
                   [&](std::size_t b) { visit_block(problem, stencil, workspace, b); });
    workspace.body_change2 = update_body_contacts(problem);
  }

  template <int Dim>
  void visit_block(DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                   Workspace<Dim>& workspace, std::size_t number) const {
    const Block& block = problem.blocks[number];
    workspace.misses[number] = 0;
    double change2 = update_contacts(problem, block);
    for (std::size_t i = block.cone_begin; i < block.cone_end; ++i)
      change2 += update_cone(problem, stencil, workspace, i, workspace.misses[number]);
    workspace.change2[number] = change2 + update_contacts(problem, block);
  }

  template <int Dim>
  static double update_contacts(DualProblem<Dim>& problem, const Block& block) {
    double change2 = 0;
    for (std::size_t c = block.contact_begin; c < block.contact_end; ++c)
      change2 += update_contact(problem, problem.contacts[c]);
    return change2;
  }

  /// Solves one local problem, or goes a step towards it; returns w_i |Δλ_i|².
  template <int Dim>
  double update_cone(DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                     Workspace<Dim>& workspace, std::size_t i, std::size_t& misses) const {
    constexpr int n = symmetric_size<Dim>;
    Vec<n> gamma = integrated_strain_rate(problem, stencil, i);
    gamma[0] += problem.free_volume_rate[i];
    if constexpr (std::is_same_v<Law, AssociatedLaw>) {
      double slip2 = 0;
      for (int k = 1; k < n; ++k)
        slip2 += gamma[k] * gamma[k];
      gamma[0] += problem.opening[i] * std::sqrt(slip2);
    }
    const Vec<n> old = problem.stress_impulse[i];
    Vec<n> lambda = old;
    if constexpr (LocalSolver<Local, Law, n>) {
      const Vec<n> b = gamma - workspace.diagonal[i] * old;
      const LocalReport report = local_.solve(workspace.prepared[i], b, lambda);
      misses += report.status == LocalStatus::not_converged;
    } else {
      local_.step(workspace.prepared[i], gamma, lambda);
    }
    Vec<n> change;
    double change2 = 0;
    for (int k = 0; k < n; ++k) {
      change[k] = lambda[k] - old[k];
      change2 += change[k] * change[k];
    }
    if (change2 == 0)
      return 0;
    problem.stress_impulse[i] = lambda;
    scatter_stress(problem, stencil, i, change);
    const double inverse_scale = workspace.inverse_scale[i];
    return inverse_scale > 0 ? change2 / inverse_scale : 0;
  }

  /// From x_k to y_k; keeps x_k.
  template <int Dim>
  static void extrapolate(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                          const Execution& execution, double beta) {
    const auto move = [&](auto& value, auto& last) {
      for (Eigen::Index k = 0; k < value.size(); ++k) {
        const double now = value[k];
        if (beta > 0)
          value[k] += beta * (now - last[k]);
        last[k] = now;
      }
    };
    const auto move_contacts = [&](auto& contacts, std::size_t first) {
      for (std::size_t c = 0; c < contacts.size(); ++c)
        move(contacts[c].impulse, workspace.last_impulse[first + c]);
    };
    move_contacts(problem.contacts, 0);
    move_contacts(problem.body_contacts, problem.contacts.size());
    for (std::size_t b = 0; b < problem.bodies.size(); ++b) {
      move(problem.bodies[b].velocity, workspace.last_body[b].velocity);
      move(problem.bodies[b].angular_velocity, workspace.last_body[b].angular_velocity);
    }
    execution.for_ranges(static_cast<std::ptrdiff_t>(problem.cones()),
                         [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                           for (std::size_t i = static_cast<std::size_t>(begin);
                                i < static_cast<std::size_t>(end); ++i) {
                             move(problem.stress_impulse[i], workspace.last_stress[i]);
                             // nothing else moves
                             move(problem.velocity[problem.node[i]], workspace.last_velocity[i]);
                           }
                         });
    problem.copies.copy(problem.velocity, execution);
  }

  Params params_{};
  Local local_{};
};

} // namespace talus
