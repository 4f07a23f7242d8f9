// SPDX-License-Identifier: MIT
// A solver of one cone where that of the whole problem belongs.
// says: no .*Workspace.* in .*SecularSolver

#include <talus/talus.hpp>

talus::Simulation<3, talus::ConstantFriction, talus::Apic, talus::SecularSolver>* simulation;
