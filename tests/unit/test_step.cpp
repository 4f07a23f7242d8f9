// SPDX-License-Identifier: MIT
// What bounds the material in a step, against numbers worked out by hand: contacts, faces, forces.

#include "talus/boundary/obstacle.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/particles.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/step/body_contacts.hpp"
#include "talus/step/contacts.hpp"
#include "talus/step/face_conditions.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/solids.hpp"
#include "talus/step/time_step.hpp"
#include "talus/step/wrenches.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"
#include "../support/step_scene.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace test_step {

using namespace talus;
using support::about, support::close, support::message_of, support::point, support::Scene,
    support::unit;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

template <int Dim>
void check_face_contacts() {
  constexpr int up = up_axis<Dim>;
  Scene<Dim> s;
  s.faces.lower[0] = {FaceKind::frictional, 0.3};
  s.faces.upper[up] = {FaceKind::frictional, 0.5};
  s.faces.lower[up] = {FaceKind::no_slip};
  s.add_cone(0, 2);
  s.add_cone(2, 2); // on no face
  s.add_cone(0, 4); // on both
  s.add_cone(0, 3);
  s.problem.inverse_mass[s.node(0, 3)][0] = 0; // held
  s.add_cone(2, 0);
  s.problem.blocks = {{0, 2, 9, 9}, {2, 5, 9, 9}};
  s.look();
  Array<Contact<Dim>> last;
  const auto collect = [&](double ratio) {
    collect_contacts(s.bounds(), s.solids, s.rank, {last, ratio}, Execution(2), s.problem);
  };
  collect(1);
  const auto& contacts = s.problem.contacts;
  REQUIRE(contacts.size() == 3);
  const auto check = [&](std::size_t c, int node, int id, const Vec<Dim>& normal, double friction) {
    CHECK(contacts[c].node == node);
    CHECK(contacts[c].boundary_id == id);
    CHECK(contacts[c].normal == normal);
    CHECK(contacts[c].friction == friction);
    CHECK(contacts[c].wall_velocity == Vec<Dim>::Zero());
    CHECK(contacts[c].impulse == Vec<Dim>::Zero());
  };
  check(0, s.node(0, 2), 0, unit<Dim>(0), 0.3);
  check(1, s.node(0, 4), 0, unit<Dim>(0), 0.3);
  check(2, s.node(0, 4), 2 * up + 1, -unit<Dim>(up), 0.5);
  CHECK(s.problem.blocks[0].contact_begin == 0);
  CHECK(s.problem.blocks[0].contact_end == 1);
  CHECK(s.problem.blocks[1].contact_begin == 1);
  CHECK(s.problem.blocks[1].contact_end == 3);

  last = contacts;
  for (std::size_t c = 0; c < 3; ++c)
    last[c].impulse.setConstant(1.0 + static_cast<double>(c));
  last[1].node = s.node(2, 2); // one has gone, one is new
  collect(0.5);
  CHECK(contacts[0].impulse == Vec<Dim>::Constant(0.5));
  CHECK(contacts[1].impulse == Vec<Dim>::Zero());
  CHECK(contacts[2].impulse == Vec<Dim>::Constant(1.5));
}

/// The distances to the ground in cells are 1.5, 0.5, -0.5 and -1.5: see node_in_solid.
template <int Dim>
void check_obstacle_contacts() {
  constexpr int up = up_axis<Dim>;
  Scene<Dim> s;
  s.add_ground(1.625);
  for (int k = 4; k >= 0; --k)
    s.add_cone(2, k);
  s.problem.inverse_mass[s.node(2, 0)].setZero();
  s.problem.blocks = {{0, 5, 0, 0}};
  const std::vector<double> share = s.look();
  CHECK(share[0] == 1);
  CHECK(share[1] == about(0.875)); // 1/2 + s (1 - s/2)
  CHECK(share[2] == about(0.125));
  CHECK(share[3] == 0.1); // at least
  collect_contacts(s.bounds(), s.solids, s.rank, {{}, 1}, Execution(), s.problem);
  REQUIRE(s.problem.contacts.size() == 3);
  for (int c = 0; c < 3; ++c) {
    const Contact<Dim>& contact = s.problem.contacts[c];
    CHECK(contact.node == s.node(2, 3 - c));
    CHECK(contact.boundary_id == 2 * Dim);
    CHECK(close(contact.normal, unit<Dim>(up)));
    CHECK(contact.friction == 0.2);
    Vec<Dim> moves = 3 * unit<Dim>(up); // at 1 m from the axis
    moves[0] = 2 - 3 * (0.125 - 0.25 * c);
    CHECK(close(contact.wall_velocity, moves));
  }
}

