// SPDX-License-Identifier: MIT
#pragma once

#include "talus/scene/collapse.hpp"

/// Collapses that tests and benchmarks share.
namespace support {

/// Run B15 of Rousseau et al. 2023, as in examples/cases/B15.toml.
inline talus::CollapseSetup b15() {
  talus::CollapseSetup setup;
  setup.inclination_deg = 15;
  setup.column_length = 0.22;
  setup.column_height = 0.11;
  setup.bed_depth = 0.02;
  setup.length = 1.52;
  setup.width = 0.06;
  setup.height = 0.15;
  setup.wall_friction = setup.gate_friction = 0.23;
  return setup;
}

/// Beads in that set-up; the parameters of a law that is not constant are left to the caller. cell:
/// along, across and up, m; time_step: s.
template <class Sim>
typename Sim::Params collapse_params(const talus::CollapseSetup& setup, const talus::Vec<3>& cell,
                                     double time_step) {
  constexpr int dim = Sim::dimension;
  typename Sim::Params params;
  params.grid = setup.grid<dim>(cell);
  params.material.density = 1470;
  params.gravity = setup.gravity_vector<dim>();
  params.time_step = time_step;
  params.faces = setup.faces<dim>();
  if constexpr (requires { params.rheology.mu; })
    params.rheology.mu = 0.44;
  params.obstacles.push_back(setup.make_gate<dim>());
  for (const auto& wall : setup.make_side_walls<dim>())
    params.obstacles.push_back(wall);
  return params;
}

} // namespace support
