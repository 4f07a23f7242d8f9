// SPDX-License-Identifier: MIT
// What physics does not know: which axis is which, left from right, and the units.

#include "../support/about.hpp"

#include "talus/boundary/shape_obstacle.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace test_symmetries {

using namespace talus;

namespace {

/// The same things told otherwise: axis `old[a]`, turned round where `turned[a]`, is axis a, and
/// what was 1 m, 1 s, 1 kg is `length`, `time`, `mass`.
template <int Dim>
struct Telling {
  SmallArray<int, Dim> old{};
  SmallArray<bool, Dim> turned{};
  double length = 1, time = 1, mass = 1;

  double unit(int lengths, int times, int masses = 0) const {
    return std::pow(length, lengths) * std::pow(time, times) * std::pow(mass, masses);
  }
  double stress() const { return unit(-1, -2, 1) * (Dim == 2 ? length : 1); }
  Mat<Dim> turn() const {
    Mat<Dim> turn = Mat<Dim>::Zero();
    for (int a = 0; a < Dim; ++a)
      turn(a, old[a]) = turned[a] ? -1 : 1;
    return turn;
  }
  Vec<Dim> vector(const Vec<Dim>& v, double unit) const { return unit * (turn() * v); }
  Mat<Dim> tensor(const Mat<Dim>& t, double unit) const {
    return unit * (turn() * t * turn().transpose());
  }
  Spin<Dim> spin(const Spin<Dim>& w, double unit) const { // a mirror turns it the other way
    const Mat<Dim> m = turn();
    if constexpr (Dim == 2)
      return unit * torque<2>(m.col(0), m.col(1))[0] * w;
    else
      return unit * torque<3>(m.col(0), m.col(1)).dot(m.col(2)) * (m * w);
  }
  RigidState<Dim> state(const RigidState<Dim>& s) const {
    return {vector(s.position, length), tensor(s.rotation, 1), vector(s.velocity, unit(1, -1)),
            spin(s.angular_velocity, unit(0, -1))};
  }
  Shape<Dim> shape(const Shape<Dim>& s) const {
    struct Told {
      Shape<Dim> shape;
      Mat<Dim> back;
      double length;
      double distance(const Vec<Dim>& x) const {
        return length * shape.distance(back * x / length);
      }
    };
    return Told{s, turn().transpose(), length};
  }
  Face face(const Faces<Dim>& faces, int a, bool upper) const {
    return upper != turned[a] ? faces.upper[old[a]] : faces.lower[old[a]];
  }
};

template <int Dim>
Telling<Dim> as_it_is() {
  Telling<Dim> told;
  for (int a = 0; a < Dim; ++a)
    told.old[a] = a;
  return told;
}

template <class S>
struct Scene {
  static constexpr int dim = S::dimension;
  typename S::Params params;
  std::vector<typename ShapeObstacle<dim>::Params> obstacles;
  Particles<dim> particles;