/// Holds all nodes, while it is there.
struct Fickle final : Obstacle<2> {
  explicit Fickle(const bool& is_there) : there(is_there) {}
  std::optional<ObstacleContact<2>> contact(const Vec<2>&, const Vec<2>&, double) const override {
    if (!there)
      return std::nullopt;
    return ObstacleContact<2>{{0, 1}, {0, 0}, 0.3};
  }
  const bool& there;
};

template <int Dim>
void check_body_contacts() {
  constexpr int up = up_axis<Dim>;
  Scene<Dim> s;
  s.add_ball(point<Dim>(2, 1.5)); // 1/4 m off floor and lid, 3/4 m off the sides
  s.faces.lower[up] = {FaceKind::no_slip};
  s.faces.lower[0] = {FaceKind::frictional, 0.3};
  s.faces.upper[0] = {FaceKind::free_slip};
  s.add_cone(2, 4); // a cell off the ball
  s.add_cone(2, 3);
  s.add_cone(2, 1);
  s.problem.inverse_mass[s.node(2, 1)].setZero();
  s.look();
  Array<BodyContact<Dim>> last;
  const auto collect = [&](double ratio) {
    const BlockOrder<Dim> order(s.grid);
    collect_touched_nodes(s.bounds(), s.solids, order, s.problem);
    const Array<BodyContact<Dim>> touched = s.problem.body_contacts;
    collect_body_contacts(s.bounds(), s.solids, touched, order, 0.125, {last, ratio}, s.problem);
  };
  const auto& contacts = s.problem.body_contacts;
  const auto check = [&](std::size_t c, int node, int id, const Vec<Dim>& normal, double friction) {
    CHECK(contacts[c].node == node);
    CHECK(contacts[c].boundary_id == id);
    CHECK(contacts[c].body == 0);
    CHECK(close(contacts[c].normal, normal));
    CHECK(close(contacts[c].arm, Vec<Dim>(0.25 * normal)));
    CHECK(contacts[c].friction == friction);
    // 1/M + 1/m_j + (1 or 2 axes across the arm) |arm|²/J
    CHECK(contacts[c].inverse_mass == about(0.5 + (node < 0 ? 0 : 2) + (Dim - 1) * 0.5));
  };
  collect(1);
  REQUIRE(contacts.size() == 2); // at rest: the sides are more than a cell away
  check(0, s.node(2, 3), 2 * Dim, unit<Dim>(up), 0.4);
  check(1, -1, 2 * up, -unit<Dim>(up), 0.4);
  CHECK(contacts[0].wall_velocity == Vec<Dim>::Zero());
  CHECK(contacts[1].wall_velocity == 2 * unit<Dim>(up)); // to the face in the step

  last = contacts;
  last[0].impulse.setConstant(2);
  last[1].impulse.setConstant(3);
  s.problem.bodies[0].velocity[0] = 2;         // 2 |V| δt = 1/2
  s.problem.bodies[0].angular_velocity[0] = 8; // 2 |ω| δt reach = 1/2
  collect(2);
  REQUIRE(contacts.size() == 4);
  check(0, s.node(2, 3), 2 * Dim, unit<Dim>(up), 0.4);
  check(1, -1, 0, -unit<Dim>(0), 0.3);
  check(2, -1, 1, unit<Dim>(0), 0);
  check(3, -1, 2 * up, -unit<Dim>(up), 0.4);
  CHECK(contacts[1].wall_velocity == 6 * unit<Dim>(0));
  CHECK(contacts[0].impulse == Vec<Dim>::Constant(4));
  CHECK(contacts[1].impulse == Vec<Dim>::Zero());
  CHECK(contacts[2].impulse == Vec<Dim>::Zero());
  CHECK(contacts[3].impulse == Vec<Dim>::Constant(6));

  s.states[0].position = point<Dim>(4, 1.25); // beyond the side
  s.look();
  collect(1);
  CHECK(contacts.empty());
}

