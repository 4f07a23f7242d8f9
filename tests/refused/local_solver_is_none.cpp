// SPDX-License-Identifier: MIT
// A Gauss-Seidel solver of cones by something that solves no cone.
// says: LocalSolver|Workspace

#include <talus/talus.hpp>

struct Nothing {
  struct Params {};
  explicit Nothing(const Params&) {}
};

talus::Simulation<2, talus::ConstantFriction, talus::Apic, talus::GaussSeidel<Nothing>>* simulation;
