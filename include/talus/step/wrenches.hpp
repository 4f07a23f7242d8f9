// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/faces.hpp"
#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/node_fields.hpp"
#include "talus/transfer/cell_moments.hpp"

#include <cstddef>
#include <iterator>

/// \file
/// Force and torque on all that bounds the material.

namespace talus {

/// A step's problem with its solution, and what the nodes had before; a view.
template <int Dim>
struct SolvedStep {
  const DualProblem<Dim>& problem;
  const Array<Vec<symmetric_size<Dim>>>& stress_impulse; ///< λ, #nodes, Pa s
  const NodeFields& fields;
  const StepWorkspace<Dim>& work;
  const ViscousSolver<Dim>& viscous;
  double density;   ///< kg/m³, if there is one material
  double time_step; ///< δt, s
  Vec<Dim> gravity; ///< m/s²

  double mass(int node) const { ///< m_j, kg (2-D: kg/m)
    return fields.mass.empty() ? density * fields.material_volume[node] : fields.mass[node];
  }
};

/// The momentum that a node of the grid would have if no face held it, N s (per metre in 2-D):
/// m_j (u*_j + δt g) + Σ_i Λ_i g_ij, and what the viscous stress gives.
template <int Dim>
Vec<Dim> momentum_if_free(const SolvedStep<Dim>& step, int node) {
  constexpr int neighbours = Grid<Dim>::neighbours;
  const DualProblem<Dim>& problem = step.problem;
  const Vec<Dim> before = step.work.velocity_before[node].template head<Dim>();
  Vec<Dim> momentum = step.mass(node) * (before + step.time_step * step.gravity);
  for (int k = 0; k < neighbours; ++k) {
    const int other = node + problem.grid.neighbour_offset(k);
    const Vec<symmetric_size<Dim>>& stress = step.stress_impulse[other];
    const int cone = step.work.cone[other];
    GradientWeights<Dim> of_other;
    const GradientWeights<Dim>* weights = &of_other;
    if (cone >= 0) {
      weights = &problem.gradient_weights[cone];
    } else if (problem.copies.halo() && !stress.isZero(0)) {
      // another rank's: of its g_ij those towards this node come from cells that are here
      const Index<Dim> index = problem.grid.owner(problem.grid.node_index(other));
      double stressed = 0; // not asked for
      gather_coupling(problem.grid, index, step.work.order, step.work.moments, of_other, stressed);
    } else {
      continue;
    }
    momentum += vector_to_symmetric<Dim, double>(stress) * weights->col(neighbours - 1 - k);
  }
  return momentum + step.viscous.impulse(node);
}

/// Sums of forces and torques by boundary id, over all ranks.
template <int Dim>
class WrenchSums {
 public:
  /// sums: workspace, kept as long as this is used.
  WrenchSums(std::size_t sources, Array<ExactSum>& sums) : sums_(sums) {
    sums.assign(sources * components, ExactSum());
  }

  /// Adds a force (or an impulse) f that acts at x.
  void add(int boundary_id, const Vec<Dim>& x, const Vec<Dim>& f) {
    ExactSum* const sums = sums_.data() + components * static_cast<std::size_t>(boundary_id);
    const Spin<Dim> turn = torque<Dim>(x, f);
    for (int a = 0; a < Dim; ++a)
      sums[a].add(f[a]);
    for (int a = 0; a < spin_size<Dim>; ++a)
      sums[Dim + a].add(turn[a]);
  }

  /// All sums of all ranks times `factor`. wrenches: by boundary id.
  void write(const Execution& execution, double factor, Array<Wrench<Dim>>& wrenches) {
    execution.join(sums_.data(), static_cast<int>(sums_.size()));
    for (std::size_t s = 0; s < wrenches.size(); ++s) {
      for (int a = 0; a < Dim; ++a)
        wrenches[s].force[a] = factor * value(s, a);
      for (int a = 0; a < spin_size<Dim>; ++a)
        wrenches[s].torque[a] = factor * value(s, Dim + a);
    }
  }

 private:
  static constexpr std::size_t components = Dim + spin_size<Dim>;
  double value(std::size_t source, int component) {
    return sums_[components * source + static_cast<std::size_t>(component)].value();
  }

