// SPDX-License-Identifier: MIT
// The parts of a step one by one, against numbers worked out by hand.

#include "talus/boundary/body.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/contacts.hpp"
#include "talus/step/face_conditions.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/friction.hpp"
#include "talus/step/node_fields.hpp"
#include "talus/step/overfilled.hpp"
#include "talus/step/report.hpp"
#include "talus/step/room.hpp"
#include "talus/step/solids.hpp"
#include "talus/step/state.hpp"
#include "talus/step/time_step.hpp"
#include "talus/step/wrenches.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

using namespace talus;
using support::about;
using support::message_of;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

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
    fields = NodeFields(nodes);
    work = StepWorkspace<Dim>(nodes);
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
      share.push_back(solids.look(bounds(), i, grid.node_position(problem.node[i])));
    return share;
  }
  /// The velocity (0, .., 1) of the neighbour at +x, coupled by the weight: D_xz = weight/2.
  void shear(std::size_t i, double weight) {
    problem.velocity[problem.node[i] + grid.node_stride(0)][up] = 1;
    problem.gradient_weights[i](0, beside) = weight;
  }
};

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
    collect_body_contacts(s.bounds(), s.solids, s.rank, 0.125, {last, ratio}, s.problem);
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
  Array<Outflow> partials;
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
  Scene<Dim> s;
  CHECK(time_step(s) == 2);                                   // the largest
  CHECK(time_step<Dim>(s, -unit<Dim>(up)) == 0.5 * 0.25 / 2); // |g| δt_max = 2 m/s
  s.problem.velocity[s.node(3, 3)][0] = -4;
  CHECK(time_step(s) == 0.0625); // half a cell of 1/2 m at 4 m/s
  CHECK(time_step<Dim>(s, 2 * unit<Dim>(0)) == 0.03125);
  CHECK(time_step<Dim>(s, unit<Dim>(up)) == 0.0625); // 8 cells a second both ways
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
  CHECK(time_step<Dim>(s, 2 * unit<Dim>(0)) == 0.03125);
  // Outside it may come back by half a cell: 3/4 m of gap and 1/4 m at 4 m/s.
  s.states[0].position[0] = 4;
  CHECK(time_step(s) == 0.25);
  s.states[0].velocity[0] = 0; // and beside the box it does not matter how fast it is across
  s.states[0].angular_velocity[0] = 0;
  s.states[0].velocity[up] = 1000;
  CHECK(time_step(s) == 2);
}

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
      {.law = {.law = {.mu_static = 0.25, .mu_limit = 0.5, .I_0 = 1}, .inertial = inertial},
       .cohesion = 6});
  const MuOfI& loose = law;
  const Stencil<Dim> stencil(s.grid);
  s.problem.stress_impulse[0][0] = normal_from_mean<Dim>(2);
  // rate = (v/2)/(v/2); p = φ 2/δt = 8 Pa
  CHECK(cone_inertial_number(loose, s.problem, stencil, 0, v / 2, 0.125) == about(1));
  // twice as full as dense: rate 1/4, φ no more than 1, p = 16 Pa
  CHECK(cone_inertial_number(loose, s.problem, stencil, 0, 2 * v, 0.125) ==
        about(0.5 / std::sqrt(8)));
  // c/μ(0) = 24 Pa more
  CHECK(cone_inertial_number(law, s.problem, stencil, 0, v / 2, 0.125) == about(0.5));
  s.problem.free_volume_rate[0] = 1; // come apart
  CHECK(cone_inertial_number(law, s.problem, stencil, 0, v / 2, 0.125) == about(1));
}

/// k_i of the middle node as a share of its volume, > 0 to compact.
template <int Dim>
struct RoomAtNode : Scene<Dim> {
  Packing packing{.slack = 0.0625, .dilatancy = 2};
  bool surfaces = false;
  int middle = this->node(2, 2);

