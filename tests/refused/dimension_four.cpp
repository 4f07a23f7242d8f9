// SPDX-License-Identifier: MIT
// Four dimensions.
// says: talus: the dimension is 2 or 3

#include <talus/talus.hpp>

using Sim = talus::Simulation<4, talus::ConstantFriction, talus::Apic, talus::GaussSeidel<>>;
double time(const Sim& sim) {
  return sim.time();
}
