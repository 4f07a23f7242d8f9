// SPDX-License-Identifier: MIT
// The policies in the wrong order.
// says: Rheology.*Apic|Apic.*Rheology

#include <talus/talus.hpp>

talus::Simulation<2, talus::Apic, talus::ConstantFriction, talus::GaussSeidel<>>* simulation;