template <int Dim>
void check_held() {
  constexpr int up = up_axis<Dim>;
  using V = NodeVec<Dim>;
  Scene<Dim> s;
  s.faces.lower[0] = {FaceKind::no_slip};
  s.faces.lower[up] = {FaceKind::free_slip};
  s.faces.upper[up] = {FaceKind::frictional, 0.3};
  const V all = V::Ones();
  V along = all; // the floor
  along[up] = 0;
  const auto after = [&](int i, int k) {
    s.problem.velocity.assign(s.problem.velocity.size(), all);
    s.problem.inverse_mass = s.problem.velocity;
    hold_at_faces(s.faces, {s.node(i, k)}, Execution(), s.problem);
    CHECK(s.problem.velocity[s.node(1, 1)] == all); // not listed
    CHECK(s.problem.inverse_mass[s.node(i, k)] == s.problem.velocity[s.node(i, k)]);
    return s.problem.velocity[s.node(i, k)];
  };
  CHECK(after(2, 2) == all);
  CHECK(after(0, 2) == V::Zero());
  CHECK(after(2, 0) == along);
  CHECK(after(2, 4) == all); // frictional: a contact
  CHECK(after(4, 2) == all); // open
  CHECK(after(0, 0) == V::Zero());
  CHECK(after(4, 0) == along);
  s.faces.lower[0] = {FaceKind::free_slip};
  V both = along;
  both[0] = 0;
  CHECK(after(0, 0) == both);
  s.faces.lower[0] = s.faces.upper[0] = {FaceKind::periodic};
  CHECK(after(0, 2) == all);
}

template <int Dim, class Real>
void check_outflow() {
  Scene<Dim> s;
  Particles<Dim, Real> sand;
  Array<std::size_t> partials;
  for (const double x : {2.0, 0.5, 1.0, 3.5, 3.0, 2.5}) // two are out, two on faces
    sand.add(point<Dim>(x, 1.5), point<Dim>(x, 0), x / 4);
  s.faces = Faces<Dim>::all({FaceKind::no_slip});
  const auto remove = [&] { return remove_outflow(s.faces, s.grid, Execution(), partials, sand); };
  CHECK(remove().particles == 0); // there is no way out
  CHECK(sand.size() == 6);
  s.faces.upper[0] = {FaceKind::open};
  const Outflow outflow = remove();
  CHECK(outflow.particles == 2);
  CHECK(outflow.volume == 1);
  CHECK(sand.id == std::vector<std::size_t>{0, 2, 4, 5});
  CHECK(sand.next_id == 6);
  for (std::size_t p = 0; p < sand.size(); ++p) {
    const double x = std::vector<double>{2, 1, 3, 2.5}[p];
    CHECK(sand.position[p] == point<Dim>(x, 1.5));
    CHECK(sand.velocity[p] == point<Dim>(x, 0).template cast<Real>());
    CHECK(sand.volume[p] == static_cast<Real>(x / 4));
  }
}

template <int Dim>
double time_step(const Scene<Dim>& s, const Vec<Dim>& gravity = Vec<Dim>::Zero()) {
  FreeBodies<Dim> free;
  free.radius.assign(s.bodies.size(), 0.25);
  free.reach = s.reach;
  SolidsAtCones<Dim> solids(s.bounds());
  solids.place(s.bounds());
  Array<double> partials;
  return cfl_time_step<Dim>(0.5, 2, s.bounds(), solids, {s.node(2, 2), s.node(3, 3)},
                            s.problem.velocity, free, gravity, Execution(), partials);
}

