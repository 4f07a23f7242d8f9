// SPDX-License-Identifier: MIT
// Nodes and bodies in a step, and what it reports and refuses, against numbers worked out by hand.

#include "talus/boundary/body.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/packing.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/friction.hpp"
#include "talus/step/overfilled.hpp"
#include "talus/step/report.hpp"
#include "talus/step/room.hpp"
#include "talus/step/state.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"
#include "../support/step_scene.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace test_step_nodes {

using namespace talus;
using support::about, support::close, support::message_of, support::Scene, support::unit;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

/// D = 1/2 along x and up: ‖D‖ V = 1/2; V = v/2, φ = 1/2.
template <int Dim>
void check_inertial_number() {
  Scene<Dim> s;
  s.add_cone(2, 2);
  const double v = s.problem.node_volume[0];
  s.shear(0, v);
  const InertialNumber inertial{.grain_diameter = 0.5, .density = 2, .strain_factor = 4};
  using Sticky = WithCohesion<MuOfI>;
  const Sticky law(
      {.law = {.mu_static = 0.25, .mu_limit = 0.5, .I_0 = 1}, .inertial = inertial, .cohesion = 6});
  const MuOfI& loose = law;
  const Stencil<Dim> stencil(s.grid);
  s.problem.stress_impulse[0][0] = normal_from_mean<Dim>(2);
  const auto cone_inertial_number = [&](const auto& of, double volume) {
    const double pressure = cone_pressure(s.problem, 0, volume, 0.125);
    return flow_inertial_number(of, cone_flow(s.problem, stencil, 0, volume, volume, pressure),
                                cone_cohesion(of, s.problem, 0));
  };
  // rate = (v/2)/(v/2); p = φ 2/δt = 8 Pa
  CHECK(cone_inertial_number(loose, v / 2) == about(1));
  // twice as full as dense: rate 1/4, φ no more than 1, p = 16 Pa
  CHECK(cone_inertial_number(loose, 2 * v) == about(0.5 / std::sqrt(8)));
  // c/μ(0) = 24 Pa more
  CHECK(cone_inertial_number(law, v / 2) == about(0.5));
  s.problem.free_volume_rate[0] = 1; // come apart
  CHECK(cone_inertial_number(law, v / 2) == about(1));
}

/// k_i of the middle node as a share of its volume, > 0 to compact.
template <int Dim>
struct RoomAtNode : Scene<Dim> {
  Packing packing{.slack = 0.0625, .dilatancy = 2, .surfaces = false};
  bool cohesive = false;
  int middle = this->node(2, 2);

  RoomAtNode() { this->add_cone(2, 2); }
  Room<Dim> room() {
    this->solids.find(this->grid, this->cone, this->problem.cones()); // there are none
    return {this->bounds(), this->solids, packing,      stencil, 0.5,
            this->fields,   this->work,   this->problem};
  }
  double room_now() const { // k_N = sqrt(d/2) room v/(d δt)
    return this->problem.free_volume_rate[0] * Dim * 0.5 /
           (std::sqrt(Dim / 2.0) * this->problem.node_volume[0]);
  }
  /// fraction: φ; mean: of its material's places, in cells.
  double set(double fraction, double strain = 0, const Vec<Dim>& mean = Vec<Dim>::Zero()) {
    const double material = fraction * this->problem.node_volume[0];
    this->fields.material_volume[middle] = material;
    this->fields.stress_volume[middle] = material;
    this->shear(0, strain * material / 0.5); // |γ̇| δt = 2 (weight/2)/material δt
    room().set(0, this->index(2, 2), material * mean, cohesive);
    return room_now();
  }

 private:
  Stencil<Dim> stencil{this->grid};
};

