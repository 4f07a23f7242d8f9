// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

/// \file
/// What the floor and the walls of a silo carry (Janssen 1895).

namespace talus {

/// The balance of one step, or means over several. Stresses in Pa, positive in compression.
struct SiloLoad {
  double depth = 0;       ///< of the filling at the dense packing, H, m
  double floor = 0;       ///< normal stress on the floor
  double wall_normal = 0; ///< on the walls, over the height H
  double wall_shear = 0;  ///< on the walls, downwards
  double vertical = 0;    ///< mean σ_zz in the filling
};

/// Hydraulic diameter of the box, D = 4 area/perimeter of its horizontal section, m.
template <int Dim>
double hydraulic_diameter(const Grid<Dim>& grid) {
  const Vec<Dim>& size = grid.size();
  if constexpr (Dim == 2)
    return 2 * size[0];
  else
    return 2 * size[0] * size[1] / (size[0] + size[1]);
}

/// The load of the last step. sim: a Simulation whose box is the silo, the faces at its sides the
/// walls. floor: number of the obstacle that closes it below. Throws std::out_of_range if there is
/// no such obstacle.
template <class Sim>
SiloLoad silo_load(const Sim& sim, std::size_t floor = 0) {
  constexpr int dim = Sim::dimension, up = up_axis<dim>;
  const auto& grid = sim.grid();
  const double area = grid.size().prod() / grid.size()[up];
  double volume = 0, vertical = 0; // ∫ φ and ∫ σ_zz
  const auto& problem = sim.problem();
  for (std::size_t i = 0; i < problem.node.size(); ++i) {
    const Index<dim> index = grid.node_index(problem.node[i]);
    // What is denser than dense counts as a whole, as its weight does; stress() is that of a full
    // node there.
    volume += problem.node_volume[i] * sim.volume_fraction(index);
    vertical +=
        std::max(problem.node_volume[i], sim.stress_volume(index)) * sim.stress(index)(up, up);
  }
  SiloLoad load;
  load.depth = volume / area;
  load.floor = -sim.obstacle_wrench(floor).force[up] / area;
  if (!(volume > 0))
    return load;
  load.vertical = vertical / volume;
  const double wall = 4 * volume / hydraulic_diameter(grid); // area
  for (int a = 0; a < up; ++a)
    for (const bool upper : {false, true}) {
      const Vec<dim>& force = sim.face_wrench(a, upper).force;
      load.wall_normal += (upper ? force[a] : -force[a]) / wall;
      load.wall_shear -= force[up] / wall;
    }
  return load;
}

/// Pressure on the floor of a silo whose walls carry all that friction lets them, Pa:
///   p = ρ g z_0 (1 − exp(−H/z_0)),  z_0 = D/(4 μ_w K),
/// K the ratio of wall_normal and vertical in `load`, H its depth. hydrostatic: ρ g H, Pa, also the
/// result if μ_w or K is 0; diameter: D, the hydraulic one, m; wall_friction: μ_w.
inline double janssen_pressure(const SiloLoad& load, double hydrostatic, double diameter,
                               double wall_friction) {
  const double ratio = load.wall_normal / load.vertical;
  const double decays = 4 * wall_friction * ratio * load.depth / diameter; // H/z_0
  return decays > 0 ? -hydrostatic * std::expm1(-decays) / decays : hydrostatic;
}

} // namespace talus
