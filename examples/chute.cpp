// SPDX-License-Identifier: MIT
//
// Steady flow down a rough incline without end, with friction µ(I): in 2-D Bagnold's profile; in
// 3-D between side walls, which carry a part of the weight, so that a layer at the surface flows,
// beside the law of the means across (Jop, Forterre & Pouliquen, J. Fluid Mech. 541, 2005). That
// leaves out the shear across, and flows less: tests/tools/chute_between_walls.py has the local law
// in all of the section.

#include "support/scene.hpp"

#include "talus/diagnostics/profile.hpp"

#include <cmath>
#include <numbers>
#include <vector>

namespace {

template <int Dim>
using Sim =
    support::OnRanks<talus::Simulation<Dim, talus::MuOfI, talus::PolyPic, talus::GaussSeidel<>>>;

/// The flow as far as it is known: pressure rises with the depth y below the surface as ρ g cos θ
/// y, and the friction that is left for the material is tan θ − µ_w y/W.
struct Law {
  talus::MuOfICurve curve;
  double tangent, wall_share; // tan θ, µ_w/W (1/m; 0 without walls)
  double rate;                // shear rate over I sqrt(y), 1/(s sqrt(m))

  double shear_rate(double y) const {
    const double mu = tangent - wall_share * y;
    return mu > curve.mu_static
               ? rate * std::sqrt(y) * curve.I_0 * (mu - curve.mu_static) / (curve.mu_limit - mu)
               : 0;
  }
  /// Velocity at depth y in a layer of depth `depth`, m/s.
  double velocity(double y, double depth) const {
    constexpr int parts = 2000;
    const double step = (depth - y) / parts;
    double sum = 0;
    for (int k = 0; k < parts; ++k)
      sum += shear_rate(y + (k + 0.5) * step) * step;
    return sum;
  }
};

/// Velocity along the slope at each row of nodes above the floor, the mean across, m/s.
template <int Dim>
std::vector<double> profile(const Sim<Dim>& sim, int rows) {
  std::vector<double> speeds;
  for (int k = 0; k <= rows; ++k) {
    talus::Index<Dim> node{};
    node[talus::up_axis<Dim>] = k;
    double sum = 0;
    if constexpr (Dim == 2) {
      sum = sim.velocity(node)[0];
    } else {
      const int across = sim.grid().cells(1);
      for (node[1] = 0; node[1] <= across; ++node[1])
        sum += sim.velocity(node)[0] / across * (node[1] == 0 || node[1] == across ? 0.5 : 1);
    }
    speeds.push_back(sum);
  }
  return speeds;
}

} // namespace

int main(int argc, char** argv) {
  double angle = 26, depth = 0.03, width = 0.04, length = 1, diameter = 5.3e-4, packing = 0.6;
  double mu_static = 0.38, mu_limit = 0.64, I_0 = 0.279;
  support::Scene scene("chute", "Steady flow down a rough incline without end, friction mu(I).");
  scene.cell = 0.0025;
  scene.packing.even = true; // it is sheared by many times its height
  scene.run.end_time = 30;
  scene.run.sample_interval = 0.05;
  scene.run.snapshot_interval = 0.5;
  scene.option("--angle", angle, "angle_deg", "Of the incline, degrees");
  scene.option("--depth", depth, "depth_m", "Of the layer, m");
  scene.option("--width", width, "width_m", "Between the side walls, m; 3-D");
  scene.option("--length", length, "length_cells", "Of the box, cells");
  scene.option("--grain-diameter", diameter, "grain_diameter_m", "m");
  scene.option("--grain-share", packing, "grain_volume_fraction", "Of the grains in the medium");
  scene.option("--mu-static", mu_static, "mu_static", "mu(I) at I = 0");
  scene.option("--mu-limit", mu_limit, "mu_limit", "mu(I) at large I");
  scene.option("--I-0", I_0, "I_0", "Where mu(I) is half way");
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    constexpr int up = talus::up_axis<dim>;
    const double slope = angle * std::numbers::pi / 180;
    talus::require_positive("--depth", depth);
    talus::require_positive("--grain-share", packing);
    if (!(length >= 1))
      talus::throw_invalid("--length", length, "a number >= 1");
    if (!(std::tan(slope) > mu_static && std::tan(slope) < mu_limit))
      talus::throw_invalid("--angle", angle,
                           "between atan(--mu-static) and atan(--mu-limit): else nothing flows, or "
                           "nothing is steady");
    auto params = scene.box<dim, Sim<dim>>({length * scene.cell, width, depth + 2 * scene.cell});
    params.faces.lower[0] = params.faces.upper[0] = {talus::FaceKind::periodic};
    params.gravity = 9.81 * (std::sin(slope) * talus::Vec<dim>::Unit(0) -
                             std::cos(slope) * talus::Vec<dim>::Unit(up));
    params.rheology = {.law = {.mu_static = mu_static, .mu_limit = mu_limit, .I_0 = I_0},
                       .inertial = {.grain_diameter = diameter,
                                    .density = scene.density / packing,
                                    .strain_factor = 2}};
    talus::Particles<dim> sand;
    talus::fill_bed(sand, talus::Grid<dim>(params.grid), depth, scene.seeding);
    Sim<dim> sim(params, sand);
    const Law law{params.rheology.law, std::tan(slope), dim == 3 ? scene.wall_friction / width : 0,
                  std::sqrt(packing * 9.81 * std::cos(slope)) / diameter};
    const int rows = static_cast<int>(std::lround(depth / sim.grid().spacing()[up]));
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& series = run.series("surface.csv", {"time_s", "speed_m_s"});
    constexpr double enough = 2e-3, interval = 1; // relative change of the speed in that time, s
    while (run.advance())
      if (run.sample_due()) {
        const double now = profile(sim, rows).back();
        series.row(run.time(), now);
        const std::size_t before = static_cast<std::size_t>(interval / scene.run.sample_interval);
        const auto& speeds = series["speed_m_s"];
        if (speeds.size() > before && now > 0 &&
            std::abs(now - speeds[speeds.size() - 1 - before]) < enough * now)
          run.stop();
      }

    std::vector<double> height, exact;
    const std::vector<double> speed = profile(sim, rows);
    double error = 0, flux = 0, flux_law = 0;
    for (int k = 0; k <= rows; ++k) {
      const double z = depth * k / rows, share = (k == 0 || k == rows ? 0.5 : 1) * depth / rows;
      height.push_back(1000 * z);
      exact.push_back(law.velocity(depth - z, depth));
      const std::size_t row = static_cast<std::size_t>(k);
      error = std::max(error, std::abs(speed[row] - exact[row]));
      flux += share * speed[row];
      flux_law += share * exact[row];
    }
    const char* name =
        dim == 2 ? "Bagnold's profile" : "mu(I) of the means across (Jop et al. 2005)";
    auto picture =
        support::picture("Chute",
                         support::text("surface %.3f m/s, law %.3f m/s; largest difference %.1f %%",
                                       speed.back(), exact.back(), 100 * error / exact.back()),
                         "velocity (m/s)", speed, "height (mm)", height);
    picture["panels"][0]["curves"].push_back(
        {{"kind", "dashed"}, {"label", name}, {"x", exact}, {"y", height}});
    return run.finish({{"surface_speed_m_s", speed.back()},
                       {"surface_speed_law_m_s", exact.back()},
                       {"flux_m2_s", flux},
                       {"flux_law_m2_s", flux_law},
                       {"profile_difference", error / exact.back()}},
                      picture);
  });
}
