// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/particles.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/wrenches.hpp"
#include "talus/transfer/transfer_scheme.hpp"

namespace talus {

/// Where a step is when it shows itself to an observer.
enum class StepStage {
  on_grid,      ///< nodes have u* and material_volume; nothing has changed yet
  on_particles, ///< the problem is solved; particles have their new fields and places
  shifted,      ///< particles have been shifted; only where the packing asks for it
  forces,       ///< λ of the nodes and the wrenches are known; bodies are where they were
  end           ///< bodies have moved; particles have left and come
};

/// A step as an observer sees it, a view. With several ranks: this one's part.
template <int Dim, class Real = double>
struct ObservedStep {
  const SolvedStep<Dim>& solved;
  const Boundaries<Dim>& bounds;
  const Particles<Dim, Real>& particles;
  ParticleField field;                ///< what of the particles' velocity fields counts
  const Array<int>& nodes;            ///< those of the box, this rank's
  const Array<Wrench<Dim>>& wrenches; ///< by boundary id, N: from StepStage::forces on
  double least_volume;                ///< Σ V_p N_i below which a node feels no stress, m^d
  const Array<double>& densities;     ///< of the materials, kg/m³
  const Execution& execution;
};

/// Something that looks on while a simulation steps (Params::observer), and changes nothing. It may
/// keep what it sees, so it serves one simulation; with several ranks each has one, and all are
/// called together. Model: EnergyBudget (talus/diagnostics/energy_budget.hpp).
template <int Dim, class Real = double>
class StepObserver {
 public:
  StepObserver() = default;
  virtual ~StepObserver() = default;
  StepObserver(const StepObserver&) = delete;
  StepObserver& operator=(const StepObserver&) = delete;

  /// Called at each stage in turn. A step that is refused ends after on_grid. What this throws
  /// arrives at the caller of step(); after on_grid restore() must come first then.
  virtual void observe(StepStage stage, const ObservedStep<Dim, Real>& step) = 0;
};

} // namespace talus
