// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/secular.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/solver/solver.hpp"
#include "talus/solver/sweeps_then_interior_point.hpp"

#include <string>
#include <variant>

namespace support {

/// Any of the library's solvers, by name, so that one simulation is compiled for all of them.
class AnySolver {
  using Default = talus::SweepsThenInteriorPoint;
  using Secular = talus::GaussSeidel<talus::SecularSolver>;
  using Newton = talus::GaussSeidel<talus::FischerBurmeisterNewton, talus::CoulombLaw>;

 public:
  struct Params {
    std::string name = "sweeps-then-interior-point"; ///< see make()
    double tolerance = Default::Params{}.tolerance;
    int max_sweeps = Default::Params{}.max_sweeps;
    double extrapolation = Default::Params{}.extrapolation; ///< "gauss-seidel-newton" has none
  };
  template <int Dim>
  struct Workspace {
    Default::Workspace<Dim> sweeps;
    Secular::Workspace<Dim> secular;
    Newton::Workspace<Dim> newton;
  };

  explicit AnySolver(const Params& params) : solver_(make(params)) {}

  template <int Dim>
  talus::SolveReport solve(talus::DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                           const talus::Execution& execution) const {
    if (const auto* secular = std::get_if<Secular>(&solver_))
      return secular->solve(problem, workspace.secular, execution);
    if (const auto* newton = std::get_if<Newton>(&solver_))
      return newton->solve(problem, workspace.newton, execution);
    return std::get<Default>(solver_).solve(problem, workspace.sweeps, execution);
  }

 private:
  using Solver = std::variant<Default, Secular, Newton>;

  static Solver make(const Params& params) {
    const auto sweeps = [&](auto of, double extrapolation) {
      of.tolerance = params.tolerance;
      of.max_sweeps = params.max_sweeps;
      of.extrapolation = extrapolation;
      return of;
    };
    if (params.name == "gauss-seidel-secular")
      return Secular(sweeps(Secular::Params{}, params.extrapolation));
    if (params.name == "gauss-seidel-newton")
      return Newton(sweeps(Newton::Params{}, 0));
    Default::Params with_interior_points = sweeps(Default::Params{}, params.extrapolation);
    if (params.name == "gauss-seidel") { // sweeps alone
      with_interior_points.lagging_starts = 0;
      with_interior_points.max_cones = 0;
    }
    return Default(with_interior_points);
  }

  Solver solver_;
};

} // namespace support
