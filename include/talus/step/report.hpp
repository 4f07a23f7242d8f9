// SPDX-License-Identifier: MIT
#pragma once

#include "talus/dual/problem.hpp"
#include "talus/solver/solver.hpp"
#include "talus/solver/viscous_solver.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <vector>

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
  std::size_t outflow = 0;     ///< particles that left through free faces in this step
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

/// Largest φ_i of the nodes that carry cones and that no solid takes a part of. open_share,
/// material_volume (m^d): #nodes.
template <int Dim>
double largest_fraction(const DualProblem<Dim>& problem, const std::vector<double>& open_share,
                        const std::vector<double>& material_volume) {
  double largest = 0;
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    const std::size_t j = static_cast<std::size_t>(problem.node[i]);
    if (open_share[j] == 1)
      largest = std::max(largest, material_volume[j] / problem.volume[i]);
  }
  return largest;
}

/// max |u_a| δt/h_a over the nodes that carry cones; not finite if one of their velocities or one
/// of a body is not. time_step: δt, s.
template <int Dim>
double courant_number(const DualProblem<Dim>& problem, double time_step) {
  double largest = 0;
  for (const int node : problem.node)
    for (int a = 0; a < Dim; ++a) {
      const double rate = std::abs(problem.velocity[static_cast<std::size_t>(node)][a]) *
                          problem.grid.inverse_spacing()[a];
      if (!std::isfinite(rate))
        return rate;
      largest = std::max(largest, rate);
    }
  for (const FreeBody<Dim>& body : problem.bodies)
    if (const double sum = body.velocity.sum() + body.angular_velocity.sum(); !std::isfinite(sum))
      return sum;
  return largest * time_step;
}

} // namespace talus