template <int Dim>
void check_room() {
  constexpr int up = up_axis<Dim>;
  RoomAtNode<Dim> s;
  CHECK(s.set(1) == 0);
  CHECK(s.set(0.95) == 0); // within the slack
  CHECK(s.set(0.5) == about(0.4375));
  CHECK(s.set(0.5, 0.25) == about(0.4375)); // shear does not matter to what is loose
  CHECK(s.set(1.5) == 0);
  CHECK(s.set(1.5, 0.25) == about(-0.125)); // half of the strain at most
  s.packing.dilatancy = 0.5;
  CHECK(s.set(1.5, 0.25) == about(std::expm1(-0.125) * 0.4375));
  // beside a solid that leaves half of the node the same
  s.fields.open_fraction[s.middle] = 0.5;
  CHECK(s.set(1.5, 0.25) == about(std::expm1(-0.125) * 0.4375));
  s.packing.surfaces = true; // but it has no surface there
  CHECK(s.set(0.5, 0, -1.0 / 3 * unit<Dim>(up)) == about(0.4375));
  // the half space up to the node: φ = 1/2, t = -1/3
  s.fields.open_fraction[s.middle] = 1;
  CHECK(s.set(0.5, 0, -1.0 / 3 * unit<Dim>(up)) == 0);
  CHECK(s.set(0.25, 0, -1.0 / 3 * unit<Dim>(up)) == about(0.1875));
  // there is none where the next node up is filled
  s.fields.material_volume[s.node(2, 3)] = 0.46 * s.problem.node_volume[0];
  CHECK(s.set(0.5, 0, -1.0 / 3 * unit<Dim>(up)) == about(0.4375));
  s.fields.material_volume[s.node(2, 3)] = 0.44 * s.problem.node_volume[0];
  CHECK(s.set(0.5, 0, -1.0 / 3 * unit<Dim>(up)) == 0);
}

} // namespace

TEST_CASE("friction: the inertial number of a cone") {
  check_inertial_number<2>();
  check_inertial_number<3>();
}

TEST_CASE("friction: cones without a friction are counted") {
  Scene<2> s;
  for (int k = 0; k < 5; ++k)
    s.add_cone(2, k);
  s.problem.opening = {0, 0.3, -0.1, not_a_number, infinity};
  Array<std::size_t> partials;
  const auto count = [&](const auto& law) {
    return count_invalid_friction(law, s.problem, Execution(), partials);
  };
  CHECK(count(ConstantFriction({.mu = 0.3})) == 3);
  using Sticky = WithCohesion<ConstantFriction>;
  CHECK(count(Sticky({.law = {.mu = 0.3}, .cohesion = 0})) == 3);
  const Sticky sticky({.law = {.mu = 0.3}, .cohesion = 5});
  CHECK(count(sticky) == 4);         // no apex at 0
  s.problem.free_volume_rate[0] = 1; // loose: no cohesion
  CHECK(count(sticky) == 3);
}

TEST_CASE("friction: cohesion moves dense cones by δt c/μ, there and back") {
  Scene<2> s;
  s.add_cone(2, 1), s.add_cone(2, 2);
  s.problem.free_volume_rate = {-1, 1}; // the second is loose
  s.problem.stress_impulse = {{1, 2, 3}, {4, 5, 6}};
  const auto before = s.problem.stress_impulse;
  const WithCohesion<ConstantFriction> law({.law = {.mu = 0.5}, .cohesion = 8});
  add_cohesion_shift(law, s.problem, 0.25);
  CHECK(s.problem.stress_impulse == Array<Vec<3>>{{5, 2, 3}, {4, 5, 6}});
  remove_cohesion_shift(law, s.problem, 0.25);
  CHECK(s.problem.stress_impulse == before);
  add_cohesion_shift(ConstantFriction({.mu = 0.5}), s.problem, 0.25);
  CHECK(s.problem.stress_impulse == before);
}

TEST_CASE("friction: the iteration's change, relaxation and update") {
  Scene<2> s;
  s.add_cone(2, 1), s.add_cone(2, 2);
  s.problem.opening = {0.5, 0.5};
  s.problem.blocks = {{.cone_begin = 0, .cone_end = 1}, {.cone_begin = 1, .cone_end = 2}};
  FrictionIteration iteration;
  iteration.next = {1, 0.5};
  CHECK(iteration.change(s.problem, Execution()) == 0); // without stress
  s.problem.stress_impulse[0][0] = 6;
  s.problem.stress_impulse[1][0] = 8;
  CHECK(iteration.change(s.problem, Execution()) == about(3.0 / 5)); // of μ p: 3 and 0, of 3 and 4
  iteration.choose_relaxation(true, 1, 0);
  iteration.update(s.problem);
  CHECK(s.problem.opening == Array<double>{1, 0.5});
  iteration.next = {0, 0.5};
  iteration.choose_relaxation(false, 0.5, 1); // fast enough
  iteration.choose_relaxation(false, 0.51, 1);
  iteration.update(s.problem);
  CHECK(s.problem.opening == Array<double>{0.5, 0.5});
  iteration.choose_relaxation(false, 1, 1);
  iteration.update(s.problem);
  CHECK(s.problem.opening == Array<double>{0.375, 0.5});
  iteration.choose_relaxation(true, 1, 1); // of the next step
  iteration.update(s.problem);
  CHECK(s.problem.opening == Array<double>{0, 0.5});
}

