// SPDX-License-Identifier: MIT
// A silo: what its floor carries, and how fast it empties.

#include "scenes.hpp"

#include "talus/boundary/obstacle.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

using namespace talus;

namespace {

constexpr double cell = 0.01, gravity = 9.81; // m, m/s²

/// The floor y = 0, with a slot around x = middle or sinking at a given speed.
class Floor final : public Obstacle<2> {
 public:
  Floor(double middle, double opening, double friction, double sink_speed)
      : middle_(middle), opening_(opening), friction_(friction), sink_speed_(sink_speed) {}
  std::optional<ObstacleContact<2>> contact(const Vec<2>& x, const Vec<2>& spacing,
                                            double) const override {
    if (x[1] > spacing[1] / 2 || std::abs(x[0] - middle_) < opening_ / 2)
      return std::nullopt;
    return ObstacleContact<2>{{0, 1}, {0, -sink_speed_}, friction_};
  }

 private:
  double middle_, opening_, friction_, sink_speed_;
};

scenes::Sim<2> silo(double width, double height, double opening, double wall_friction,
                    double sink_speed = 0) {
  auto params = scenes::box<2>({width, 0, height + 5 * cell},
                               {static_cast<int>(std::lround(width / cell)), 1,
                                static_cast<int>(std::lround(height / cell)) + 5},
                               0, 0.44);
  params.time_step = 1.6e-3;
  params.faces.lower[0] = params.faces.upper[0] = {FaceKind::frictional, wall_friction};
  params.faces.lower[1].kind = FaceKind::free;
  params.obstacles.push_back(
      std::make_shared<Floor>(width / 2, opening, wall_friction, sink_speed));
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {width, height}, {});
  return scenes::Sim<2>(params, sand);
}

/// Time in which the volume out goes from `from` to `to` (m²), s.
double seconds_to_leave(scenes::Sim<2>& sim, double& out, double to) {
  const double start = sim.time();
  while (out < to) {
    const StepReport report = sim.step();
    REQUIRE(report.completed());
    out += report.outflow_volume;
  }
  return sim.time() - start;
}

} // namespace

TEST_CASE("Janssen: above a sinking floor the walls carry the weight of what is added") {
  // p(H) = ρ g z_0 (1 − exp(−H/z_0)), z_0 = W/(2 μ_w K); K, the ratio of the mean stresses normal
  // to the walls and vertical, is measured.
  const double width = 0.1, wall_friction = 0.4;
  for (const double height : {0.2, 0.8}) {
    auto sim = silo(width, height, 0, wall_friction, 0.05);
    double floor = 0, normal = 0, shear = 0, vertical = 0, volume = 0, steps = 0;
    while (sim.time() < 0.6) {
      REQUIRE(sim.step().completed());
      if (sim.time() < 0.3)
        continue;
      ++steps;
      for (const auto& contact : sim.problem().contacts) {
        const Vec<2> force = contact.impulse / sim.time_step();
        if (contact.source == 4) {
          floor += force[1];
        } else {
          normal += force.dot(contact.normal);
          shear += force[1];
        }
      }
      for (const int node : sim.problem().node) {
        const Index<2> index = sim.grid().node_index(node);
        const double node_volume = sim.grid().node_volume(index);
        vertical += node_volume * sim.stress(index)(1, 1);
        volume += node_volume * std::min(1.0, sim.volume_fraction(index));
      }
    }
    CHECK(shear / normal == doctest::Approx(wall_friction).epsilon(0.01)); // all of it slides
    const double depth = volume / steps / width;
    const double K = normal / steps / (2 * depth) / (vertical / volume);
    CHECK(K > 0.4);
    CHECK(K < 1);
    const double decay = width / (2 * wall_friction * K);
    const double pressure = floor / steps / width, density = 1500;
    CHECK(pressure ==
          doctest::Approx(-density * gravity * decay * std::expm1(-depth / decay)).epsilon(0.04));
    if (height > 0.5) // saturated: seven eighths of it would change little
      CHECK(pressure > 0.9 * density * gravity * decay);
  }
}

TEST_CASE("a silo empties at a rate that does not depend on the height of the filling") {
  const double width = 0.3, opening = 7 * cell;
  auto sim = silo(width, 0.4, opening, 0.23);
  double out = 0;
  const double part = width * 0.4 / 8;
  seconds_to_leave(sim, out, part);
  const double early = 2 * part / seconds_to_leave(sim, out, 3 * part);
  const double late = 2 * part / seconds_to_leave(sim, out, 5 * part);
  CHECK(late == doctest::Approx(early).epsilon(0.1));
}

TEST_CASE("the rate of a silo goes with the opening to the power 3/2") {
  const auto rate = [](double opening) {
    auto sim = silo(4 * opening, 3 * opening, opening, 0.23);
    double out = 0;
    const double volume = opening * opening;
    seconds_to_leave(sim, out, volume);
    return 2 * volume / seconds_to_leave(sim, out, 3 * volume);
  };
  const double narrow = rate(7 * cell), wide = rate(15 * cell);
  CHECK(std::log(wide / narrow) / std::log(15.0 / 7) == doctest::Approx(1.5).epsilon(0.05));
}
