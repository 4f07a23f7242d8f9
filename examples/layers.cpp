// SPDX-License-Identifier: MIT
//
// A column of two materials collapses: glass beads on granules, of the frictions and densities that
// Rousseau et al., J. Fluid Mech. 2023, measured. How far each runs out.

#include "support/scene.hpp"

#include "talus/diagnostics/deposit.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/rheology/materials.hpp"
#include "talus/scene/region.hpp"

#include <cmath>
#include <cstddef>
#include <string>

namespace {

template <int Dim>
using Layers = support::OnRanks<talus::Simulation<Dim, talus::Materials<talus::ConstantFriction>,
                                                  talus::PolyPic, talus::GaussSeidel<>>>;

/// The particles of one material.
template <int Dim>
talus::Particles<Dim> of_material(const talus::Particles<Dim>& all, int material) {
  talus::Particles<Dim> some;
  for (std::size_t p = 0; p < all.size(); ++p)
    if ((all.material.empty() ? 0 : all.material[p]) == material)
      some.add(all.position[p], all.velocity[p], all.volume[p]);
  return some;
}

} // namespace

int main(int argc, char** argv) {
  double length = 0.1, height = 0.15, share = 0.5;                    // m
  double lower_friction = 0.75, lower_density = 1520, density = 1470; // kg/m³
  support::Scene scene("layers", "A column of two materials collapses: beads on granules.");
  scene.run.end_time = 1;
  scene.without({"wall-friction"}); // the walls are smooth
  scene.option("--column-length", length, "column_length_m", "m");
  scene.option("--column-height", height, "column_height_m", "m");
  scene.option("--lower-share", share, "lower_share",
               "Of the height, of the lower material, 0 to 1");
  scene.option("--lower-friction", lower_friction, "lower_friction",
               "Of the lower material; --friction is that of the upper one");
  scene.option("--lower-density", lower_density, "lower_density", "kg/m³");
  scene.option("--density", density, "density", "Of the upper material, kg/m³");
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    constexpr int up = dim - 1;
    if (!(share > 0 && share < 1))
      talus::throw_invalid("--lower-share", share, "a number between 0 and 1");
    auto params = scene.box<dim, Layers<dim>>({6 * length, 0.05, 1.1 * height});
    params.rheology.list = {{.density = lower_density, .law = {.mu = lower_friction}},
                            {.density = density, .law = {.mu = scene.friction}}};
    for (std::size_t a = 0; a + 1 < dim; ++a) // no friction at the sides
      params.faces.lower[a] = params.faces.upper[a] = {talus::FaceKind::free_slip};
    const talus::Grid<dim> grid(params.grid);
    talus::Particles<dim> sand;
    for (const int m : {0, 1}) {
      talus::Vec<dim> lower = grid.origin(), upper = grid.upper();
      upper[0] = length;
      lower[up] = m == 0 ? 0 : share * height;
      upper[up] = m == 0 ? share * height : height;
      talus::Seeding seeding = scene.seeding;
      seeding.material = m;
      fill_box(sand, grid, lower, upper, seeding);
    }
    const double volume[] = {talus::total_volume(sand, 0), talus::total_volume(sand, 1)};
    Layers<dim> sim(params, sand);
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& fronts = run.series("fronts.csv", {"time_s", "lower_m", "upper_m", "speed_max_m_s"});
    const auto front = [&](int m) { // where all but a hundredth lies
      return talus::volume_quantile(of_material(sim.particles(), m), 0.99);
    };
    while (run.advance())
      if (run.sample_due())
        fronts.row(run.time(), front(0), front(1), talus::largest_speed(sim));

    const double lower = front(0), upper = front(1);
    const double change =
        total_volume(sim.particles(), 0) - volume[0] + total_volume(sim.particles(), 1) - volume[1];
    const auto curve = [&](const char* label, const char* column) {
      return nlohmann::json{
          {"kind", "line"}, {"label", label}, {"x", fronts["time_s"]}, {"y", fronts[column]}};
    };
    auto picture = support::picture(
        "Two materials collapse",
        support::text("fronts at the end: upper material (friction %.2f) %.3f m, lower one (%.2f) "
                      "%.3f m",
                      scene.friction, upper, lower_friction, lower));
    picture["panels"] = {
        {{"x", "time (s)"},
         {"y", "front (m)"},
         {"curves", {curve("upper material", "upper_m"), curve("lower material", "lower_m")}}}};
    return run.finish(
        {{"front_lower_m", lower},
         {"front_upper_m", upper},
         {"centre_height_lower_m", talus::centre_of_mass(of_material(sim.particles(), 0))[up]},
         {"centre_height_upper_m", talus::centre_of_mass(of_material(sim.particles(), 1))[up]},
         {"volume_change", change},
         {"speed_max_m_s", talus::largest_speed(sim)}},
        picture);
  });
}