  Array<ExactSum>& sums_;
};

/// Calls visit(axis, boundary id, how many share it) for the faces that hold a component of a
/// node's velocity. Where several faces that stick meet, they share the tangential components of
/// their common nodes. inverse_mass: the node's, 0 where held.
template <int Dim, class Visit>
void for_each_holding_face(const Boundaries<Dim>& bounds, int node,
                           const NodeVec<Dim>& inverse_mass, const Visit& visit) {
  const Index<Dim> index = bounds.grid.node_index(node);
  for (int a = 0; a < Dim; ++a) {
    if (inverse_mass[a] != 0)
      continue;
    SmallArray<int, Dim> faces;
    int count = 0;
    bool normal = false;
    for_each_face(bounds.grid, bounds.faces, index, [&](int axis, bool upper, const Face& face) {
      const bool holds = face.kind == FaceKind::no_slip || face.kind == FaceKind::free_slip;
      if (holds && axis == a) {
        faces[0] = bounds.face_id(axis, upper);
        count = 1;
        normal = true;
      } else if (!normal && face.kind == FaceKind::no_slip) {
        faces[count++] = bounds.face_id(axis, upper);
      }
    });
    for (int k = 0; k < count; ++k)
      visit(a, faces[k], count);
  }
}

/// Gives the momentum of a node to the faces that hold it.
template <int Dim>
void add_to_holding_faces(const Boundaries<Dim>& bounds, int node, const NodeVec<Dim>& inverse_mass,
                          const Vec<Dim>& momentum, WrenchSums<Dim>& sums) {
  for_each_holding_face(bounds, node, inverse_mass, [&](int a, int face, int sharing) {
    Vec<Dim> along = Vec<Dim>::Zero();
    along[a] = momentum[a] / sharing;
    sums.add(face, bounds.grid.node_position(node), along);
  });
}

/// Is the node this rank's own? node: a number in the window or beyond, see Ranks::share_contacts.
template <int Dim>
bool owns_node(const Grid<Dim>& grid, int node) {
  return node < grid.node_count() && grid.own().holds(grid.node_index(node));
}

/// What every face, obstacle and body feels, the mean over the step: the impulses of its contacts,
/// and on faces that stick or slip the momentum that the nodes on them would have without them.
/// held_momentum, wrench_sums: workspace; wrenches: by boundary id.
template <int Dim>
void measure_wrenches(const Boundaries<Dim>& bounds, const SolvedStep<Dim>& step,
                      const Execution& execution, Array<Vec<Dim>>& held_momentum,
                      Array<ExactSum>& wrench_sums, Array<Wrench<Dim>>& wrenches) {
  const DualProblem<Dim>& problem = step.problem;
  const auto is_held = [&](int node) {
    bool held = false;
    for (int a = 0; a < Dim; ++a)
      held = held || problem.inverse_mass[node][a] == 0;
    return held;
  };
  held_momentum.resize(problem.cones());
  execution.for_each(std::ssize(problem.node), [&](std::ptrdiff_t i) {
    if (is_held(problem.node[i]))
      held_momentum[i] = momentum_if_free(step, problem.node[i]);
  });
  WrenchSums<Dim> sums(wrenches.size(), wrench_sums);
  const auto add_if_held = [&](int node, const Vec<Dim>& momentum) {
    add_to_holding_faces(bounds, node, problem.inverse_mass[node], momentum, sums);
  };
  for (std::size_t i = 0; i < problem.cones(); ++i)
    if (is_held(problem.node[i]))
      add_if_held(problem.node[i], held_momentum[i]);
  for (const Contact<Dim>& contact : problem.contacts) {
    sums.add(contact.boundary_id, bounds.grid.node_position(contact.node), -contact.impulse);
    add_if_held(contact.node, contact.impulse);
  }
  for (const BodyContact<Dim>& contact : problem.body_contacts) { // all ranks have all of them
    if (contact.node >= 0 ? !owns_node(bounds.grid, contact.node) : !execution.first_rank())
      continue;
    const Vec<Dim> x = bounds.body_states[contact.body].position + contact.arm;
    sums.add(bounds.body_id(0) + contact.body, x, -contact.impulse);
    if (contact.node >= 0)
      add_if_held(contact.node, contact.impulse);
    else
      sums.add(contact.boundary_id, x, contact.impulse);
  }
  sums.write(execution, 1 / step.time_step, wrenches);
}

} // namespace talus
