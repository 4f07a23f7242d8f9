// SPDX-License-Identifier: MIT
// Where the energy goes: exact cases, and a budget that closes in all others.

#include "../support/about.hpp"
#include "../distributed/scenes.hpp"
#include "scenes.hpp"

#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/energy_budget.hpp"
#include "talus/diagnostics/totals.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <memory>

using namespace talus;

namespace {

template <class S>
std::shared_ptr<EnergyBudget<S::dimension>> watch(typename S::Params& params) {
  auto budget = std::make_shared<EnergyBudget<S::dimension>>();
  params.observer = budget;
  return budget;
}

/// Steps a scene and checks the budget of each step against the particles' own totals.
template <class S>
EnergyRecord closes(scenes::Scene<S> scene, int steps) {
  constexpr int dim = S::dimension;
  const auto budget = watch<S>(scene.params);
  S sim(scene.params, scene.particles);
  for (int k = 0; k < steps; ++k) {
    REQUIRE(sim.step().completed());
    const EnergyLevels& now = budget->record().now;
    const double density = sim.params().material.density;
    CHECK(now.kinetic == support::about(kinetic_energy(sim.particles(), density), 1e-13));
    if (!sim.grid().any_periodic())
      CHECK(now.potential ==
            support::about(potential_energy<dim>(sim.particles(), density, sim.gravity()), 1e-12));
    const MomentumTerms<dim>& momentum = budget->momentum();
    const double scale = momentum.before.norm() + momentum.after.norm() + momentum.weight.norm();
    CHECK(momentum.closure().norm() <= 1e-8 * scale);
  }
  const EnergyRecord record = budget->record();
  MESSAGE("closure " << record.largest_closure);
  EnergyLevels::for_each(record.now, [](const char* name, double x) { MESSAGE(name << " " << x); });
  EnergyTerms::for_each(record.total, [](const char* name, double x) { MESSAGE(name << " " << x); });
  for (const auto& w : record.total.boundaries)
    MESSAGE("boundary " << w.friction << " " << w.motion << " " << w.impact);
  CHECK(record.largest_closure < 1e-12);
  return record;
}

} // namespace

TEST_CASE("budget closes") {
  closes(scenes::collapse<2>(), 60);
  closes(scenes::impact<2>(), 60);
  closes(scenes::fountain<2>(), 60);
  closes(scenes::chute<2>(), 30);
}
