// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/flow_state.hpp"
#include "talus/rheology/rheology.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <type_traits>
#include <utility>

/// \file
/// Friction and cohesion of the cones, from the rheology.

namespace talus {

/// Σ_m V_m value(law m) / Σ_m V_m over the materials that a node has. volumes: V_m, m^d.
template <OfMaterials R, class Value>
double mean_by_volume(const R& rheology, const double* volumes, const Value& value) {
  double sum = 0, all = 0;
  for (int m = 0; m < rheology.materials(); ++m)
    if (volumes[m] > 0) { // a law may give infinity
      sum += volumes[m] * value(rheology.law(m));
      all += volumes[m];
    }
  return sum / all;
}

/// The cohesion of a node full of it, Pa.
template <Rheology R>
double cohesion_of(const R& law) {
  if constexpr (Cohesive<R>)
    return law.cohesion();
  else
    return 0;
}

/// Does the rheology, or that of one of its materials, have cohesion?
template <Rheology R>
constexpr bool has_cohesion() {
  if constexpr (OfMaterials<R>)
    return has_cohesion<std::remove_cvref_t<decltype(std::declval<const R&>().law(0))>>();
  else
    return Cohesive<R>;
}

/// c of a node if it is dense, Pa. volumes: of each material there, m^d; read if there are several.
template <Rheology R>
double node_cohesion([[maybe_unused]] const R& rheology, [[maybe_unused]] const double* volumes) {
  if constexpr (!has_cohesion<R>())
    return 0;
  else if constexpr (OfMaterials<R>)
    return mean_by_volume(rheology, volumes, [](const auto& law) { return cohesion_of(law); });
  else
    return rheology.cohesion();
}

/// c_i, Pa, of cone i: where the medium is dense. volume_by_material: see NodeFields; read if there
/// are several materials.
template <Rheology R, int Dim>
double cone_cohesion(const R& rheology, const DualProblem<Dim>& problem, std::size_t i,
                     [[maybe_unused]] const double* volume_by_material = nullptr) {
  if constexpr (!has_cohesion<R>()) {
    return 0;
  } else {
    if (!(problem.free_volume_rate[i] <= 0))
      return 0;
    if constexpr (OfMaterials<R>)
      volume_by_material += std::ptrdiff_t{problem.node[i]} * rheology.materials();
    return node_cohesion(rheology, volume_by_material);
  }
}

/// Normal component of δt (c_i/μ_i) I, Pa s: how far the apex of the cone lies from no stress.
/// time_step: δt, s; volume_by_material: see cone_cohesion.
template <Rheology R, int Dim>
double cone_apex(const R& rheology, const DualProblem<Dim>& problem, double time_step,
                 std::size_t i, const double* volume_by_material = nullptr) {
  const double c = cone_cohesion(rheology, problem, i, volume_by_material);
  return c > 0 ? time_step * c / problem.opening[i] : 0;
}

/// Cohesion: from λ to the λ' = λ + (c/μ) I that the cone law holds for. The velocities stay, so
/// the constant tension becomes a part of u_free.
template <Rheology R, int Dim>
void add_cohesion_shift(const R& rheology, DualProblem<Dim>& problem, double time_step,
                        [[maybe_unused]] const double* volume_by_material = nullptr) {
  if constexpr (has_cohesion<R>())
    for (std::size_t i = 0; i < problem.cones(); ++i)
      problem.stress_impulse[i][0] +=
          cone_apex(rheology, problem, time_step, i, volume_by_material);
}

/// Back from λ' to λ.
template <Rheology R, int Dim>
void remove_cohesion_shift(const R& rheology, DualProblem<Dim>& problem, double time_step,
                           [[maybe_unused]] const double* volume_by_material = nullptr) {
  if constexpr (has_cohesion<R>())
    for (std::size_t i = 0; i < problem.cones(); ++i)
      problem.stress_impulse[i][0] -=
          cone_apex(rheology, problem, time_step, i, volume_by_material);
}

/// Nodes where the rheology gave no finite μ ≥ 0, or no μ > 0 where there is cohesion. partials:
/// workspace; volume_by_material: see cone_cohesion.
template <Rheology R, int Dim>
std::size_t count_invalid_friction(const R& rheology, const DualProblem<Dim>& problem,
                                   const Execution& execution, Array<std::size_t>& partials,
                                   const double* volume_by_material = nullptr) {
  return execution.sum(execution.reduce(
      std::ssize(problem.node), partials, std::size_t{0},
      [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        std::size_t count = 0;
        for (std::size_t i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end);
             ++i) {
          const double mu = problem.opening[i];
          const bool some = cone_cohesion(rheology, problem, i, volume_by_material) > 0;
          count += std::isfinite(mu) && (some ? mu > 0 : mu >= 0) ? 0U : 1U;
        }
        return count;
      },
      std::plus<>()));
}

