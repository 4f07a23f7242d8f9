// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

namespace talus {

/// What a friction law may see of a node, from the velocities and the stress of the last solve.
template <int Dim>
struct FlowState {
  Vec<Dim> position = Vec<Dim>::Zero(); ///< m
  double strain_rate = 0;               ///< ‖D‖ = sqrt(D:D/2), 1/s: half of the shear rate
  double pressure = 0;        ///< p = −Tr σ/d, Pa, the mean over the node and its neighbours
  double volume_fraction = 0; ///< φ; 1 is dense
};

} // namespace talus