template <int Dim>
void check_time_step() {
  constexpr int up = up_axis<Dim>;
  const double with_gravity = (std::sqrt(18.0) - 4) / 4;
  Scene<Dim> s;
  CHECK(time_step(s) == 2);                                                 // the largest
  CHECK(time_step<Dim>(s, -unit<Dim>(up)) == about(std::sqrt(0.5 * 0.25))); // |g| δt² = cfl h
  CHECK(time_step<Dim>(s, -1e-9 * unit<Dim>(up)) == 2);
  s.problem.velocity[s.node(3, 3)][0] = -4;
  CHECK(time_step(s) == 0.0625); // half a cell of 1/2 m at 4 m/s
  CHECK(time_step<Dim>(s, 2 * unit<Dim>(0)) == about(with_gravity)); // (4 + 2 δt) δt = 1/4
  CHECK(time_step<Dim>(s, unit<Dim>(up)) == 0.0625);
  s.problem.velocity[s.node(3, 3)].setZero();
  s.problem.velocity[s.node(1, 1)][0] = 100; // not listed
  CHECK(time_step(s) == 2);

  // The ground's rim at (3, z) rises at 6 m/s, though no node is in the material.
  s.add_ground(1.5);
  CHECK(time_step(s) == about(0.5 * 0.25 / 6));
  s.obstacles.clear();
  s.add_ground(-10);
  CHECK(time_step(s) == 2);

  s.add_ball(point<Dim>(2, 1.5));
  s.states[0].velocity[0] = 3;
  s.states[0].angular_velocity[0] = 4; // 1 m/s on its surface
  CHECK(time_step(s) == 0.0625);       // 4 m/s along x; 1 m/s up
  CHECK(time_step<Dim>(s, 2 * unit<Dim>(0)) == about(with_gravity));
  // Outside it may come back by half a cell: 3/4 m of gap and 1/4 m at 4 m/s.
  s.states[0].position[0] = 4;
  CHECK(time_step(s) == 0.25);
  s.states[0].velocity[0] = 0; // and beside the box it does not matter how fast it is across
  s.states[0].angular_velocity[0] = 0;
  s.states[0].velocity[up] = 1000;
  CHECK(time_step(s) == 2);
}

template <int Dim>
void check_momentum() {
  Scene<Dim> s;
  constexpr int up = up_axis<Dim>, middle = (ipow(3, Dim) - 1) / 2;
  s.add_cone(2, 2);
  s.add_cone(3, 2);
  const int node = s.node(2, 2);
  s.fields.material_volume[node] = 0.25;
  s.work.velocity_before[node].template head<Dim>() = point<Dim>(1, 2);
  s.work.cone = s.cone;
  Array<Vec<symmetric_size<Dim>>> stress(s.cone.size(), Vec<symmetric_size<Dim>>::Zero());
  Mat<Dim> tensor = Mat<Dim>::Identity();
  tensor(0, up) = tensor(up, 0) = 2;
  stress[node] = symmetric_to_vector<Dim, double>(tensor);
  stress[s.node(3, 2)] = 10 * stress[node];
  stress[s.node(1, 2)] = 1000 * stress[node]; // carries no cone
  s.problem.gradient_weights[0].col(middle) = 3 * unit<Dim>(0);
  s.problem.gradient_weights[1].col(2 * middle - Scene<Dim>::beside) = unit<Dim>(up);
  s.problem.gradient_weights[1].col(Scene<Dim>::beside).setConstant(1000); // away from the node
  const ViscousSolver<Dim> viscous;
  const SolvedStep<Dim> step{s.problem, stress, s.fields, s.work,
                             viscous,   16,     0.5,      -10 * unit<Dim>(up)};
  // 16/4 (u - 5 e_up), Λ (3 e_x) and 10 Λ e_up
  Vec<Dim> expected = 4 * point<Dim>(1, 2 - 5);
  expected[0] += 3 * 1 + 10 * 2;
  expected[up] += 3 * 2 + 10 * 1;
  CHECK(close(momentum_if_free(step, node), expected));
}

} // namespace

TEST_CASE("contacts: nodes on frictional faces, with the impulses of the last step") {
  check_face_contacts<2>();
  check_face_contacts<3>();
}

TEST_CASE("contacts: nodes at an obstacle, with its velocity there") {
  check_obstacle_contacts<2>();
  check_obstacle_contacts<3>();
}

