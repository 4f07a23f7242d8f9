// SPDX-License-Identifier: MIT
// A parameter that the friction law does not have.
// says: ConstantFriction::Params

#include <talus/talus.hpp>

using Sim = talus::Simulation<2, talus::ConstantFriction, talus::Apic, talus::GaussSeidel<>>;

void set(Sim::Params& params) {
  params.rheology = {.mu_static = 0.3};
}