TEST_CASE("room: dense, loose and overpacked nodes, beside solids and at surfaces") {
  check_room<2>();
  check_room<3>();
}

TEST_CASE("room: surfaces at faces") {
  // of a node that is half full, with a slack of 1/16; mean: of its material's places, in cells
  const auto room = [](Scene<2>& s, int i, int k, const Vec<2>& mean) {
    const std::size_t cone = s.add_cone(i, k);
    const double half = 0.5 * s.problem.node_volume[cone];
    s.fields.material_volume[s.node(i, k)] = half;
    const Packing packing{.slack = 0.0625};
    const Stencil<2> stencil(s.grid);
    const Room<2> set{s.bounds(), s.solids, packing, stencil, 0.5, s.fields, s.work, s.problem};
    set.set(cone, s.index(i, k), half * mean, false);
    return s.problem.free_volume_rate[cone] / s.problem.node_volume[cone]; // 2 δt = 1
  };
  Scene<2> s;
  CHECK(room(s, 2, 3, {0, -1.0 / 3}) == 0); // below an open lid
  s.faces.upper[1] = {FaceKind::free_slip};
  CHECK(room(s, 2, 3, {0, -1.0 / 3}) == about(0.4375)); // below a closed one there is a gap
  // a layer of half a cell at a face: φ = 3/4, t = 2/9
  CHECK(room(s, 1, 0, {0, 2.0 / 9}) == about(0.1875));
  CHECK(room(s, 1, 4, {0, -2.0 / 9}) == about(0.1875));
  s.fields.material_volume[s.node(3, 1)] = 0.125; // full: the layer is no layer
  CHECK(room(s, 3, 0, {0, 2.0 / 9}) == about(0.4375));
  Scene<2> ring({true, false}); // node -1 is node 3
  ring.faces.lower[0] = ring.faces.upper[0] = {FaceKind::periodic};
  CHECK(room(ring, 0, 2, {1.0 / 3, 0}) == 0);
  ring.fields.material_volume[ring.node(3, 2)] = 0.125;
  CHECK(room(ring, 0, 2, {1.0 / 3, 0}) == about(0.4375));
}

TEST_CASE("room: in the midst of dense material neighbours must agree") {
  RoomAtNode<2> s;
  s.packing.surfaces = s.packing.even = true;
  for (const auto& [i, k] : {std::pair(1, 2), {3, 2}, {2, 1}, {2, 3}})
    s.fields.material_volume[s.node(i, k)] = 0.125; // there is no surface
  const auto inside = [&] {
    s.room().set_inside(0, s.cohesive);
    return s.room_now();
  };
  CHECK(s.set(1.5, 0.25) == about(-0.125));
  CHECK(s.work.excess[s.middle] == about(0.5));
  CHECK(s.work.strain[s.middle] == about(0.25));
  CHECK(inside() == about(-0.125)); // alone with itself
  s.work.excess[s.node(3, 2)] = -1; // weights 4 and 2: the mean is 0
  CHECK(inside() == 0);
  s.work.excess[s.node(3, 2)] = 0.75;
  s.work.excess[s.node(1, 3)] = -3; // 4, 2 and 1: 1/14, and 1/112 beyond the slack
  CHECK(inside() == about(std::expm1(-0.5) * (0.5 / 7 - 0.0625)));
  CHECK(s.set(0.75) == about(0.1875));
  s.work.excess[s.node(3, 2)] = 0.5; // 4 · -1/4 + 2 · 1/2
  s.work.excess[s.node(1, 3)] = 0;
  CHECK(inside() == 0); // dense by chance
  s.work.excess[s.middle] = not_inside;
  s.problem.free_volume_rate[0] = 17;
  s.room().set_inside(0, s.cohesive);
  CHECK(s.problem.free_volume_rate[0] == 17);
}