  S told(const Telling<dim>& by) const {
    auto p = params;
    for (int a = 0; a < dim; ++a) {
      const int o = by.old[a];
      const double from = params.grid.origin[o];
      p.grid.origin[a] = by.length * (by.turned[a] ? -(from + params.grid.size[o]) : from);
      p.grid.size[a] = by.length * params.grid.size[o];
      p.grid.cells[a] = params.grid.cells[o];
      p.faces.lower[a] = by.face(params.faces, a, false);
      p.faces.upper[a] = by.face(params.faces, a, true);
    }
    const double density = by.unit(-dim, 0, 1);
    p.material.density *= density;
    p.gravity = by.vector(params.gravity, by.unit(1, -2));
    p.time_step *= by.time;
    if constexpr (requires { p.rheology.viscosity; }) {
      p.rheology.inertial.grain_diameter *= by.length;
      p.rheology.inertial.density *= density;
      p.rheology.cohesion *= by.stress();
      p.rheology.viscosity *= by.stress() * by.time;
    }
    for (auto obstacle : obstacles) {
      obstacle.shape = by.shape(obstacle.shape);
      if (obstacle.motion)
        obstacle.motion = [by, motion = obstacle.motion](double t) {
          return by.state(motion(t / by.time));
        };
      p.obstacles.push_back(std::make_shared<ShapeObstacle<dim>>(obstacle));
    }
    for (Body<dim>& body : p.bodies) {
      body.shape = by.shape(body.shape);
      body.mass *= by.mass;
      if constexpr (dim == 3)
        body.inertia = by.tensor(body.inertia, 1);
      body.inertia *= by.unit(2, 0, 1);
      body.start = by.state(body.start);
      for (Vec<dim>& corner : body.corners)
        corner = by.vector(corner, by.length);
      body.corner_radius *= by.length;
    }
    Particles<dim> sand = particles;
    for (std::size_t i = 0; i < sand.size(); ++i) {
      sand.position[i] = by.vector(sand.position[i], by.length);
      sand.velocity[i] = by.vector(sand.velocity[i], by.unit(1, -1));
      sand.affine[i] = by.tensor(sand.affine[i], by.unit(0, -1));
      sand.volume[i] *= by.unit(dim, 0);
    }
    return S(p, sand);
  }
};

/// The largest difference between what `sim` and `other`, which is the same in another telling,
/// have, over the largest value of its kind.
template <class S>
double difference(const S& sim, const S& other, const Telling<S::dimension>& by) {
  constexpr int dim = S::dimension;
  double worst = 0;
  double error = 0, largest = 0;
  const auto add = [&](const auto& told, const auto& found) {
    error = larger_or_nan(error, (told - found).cwiseAbs().maxCoeff());
    largest = larger_or_nan(largest, told.cwiseAbs().maxCoeff());
  };
  const auto next = [&] {
    if (error > 0 || std::isnan(error))
      worst = larger_or_nan(worst, error / largest);
    error = largest = 0;
  };
  const auto& sand = sim.particles();
  const auto& same = other.particles();
  REQUIRE(sand.size() == same.size());
  std::vector<std::size_t> place(same.next_id);
  for (std::size_t p = 0; p < same.size(); ++p)
    place[same.id[p]] = p;
  const auto of_particles = [&](const auto& told) {
    for (std::size_t p = 0; p < sand.size(); ++p)
      told(p, place[sand.id[p]]);
    next();
  };
  of_particles([&](std::size_t p, std::size_t q) {
    add(by.vector(sand.position[p], by.length), same.position[q]);
  });
  of_particles([&](std::size_t p, std::size_t q) {
    add(by.vector(sand.velocity[p], by.unit(1, -1)), same.velocity[q]);
  });
  of_particles([&](std::size_t p, std::size_t q) {
    add(by.tensor(sand.affine[p], by.unit(0, -1)), same.affine[q]);
  });
  for (std::size_t b = 0; b < sim.bodies().size(); ++b) {
    const RigidState<dim> told = by.state(sim.bodies()[b]), found = other.bodies()[b];
    add(told.position, found.position);
    next();
    add(told.rotation, found.rotation);
    next();
    add(told.velocity, found.velocity);
    next();
    add(told.angular_velocity, found.angular_velocity);
    next();
  }
  // Where several solids hold a node, how they share its force is open: only the sum is not.
  const auto force = [](const S& of) {
    Vec<dim> sum = Vec<dim>::Zero();
    for (int a = 0; a < dim; ++a)
      sum += of.face_wrench(a, false).force + of.face_wrench(a, true).force;
    for (std::size_t k = 0; k < of.params().obstacles.size(); ++k)
      sum += of.obstacle_wrench(k).force;
    for (std::size_t b = 0; b < of.bodies().size(); ++b)
      sum -= of.body_wrench(b).force;
    return sum;
  };
  add(by.vector(force(sim), by.stress() * by.unit(dim - 1, 0)), force(other));
  next();
  const Grid<dim>& grid = sim.grid();
  const auto of_nodes = [&](const auto& told) {
    for (int j = 0; j < grid.node_count(); ++j) {
      const Index<dim> node = grid.node_index(j);
      Index<dim> there;
      for (int a = 0; a < dim; ++a)
        there[a] = by.turned[a] ? grid.cells(by.old[a]) - node[by.old[a]] : node[by.old[a]];
      told(node, there);
    }
    next();
  };
  of_nodes([&](const Index<dim>& node, const Index<dim>& there) {
    add(Vec<1>(sim.volume_fraction(node)), Vec<1>(other.volume_fraction(there)));
  });
  of_nodes([&](const Index<dim>& node, const Index<dim>& there) {
    add(by.tensor(sim.stress(node), by.stress()), other.stress(there));
  });
  return worst;
}

template <class S>
double difference_after(int steps, const Scene<S>& scene, const Telling<S::dimension>& by) {
  S sim = scene.told(as_it_is<S::dimension>()), other = scene.told(by);
  for (int n = 0; n < steps; ++n) {
    const StepReport report = sim.step(), same = other.step();
    CHECK(report.completed());
    CHECK(same.solve.status == report.solve.status);
    CHECK(same.time_step == support::about(by.time * report.time_step));
  }
  return difference(sim, other, by);
}

/// Sand that moves, seeded as users do, in cells that are no cubes, under gravity askew, between
/// faces of all kinds.
template <class S>
Scene<S> sand_in_a_box() {
  constexpr int dim = S::dimension, up = up_axis<dim>;
  Scene<S> scene;
  auto& p = scene.params;
  for (int a = 0; a < dim; ++a) {
    p.grid.origin[a] = 0.25 * a - 0.5;
    p.grid.cells[a] = a == 0 ? 7 : a == up ? 6 : 4;
    p.grid.size[a] = p.grid.cells[a] * (a == up ? 0.15625 : 0.125);
  }
  p.gravity = -9.81 * Vec<dim>::Unit(up) + 2.7 * Vec<dim>::Unit(0);
  if constexpr (dim == 3)
    p.gravity[1] = 0.8;
  p.time_step = 1.0 / 512;
  p.material.density = 1500;
  p.faces = Faces<dim>::all({FaceKind::frictional, 0.3});
  p.faces.lower[0] = {FaceKind::frictional, 0.6};
  p.faces.lower[up] = {FaceKind::no_slip};
  p.faces.upper[up] = {FaceKind::open};
  if constexpr (dim == 3)
    p.faces.upper[1] = {FaceKind::free_slip};
  Vec<dim> upper = p.grid.origin + p.grid.size;
  upper[0] -= 0.18;
  upper[up] -= 0.35;
  fill_box<dim>(scene.particles, Grid<dim>(p.grid), p.grid.origin, upper, {.per_axis = 2});
  for (std::size_t i = 0; i < scene.particles.size(); ++i) {
    const Vec<dim>& x = scene.particles.position[i];
    scene.particles.velocity[i] = 0.2 * Vec<dim>::Unit(0) * std::sin(7 * x[up]);
    scene.particles.affine[i](0, up) = 1.4 * std::cos(7 * x[up]);
  }
  return scene;
}

template <int Dim>
using Usual = Simulation<Dim, ConstantFriction, PolyPic, GaussSeidel<>>;

template <int Dim>
Scene<Usual<Dim>> usual_scene() {
  auto scene = sand_in_a_box<Usual<Dim>>();
  scene.params.rheology.mu = 0.44;
  scene.params.solver.tolerance = 1e-12;
  scene.params.solver.max_sweeps = 50000;
  return scene;
}

/// A falling block that turns, and a bar that moves under the surface.
template <class S>
void add_solids(Scene<S>& scene) {
  constexpr int dim = S::dimension, up = up_axis<dim>;
  const auto place = [&](double along, double height) {
    Vec<dim> x = scene.params.grid.origin + scene.params.grid.size / 2;
    x[0] += along;
    x[up] += height;
    return x;
  };
  Vec<dim> size = Vec<dim>::Constant(0.26);
  size[0] = 0.3;
  auto body = block_body<dim>(place(0.2, 0.26), size, 900, 0.4);
  body.start.velocity = -0.3 * Vec<dim>::Unit(up);
  body.start.angular_velocity.setOnes();
  body.start.rotation = rotation_by<dim>(Spin<dim>(Spin<dim>::Constant(0.2)));
  scene.params.bodies.push_back(body);
  Vec<dim> half = Vec<dim>::Constant(0.05);
  half[0] = 0.15;
  RigidState<dim> start;
  start.position = place(-0.15, 0.03);
  start.velocity[0] = 0.2;
  start.rotation = rotation_by<dim>(Spin<dim>(Spin<dim>::Constant(-0.15)));
  scene.obstacles.push_back(
      {.shape = shapes::Box<dim>(-half, half), .friction = 0.4, .motion = steady_motion(start)});
}

/// Each axis turned round, each exchanged with the next one, and all of that at once.
template <int Dim>
std::vector<Telling<Dim>> tellings() {
  std::vector<Telling<Dim>> all;
  Telling<Dim> together = as_it_is<Dim>();
  for (int a = 0; a < Dim; ++a) {
    all.push_back(as_it_is<Dim>());
    all.back().turned[a] = together.turned[a] = true;
    if (a == 0)
      continue;
    all.push_back(as_it_is<Dim>());
    for (Telling<Dim>* told : {&all.back(), &together})
      std::swap(told->old[a - 1], told->old[a]);
  }
  all.push_back(together);
  return all;
}

template <int Dim>
void check_axes(const Scene<Usual<Dim>>& scene) {
  for (const Telling<Dim>& told : tellings<Dim>()) {
    CAPTURE(told.turn());
    CHECK(difference_after(4, scene, told) < 1e-7);
  }
}

/// Powers of four, so that no root and no product is rounded otherwise.
template <int Dim>
Telling<Dim> other_units() {
  Telling<Dim> told = as_it_is<Dim>();
  told.length = 1024;
  told.time = 1.0 / 64;
  told.mass = 1.0 / 4194304;
  return told;
}

} // namespace

