// SPDX-License-Identifier: MIT

#include "talus/core/execution.hpp"
#include "talus/solver/held_nodes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>

namespace test_held_nodes {

using namespace talus;

namespace {

/// Nodes of mass 2 with u = (1, −1), contacts with a floor of friction 0.5; velocities of 0.01 m/s
/// are usual.
DualProblem<2> nodes_on_floor(const Array<Vec<2>>& impulses) {
  DualProblem<2> problem;
  problem.velocity_scale = 0.01;
  for (std::size_t k = 0; k < impulses.size(); ++k) {
    problem.velocity.push_back({1, -1});
    problem.inverse_mass.push_back({0.5, 0.5});
    Contact<2> contact;
    contact.node = static_cast<int>(k);
    contact.normal = {0, 1};
    contact.friction = 0.5;
    contact.impulse = impulses[k];
    problem.contacts.push_back(contact);
  }
  return problem;
}

} // namespace

TEST_CASE("held nodes: what pressed is held, what slid along the wall alone") {
  auto problem = nodes_on_floor({{0, 1},        // sticks
                                 {0.5, 1},      // slides
                                 {0.499999, 1}, // slides, to a solver's tolerance
                                 {0.500001, 1}, // the same after a turn of the normal
                                 {0, 1e-6},     // what interior points leave of an open contact
                                 {0, 0},        // open
                                 {0.1, 0.02}}); // bears the node's own weight
  HeldNodes<2> held;
  held.hold(problem, Execution());
  CHECK(!held.bodies());
  const NodeVec<2> v(3, 4);
  const auto free = [&](int node) { return Vec<2>(held.free(problem, node, v).head<2>()); };
  CHECK(free(0) == Vec<2>(0, 0));
  CHECK(problem.velocity[0] == NodeVec<2>(0, 0));
  CHECK(problem.contacts[0].impulse == Vec<2>(-2, 3)); // took the momentum
  for (const int slides : {1, 2, 3, 6}) {
    CHECK(free(slides) == Vec<2>(3, 0));
    CHECK(problem.velocity[slides] == NodeVec<2>(1, 0));
    CHECK(problem.contacts[slides].impulse[1] > 2);
  }
  for (const int open : {4, 5}) {
    CHECK(free(open) == Vec<2>(3, 4));
    CHECK(problem.velocity[open] == NodeVec<2>(1, -1));
  }
}

TEST_CASE("held nodes: a body takes them along as in a plastic impact, about its centre, too") {
  auto problem = nodes_on_floor({{0, 0}, {0, 0}});
  problem.contacts.clear();
  problem.velocity = {{0, 3}, {0, 1}};
  FreeBody<2> body;
  body.velocity = {4, -6};
  body.angular_velocity[0] = 2;
  body.inverse_mass = 0.25;
  body.inverse_inertia(0, 0) = 0.125;
  problem.bodies.push_back(body);
  for (const int node : {0, 1}) {
    BodyContact<2> contact;
    contact.node = node;
    contact.normal = {0, -1};
    contact.friction = node == 0 ? 10 : 0; // the other one slides along it
    contact.impulse = {0, -1};
    contact.arm = {node == 0 ? -1.0 : 2.0, -1};
    problem.body_contacts.push_back(contact);
  }
  const auto momentum = [&] {
    const FreeBody<2>& b = problem.bodies[0];
    Vec<3> sum(4 * b.velocity[0], 4 * b.velocity[1], 8 * b.angular_velocity[0]);
    for (const int node : {0, 1}) {
      const Vec<2> p = 2 * problem.velocity[node].head<2>();
      sum += Vec<3>(p[0], p[1], torque<2>(problem.body_contacts[node].arm, p)[0]);
    }
    return sum;
  };
  const Vec<3> before = momentum();
  HeldNodes<2> held;
  held.hold(problem, Execution());
  CHECK(held.bodies());
  CHECK((momentum() - before).norm() < 1e-13);
  const auto slip = [&](int node) {
    return Vec<2>(relative_velocity(problem, problem.body_contacts[node]));
  };
  CHECK(slip(0).norm() < 1e-14);
  CHECK(std::abs(slip(1)[1]) < 1e-14);
  CHECK(problem.velocity[1][0] == 0);
}

} // namespace test_held_nodes
