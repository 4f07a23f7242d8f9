// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/dual/problem.hpp"
#include "talus/solver/solver.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/step/node_fields.hpp"

#include <cmath>
#include <cstddef>
#include <string_view>

namespace talus {

/// Wall-clock seconds of one step, by phase.
struct PhaseSeconds {
  double to_grid = 0;  ///< sorting, particles to grid
  double assembly = 0; ///< boundary conditions, cones and contacts, warm start, viscosity
  double solve = 0;
  double to_particles = 0; ///< grid to particles, advection

  double total() const { return to_grid + assembly + solve + to_particles; }
};

/// What one step did.
struct [[nodiscard]] StepReport {
  SolveReport solve;     ///< iterations and seconds of all friction updates
  ViscousReport viscous; ///< of the Newtonian part, if there is one
  PhaseSeconds seconds;
  double time_step = 0;       ///< δt, s
  int friction_updates = 1;   ///< how often μ_i was taken from the rheology
  double friction_change = 0; ///< relative change of μ p by the last update, or by the one left out
  std::size_t cones = 0, contacts = 0;
  std::size_t invalid_friction = 0; ///< nodes whose friction law gave no finite μ ≥ 0
  bool stands_still = false;        ///< δt is too small to change the time
  /// Largest φ_i before the step, of nodes that no solid takes a part of; far above 1 the scene is
  /// filled twice, or what flows is more than the grid resolves.
  double largest_fraction = 0;
  double courant = 0;          ///< largest |u_a| δt/h_a of a node after the solve: cells crossed
  std::size_t inflow = 0;      ///< particles that sources added at the end of this step
  double inflow_volume = 0;    ///< m^d
  double held_back_volume = 0; ///< m^d that sources had no room for; it does not come later
  std::size_t outflow = 0;     ///< particles that left through open faces and sinks in this step
  double outflow_volume = 0;   ///< m^d
  std::size_t bodies_left = 0; ///< free bodies that left the box in this step

  /// False if the step was refused, see why(): particles, bodies, time, fields and forces are as
  /// before, but for the order of the particles.
  bool completed() const { return solve.status != SolveStatus::not_finite; }

  /// Why the step was refused; empty if it was not.
  std::string_view why() const {
    if (completed())
      return {};
    if (stands_still)
      return "the time step is too small to change the time";
    if (invalid_friction > 0)
      return "rheology.friction(I) gave no finite number >= 0 (> 0 where there is cohesion)";
    return "the solver met numbers that are not finite";
  }
};

/// The larger of two numbers; a NaN is kept, not lost.
inline double larger_or_nan(double a, double b) {
  return b <= a || std::isnan(a) ? a : b;
}

/// The largest of value(cone) over the cones of all ranks, at least 0, or NaN if there is one.
template <int Dim, class ValueOf>
double largest_of_cones(const DualProblem<Dim>& problem, const Execution& execution,
                        Array<double>& partials, const ValueOf& value) {
  return execution.largest(execution.reduce(
      static_cast<std::ptrdiff_t>(problem.cones()), partials, 0.0,
      [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        double largest = 0;
        for (std::ptrdiff_t i = begin; i < end; ++i)
          largest = larger_or_nan(largest, value(static_cast<std::size_t>(i)));
        return largest;
      },
      larger_or_nan));
}

/// Largest φ_i of the nodes that carry cones and that no solid takes a part of. partials:
/// workspace.
template <int Dim>
double largest_fraction(const DualProblem<Dim>& problem, const NodeFields& fields,
                        const Execution& execution, Array<double>& partials) {
  return largest_of_cones(problem, execution, partials, [&](std::size_t i) {
    const int j = problem.node[i];
    return fields.open_fraction[j] == 1 ? fields.material_volume[j] / problem.node_volume[i] : 0;
  });
}

/// max |u_a| δt/h_a over the nodes that carry cones; not finite if one of their velocities or one
/// of a body is not. time_step: δt, s; partials: workspace.
template <int Dim>
double courant_number(const DualProblem<Dim>& problem, double time_step, const Execution& execution,
                      Array<double>& partials) {
  const double largest = largest_of_cones(problem, execution, partials, [&](std::size_t i) {
    double largest_rate = 0;
    for (int a = 0; a < Dim; ++a) {
      const double rate =
          std::abs(problem.velocity[problem.node[i]][a]) * problem.grid.inverse_spacing()[a];
      largest_rate = larger_or_nan(largest_rate, rate);
    }
    return largest_rate;
  });
  for (const FreeBody<Dim>& body : problem.bodies)
    if (const double sum = body.velocity.sum() + body.angular_velocity.sum(); !std::isfinite(sum))
      return sum;
  return largest * time_step;
}

} // namespace talus
