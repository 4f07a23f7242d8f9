// SPDX-License-Identifier: MIT
// The programs of docs/concepts/boundary.md: a shape, an obstacle and a motion of one's own.

#include <talus/talus.hpp>

#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>

// [shape]
/// The sea floor in 2-D: everything below y = a cos(k x). A model of SignedDistance: the height
/// over the wave, divided by the largest slope of it, is at most the distance.
struct Ripples {
  double amplitude = 0.01, wave_number = 60; // m, 1/m

  double distance(const talus::Vec<2>& x) const {
    const double slope = amplitude * wave_number;
    return (x[1] - amplitude * std::cos(wave_number * x[0])) / std::sqrt(1 + slope * slope);
  }
};
static_assert(talus::SignedDistance<Ripples, 2>);
// [shape]

// [obstacle]
/// A conveyor belt: the floor holds its nodes and drags them along at a speed of its own, which no
/// rigid motion has.
class Belt final : public talus::Obstacle<2> {
 public:
  Belt(double height, double speed, double friction)
      : floor_({0, height}, {0, 1}), speed_(speed), friction_(friction) {}

  std::optional<talus::ObstacleContact<2>>
  contact(const talus::Vec<2>& x, const talus::Vec<2>& spacing, double /*time*/) const override {
    const auto node = look(x, spacing);
    if (!node.contact)
      return std::nullopt;
    return talus::ObstacleContact<2>{
        .normal = node.normal, .velocity = {speed_, 0}, .friction = friction_};
  }

  double open_fraction(const talus::Vec<2>& x, const talus::Vec<2>& spacing,
                       double /*time*/) const override {
    return look(x, spacing).open_fraction;
  }

  double distance(const talus::Vec<2>& x, const talus::Vec<2>& /*spacing*/, double /*time*/,
                  const talus::RigidState<2>& /*frame*/) const override {
    return floor_.distance(x); // free bodies touch it
  }

 private:
  talus::NodeInSolid<2> look(const talus::Vec<2>& x, const talus::Vec<2>& spacing) const {
    return talus::node_in_solid<2>(floor_, x, spacing);
  }

  talus::shapes::HalfSpace<2> floor_;
  double speed_, friction_;
};
// [obstacle]

int main() {
  // [use]
  using Sim = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.6, 0.3}, .cells = {60, 30}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.obstacles = {talus::make_obstacle<Belt>(0.03, 0.2, 0.4),
                      // a plough that swings about a point above the sand
                      talus::make_obstacle<talus::ShapeObstacle<2>>(
                          {.shape = talus::shapes::Capsule<2>({0, 0}, {0, -0.15}, 0.02),
                           .friction = 0.3,
                           .motion = [](double t) {
                             talus::RigidState<2> state;
                             state.position = {0.4, 0.25};
                             state.rotation =
                                 talus::rotation_by<2>(talus::Spin<2>(0.5 * std::sin(3 * t)));
                             state.angular_velocity[0] = 1.5 * std::cos(3 * t);
                             return state;
                           }})};
  // a stone that floats in the sand, or does not
  params.bodies = {talus::ball_body<2>({0.15, 0.16}, 0.03, 2600, 0.4)};

  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0.03}, {0.3, 0.12}, {.per_axis = 3});
  Sim sim(params, sand);
  while (sim.time() < 0.2) {
    const talus::StepReport report = sim.step();
    if (report.solve.status != talus::SolveStatus::converged)
      std::printf("t = %.3f s: residual %.1e\n", sim.time(), report.solve.residual.l2);
  }
  std::printf("the belt is pulled back with %.1f N/m, the stone is at x = %.3f m\n",
              -sim.obstacle_wrench(0).force[0], sim.bodies()[0].position[0]);
  // [use]

  const double above = Ripples{}.distance({0, 0.02}), below = Ripples{}.distance({0, 0});
  return above > 0 && below < 0 && sim.bodies()[0].position[0] > 0.15 ? 0 : 1;
}
