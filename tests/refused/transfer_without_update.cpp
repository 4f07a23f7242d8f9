// SPDX-License-Identifier: MIT
// A transfer scheme without update().
// says: t.update.sample, field

#include <talus/talus.hpp>

struct Scheme {
  struct Params {};
  static constexpr talus::ParticleField field = talus::ParticleField::constant;
  explicit Scheme(const Params&) {}
};

talus::Simulation<3, talus::ConstantFriction, Scheme, talus::GaussSeidel<>>* simulation;
