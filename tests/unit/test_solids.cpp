// SPDX-License-Identifier: MIT
// The list of solids at nodes against a loop over all solids, and how often solids are asked.

#include "talus/boundary/body.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/step/solids.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/about.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace test_solids {

using namespace talus;

namespace {

template <int Dim>
Vec<Dim> random_vector(Random& random, double size) {
  Vec<Dim> v;
  for (int a = 0; a < Dim; ++a)
    v[a] = size * (2 * random.uniform() - 1);
  return v;
}

/// Its distance grows by 20 a metre: no distance at all, but it has always had a surface.
template <int Dim>
struct Steep {
  double distance(const Vec<Dim>& x) const { return 20 * x.norm() - 2; } // radius 0.1
};

/// An obstacle that says only what it must.
template <int Dim>
class Ceiling final : public Obstacle<Dim> {
 public:
  std::optional<ObstacleContact<Dim>> contact(const Vec<Dim>& x, const Vec<Dim>&,
                                              double time) const override {
    if (x[0] < 0.8 + time)
      return std::nullopt;
    return ObstacleContact<Dim>{-Vec<Dim>::Unit(0), Vec<Dim>::Unit(0), 0.3};
  }
  double open_fraction(const Vec<Dim>& x, const Vec<Dim>&, double time) const override {
    return x[0] < 0.8 + time ? 1 : 0.7;
  }
};

/// Shapes with and without end, exact and not, about the origin and beside it, some 0.1 m in size.
template <int Dim>
std::vector<Shape<Dim>> some_shapes(Random& random) {
  const auto vector = [&](double size) { return random_vector<Dim>(random, size); };
  using shapes::Ball, shapes::Box, shapes::HalfSpace;
  const Vec<Dim> corner = vector(0.1).cwiseAbs() + Vec<Dim>::Constant(0.05);
  const Vec<Dim> rod = Vec<Dim>::Constant(0.02) + 0.8 * Vec<Dim>::Unit(0);
  const Ball<Dim> ball(vector(0.1), 0.1);
  const HalfSpace<Dim> half(vector(0.1), vector(1).normalized());
  return {ball,
          half,
          Box<Dim>(-corner, corner),
          shapes::Capsule<Dim>(vector(0.2), vector(0.2), 0.04),
          shapes::Union(ball, Ball<Dim>(vector(0.3), 0.05)),
          shapes::Intersection(ball, half),
          shapes::Complement(Ball<Dim>(vector(0.1), 0.4)),
          shapes::difference(Box<Dim>(-corner, corner), ball),
          Box<Dim>(Vec<Dim>::Zero(), 1e-3 * Vec<Dim>::Ones() + 0.2 * Vec<Dim>::Unit(0)),
          Box<Dim>(-rod, rod),
          Steep<Dim>{}};
}

template <int Dim>
RigidState<Dim> random_state(Random& random, const Vec<Dim>& near) {
  RigidState<Dim> state;
  state.position = near + random_vector<Dim>(random, random.uniform() < 0.1 ? 40 : 1);
  state.rotation = rotation_by<Dim>(random_vector<spin_size<Dim>>(random, 3));
  state.velocity = random_vector<Dim>(random, 1);
  state.angular_velocity = random_vector<spin_size<Dim>>(random, 1);
  return state;
}

/// Asks every solid at every node and compares.
template <int Dim>
void check_list(Random& random, const Vec<Dim>& origin) {
  GridParams<Dim> box;
  box.origin = origin;
  for (int a = 0; a < Dim; ++a) {
    box.size[a] = 1 - 0.1 * a;
    box.cells[a] = Dim == 2 ? 40 - 7 * a : 16 - 3 * a;
  }
  const Grid<Dim> grid(box);
  const Vec<Dim> middle = origin + 0.5 * box.size;
  const Faces<Dim> faces{};
  std::vector<std::shared_ptr<const Obstacle<Dim>>> obstacles;
  std::vector<Body<Dim>> bodies;
  std::vector<RigidState<Dim>> states;
  for (const Shape<Dim>& shape : some_shapes<Dim>(random)) {
    const RigidState<Dim> start = random_state<Dim>(random, middle);
    obstacles.push_back(make_obstacle<ShapeObstacle<Dim>>(
        {.shape = shape, .friction = 0.2, .motion = steady_motion(start)}));
    obstacles.push_back(make_obstacle<ShapeObstacle<Dim>>(
        {.shape = shapes::translated<Dim>(shape, middle + random_vector<Dim>(random, 0.5)),
         .friction = 0.3}));
    bodies.emplace_back();
    bodies.back().shape = shape;
    states.push_back(random_state<Dim>(random, middle));
  }
  obstacles.push_back(std::make_shared<Ceiling<Dim>>());
  obstacles.push_back(
      make_obstacle<Gate<Dim>>({.position = middle[0], .bottom = middle[1], .friction = 0}));
  const std::vector<double> reach(bodies.size(), 0);
  const Boundaries<Dim> bounds{grid, faces, obstacles, bodies, states, reach, 0.1};

  // cones at two nodes of three, in an order of their own
  std::vector<int> cone_node, node_cone(static_cast<std::size_t>(grid.node_count()), -1);
  for (int node = grid.node_count(); node-- > 0;) {
    bool in_box = true;
    for (int a = 0; a < Dim; ++a)
      in_box = in_box && grid.node_index(node)[a] >= 0 && grid.node_index(node)[a] <= grid.cells(a);
    if (!in_box || node % 3 == 0)
      continue;
    node_cone[static_cast<std::size_t>(node)] = static_cast<int>(cone_node.size());
    cone_node.push_back(node);
  }
  SolidsAtCones<Dim> solids(bounds);
  for (int again = 0; again < 2; ++again) { // the second time in the memory of the first
    solids.place(bounds);
    solids.find(grid, node_cone, cone_node.size());
    std::vector<std::pair<std::size_t, std::size_t>> held;
    for (std::size_t i = 0; i < cone_node.size(); ++i) {
      const Vec<Dim> x = grid.node_position(cone_node[i]);
      const Index<Dim> index = grid.node_index(cone_node[i]);
      Vec<Dim> inner = x, extent = grid.spacing(); // of what the box has of the node
      for (int a = 0; a < Dim; ++a)
        if (index[a] == 0 || index[a] == grid.cells(a)) {
          inner[a] += (index[a] == 0 ? 1 : -1) * grid.spacing()[a] / 3;
          extent[a] /= std::sqrt(3.0);
        }
      double share = 1;
      std::vector<std::size_t> holding, found;
      for (std::size_t o = 0; o < obstacles.size(); ++o) {
        share *= obstacles[o]->open_fraction(inner, extent, bounds.time);
        if (const auto contact = obstacles[o]->contact(x, grid.spacing(), bounds.time)) {
          holding.push_back(o);
          const auto ours = solids.at_obstacle(bounds, o, x).contact;
          REQUIRE(ours);
          CHECK(ours->normal == contact->normal);
          CHECK(ours->velocity == contact->velocity);
          CHECK(ours->friction == contact->friction);
        }
      }
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        const Posed<Dim> body{bodies[b].shape, states[b]};
        share *= node_in_solid<Dim>(body, inner, extent).open_fraction;
        if (node_in_solid<Dim>(body, x, grid.spacing()).contact)
          held.emplace_back(b, i);
      }
      CHECK(solids.look(bounds, i, index) == support::about(std::max(share, 0.1)));
      solids.for_each_holding_obstacle(bounds, i, [&](std::size_t o) { found.push_back(o); });
      CHECK(found == holding);
    }
    std::sort(held.begin(), held.end());
    CHECK(solids.held_by_bodies(bounds) == held);
  }
}