TEST_CASE("contacts: an obstacle that gives one and then does not is refused") {
  Scene<2> s;
  bool there = true;
  s.obstacles = {std::make_shared<Fickle>(there)};
  s.add_cone(2, 2);
  s.problem.blocks = {{0, 1, 0, 0}};
  s.look();
  const auto collect = [&] {
    collect_contacts(s.bounds(), s.solids, s.rank, {{}, 1}, Execution(), s.problem);
  };
  collect();
  CHECK(s.problem.contacts.size() == 1);
  there = false;
  CHECK(message_of<std::invalid_argument>(collect) ==
        "obstacle 0 at x = (2, 1.5) m: the number of contacts that it gave and then did not is 1; "
        "allowed: 0: the same answer for the same arguments");
}

TEST_CASE("contacts: nodes at a free body, and its corners at faces that it may reach") {
  check_body_contacts<2>();
  check_body_contacts<3>();
}

TEST_CASE("solids: what several leave of a node, and the nodes that bodies hold") {
  Scene<2> s;
  for (const int k : {0, 1, 2, 3, 4})
    s.add_cone(2, k);
  s.add_ball({2, 1.5});
  // On its surface, of a radius of half a cell's length and one cell's height: 0.729 by sums over
  // points.
  const double open = s.look()[1];
  CHECK(open == about(0.729, 0.06));
  CHECK(s.look()[4] == 1); // a cell off
  s.add_ground(1.25);
  CHECK(s.look()[1] == about(open / 2)); // a half of that
  CHECK(s.look()[0] == 0.1);
  s.add_ball({2, 2}); // holds the lid's node
  s.look();
  CHECK(s.solids.held_by_bodies(s.bounds()) ==
        Array<std::pair<std::size_t, std::size_t>>{{0, 1}, {0, 2}, {0, 3}, {1, 3}, {1, 4}});
}

TEST_CASE("wrenches: the momentum of a node without its faces") {
  check_momentum<2>();
  check_momentum<3>();
}

TEST_CASE("wrenches: which face holds a node") {
  Scene<3> s;
  const auto forces = [&](const Index<3>& index, const NodeVec<3>& inverse_mass) {
    Array<Wrench<3>> wrenches(s.bounds().sources());
    Array<ExactSum> workspace;
    WrenchSums<3> sums(wrenches.size(), workspace);
    add_to_holding_faces<3>(s.bounds(), s.grid.node(index), inverse_mass, {2, 4, 6}, sums);
    sums.write(Execution(), 1, wrenches);
    const Vec<3> x = s.grid.node_position(index);
    std::vector<Vec<3>> force;
    for (const Wrench<3>& w : wrenches) {
      CHECK(w.torque == torque<3>(x, w.force));
      force.push_back(w.force);
    }
    return force;
  };
  using Forces = std::vector<Vec<3>>;
  const Vec<3> none = Vec<3>::Zero();
  const NodeVec<3> held = NodeVec<3>::Zero(), slides{0, 1, 1, 0};
  s.faces.lower[0] = s.faces.lower[1] = {FaceKind::no_slip};
  s.faces.upper[2] = {FaceKind::free_slip};
  CHECK(forces({2, 2, 2}, held) == Forces(6, none)); // held by no face
  CHECK(forces({0, 2, 2}, held) == Forces{{2, 4, 6}, none, none, none, none, none});
  CHECK(forces({0, 2, 2}, slides) == Forces{{2, 0, 0}, none, none, none, none, none});
  // an edge of two that stick: each takes what is normal to it, and half of what is along both
  CHECK(forces({0, 0, 2}, held) == Forces{{2, 0, 3}, none, {0, 4, 3}, none, none, none});
  // a slipping one takes what is normal to it, and nothing else
  CHECK(forces({0, 2, 4}, held) == Forces{{2, 4, 0}, none, none, none, none, {0, 0, 6}});
  CHECK(forces({0, 0, 4}, held) == Forces{{2, 0, 0}, none, {0, 4, 0}, none, none, {0, 0, 6}});
  s.faces.lower[1] = {FaceKind::frictional, 0.3};
  CHECK(forces({0, 0, 2}, held) == Forces{{2, 4, 6}, none, none, none, none, none});
}

