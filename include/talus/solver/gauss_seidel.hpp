// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/error.hpp"
#include "talus/core/parallel.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/dual/residual.hpp"
#include "talus/solver/solver.hpp"

#include <chrono>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace talus {

/// Block Gauss–Seidel, matrix-free: visits the cones in turn, solves each local problem with the
/// others frozen and puts the change of its stress into the velocities at once.
///
/// Law says which local problem that is:
///   - AssociatedLaw (default): the de Saxcé term s_i = μ̃ |γ_T| is taken from the latest velocities
///     and frozen during the local solve, which then is convex. Converges where the other cycles.
///   - CoulombLaw: the non-associated law itself, as in Rousseau et al. 2023. In 3-D it may enter a
///     limit cycle for μ above about 0.4, which the report shows; kept for comparison.
/// Both have the same solutions.
template <class Local, class Law = AssociatedLaw>
class GaussSeidel {
 public:
  struct Params {
    double tolerance = 1e-4; ///< for the l2 residual of dual/residual.hpp
    int max_sweeps = 2000;
    int check_every = 10; ///< sweeps between two measurements of the residual
    typename Local::Params local{};
  };

  template <int Dim>
  struct Workspace {
    std::vector<typename Local::template Prepared<Law, symmetric_size<Dim>>> prepared; ///< #cones
    std::vector<Mat<symmetric_size<Dim>>> diagonal; ///< W_ii, #cones
    std::vector<double> inverse_scale;              ///< s/tr W_ii, #cones
    std::vector<std::size_t> misses;                ///< local solves that failed, #blocks
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
  }

  const Params& params() const { return params_; }

  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace, int threads) const {
    static_assert(LocalSolver<Local, Law, symmetric_size<Dim>>);
    const auto start = std::chrono::steady_clock::now();
    const Stencil<Dim> stencil(problem.grid);
    prepare(problem, stencil, workspace, threads);

    SolveReport report;
    auto measure = [&] {
      report.residual = workspace.meter(problem, stencil, workspace.inverse_scale, threads);
      if (!report.residual.finite())
        report.status = SolveStatus::not_finite;
      else if (report.residual.l2 <= params_.tolerance)
        report.status = SolveStatus::converged;
      else
        report.status = SolveStatus::not_converged;
      return report.status == SolveStatus::not_converged;
    };
    while (measure() && report.iterations < params_.max_sweeps)
      for (int k = 0; k < params_.check_every && report.iterations < params_.max_sweeps; ++k)
        sweep(problem, stencil, workspace, threads, report.iterations++ % 2 != 0);
    if (report.iterations > 0)
      for (const std::size_t misses : workspace.misses)
        report.local_misses += misses;
    report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
  }

 private:
  template <int Dim>
  void prepare(const DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
               Workspace<Dim>& workspace, int threads) const {
    constexpr int n = symmetric_size<Dim>;
    const std::size_t cones = problem.cones();
    workspace.prepared.resize(cones);
    workspace.diagonal.resize(cones);
    workspace.inverse_scale.resize(cones);
    workspace.misses.assign(problem.blocks.size(), 0);
    parallel_chunks(threads, static_cast<std::ptrdiff_t>(cones), 32,
                    [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                      for (std::size_t i = static_cast<std::size_t>(begin);
                           i < static_cast<std::size_t>(end); ++i) {
                        workspace.diagonal[i] = diagonal_block(problem, stencil, i);
                        const double trace = workspace.diagonal[i].trace();
                        workspace.inverse_scale[i] = trace > 0 ? n / trace : 0;
                        workspace.prepared[i] =
                            local_.prepare(Law{}, workspace.diagonal[i], problem.friction[i]);
                      }
                    });
  }

  /// One pass over all cones and contacts, there or back.
  template <int Dim>
  void sweep(DualProblem<Dim>& problem, const Stencil<Dim>& stencil, Workspace<Dim>& workspace,
             int threads, bool back) const {
    const std::size_t colours = problem.colour_begin.size() - 1;
    for (std::size_t k = 0; k < colours; ++k) {
      const std::size_t colour = back ? colours - 1 - k : k;
      const std::size_t first = problem.colour_begin[colour];
      const std::size_t count = problem.colour_begin[colour + 1] - first;
      parallel_for(threads, static_cast<std::ptrdiff_t>(count), [&](std::ptrdiff_t b) {
        visit_block(problem, stencil, workspace, first + static_cast<std::size_t>(b), back);
      });
    }
  }

  template <int Dim>
  void visit_block(DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                   Workspace<Dim>& workspace, std::size_t block_number, bool back) const {
    const Block& block = problem.blocks[block_number];
    std::size_t misses = 0;
    for (std::size_t c = block.contact_begin; c < block.contact_end; ++c)
      update_contact(problem, problem.contacts[c]);
    for (std::size_t k = block.cone_begin; k < block.cone_end; ++k)
      misses += !update_cone(problem, stencil, workspace,
                             back ? block.cone_end - 1 - (k - block.cone_begin) : k);
    for (std::size_t c = block.contact_begin; c < block.contact_end; ++c)
      update_contact(problem, problem.contacts[c]);
    workspace.misses[block_number] = misses;
  }

  /// Solves one local problem; false if the local solver missed.
  template <int Dim>
  bool update_cone(DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                   Workspace<Dim>& workspace, std::size_t i) const {
    constexpr int n = symmetric_size<Dim>;
    Vec<n> gamma = strain_rate(problem, stencil, i);
    gamma[0] += problem.void_rate[i];
    const Vec<n> old = problem.stress[i];
    Vec<n> b = gamma - workspace.diagonal[i] * old;
    if constexpr (std::is_same_v<Law, AssociatedLaw>)
      b[0] += problem.friction[i] * gamma.template tail<n - 1>().norm();
    Vec<n> lambda = old;
    const LocalReport report = local_.solve(workspace.prepared[i], b, lambda);
    const Vec<n> change = lambda - old;
    if (!change.isZero(0)) {
      problem.stress[i] = lambda;
      apply_stress(problem, stencil, i, change);
    }
    return report.status != LocalStatus::not_converged;
  }

  Params params_{};
  Local local_{};
};

} // namespace talus