TEST_CASE("room: what coheres is loose only if its neighbours are, too, but for surfaces") {
  RoomAtNode<2> s;
  s.cohesive = s.packing.surfaces = true;
  s.packing.cohesion_slack = 0.125;
  for (const auto& [i, k] : {std::pair(1, 2), {3, 2}, {2, 1}, {2, 3}})
    s.fields.material_volume[s.node(i, k)] = 0.125; // there is no surface
  const auto inside = [&] {
    s.room().set_inside(0, s.cohesive);
    return s.room_now();
  };
  CHECK(s.set(0.75) == about(0.1875)); // until it is asked again
  CHECK(inside() == about(0.125));
  s.work.excess[s.node(3, 2)] = 0; // 4 · -1/4 + 2 · 0
  CHECK(inside() == about(1.0 / 6 - 0.125));
  s.work.excess[s.node(1, 2)] = 0; // the mean is -1/8
  CHECK(inside() == 0);
  CHECK(s.set(1.5, 0.25) == about(-0.125)); // what is overpacked expands by itself
  CHECK(inside() == about(-0.125));
  s.fields.material_volume[s.node(2, 3)] = 0; // a surface: what is below does not hang on it
  CHECK(s.set(0.75, 0, -1.0 / 3 * unit<2>(1)) == about(0.1875));
  CHECK(s.work.excess[s.middle] == about(0.5)); // as it was
}

TEST_CASE("free bodies: the gap to the box, and who has left") {
  const Scene<2> s;
  const auto gap = [&](double x, int axis) { return gap_to_box<2>(s.grid, {x, x}, 0.25, axis); };
  CHECK(gap(0.5, 0) == 0.25);
  CHECK(gap(0.75, 0) == 0); // touches
  CHECK(gap(2, 0) == 0);
  CHECK(gap(3.5, 0) == 0.25);
  CHECK(gap(3.5, 1) == 1.25); // the box is 1 m high
  const auto left = [&](double x, double z) { return has_left<2>(s.grid, {x, z}, 0.25); };
  CHECK_FALSE(left(2, 1.5));
  CHECK_FALSE(left(3.25, 1.5));
  CHECK(left(3.5, 1.5));
  CHECK(left(0.5, 1.5));
  CHECK(left(2, 0.5));
  CHECK_FALSE(left(2, 50)); // it falls back
  CHECK(left(3.5, 50));
  CHECK(has_left<3>(Scene<3>().grid, {2, 3.5, 2}, 0.25)); // across
  CHECK_FALSE(has_left<3>(Scene<3>().grid, {2, 2, 50}, 0.25));
}

TEST_CASE("free bodies: the gaps of turned corners to all faces but open ones") {
  Scene<2> s;
  s.faces = Faces<2>::all({FaceKind::no_slip});
  s.faces.upper[1] = {FaceKind::open};
  Body<2> body;
  body.corners = {{0.5, 0}, {0, 0}};
  body.corner_radius = 0.125;
  RigidState<2> state;
  state.position = {1.5, 1.25};
  state.rotation << 0, -1, 1, 0; // the corner at (1.5, 1.75)
  using Gap = std::tuple<std::size_t, int, bool, double>;
  std::vector<Gap> gaps;
  for (const std::size_t c : {std::size_t{0}, std::size_t{1}})
    for_each_face_gap(s.grid, s.faces, corner_at(body, state, c), body.corner_radius,
                      [&](auto... gap) { gaps.emplace_back(c, gap...); });
  CHECK(gaps == std::vector<Gap>{{0, 0, false, 0.375},
                                 {0, 0, true, 1.375},
                                 {0, 1, false, 0.625},
                                 {1, 0, false, 0.375},
                                 {1, 0, true, 1.375},
                                 {1, 1, false, 0.125}});
}

