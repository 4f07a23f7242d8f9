// SPDX-License-Identifier: MIT
#pragma once

#include "talus/solver/solver.hpp"
#include "talus/solver/viscous_solver.hpp"

#include <cstddef>

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
  int friction_updates = 1;   ///< how often μ_i was taken from the rheology
  double friction_change = 0; ///< relative change of μ p by the last update, or by the one left out
  std::size_t cones = 0, contacts = 0;
  std::size_t invalid_friction = 0; ///< nodes whose friction law gave no finite μ ≥ 0
  std::size_t outflow = 0;          ///< particles that left through free faces in this step
  double outflow_volume = 0;        ///< m^d

  /// False if the step was refused because numbers were not finite or friction was invalid;
  /// particles and time are as before.
  bool completed() const { return solve.status != SolveStatus::not_finite; }
};

} // namespace talus
