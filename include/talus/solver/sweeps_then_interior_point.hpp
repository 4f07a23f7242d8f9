// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/lagging_slip_step.hpp"
#include "talus/cone/law.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/dual/problem.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/solver/interior_point.hpp"
#include "talus/solver/solver.hpp"

#include <algorithm>
#include <cstddef>

namespace talus {

/// Sweeps of GaussSeidel<>, and where they do not reach the tolerance, from what they left: as many
/// sweeps with LaggingSlipStep, started over several times so that the slip catches up, and where
/// those miss it, too, InteriorPoint from the best so far. As cheap as sweeps alone in the steps
/// that those solve, and bit for bit the same.
class SweepsThenInteriorPoint {
 public:
  struct Params {
    double tolerance = 5e-5;    ///< for the l2 residual of dual/residual.hpp
    int max_sweeps = 2000;      ///< of either kind
    double extrapolation = 0.9; ///< of the sweeps
    int lagging_starts = 8;     ///< of sweeps with LaggingSlipStep; 0: without them
    int max_iterations = 100;   ///< of InteriorPoint, which takes 10 to 40 where it arrives
    /// Of problems, on all ranks, that interior points may have: 10 600 cones in 3-D take 1 GB
    /// (each rank) and 5 s an iteration. 0: never.
    std::size_t max_cones = 12000;
  };
  template <int Dim>
  struct Workspace {
    GaussSeidel<>::Workspace<Dim> sweeps;
    GaussSeidel<LaggingSlipStep, CoulombLaw>::Workspace<Dim> lagging;
    InteriorPoint::Workspace<Dim> interior_point;
    DualProblem<Dim> best; ///< of the steps that sweeps do not solve
  };

  SweepsThenInteriorPoint() : SweepsThenInteriorPoint(Params{}) {}

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit SweepsThenInteriorPoint(const Params& params)
      : params_(params), sweeps_({.tolerance = params.tolerance,
                                  .max_sweeps = params.max_sweeps,
                                  .extrapolation = params.extrapolation}),
        lagging_(of_a_start(params)),
        interior_point_({.tolerance = params.tolerance, .max_iterations = params.max_iterations}) {
    if (params_.lagging_starts < 0)
      throw_invalid("solver.lagging_starts", params_.lagging_starts, "an integer >= 0");
  }

  const Params& params() const { return params_; }

  /// iterations: sweeps and factorisations. Where nothing arrives the best of all is left.
  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                    const Execution& execution) const {
    SolveReport best = sweeps_.solve(problem, workspace.sweeps, execution);
    if (best.status != SolveStatus::not_converged)
      return best;
    SolveReport last = best;
    const auto add = [&](const SolveReport& report) {
      const int iterations = last.iterations + report.iterations;
      const double seconds = last.seconds + report.seconds;
      last = report;
      last.iterations = iterations;
      last.seconds = seconds;
    };
    if (params_.lagging_starts > 0) {
      workspace.best = problem;
      for (int k = 0; k < params_.lagging_starts && last.status == SolveStatus::not_converged;
           ++k) {
        add(lagging_.solve(problem, workspace.lagging, execution));
        if (last.residual.l2 < best.residual.l2) {
          best = last;
          workspace.best = problem;
        }
      }
      if (last.status == SolveStatus::converged)
        return last;
      problem = workspace.best;
      best.iterations = last.iterations;
      best.seconds = last.seconds;
      last = best;
    }
    if (execution.sum(problem.cones()) <= params_.max_cones)
      add(interior_point_.solve(problem, workspace.interior_point, execution));
    return last;
  }

 private:
  static GaussSeidel<LaggingSlipStep, CoulombLaw>::Params of_a_start(const Params& params) {
    return {.tolerance = params.tolerance,
            .max_sweeps = std::max(1, params.max_sweeps / std::max(1, params.lagging_starts)),
            .extrapolation = params.extrapolation};
  }

  Params params_{};
  GaussSeidel<> sweeps_;
  GaussSeidel<LaggingSlipStep, CoulombLaw> lagging_;
  InteriorPoint interior_point_;
};

} // namespace talus