TEST_CASE("free bodies: reach, inertia in the box, free velocities") {
  CHECK(reach_of<2>(shapes::Ball<2>({0, 0}, 0.25), 1024) == std::sqrt(2 * 0.0625));
  CHECK(reach_of<3>(shapes::Ball<3>({0, 0, 0}, 0.25), 1024) == std::sqrt(3 * 0.0625));
  // from one side it reaches 3/4 m; across as far as its radius, but for 0.5²/(2 far)
  CHECK(reach_of<2>(shapes::Ball<2>({-0.5, 0}, 0.25), 1024) ==
        about(std::hypot(0.75, 0.25 - 0.125 / 1024), 1e-10));
  CHECK(reach_of<2>(shapes::HalfSpace<2>({0, 0}, {0, 1}), 1024) == std::hypot(1024, 2048));

  RigidState<3> turned; // its x, y and z point along y, z and x
  turned.rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const Mat<3> inertia = Vec<3>(1, 2, 3).asDiagonal();
  CHECK(in_box<3>(turned, inertia) == Mat<3>(Vec<3>(3, 1, 2).asDiagonal()));

  turned.velocity = {1, 2, 3};
  turned.angular_velocity = {4, 5, 6};
  Body<3> body;
  body.mass = 4;
  FreeBodies<3> free;
  free.inverse_inertia = {inertia};
  DualProblem<3> problem;
  problem.bodies.resize(1);
  set_free_velocities<3>({body}, free, {turned}, {0, 0, -1}, problem);
  CHECK(problem.bodies[0].velocity == Vec<3>(1, 2, 2));
  CHECK(problem.bodies[0].angular_velocity == Vec<3>(4, 5, 6));
  CHECK(problem.bodies[0].inverse_mass == 0.25);
  CHECK(problem.bodies[0].inverse_inertia == in_box<3>(turned, inertia));
}

TEST_CASE("free bodies: their start") {
  Scene<2> s;
  s.faces.lower[0] = {FaceKind::no_slip};
  const Array<int> nodes{s.node(2, 2)};
  Body<2> ball = ball_body<2>({2, 1.5}, 0.25, 1000, 0.3), held = ball;
  ball.start.angular_velocity[0] = held.start.angular_velocity[0] = 3;
  held.rotates = false;
  Array<RigidState<2>> start;
  const FreeBodies<2> free =
      start_bodies<2>({ball, held}, s.grid, s.faces, nodes, Execution(), start);
  CHECK(free.radius == Array<double>{0.25, 0.25});
  CHECK(free.reach[0] == about(std::sqrt(2) * 0.25));
  CHECK(start[0].angular_velocity[0] == 3);
  CHECK(start[1].angular_velocity[0] == 0);
  CHECK(free.inverse_inertia[0](0, 0) == 1 / ball.inertia(0, 0));
  CHECK(free.inverse_inertia[1](0, 0) == 0);
  const auto refused = [&](const Vec<2>& centre, double radius) {
    const Body<2> body = ball_body<2>(centre, radius, 1000, 0.3);
    return message_of<std::invalid_argument>(
        [&] { start_bodies<2>({body}, s.grid, s.faces, nodes, Execution(), start); });
  };
  CHECK(refused({1.25, 1}, 0.25) == "(nothing thrown)"); // it passes through the open floor
  CHECK(refused({1.125, 1.5}, 0.25) ==
        "the distance of a body's corner to a face is -0.125; allowed: >= 0");
  CHECK(refused({2, 1.5}, 0.125) ==
        "a body's thickness is 0.25; allowed: at least two cells, 0.5 m");
}

