// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/execution.hpp"
#include "talus/dual/problem.hpp"
#include "talus/dual/residual.hpp"

#include <concepts>
#include <string_view>

namespace talus {

enum class SolveStatus {
  converged,     ///< the residual is at most the tolerance
  not_converged, ///< the iterations ran out; the velocities are finite and usable
  not_finite,    ///< NaN or infinity turned up, or no valid friction; not to be used
};

inline std::string_view to_string(SolveStatus status) {
  switch (status) {
  case SolveStatus::converged:
    return "converged";
  case SolveStatus::not_converged:
    return "not converged";
  case SolveStatus::not_finite:
    return "not finite";
  }
  return "";
}

/// What a global solver says about one solve.
struct [[nodiscard]] SolveReport {
  SolveStatus status = SolveStatus::converged;
  int iterations = 0;
  Residual residual;
  std::size_t local_failures = 0; ///< local solves of the last iteration that did not converge
  double seconds = 0;
};

/// A solver of the dual problem. A model S has
///   - `S::Params`, an aggregate that S is constructible from;
///   - `S::Workspace<Dim>`, default constructible, kept between steps so that a warm solve
///   allocates
///     nothing;
///   - `s.solve(problem, workspace, execution)` → SolveReport: improves `problem.stress_impulse`
///   and the
///     contacts' impulses from the values they have, keeping `problem.velocity` consistent, until
///     the residual of dual/residual.hpp meets the solver's tolerance. The result does not depend
///     on the number of threads.
/// Models: GaussSeidel, InteriorPoint, SweepsThenInteriorPoint.
template <class S, int Dim>
concept Solver = std::constructible_from<S, const typename S::Params&> &&
    std::default_initializable<typename S::template Workspace<Dim>> &&
    requires(const S s, DualProblem<Dim>& problem, typename S::template Workspace<Dim>& workspace) {
  { s.solve(problem, workspace, Execution()) } -> std::same_as<SolveReport>;
};

} // namespace talus
