// SPDX-License-Identifier: MIT
// A law that depends on the rate but does not say with which inertial number.
// says: r.inertial_number

#include <talus/talus.hpp>

struct Law {
  struct Params {};
  static constexpr bool rate_dependent = true;
  explicit Law(const Params&) {}
  double friction(double) const { return 0.4; }
};

talus::Simulation<2, Law, talus::Apic, talus::GaussSeidel<>>* simulation;