TEST_CASE("any axis may be up, and left be right") {
  for (const bool even : {false, true}) {
    auto plane = usual_scene<2>();
    plane.params.packing.even = even;
    check_axes(plane);
    auto room = usual_scene<3>();
    room.params.packing.even = even;
    check_axes(room);
  }
}

TEST_CASE("any axis may be up, and left be right, with bodies and obstacles, by cfl") {
  auto plane = usual_scene<2>();
  add_solids(plane);
  plane.params.cfl = 0.02;
  check_axes(plane);
  auto room = usual_scene<3>();
  add_solids(room);
  room.params.cfl = 0.02;
  check_axes(room);
}

TEST_CASE("any axis may be up, and left be right, in a periodic box") {
  const auto make = [](auto scene) {
    scene.params.faces.lower[0] = scene.params.faces.upper[0] = {FaceKind::periodic};
    return scene;
  };
  check_axes(make(usual_scene<2>()));
  check_axes(make(usual_scene<3>()));
}

TEST_CASE("other units, the same bits") {
  const auto check = []<int Dim>(std::integral_constant<int, Dim>) {
    auto usual = usual_scene<Dim>();
    usual.params.solver = {};
    add_solids(usual);
    usual.params.cfl = 0.05;
    CHECK(difference_after(20, usual, other_units<Dim>()) == 0);
    using S = Simulation<Dim, WithViscosity<WithCohesion<MuOfI>>, PolyPic, GaussSeidel<>>;
    auto modified = sand_in_a_box<S>();
    modified.params.rheology = {
        .law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279},
        .inertial = {.grain_diameter = 1e-3, .density = 1500, .strain_factor = 1},
        .cohesion = 200,
        .viscosity = 20};
    modified.params.friction_updates = 3;
    modified.params.packing.even = true;
    CHECK(difference_after(20, modified, other_units<Dim>()) == 0);
  };
  check(std::integral_constant<int, 2>());
  check(std::integral_constant<int, 3>());
}

} // namespace test_symmetries
