// SPDX-License-Identifier: MIT
// The program of docs/how-to/energy.md: a block of sand falls over, and where its energy goes.

#include <talus/diagnostics/energy_budget.hpp>
#include <talus/talus.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <memory>

// [observer]
/// Remembers the largest force on the floor.
class Hardest : public talus::StepObserver<2> {
 public:
  void observe(talus::StepStage stage, const talus::ObservedStep<2>& step) override {
    if (stage == talus::StepStage::forces)
      largest = std::max(largest, -step.wrenches[talus::Boundaries<2>::face_id(1, false)].force[1]);
  }
  double largest = 0; ///< N/m
};
// [observer]

using Sim = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;

Sim::Params scene() {
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.6, 0.2}, .cells = {60, 20}}; // m
  params.material.density = 1500;                                          // kg/m³
  params.gravity = {0, -9.81};                                             // m/s²
  params.time_step = 1e-3;                                                 // s
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::frictional, 0.3};
  params.faces.upper[1] = {talus::FaceKind::open};
  return params;
}

int main() {
  Sim::Params params = scene();
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0}, {0.1, 0.15}, {.per_axis = 3});
  // [watch]
  const auto budget = std::make_shared<talus::EnergyBudget<2>>();
  params.observer = budget;
  Sim sim(params, sand);
  while (sim.time() < 0.5)
    if (!sim.step().completed())
      return 1;

  const talus::EnergyRecord& record = budget->record(); // of all steps; last(): of the last one
  const talus::EnergyTerms& all = record.total;
  const std::size_t floor = talus::Boundaries<2>::face_id(1, false);
  std::printf("potential energy lost %.2f J/m, still moving %.4f J/m\n",
              record.start.potential - record.now.potential,
              record.now.kinetic + record.now.within);
  std::printf("friction of the sand %.2f, floor %.2f, impact %.2f, solver %.4f J/m\n", all.friction,
              all.boundaries[floor].sum(), all.impact, all.solver_error);
  std::printf("what does not add up: %.1e of the whole\n", record.largest_closure);
  // [watch]
  const auto hardest = std::make_shared<Hardest>();
  params.observer = hardest;
  Sim again(params, sand);
  while (again.time() < 0.2)
    if (!again.step().completed())
      return 1;
  std::printf("the floor carried at most %.0f N/m\n", hardest->largest);
  return record.largest_closure < 1e-12 && hardest->largest > 0 ? 0 : 1;
}
