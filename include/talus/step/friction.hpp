// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/rheology.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>

/// \file
/// Friction and cohesion of the cones, from the rheology.

namespace talus {

/// c_i, Pa, of cone i: where the medium is dense.
template <Rheology R, int Dim>
double cone_cohesion(const R& rheology, const DualProblem<Dim>& problem, std::size_t i) {
  if constexpr (Cohesive<R>)
    return problem.free_volume_rate[i] <= 0 ? rheology.cohesion() : 0;
  else
    return 0;
}

/// Normal component of δt (c_i/μ_i) I, Pa s: how far the apex of the cone lies from no stress.
/// time_step: δt, s.
template <Rheology R, int Dim>
double cone_apex(const R& rheology, const DualProblem<Dim>& problem, double time_step,
                 std::size_t i) {
  const double c = cone_cohesion(rheology, problem, i);
  return c > 0 ? time_step * c / problem.opening[i] : 0;
}

/// Cohesion: from λ to the λ' = λ + (c/μ) I that the cone law holds for. The velocities stay, so
/// the constant tension becomes a part of u_free.
template <Rheology R, int Dim>
void add_cohesion_shift(const R& rheology, DualProblem<Dim>& problem, double time_step) {
  if constexpr (Cohesive<R>)
    for (std::size_t i = 0; i < problem.cones(); ++i)
      problem.stress_impulse[i][0] += cone_apex(rheology, problem, time_step, i);
}

/// Back from λ' to λ.
template <Rheology R, int Dim>
void remove_cohesion_shift(const R& rheology, DualProblem<Dim>& problem, double time_step) {
  if constexpr (Cohesive<R>)
    for (std::size_t i = 0; i < problem.cones(); ++i)
      problem.stress_impulse[i][0] -= cone_apex(rheology, problem, time_step, i);
}

/// Nodes where the rheology gave no finite μ ≥ 0, or no μ > 0 where there is cohesion. partials:
/// workspace.
template <Rheology R, int Dim>
std::size_t count_invalid_friction(const R& rheology, const DualProblem<Dim>& problem,
                                   const Execution& execution, Array<std::size_t>& partials) {
  return execution.sum(execution.reduce(
      std::ssize(problem.node), partials, std::size_t{0},
      [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        std::size_t count = 0;
        for (std::size_t i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end);
             ++i) {
          const double mu = problem.opening[i];
          const bool some = cone_cohesion(rheology, problem, i) > 0;
          count += std::isfinite(mu) && (some ? mu > 0 : mu >= 0) ? 0U : 1U;
        }
        return count;
      },
      std::plus<>()));
}

/// I_i from the velocities and the stress λ (not λ') that the problem has. material_volume:
/// Σ V_p N_i of its node, m^d; time_step: δt, s.
template <Rheology R, int Dim>
double cone_inertial_number(const R& rheology, const DualProblem<Dim>& problem,
                            const Stencil<Dim>& stencil, std::size_t i, double material_volume,
                            double time_step) {
  const double rate = integrated_strain_rate(problem, stencil, i).norm() / material_volume;
  const double share = std::min(1.0, material_volume / problem.node_volume[i]); // φ
  double pressure = share / time_step * mean_from_normal<Dim>(problem.stress_impulse[i][0]);
  const double cohesion = cone_cohesion(rheology, problem, i);
  if (cohesion > 0) // what presses the grains together
    pressure += cohesion / rheology.friction(0);
  return rheology.inertial_number()(rate, pressure);
}

/// The iteration between friction and solution: μ_i ← μ_i + relaxation (μ(I_i) − μ_i). The
/// relaxation halves when the changes do not.
class FrictionIteration {
 public:
  Array<double> next; ///< μ̃ from the rheology, #cones; to be filled before each update

  /// The change that all of next would make to the yield stress μ p, relative, in the mean square.
  template <int Dim>
  double change(const DualProblem<Dim>& problem, const Execution& execution) {
    const auto of_block = [&](const Block& block, double* of) {
      double change2 = 0, sum2 = 0;
      for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
        const double pressure = problem.stress_impulse[i][0];
        const double by = (next[i] - problem.opening[i]) * pressure;
        const double yield = problem.opening[i] * pressure;
        change2 += by * by;
        sum2 += yield * yield;
      }
      of[0] = change2;
      of[1] = sum2;
    };
    const auto sums = sum_over_blocks<2>(problem, execution, partials_, of_block);
    return sums[1] > 0 ? std::sqrt(sums[0] / sums[1]) : 0;
  }

  /// Chooses the relaxation. first: of this step; change, last_change: see change().
  void choose_relaxation(bool first, double change, double last_change) {
    if (first)
      relaxation_ = 1;
    else if (change > last_change / 2) // too slow, or going back and forth
      relaxation_ /= 2;
  }

  template <int Dim>
  void update(DualProblem<Dim>& problem) const {
    for (std::size_t i = 0; i < problem.cones(); ++i)
      problem.opening[i] += relaxation_ * (next[i] - problem.opening[i]);
  }

 private:
  double relaxation_ = 1;
  Array<double> partials_;
};

} // namespace talus
