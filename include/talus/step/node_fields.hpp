// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/shifting.hpp"

#include <cstddef>

namespace talus {

/// What a simulation shows of the nodes after a step, beside the problem: #nodes each.
struct NodeFields {
  void start(std::size_t nodes) {
    material_volume.assign(nodes, 0);
    stress_volume.assign(nodes, 0);
    open_fraction.assign(nodes, 1);
    inertial_number.assign(nodes, 0);
  }

  void swap(NodeFields& other) noexcept {
    material_volume.swap(other.material_volume);
    stress_volume.swap(other.stress_volume);
    open_fraction.swap(other.open_fraction);
    inertial_number.swap(other.inertial_number);
    mass.swap(other.mass);
    volume_by_material.swap(other.volume_by_material);
  }

  Array<double> material_volume; ///< V_i = Σ V_p N_i, m^d
  Array<double> stress_volume;   ///< that stress acts on, m^d: V_i, or see even_volume()
  Array<double> open_fraction;   ///< of a node's volume: what no solid takes
  Array<double> inertial_number;
  // Empty if there is one material.
  Array<double> mass;               ///< Σ ρ_p V_p N_i, kg (2-D: kg/m)
  Array<double> volume_by_material; ///< V_im, #nodes × #materials, m^d
};

/// What a step computes on its way; kept for its memory alone.
template <int Dim>
struct StepWorkspace {
  void start(std::size_t nodes) {
    velocity_before.assign(nodes, NodeVec<Dim>::Zero());
    divergence.assign(nodes, 0);
    cone.assign(nodes, -1);
    excess.assign(nodes, not_inside);
    excess_beside.assign(nodes, not_inside);
    strain.assign(nodes, 0);
    pressure.assign(nodes, 0);
  }

  CellOrder<Dim> order;
  Array<CellMoments<Dim>> moments;     ///< #cells
  Array<double> corner_volumes;        ///< see material_corner_volumes
  Array<NodeVec<Dim>> velocity_before; ///< u*, #nodes, m/s
  Array<double> divergence;            ///< mean tr ∇u around a node, #nodes, 1/s
  Array<int> cone;                     ///< the cone of a node or −1, #nodes
  Array<double> excess;                ///< φ − 1 or not_inside, #nodes
  Array<double> excess_beside;         ///< the same of cohesive nodes beside solids, #nodes
  Array<double> strain;                ///< |γ̇| δt, #nodes
  Array<double> pressure;              ///< of cones, for laws that see it, #nodes, Pa
  Array<BodyContact<Dim>> touched;     ///< nodes that free bodies touch
  Array<Vec<Dim>> held_momentum;       ///< of cones at faces, N s, see measure_wrenches
  Array<ExactSum> wrench_sums;         ///< see WrenchSums
  Array<std::size_t> counts;           ///< of cones by block; of sums
  Array<double> partials;              ///< of sums and maxima
};

} // namespace talus
