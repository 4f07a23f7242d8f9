// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/execution.hpp"
#include "talus/dual/problem.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/solver/interior_point.hpp"
#include "talus/solver/solver.hpp"

#include <cstddef>

namespace talus {

/// Sweeps of GaussSeidel<>, and where they do not reach the tolerance, InteriorPoint from what they
/// left: as cheap as sweeps alone in the steps that those solve. With several ranks, or more cones
/// than `max_cones`, it is sweeps alone.
class SweepsThenInteriorPoint {
 public:
  struct Params {
    double tolerance = 5e-5;    ///< for the l2 residual of dual/residual.hpp
    int max_sweeps = 2000;      ///< then interior points take over
    double extrapolation = 0.9; ///< of the sweeps
    int max_iterations = 100;   ///< of InteriorPoint, which takes 10 to 40 where it arrives
    /// Of problems that interior points may have, whose factors fill; 0: never.
    std::size_t max_cones = 5000;
  };
  template <int Dim>
  struct Workspace {
    GaussSeidel<>::Workspace<Dim> sweeps;
    InteriorPoint::Workspace<Dim> interior_point;
  };

  SweepsThenInteriorPoint() = default;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit SweepsThenInteriorPoint(const Params& params)
      : params_(params), sweeps_({.tolerance = params.tolerance,
                                  .max_sweeps = params.max_sweeps,
                                  .extrapolation = params.extrapolation}),
        interior_point_({.tolerance = params.tolerance, .max_iterations = params.max_iterations}) {}

  const Params& params() const { return params_; }

  /// iterations: sweeps and factorisations.
  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                    const Execution& execution) const {
    const SolveReport first = sweeps_.solve(problem, workspace.sweeps, execution);
    if (first.status != SolveStatus::not_converged || execution.sum(std::size_t{1}) > 1 ||
        problem.cones() > params_.max_cones)
      return first;
    SolveReport report = interior_point_.solve(problem, workspace.interior_point, execution);
    report.iterations += first.iterations;
    report.seconds += first.seconds;
    return report;
  }

 private:
  Params params_{};
  GaussSeidel<> sweeps_{};
  InteriorPoint interior_point_{};
};

} // namespace talus