  RoomAtNode() { this->add_cone(2, 2); }
  Room<Dim> room() {
    return {this->faces, packing, surfaces, stencil, 0.5, this->fields, this->work, this->problem};
  }
  double room_now() const { // k_N = sqrt(d/2) room v/(d δt)
    return this->problem.free_volume_rate[0] * Dim * 0.5 /
           (std::sqrt(Dim / 2.0) * this->problem.node_volume[0]);
  }
  /// fraction: φ; mean: of its material's places, in cells.
  double set(double fraction, double strain = 0, const Vec<Dim>& mean = Vec<Dim>::Zero()) {
    const double material = fraction * this->problem.node_volume[0];
    this->fields.material_volume[middle] = material;
    this->shear(0, strain * material / 0.5); // |γ̇| δt = 2 (weight/2)/material δt
    room().set(0, this->index(2, 2), material * mean);
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
  // beside a solid that leaves half of the node
  s.fields.open_fraction[s.middle] = 0.5;
  CHECK(s.set(1.5, 0.25) == 0);
  s.surfaces = true; // even if it ends there, below a surface
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
  CHECK(s.look()[1] == about(0.5)); // on its surface
  CHECK(s.look()[4] == 1);          // a cell off
  s.add_ground(1.25);
  CHECK(s.look()[1] == about(0.25)); // a half of a half
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
    add_to_holding_faces<3>(s.bounds(), s.grid.node(index), inverse_mass, {2, 4, 6}, wrenches);
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
                      Execution(), s.work.held_momentum, wrenches);
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
  FrictionIteration iteration;
  iteration.next = {1, 0.5};
  CHECK(iteration.change(s.problem) == 0); // without stress
  s.problem.stress_impulse[0][0] = 6;
  s.problem.stress_impulse[1][0] = 8;
  CHECK(iteration.change(s.problem) == about(3.0 / 5)); // of μ p: 3 and 0, of 3 and 4
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
    const Room<2> set{s.faces, packing, true, Stencil<2>(s.grid), 0.5, s.fields, s.work, s.problem};
    set.set(cone, s.index(i, k), half * mean);
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
  s.surfaces = s.packing.even = true;
  for (const auto& [i, k] : {std::pair(1, 2), {3, 2}, {2, 1}, {2, 3}})
    s.fields.material_volume[s.node(i, k)] = 0.125; // there is no surface
  const auto inside = [&] {
    s.room().set_inside(0);
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
  s.room().set_inside(0);
  CHECK(s.problem.free_volume_rate[0] == 17);
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
  for_each_corner_gap(s.grid, s.faces, body, state,
                      [&](auto... gap) { gaps.emplace_back(gap...); });
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
  const FreeBodies<2> free = start_bodies<2>({ball, held}, s.grid, s.faces, nodes);
  CHECK(free.radius == Array<double>{0.25, 0.25});
  CHECK(free.reach[0] == about(std::sqrt(2) * 0.25));
  CHECK(free.start[0].angular_velocity[0] == 3);
  CHECK(free.start[1].angular_velocity[0] == 0);
  CHECK(free.inverse_inertia[0](0, 0) == 1 / ball.inertia(0, 0));
  CHECK(free.inverse_inertia[1](0, 0) == 0);
  const auto refused = [&](const Vec<2>& centre, double radius) {
    const Body<2> body = ball_body<2>(centre, radius, 1000, 0.3);
    return message_of<std::invalid_argument>(
        [&] { start_bodies<2>({body}, s.grid, s.faces, nodes); });
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
  t.problem.bodies[0].angular_velocity = {1, 2, 3};
  FreeBodies<3> spinning;
  spinning.reach = t.reach;
  spinning.inverse_inertia = {t.bodies[0].inverse_inertia()};
  CHECK(move_bodies(t.bodies, spinning, t.problem, 0.5, t.states) == 0);
  const RigidState<3>& now = t.states[0];
  CHECK(close(Vec<3>(in_box(now, t.bodies[0].inertia) * now.angular_velocity), Vec<3>(1, 4, 12)));
  CHECK(close(now.rotation, rotation_by<3>({0.5, 1, 1.5})));
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
