// SPDX-License-Identifier: MIT
// The programs of docs/concepts/rheology.md: friction laws of one's own, cohesion and viscosity.

#include <talus/talus.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

// [curve]
/// μ(I) with a term that goes on rising: μ_s + (μ_2 − μ_s)/(1 + I_0/I) + b I, up to a largest μ.
struct RisingFriction {
  double mu_static = 0.38, mu_limit = 0.64, I_0 = 0.279, b = 0.1, largest = 1;

  void validate() const { // optional
    talus::require_positive("rheology.law.I_0", I_0);
    talus::require_non_negative("rheology.law.b", b);
  }
  double operator()(double I) const {
    if (!(I > 0))
      return mu_static;
    return std::min(largest, mu_static + (mu_limit - mu_static) / (1 + I_0 / I) + b * I);
  }
};
static_assert(talus::FrictionFunction<RisingFriction>);
// [curve]

// [rheology]
/// A rheology from scratch: friction that does not depend on the flow, given as an angle.
struct RestAngle {
  struct Params {
    double degrees = 25;
  };
  static constexpr bool rate_dependent = false;

  explicit RestAngle(const Params& params) : mu(std::tan(params.degrees * 3.14159265 / 180)) {
    talus::require_non_negative("rheology.degrees", params.degrees);
  }
  double friction(double /*I*/) const { return mu; }

  double mu;
};
static_assert(talus::Rheology<RestAngle>);
// [rheology]

template <class Rheology>
using Sim = talus::Simulation<2, Rheology, talus::PolyPic, talus::GaussSeidel<>>;

/// Where the front of a column is after 0.2 s.
template <class Rheology>
double front(const typename Rheology::Params& rheology) {
  typename Sim<Rheology>::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {20, 10}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 2e-3;
  params.rheology = rheology;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[1] = {talus::FaceKind::open};
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0}, {0.1, 0.15}, {});
  Sim<Rheology> sim(params, sand);
  while (sim.time() < 0.2)
    if (!sim.step().completed())
      return 0;
  return talus::front_position(talus::measure_profile(sim), 0.01);
}

int main() {
  // [use]
  const talus::InertialNumber beads{.grain_diameter = 5e-4, .density = 1500, .strain_factor = 1};
  using Mine = talus::FrictionLaw<RisingFriction>;
  const double mine = front<Mine>({.law = {.b = 0.2}, .inertial = beads});

  const double at_rest = 0.4;
  const auto rises = [at_rest](double I) { return at_rest + std::min(I, 0.3); };
  using Line = talus::FrictionLaw<decltype(rises)>;
  const double line = front<Line>({.law = rises, .inertial = beads});
  // [use]

  // [additions]
  using Mud = talus::WithViscosity<talus::WithCohesion<talus::MuOfI>>;
  const double mud = front<Mud>({.law = {.mu_static = 0.3, .mu_limit = 0.6, .I_0 = 0.3},
                                 .inertial = beads,
                                 .cohesion = 150,  // Pa
                                 .viscosity = 5}); // Pa s
  // [additions]

  const double angle = front<RestAngle>({.degrees = 23.75});
  std::printf("front after 0.2 s: %.3f m rising, %.3f m line, %.3f m mud, %.3f m angle\n", mine,
              line, mud, angle);
  return mine > 0.1 && line > 0.1 && mud > 0.1 && mud < angle ? 0 : 1;
}
