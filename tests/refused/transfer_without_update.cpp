// SPDX-License-Identifier: MIT
// A transfer scheme without update().
// says: t.update.sample, v, c

#include <talus/talus.hpp>

struct Scheme {
  struct Params {};
  static constexpr bool affine = false;
  explicit Scheme(const Params&) {}
};

talus::Simulation<3, talus::ConstantFriction, Scheme, talus::GaussSeidel<>>* simulation;