TEST_CASE("free bodies: they move as the solve says, turn freely, and leave once") {
  Scene<2> s;
  s.add_ball({2.75, 1.5});
  s.problem.bodies[0].velocity = {1, 0};
  s.problem.bodies[0].angular_velocity[0] = 2;
  FreeBodies<2> free;
  free.reach = s.reach;
  free.inverse_inertia = {s.problem.bodies[0].inverse_inertia};
  const auto move = [&] { return move_bodies(s.bodies, free, s.problem, 0.5, s.states); };
  CHECK(move() == 0);
  CHECK(s.states[0].position == Vec<2>(3.25, 1.5)); // its rim is on the face
  CHECK(s.states[0].velocity == Vec<2>(1, 0));
  CHECK(s.states[0].angular_velocity[0] == 2);
  CHECK(s.states[0].rotation(1, 0) == about(std::sin(1)));
  CHECK(move() == 1);
  CHECK(move() == 0);

  Scene<3> t;
  t.add_ball({2, 2, 1.5});
  t.bodies[0].inertia = Vec<3>(1, 2, 4).asDiagonal();
  FreeBodies<3> spinning;
  spinning.reach = t.reach;
  spinning.inverse_inertia = {t.bodies[0].inverse_inertia()};
  const RigidState<3>& now = t.states[0];
  const auto turn = [&](const Vec<3>& rate, double time) {
    t.problem.bodies[0].angular_velocity = rate;
    CHECK(move_bodies(t.bodies, spinning, t.problem, time, t.states) == 0);
  };
  turn({0.1, 0.2, 0.3}, 0.5);
  CHECK(close(Vec<3>(in_box(now, t.bodies[0].inertia) * now.angular_velocity),
              Vec<3>(0.1, 0.4, 1.2)));
  const Mat<3> turned = now.rotation;
  turn(now.angular_velocity, -0.5); // the same way back
  CHECK((now.rotation - Mat<3>::Identity()).norm() < 1e-13);
  CHECK((now.angular_velocity - Vec<3>(0.1, 0.2, 0.3)).norm() < 1e-13);
  const auto error = [&](int steps) { // against what many steps give
    t.states[0].rotation.setIdentity();
    Vec<3> rate(0.1, 0.2, 0.3);
    for (int n = 0; n < steps; ++n) {
      turn(rate, 0.5 / steps);
      rate = now.angular_velocity;
    }
    return (now.rotation - turned).norm();
  };
  const double by_two = error(2), by_many = error(64);
  CHECK(by_many < 1e-3);
  CHECK(by_two == about(0.75 * by_many, 0.02)); // of second order: a step leaves δt³, two a quarter
}

TEST_CASE("report: a NaN is kept") {
  CHECK(larger_or_nan(1, 2) == 2);
  CHECK(larger_or_nan(2, 1) == 2);
  CHECK(std::isnan(larger_or_nan(not_a_number, 1)));
  CHECK(std::isnan(larger_or_nan(1, not_a_number)));
}

TEST_CASE("report: the fullest node that no solid takes a part of") {
  Scene<2> s;
  Array<double> partials;
  const auto fullest = [&] { return largest_fraction(s.problem, s.fields, Execution(), partials); };
  CHECK(fullest() == 0);
  for (int k = 1; k < 4; ++k) { // volumes of 1/8 m²
    s.add_cone(2, k);
    s.fields.material_volume[s.node(2, k)] = 0.0625 * k;
  }
  s.fields.material_volume[s.node(1, 1)] = 10; // carries no cone
  CHECK(fullest() == 1.5);
  s.fields.open_fraction[s.node(2, 3)] = 0.5;
  CHECK(fullest() == 1);
}

TEST_CASE("report: the Courant number, also of what is not a number") {
  Scene<3> s;
  Array<double> partials;
  const auto courant = [&] { return courant_number(s.problem, 0.125, Execution(), partials); };
  CHECK(courant() == 0);
  const std::size_t first = s.add_cone(2, 1);
  for (int n = 0; n < 600; ++n) // more than one partial maximum
    s.add_cone(2, 2);
  s.problem.velocity[s.node(2, 1)] = {-2, 1, -1.5, 0};
  s.problem.velocity[s.node(3, 3)].setConstant(100); // carries no cone
  CHECK(courant() == 0.75);                          // 1.5 m/s up through cells of 1/4 m
  s.problem.node[first] = s.node(2, 2);
  CHECK(courant() == 0);
  s.problem.node[300] = s.node(2, 1);
  s.problem.velocity[s.node(2, 1)][0] = not_a_number;
  CHECK(std::isnan(courant()));
  s.problem.velocity[s.node(2, 1)][0] = 0;
  s.add_ball({2, 2, 1.5});
  CHECK(courant() == 0.75);
  s.problem.bodies[0].angular_velocity[2] = infinity;
  CHECK(courant() == infinity);
}