/// Does the rheology, or that of its materials, look at the pressure?
template <Rheology R, int Dim>
constexpr bool sees_pressure() {
  if constexpr (OfMaterials<R>)
    return sees_pressure<std::remove_cvref_t<decltype(std::declval<const R&>().law(0))>, Dim>();
  else
    return R::rate_dependent || SeesFlow<R, Dim>;
}

/// p of cone i from the stress λ (not λ') that the problem has, Pa. stress_volume: what stress acts
/// on at its node, m^d; time_step: δt, s.
template <int Dim>
double cone_pressure(const DualProblem<Dim>& problem, std::size_t i, double stress_volume,
                     double time_step) {
  const double share = std::min(1.0, stress_volume / problem.node_volume[i]);
  return share / time_step * mean_from_normal<Dim>(problem.stress_impulse[i][0]);
}

/// The mean pressure over a node and its neighbours, Pa, by the volumes V that stress acts on
/// there: \f[ \bar p = Σ_k w_k V_k p_k / Σ_k w_k V_k, \f] w: see Grid::neighbour_weight. A law gets
/// this one, since the pressure of single nodes alternates from one to the next and from step to
/// step: μ(p) is convex, so that the mean of μ is above μ of the mean. pressure: Pa, volume: m^d,
/// #nodes each.
template <int Dim>
double mean_pressure(const Grid<Dim>& grid, int node, const Array<double>& pressure,
                     const Array<double>& volume) {
  double sum = 0, volumes = 0;
  for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
    const int neighbour = node + grid.neighbour_offset(k);
    const double part = Grid<Dim>::neighbour_weight(k) * volume[neighbour]; // 0 without a cone
    sum += part * pressure[neighbour];
    volumes += part;
  }
  return sum / volumes;
}

/// What a law sees of cone i, but for the place, from the velocities that the problem has. Of its
/// node, m^d: material_volume Σ V_p N_i, stress_volume what stress acts on. pressure: Pa, see
/// mean_pressure.
template <int Dim>
FlowState<Dim> cone_flow(const DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                         std::size_t i, double material_volume, double stress_volume,
                         double pressure) {
  FlowState<Dim> flow;
  flow.strain_rate = integrated_strain_rate(problem, stencil, i).norm() / stress_volume;
  flow.volume_fraction = material_volume / problem.node_volume[i];
  flow.pressure = pressure;
  return flow;
}

/// I of a law. cohesion: c of the node, Pa.
template <Rheology R, int Dim>
double flow_inertial_number(const R& law, const FlowState<Dim>& flow, double cohesion) {
  double pressure = flow.pressure;
  if (cohesion > 0) // what presses the grains together
    pressure += cohesion / law.friction(0);
  return law.inertial_number()(flow.strain_rate, pressure);
}

/// μ of a node full of one material, and its I: 0 if the law does not say with which one.
struct FlowFriction {
  double friction = 0, inertial_number = 0;
};

/// dense: has it its cohesion?
template <Rheology R, int Dim>
FlowFriction flow_friction(const R& law, const FlowState<Dim>& flow, bool dense) {
  if constexpr (SeesFlow<R, Dim>) {
    return {law.friction(flow), 0};
  } else {
    double I = 0;
    if constexpr (R::rate_dependent)
      I = flow_inertial_number(law, flow, dense ? cohesion_of(law) : 0);
    return {law.friction(I), I};
  }
}

/// The means over the volumes V_m (m^d) that a node has of each material; see Materials. Friction
/// is NaN if a law gives no finite μ ≥ 0, which others might hide.
template <OfMaterials R, int Dim>
FlowFriction flow_friction(const R& rheology, const FlowState<Dim>& flow, bool dense,
                           const double* volumes) {
  FlowFriction mean;
  mean.friction = mean_by_volume(rheology, volumes, [&](const auto& law) {
    const double mu = flow_friction(law, flow, dense).friction;
    return mu >= 0 && std::isfinite(mu) ? mu : not_given;
  });
  mean.inertial_number = mean_by_volume(rheology, volumes, [&](const auto& law) {
    return flow_friction(law, flow, dense).inertial_number;
  });
  return mean;
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