TEST_CASE("wrenches: contacts give the reverse of their impulses, over the time step") {
  Scene<2> s;
  s.add_ground(1.5);
  s.add_ball({2, 1.75});
  s.faces.lower[1] = {FaceKind::no_slip};
  s.add_cone(1, 2); // at (1.5, 1.5)
  s.add_cone(2, 0); // at (2, 1), held
  s.problem.inverse_mass[s.node(2, 0)].setZero();
  s.fields.material_volume[s.node(2, 0)] = 1;
  Contact<2> contact;
  contact.node = s.node(1, 2);
  contact.boundary_id = 4;
  contact.impulse = {3, -2};
  BodyContact<2> corner, touch;
  corner.node = -1;
  corner.boundary_id = 1;
  corner.arm = {0.25, 0.25}; // at (2.25, 2)
  corner.impulse = {1, 0};
  touch.node = s.node(2, 0);
  touch.arm = {0, -0.25}; // at (2, 1.5)
  touch.impulse = {0, -1};
  s.problem.contacts = {contact};
  s.problem.body_contacts = {corner, touch};
  const Array<Vec<3>> stress(s.cone.size(), Vec<3>::Zero());
  const ViscousSolver<2> viscous;
  Array<Wrench<2>> wrenches(6);
  wrenches[3].force = {7, 7}; // of the last step
  measure_wrenches<2>(s.bounds(), {s.problem, stress, s.fields, s.work, viscous, 2, 0.5, {0, -10}},
                      Execution(), s.work.held_momentum, s.work.wrench_sums, wrenches);
  const auto check = [&](std::size_t source, const Vec<2>& force, double torque) {
    CAPTURE(source);
    CHECK(wrenches[source].force == force);
    CHECK(wrenches[source].torque[0] == torque);
  };
  check(0, {0, 0}, 0);
  check(1, {2, 0}, -4);    // the face that the corner is at
  check(2, {0, -22}, -44); // 2 kg at -5 m/s, and the body's -1 N s, at (2, 1)
  check(3, {0, 0}, 0);
  check(4, {-6, 4}, 15);    // 1.5 (4 + 6)
  check(5, {-2, 2}, 4 + 4); // 2 · 2 and 2 · 2
}

TEST_CASE("faces: what holds nodes") {
  check_held<2>();
  check_held<3>();
}

TEST_CASE("faces: walls bound the particles, open and periodic faces do not") {
  Scene<3> s({true, false, false});
  s.faces = Faces<3>::all({FaceKind::no_slip});
  s.faces.lower[0] = s.faces.upper[0] = {FaceKind::periodic};
  s.faces.lower[1] = {FaceKind::open};
  s.faces.upper[1] = {FaceKind::frictional, 0.3};
  s.faces.upper[2] = {FaceKind::open};
  const auto [lower, upper] = particle_bounds(s.faces, s.grid);
  CHECK(lower == Vec<3>(-infinity, -infinity, 1));
  CHECK(upper == Vec<3>(infinity, 3, infinity));
}

TEST_CASE("faces: outflow takes what is outside, and keeps the rest in its order") {
  check_outflow<2, double>();
  check_outflow<3, float>();
}

TEST_CASE("the time step: nodes, gravity, obstacles and bodies") {
  check_time_step<2>();
  check_time_step<3>();
}

TEST_CASE("blocks along a very long periodic axis") {
  const int cells = 200'000;
  const BlockOrder<2> order(
      Grid<2>({.origin = {0, 0}, .size = {2e5, 1}, .cells = {cells, 1}}, {true, false}));
  REQUIRE(order.nodes().size() == 2 * cells);
  std::vector<bool> there(4 * (cells + 3));
  for (std::size_t b = 0; b < order.blocks(); ++b) {
    CHECK_LE(order.begin(b + 1) - order.begin(b), 4 * 2 * 2); // at most twice as long as others
    for (std::size_t k = order.begin(b); k < order.begin(b + 1); ++k)
      there[static_cast<std::size_t>(order.nodes()[k])] = true;
  }
  CHECK(std::count(there.begin(), there.end(), true) == 2 * cells);
}

} // namespace test_step
