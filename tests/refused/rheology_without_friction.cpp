// SPDX-License-Identifier: MIT
// A friction law that does not say the friction.
// says: r.friction.inertial_number

#include <talus/talus.hpp>

struct Law {
  struct Params {};
  static constexpr bool rate_dependent = false;
  explicit Law(const Params&) {}
};

talus::Simulation<2, Law, talus::Apic, talus::GaussSeidel<>>* simulation;
