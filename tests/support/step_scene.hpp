// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/node_fields.hpp"
#include "talus/step/solids.hpp"

#include <cstddef>
#include <memory>
#include <vector>

/// What a step has around it, to call its parts one by one.
namespace support {

using namespace talus;

/// But for rounding.
template <class Vector>
bool close(const Vector& a, const Vector& b) {
  return (a - b).norm() < 1e-12;
}

template <int Dim>
Vec<Dim> unit(int axis) {
  return Vec<Dim>::Unit(axis);
}

/// A point by its coordinates downslope and up; 2 across.
template <int Dim>
Vec<Dim> point(double x, double z) {
  Vec<Dim> p = Vec<Dim>::Constant(2);
  p[0] = x;
  p[up_axis<Dim>] = z;
  return p;
}

/// Four cells along each axis of the box from (1, 1, 1), 1/2 m long and wide and 1/4 m high, and
/// what a step has around it.
template <int Dim>
struct Scene {
  static constexpr int up = up_axis<Dim>;
  static constexpr int beside = (ipow(3, Dim) - 1) / 2 + ipow(3, Dim - 1); ///< the neighbour at +x

  Grid<Dim> grid;
  Faces<Dim> faces = Faces<Dim>::all({FaceKind::open});
  std::vector<std::shared_ptr<const Obstacle<Dim>>> obstacles;
  std::vector<Body<Dim>> bodies;
  Array<RigidState<Dim>> states;
  Array<double> reach;
  DualProblem<Dim> problem;
  Array<int> cone;
  Array<std::size_t> rank;
  SolidsAtCones<Dim> solids;
  NodeFields fields;
  StepWorkspace<Dim> work;

  explicit Scene(const SmallArray<bool, Dim>& periodic = {}) {
    GridParams<Dim> box;
    box.origin.setOnes();
    box.size = point<Dim>(2, 1);
    for (int a = 0; a < Dim; ++a)
      box.cells[a] = 4;
    grid = problem.grid = Grid<Dim>(box, periodic);
    const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
    problem.velocity.assign(nodes, NodeVec<Dim>::Zero());
    problem.inverse_mass.assign(nodes, NodeVec<Dim>::Zero());
    cone.assign(nodes, -1);
    rank.assign(nodes, 0);
    fields.start(nodes);
    work.start(nodes);
  }
  Boundaries<Dim> bounds() const { return {grid, faces, obstacles, bodies, states, reach, 0}; }

  /// A node by its numbers downslope and up, in the middle across.
  static Index<Dim> index(int i, int k) {
    Index<Dim> node;
    for (int a = 0; a < Dim; ++a)
      node[a] = 2;
    node[0] = i;
    node[up] = k;
    return node;
  }
  int node(int i, int k) const { return grid.node(index(i, k)); }

  /// A cone at a node of 1/2 kg.
  std::size_t add_cone(int i, int k) {
    const int j = node(i, k);
    const std::size_t number = problem.cones();
    cone[j] = static_cast<int>(number);
    rank[j] = number;
    problem.node.push_back(j);
    problem.gradient_weights.push_back(GradientWeights<Dim>::Zero());
    problem.free_volume_rate.push_back(0);
    problem.opening.push_back(0.5);
    problem.node_volume.push_back(grid.node_volume(index(i, k)));
    problem.stress_impulse.push_back(Vec<symmetric_size<Dim>>::Zero());
    problem.inverse_mass[j].template head<Dim>().setConstant(2);
    return number;
  }
  /// A ball of 1/4 m, 2 kg and 1/8 kg m².
  void add_ball(const Vec<Dim>& centre) {
    bodies.push_back(ball_body<Dim>(centre, 0.25, 1000, 0.4));
    states.push_back(bodies.back().start);
    reach.push_back(0.25);
    problem.bodies.emplace_back();
    problem.bodies.back().inverse_mass = 0.5;
    problem.bodies.back().inverse_inertia.setIdentity();
    problem.bodies.back().inverse_inertia *= 8;
  }
  /// All below z, which moves at 2 m/s along x and turns by 3 rad/s about (1, z), from x to z.
  void add_ground(double z) {
    RigidState<Dim> start;
    start.position.setOnes();
    start.position[up] = z;
    start.velocity[0] = 2;
    start.angular_velocity[spin_size<Dim> / 2] = Dim == 2 ? 3 : -3;
    obstacles.push_back(make_obstacle<ShapeObstacle<Dim>>(
        {.shape = shapes::HalfSpace<Dim>(Vec<Dim>::Zero(), unit<Dim>(up)),
         .friction = 0.2,
         .motion = steady_motion(start)}));
  }
  /// The open shares of the cones' nodes.
  std::vector<double> look() {
    solids = SolidsAtCones<Dim>(bounds());
    solids.place(bounds());
    solids.find(grid, cone, problem.cones());
    std::vector<double> share;
    for (std::size_t i = 0; i < problem.cones(); ++i)
      share.push_back(solids.look(bounds(), i, grid.node_index(problem.node[i])));
    return share;
  }
  /// The velocity (0, .., 1) of the neighbour at +x, coupled by the weight: D_xz = weight/2.
  void shear(std::size_t i, double weight) {
    problem.velocity[problem.node[i] + grid.node_stride(0)][up] = 1;
    problem.gradient_weights[i](0, beside) = weight;
  }
};

} // namespace support