/// Counts how often it is asked.
struct Counted {
  double radius;
  std::size_t* calls;
  double distance(const Vec<2>& x) const {
    ++*calls;
    return x.norm() - radius;
  }
};

} // namespace

TEST_CASE("solids at nodes: what a loop over all solids finds, to the bit and in its order") {
  Random random(11);
  for (int n = 0; n < 6; ++n) {
    check_list<2>(random, {0, 0});
    check_list<3>(random, {-0.5, 0.2, 0});
  }
  check_list<2>(random, {5e6, -4e5});
  check_list<3>(random, {5e6, -4e5, 100});
}

TEST_CASE("a motion is asked once a step, with cfl twice, a shape only near it") {
  using Sim = Simulation<2, ConstantFriction, PolyPic, GaussSeidel<>>;
  for (const double cfl : {0.0, 0.5}) {
    Sim::Params params;
    params.grid = {.origin = {0, 0}, .size = {1, 1}, .cells = {100, 100}};
    params.material.density = 1500;
    params.gravity = {0, -9.81};
    params.time_step = 1e-3;
    params.cfl = cfl;
    params.rheology.mu = 0.4;
    params.faces = Faces<2>::all({FaceKind::free_slip});
    std::size_t motions = 0, of_obstacle = 0, of_body = 0;
    params.obstacles.push_back(make_obstacle<ShapeObstacle<2>>(
        {.shape = Counted{0.02, &of_obstacle}, .friction = 0.3, .motion = [&](double time) {
           ++motions;
           RigidState<2> state;
           state.position = {0.3 + 0.1 * time, 0.2};
           state.velocity = {0.1, 0};
           return state;
         }}));
    params.bodies = {ball_body<2>({0.7, 0.2}, 0.02, 2000, 0.3)};
    params.bodies[0].shape = Counted{0.02, &of_body};
    Particles<2> sand;
    fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {1, 0.5}, {.per_axis = 2});
    Sim sim(params, sand);
    motions = of_obstacle = of_body = 0;
    for (int i = 0; i < 3; ++i)
      REQUIRE(sim.step().cones > 5000);
    CHECK(motions == (cfl > 0 ? 6 : 3)); // at the end of the step, too
    // a box of 13² nodes, at most 8 distances each, and once more where it holds or moves
    CHECK(of_obstacle < 3 * 2 * 8 * 13 * 13);
    CHECK(of_body < 3 * 2 * 8 * 13 * 13);
  }
}

} // namespace test_solids
