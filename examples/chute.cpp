// SPDX-License-Identifier: MIT
//
// Steady flow down a rough incline without end, with friction µ(I): in 2-D Bagnold's profile; in
// 3-D between side walls, which carry a part of the weight, so that a layer at the surface flows,
// beside the law of the means across (Jop, Forterre & Pouliquen, J. Fluid Mech. 541, 2005). That
// leaves out the shear across, and flows less: tests/tools/chute_between_walls.py has the local law
// in all of the section.

#include "support/scene.hpp"

#include "talus/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
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
    return integral(y, depth, [&](double at) { return shear_rate(at); });
  }
  /// Of the layer, m²/s: ∫ u dy = ∫ y du, as u is 0 at the floor.
  double flux(double depth) const {
    return integral(0, depth, [&](double at) { return at * shear_rate(at); });
  }

 private:
  template <class Function>
  static double integral(double from, double to, const Function& f) {
    constexpr int parts = 2000;
    const double step = (to - from) / parts;
    double sum = 0;
    for (int k = 0; k < parts; ++k)
      sum += f(from + (k + 0.5) * step) * step;
    return sum;
  }
};

/// Velocity along the slope at each row of nodes from the floor up to the surface, the mean across,
/// m/s. rows: up to the surface at the start; those above material that has sunk are left out.
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
  while (speeds.size() > 2 && !(speeds.back() > 0))
    speeds.pop_back();
  return speeds;
}

/// Has the speed of the surface the same mean in the last second as in the one before?
bool is_steady(const support::Series& surface) {
  constexpr double span = 1, change = 1e-3; // s, relative
  constexpr int least = 3;                  // rows in a second
  const auto& time = surface["time_s"];
  const auto& speed = surface["speed_m_s"];
  double sum[] = {0, 0}; // of the last second, and of the one before
  int rows[] = {0, 0};
  for (std::size_t i = time.size(); i-- > 0 && time.back() - time[i] < 2 * span;) {
    const int second = time.back() - time[i] < span ? 0 : 1;
    sum[second] += speed[i];
    ++rows[second];
  }
  if (time.empty() || time.back() < 2 * span || rows[0] < least || rows[1] < least)
    return false;
  const double now = sum[0] / rows[0];
  return std::abs(now - sum[1] / rows[1]) < change * now;
}

} // namespace

int main(int argc, char** argv) {
  double angle = 26, depth = 0.03, width = 0.04, length = 1, diameter = 5.3e-4, packing = 0.6;
  double mu_static = 0.38, mu_limit = 0.64, I_0 = 0.279;
  support::Scene scene("chute", "Steady flow down a rough incline without end, friction mu(I).");
  scene.cell = 0.0025;
  scene.without({"friction"}); // it is mu(I)
  scene.packing.even = true;   // it is sheared by many times its height
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
    if (!(packing > 0 && packing <= 1))
      talus::throw_invalid("--grain-share", packing, "a number > 0, at most 1");
    if (scene.cell > depth)
      talus::throw_invalid("--cell", scene.cell, "at most --depth");
    if (dim == 2 && scene.given("--wall-friction"))
      talus::throw_invalid("--wall-friction", scene.wall_friction,
                           "nothing in 2-D: there are no side walls");
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
    const double cell = sim.grid().spacing()[up];
    const int rows = static_cast<int>(depth / cell + 1e-6); // the highest one in the layer
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    auto& series = run.series("surface.csv", {"time_s", "speed_m_s"});
    while (run.advance())
      if (run.sample_due()) {
        series.row(run.time_before(), profile(sim, rows).back());
        if (is_steady(series))
          run.stop();
      }

    std::vector<double> height, exact;
    const std::vector<double> speed = profile(sim, rows);
    const bool steady = is_steady(series);
    double error = 0, flux = 0;
    for (std::size_t k = 0; k < speed.size(); ++k) {
      const double z = cell * static_cast<double>(k);
      height.push_back(1000 * z);
      exact.push_back(law.velocity(std::max(0.0, depth - z), depth));
      error = std::max(error, std::abs(speed[k] - exact[k]));
      if (k > 0)
        flux += cell * (speed[k] + speed[k - 1]) / 2;
    }
    flux += (depth - cell * static_cast<double>(speed.size() - 1)) * speed.back();
    const char* name =
        dim == 2 ? "Bagnold's profile" : "mu(I) of the means across (Jop et al. 2005)";
    std::string fact = support::text("surface %.3f m/s, law %.3f m/s; largest difference %.1f %%",
                                     speed.back(), exact.back(), 100 * error / exact.back());
    if (!steady)
      fact += ", not yet steady";
    auto picture = support::picture("Chute", fact, "velocity (m/s)", speed, "height (mm)", height);
    picture["panels"][0]["curves"].push_back(
        {{"kind", "dashed"}, {"label", name}, {"x", exact}, {"y", height}});
    return run.finish({{"steady", steady},
                       {"surface_speed_m_s", speed.back()},
                       {"surface_speed_law_m_s", exact.back()},
                       {"flux_m2_s", flux},
                       {"flux_law_m2_s", law.flux(depth)},
                       {"profile_difference", error / exact.back()}},
                      picture);
  });
}
