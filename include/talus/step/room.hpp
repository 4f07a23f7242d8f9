// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/faces.hpp"
#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/packing.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/node_fields.hpp"
#include "talus/step/solids.hpp"
#include "talus/transfer/shifting.hpp"

#include <cmath>
#include <cstddef>

namespace talus {

/// Sets k_i, by how much the node of each cone may compact or must expand, see Packing. A view.
template <int Dim>
struct Room {
  Boundaries<Dim> bounds;
  const SolidsAtCones<Dim>& solids; ///< looked at before
  const Packing& packing;
  const Stencil<Dim>& stencil;
  double time_step; ///< s
  const NodeFields& fields;
  StepWorkspace<Dim>& work;
  DualProblem<Dim>& problem;

  /// Sets k_i of a cone at a surface or beside solids, or else what set_inside() needs.
  /// first_moment: Σ V_p N_i (x_p − x_i)/h by axis, m^d; cohesive: has any of the node's material
  /// cohesion?
  void set(std::size_t i, const Index<Dim>& index, const Vec<Dim>& first_moment,
           bool cohesive) const {
    const int j = problem.node[i];
    const double material = fields.material_volume[j], volume = problem.node_volume[i];
    const bool in_the_open = fields.open_fraction[j] == 1; // or a solid would look like a surface
    // Cohesion would hang what is below a surface on the air above it.
    const bool surfaces = packing.surfaces && !cohesive;
    double dense = 1, strain = 0;
    bool inside = false;
    if (in_the_open && (surfaces || cohesive)) {
      const double if_dense = dense_at(i, index, scaled<Dim>(1 / material, first_moment), cohesive);
      inside = if_dense == 1 && (packing.even || cohesive);
      if (surfaces)
        dense = if_dense;
    }
    if (material > volume || packing.even) {
      const Vec<symmetric_size<Dim>> rate = integrated_strain_rate(problem, stencil, i);
      double shear2 = 0;
      for (int k = 1; k < symmetric_size<Dim>; ++k)
        shear2 += rate[k] * rate[k];
      strain = 2 * std::sqrt(shear2) / fields.stress_volume[j] * time_step; // |γ̇|² = 4 γ_T²
    }
    work.strain[j] = strain;
    if (inside) {
      work.excess[j] = material / volume - 1;
    } else if (!in_the_open && cohesive && !has_surface(i, index)) {
      work.excess_beside[j] = material / volume - 1;
    }
    set(i, material / volume, dense, strain);
  }

  /// Sets k_i of a cone in the midst of dense material, from the packing of its neighbours as well.
  /// Beside solids that is for cohesion alone; neighbours there count by the volume that is open.
  void set_inside(std::size_t i, bool cohesive) const {
    const int j = problem.node[i];
    const bool beside = work.excess_beside[j] < not_inside;
    if (!beside && !(work.excess[j] < not_inside))
      return;
    double sum = 0, weights = 0;
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) { // ghosts are never inside
      const int neighbour = j + problem.grid.neighbour_offset(k);
      double other = work.excess[neighbour], weight = Grid<Dim>::neighbour_weight(k);
      if (beside && !(other < not_inside)) {
        other = work.excess_beside[neighbour];
        weight *= fields.open_fraction[neighbour];
      }
      if (!(other < not_inside))
        continue;
      sum += weight * other;
      weights += weight;
    }
    const double own = 1 + (beside ? work.excess_beside[j] : work.excess[j]);
    const double fraction = packing.even || own < 1 ? Packing::agreed(own, 1 + sum / weights) : own;
    const double dense = cohesive ? 1 - std::max(0.0, packing.cohesion_slack - packing.slack) : 1;
    set(i, fraction, dense, work.strain[j]);
  }

 private:
  void set(std::size_t i, double fraction, double dense, double strain) const {
    problem.free_volume_rate[i] = normal_from_mean<Dim>(packing.room(fraction, dense, strain) *
                                                        problem.node_volume[i] / (Dim * time_step));
  }

  /// Does the material of a cone's node end at a free surface along `axis`: is the next node that
  /// way (±1) emptier than that of a dense layer a cell thick (1/2), but for noise? What is empty
  /// before a closed face is a gap, not a surface; nor, if solids are asked for, is what they take.
  bool surface_towards(std::size_t cone, const Index<Dim>& index, int axis, int way,
                       bool ask_solids) const {
    const Grid<Dim>& grid = problem.grid;
    const Faces<Dim>& faces = bounds.faces;
    Index<Dim> next = index;
    next[axis] += way;
    int other = problem.node[cone] + way * grid.node_stride(axis);
    if (grid.periodic(axis)) {
      next = grid.owner(next);
      other = grid.node(next); // in another's part: its copy
    } else if (next[axis] < 0 || next[axis] > grid.cells(axis) ||
               (next[axis] == 0 && faces.lower[axis].kind != FaceKind::open) ||
               (next[axis] == grid.cells(axis) && faces.upper[axis].kind != FaceKind::open)) {
      return false;
    }
    const double open =
        ask_solids ? solids.open_share(bounds, cone, grid.node_position(next)) : 1.0;
    return fields.material_volume[other] < 0.45 * open * grid.node_volume(next);
  }

  /// Does it end along any axis, either way?
  bool has_surface(std::size_t cone, const Index<Dim>& index) const {
    for (int a = 0; a < Dim; ++a)
      for (int way = -1; way <= 1; way += 2)
        if (surface_towards(cone, index, a, way, true))
          return true;
    return false;
  }

  /// φ of a cone's node if it were dense, from where its material lies. mean: see dense_fraction.
  double dense_at(std::size_t cone, const Index<Dim>& index, Vec<Dim> mean, bool cohesive) const {
    const Grid<Dim>& grid = problem.grid;
    SmallArray<NodeSide, Dim> side;
    for (int a = 0; a < Dim; ++a) {
      side[a] = grid.periodic(a)            ? NodeSide::inside
                : index[a] == 0             ? NodeSide::on_lower_face
                : index[a] == grid.cells(a) ? NodeSide::on_upper_face
                                            : NodeSide::inside;
      const int way = side[a] == NodeSide::on_lower_face   ? 1
                      : side[a] == NodeSide::on_upper_face ? -1
                      : mean[a] > 0                        ? -1
                                                           : 1;
      if (!surface_towards(cone, index, a, way, cohesive))
        mean[a] = side[a] == NodeSide::inside ? 0 : 1;
    }
    return dense_fraction<Dim>(mean, side);
  }
};

} // namespace talus