TEST_CASE("a full place is refused at densest + 4/√n of the room around it") {
  const Scene<2> s; // cells of 1/8 m²
  const auto refused = [&](const Vec<2>& x, int count, double over_room) {
    Particles<2> sand;
    for (int n = 0; n < count; ++n)
      sand.add(x, {0, 0}, over_room * 0.125 / count);
    return message_of<std::invalid_argument>([&] { check_overfilled(sand, s.grid, 1.5); });
  };
  const double one = 1.5 + 4, four = 1.5 + 2, less = 1 - 1e-9, more = 1 + 1e-9;
  const std::string fine = "(nothing thrown)";
  CHECK(refused({2.1, 1.6}, 1, 9 * one * less) == fine); // 9 cells around it
  CHECK(refused({2.1, 1.6}, 1, 9 * one * more)
            .starts_with("the volume of the 1 particles around x = (2, 1.5) m over that of the "
                         "cells which hold them is 5.5"));
  CHECK(refused({2.1, 1.6}, 4, 9 * four * less) == fine);
  CHECK(refused({2.1, 1.6}, 4, 9 * four * more) != fine);
  CHECK(refused({2.1, 1.1}, 4, 6 * four * less) == fine); // at a face
  CHECK(refused({2.1, 1.1}, 4, 6 * four * more) != fine);
  CHECK(refused({3, 2}, 4, 4 * four * less) == fine); // in a corner
  CHECK(refused({3, 2}, 4, 4 * four * more) != fine);
}

TEST_CASE("a state that does not fit is refused by name and value") {
  Scene<2> s;
  s.add_ball({2, 1.5}); // with one corner
  SimulationState<2> good;
  good.time_step = 0.5;
  good.particles.add({2, 1.5}, {0, 0}, 0.1);
  good.stress_impulse.assign(s.cone.size(), Vec<3>::Zero());
  good.bodies = s.states;
  good.body_contacts.resize(1);
  good.body_contacts[0].node = -1;
  const auto refused = [&](const auto& change) {
    SimulationState<2> bad = good;
    change(bad);
    return message_of<std::invalid_argument>([&] { check_state(bad, s.bounds()); });
  };
  using State = SimulationState<2>;
  CHECK(refused([](State&) {}) == "(nothing thrown)");
  CHECK(refused([](State& b) { b.time = -1; }) ==
        "state.time is -1; allowed: a finite number >= 0");
  CHECK(
      refused([](State& b) { b.gravity[1] = infinity; }) ==
      "state.gravity.y is inf; allowed: finite numbers, m/s²; it has no default: {0, 0} for none");
  CHECK(refused([](State& b) { b.stress_impulse[3][2] = not_a_number; }) ==
        "a node's stress of the state is nan; allowed: a finite number");
  CHECK(refused([](State& b) { b.bodies.clear(); }) ==
        "the number of bodies of the state is 0; allowed: 1");
  CHECK(refused([](State& b) { b.bodies[0].velocity[0] = not_a_number; }) ==
        "a body's velocity is nan; allowed: a finite number");
  CHECK(refused([](State& b) { b.body_contacts[0].impulse[1] = not_a_number; }) ==
        "the impulse of a contact is nan; allowed: a finite number");
  CHECK(refused([](State& b) { b.body_contacts[0].body = 1; }) ==
        "the body of a contact is 1; allowed: a body of the simulation");
  CHECK(refused([](State& b) { b.body_contacts[0].body = -1; }) ==
        "the body of a contact is -1; allowed: a body of the simulation");
  CHECK(refused([](State& b) { b.body_contacts[0].node = -2; }) ==
        "the node of a contact is -2; allowed: a node of the grid, or a corner");
  CHECK(refused([&](State& b) {
          b.body_contacts[0].node = s.grid.node_count();
        }).starts_with("the node of a contact is "));
  CHECK(refused([](State& b) { b.particles.volume.clear(); }) ==
        "the number of the particles' volumes is 0; allowed: 1, that of their positions");
  CHECK(refused([](State& b) {
          b.particles.affine.clear();
        }).starts_with("the number of the particles' affine matrices is 0"));
  CHECK(refused([](State& b) {
          b.particles.id.push_back(1);
        }).starts_with("the number of the particles' ids is 2"));
  CHECK(refused([](State& b) {
          b.particles.resize_mixed(2);
        }).starts_with("the number of the particles' mixed derivatives is 2"));
  CHECK(refused([](State& b) {
          b.particles.resize_mixed(1);
          b.particles.mixed[0](1, 0) = not_a_number;
        }) == "a particle's mixed derivative is nan; allowed: a finite number");
  CHECK(refused([](State& b) { b.particles.velocity[0][1] = infinity; }) ==
        "a particle's velocity is inf; allowed: a finite number");
  CHECK(refused([](State& b) { b.particles.position[0][1] = 2 + 0x1p-50; }) ==
        "a particle's coordinate is 2; allowed: a position in the box of the grid; it is 8.9e-16 m "
        "outside");
}

} // namespace test_step_nodes
