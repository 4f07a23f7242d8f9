// SPDX-License-Identifier: MIT
// Signed distances against points of the surface, rigid motions, and how nodes see solids.

#include "talus/boundary/body.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/scene/fill.hpp"

#include "../support/files.hpp"

#include <Eigen/Geometry>
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace test_shapes {

using namespace talus;
using namespace talus::shapes;
using support::contains;
using support::message_of;

namespace {

template <class Function>
std::string refused(const Function& function) {
  return message_of<std::invalid_argument>(function);
}

template <int Dim>
Vec<Dim> random_point(Random& random) {
  Vec<Dim> x;
  for (int a = 0; a < Dim; ++a)
    x[a] = 4 * random.uniform() - 2;
  return x;
}

template <int Dim, class S>
void is_one_lipschitz(const S& solid) {
  Random random(7);
  for (int n = 0; n < 2000; ++n) {
    const Vec<Dim> x = random_point<Dim>(random), y = random_point<Dim>(random);
    CHECK(std::abs(solid.distance(x) - solid.distance(y)) <= (x - y).norm() * (1 + 1e-12));
  }
}

/// Walks from x by its distance along the normal: where it is exact, that is the surface.
template <int Dim, class S>
void is_exact(const S& solid, bool inside_too) {
  Random random(11);
  int seen = 0;
  for (int n = 0; n < 2000; ++n) {
    const Vec<Dim> x = random_point<Dim>(random);
    const double distance = solid.distance(x);
    if (distance < 0 && !inside_too)
      continue;
    const Vec<Dim> normal = surface_normal<Dim>(solid, x, 1e-6);
    const double left = solid.distance(Vec<Dim>(x - distance * normal));
    if (std::abs(left) < 1e-5)
      ++seen; // but for ridges, where the normal jumps
  }
  CHECK(seen > (inside_too ? 1950 : 900));
  is_one_lipschitz<Dim>(solid);
}

} // namespace

static_assert(SignedDistance<Ball<2>, 2> && SignedDistance<Cylinder, 3> &&
              !SignedDistance<Vec<2>, 2>);
static_assert(SignedDistance<Complement<Ball<3>>, 3> && SignedDistance<Shape<2>, 2>);

TEST_CASE("shapes of shapes whose type is forgotten") {
  const Shape<2> left = shapes::Ball<2>({0, 0}, 1), right = shapes::Ball<2>({1, 0}, 1);
  const Shape<2> moon = shapes::difference(left, right), again = shapes::difference(left, moon);
  const Shape<2> outside = shapes::Complement(moon), whole = shapes::Union(moon, left);
  CHECK(moon.distance({-0.5, 0}) == -0.5);
  CHECK(moon.distance({0.5, 0}) == 0.5);
  CHECK(again.distance({0.5, 0}) == -0.5);
  CHECK(outside.distance({-0.5, 0}) == 0.5);
  CHECK(whole.distance({0.5, 0}) == -0.5);
}

TEST_CASE("distances of solids are exact") {
  is_exact<2>(HalfSpace<2>({0.1, 0.2}, {1, 2}), true);
  is_exact<3>(HalfSpace<3>({0.1, 0.2, 0}, {1, 2, -1}), true);
  is_exact<2>(Ball<2>({0.1, 0.2}, 0.7), true);
  is_exact<3>(Ball<3>({0.1, 0.2, 0}, 0.7), true);
  is_exact<2>(Box<2>({-0.5, -1}, {0.9, 0.3}), true);
  is_exact<3>(Box<3>({-0.5, -1, -0.2}, {0.9, 0.3, 1}), true);
  is_exact<2>(Capsule<2>({-0.5, -1}, {0.9, 0.3}, 0.4), true);
  is_exact<3>(Capsule<3>({-0.5, -1, 0}, {0.9, 0.3, 1}, 0.4), true);
  is_exact<3>(Cylinder({-0.5, -1, 0}, {0.9, 0.3, 1}, 0.4), true);
  CHECK(Cylinder({0, 0, 0}, {0, 0, 1}, 0.5).distance({0.8, 0, 1.4}) == doctest::Approx(0.5));
  CHECK(Cylinder({0, 0, 0}, {0, 0, 1}, 0.5).distance({0.1, 0, 0.5}) == doctest::Approx(-0.4));
  CHECK(Box<2>({0, 0}, {1, 2}).distance({4, 6}) == doctest::Approx(5));
  CHECK(Capsule<2>({0, 0}, {1, 0}, 0.5).distance({4, 4}) == doctest::Approx(4.5));
}

TEST_CASE("composed solids") {
  const Ball<2> left({-0.5, 0}, 0.7), right({0.5, 0}, 0.7);
  is_exact<2>(Union(left, right), false);
  is_one_lipschitz<2>(Intersection(left, right));
  is_one_lipschitz<2>(difference(left, right));
  CHECK(Union(left, right).distance(Vec<2>(1.5, 0)) == doctest::Approx(0.3));
  CHECK(Intersection(left, right).distance(Vec<2>(0, 0)) == doctest::Approx(-0.2));
  CHECK(difference(left, right).distance(Vec<2>(0, 0)) == doctest::Approx(0.2));
  CHECK(Complement(left).distance(Vec<2>(-0.5, 0)) == doctest::Approx(0.7));
  const Mat<2> quarter = rotation_by<2>(Spin<2>(std::numbers::pi / 2));
  const Transformed<2, Box<2>> turned(Box<2>({0, 0}, {2, 1}), quarter,
                                      {1, 0}); // now [0, 1] × [0, 2]
  is_exact<2>(turned, true);
  CHECK(turned.distance({0.5, 2.5}) == doctest::Approx(0.5));
  CHECK(turned.distance({-0.25, 1}) == doctest::Approx(0.25));
  CHECK(translated<2>(left, {0, 3}).distance({-0.5, 3}) == doctest::Approx(-0.7));
  const Shape<2> any = Union(left, right), copy = any;
  CHECK(copy.distance({1.5, 0}) == any.distance({1.5, 0}));
  CHECK(Shape<2>().empty());
}

TEST_CASE("what makes no solid, obstacle or body is refused") {
  CHECK(contains(refused([] { Ball<2>({0, 0}, 0); }), "ball: radius is 0"));
  CHECK(contains(refused([] { Ball<2>({0, std::nan("")}, 1); }), "ball: centre is nan"));
  CHECK(contains(refused([] { HalfSpace<3>({0, 0, 0}, {0, 0, 0}); }), "|normal| is 0"));
  CHECK(contains(refused([] { Box<2>({0, 0}, {1, -1}); }), "box: upper - lower is -1"));
  CHECK(contains(refused([] { Capsule<2>({0, 0}, {0, 0}, 1); }), "capsule: |b - a| is 0"));
  CHECK(contains(refused([] { Cylinder({0, 0, 0}, {1, 0, 0}, -1); }), "cylinder: radius is -1"));
  CHECK(contains(refused([] {
                   Transformed<2, Ball<2>>(Ball<2>({0, 0}, 1), 2 * Mat<2>::Identity(), {0, 0});
                 }),
                 "a rotation"));
  CHECK(contains(refused([] { ShapeObstacle<2>({.shape = {}}); }), "shape is empty"));
  CHECK(contains(refused([] {
                   ShapeObstacle<2>({.shape = Ball<2>({0, 0}, 1), .friction = -1});
                 }),
                 "friction is -1"));
  auto body = ball_body<3>({0, 0, 0}, 1, 1, 0);
  body.mass = 0;
  CHECK(contains(refused([&] { body.validate(); }), "body.mass is 0"));
  body.mass = 1;
  body.inertia(0, 0) = -1;
  CHECK(contains(refused([&] { body.validate(); }), "positive definite"));
  body.rotates = false;
  body.validate();
  CHECK(contains(refused([] {
                   static_cast<void>(ball_body<2>({0, 0}, 1, 0, 0));
                 }),
                 "density is 0"));
}

TEST_CASE("mass and inertia of balls and blocks against sums over points") {
  const auto check = [](const Body<3>& body, double density) {
    constexpr int n = 60;
    Mat<3> inertia = Mat<3>::Zero();
    double mass = 0;
    for (int i = 0; i < n * n * n; ++i) {
      const Vec<3> x = (Vec<3>(i % n, i / n % n, i / n / n).array() + 0.5) / n * 2 - 1;
      if (body.shape.distance(x) > 0)
        continue;
      const double m = density * 8 / (n * n * n);
      mass += m;
      inertia += m * (x.squaredNorm() * Mat<3>::Identity() - x * x.transpose());
    }
    CHECK(body.mass == doctest::Approx(mass).epsilon(5e-3));
    CHECK((body.inertia - inertia).norm() < 0.01 * inertia.norm());
  };
  check(ball_body<3>({5, 5, 5}, 0.9, 1000, 0), 1000);
  check(block_body<3>({5, 5, 5}, {1, 1.4, 1.8}, 1000, 0), 1000);
  const auto disc = ball_body<2>({0, 0}, 0.9, 1000, 0);
  CHECK(disc.mass == doctest::Approx(1000 * std::numbers::pi * 0.81));
  CHECK(disc.inertia(0, 0) == doctest::Approx(disc.mass * 0.81 / 2));
  CHECK(block_body<2>({0, 0}, {1, 2}, 3, 0).inertia(0, 0) == doctest::Approx(6 * 5 / 12.0));
}

TEST_CASE("rigid motions") {
  const Vec<3> omega(0.3, -0.5, 0.7), x(1, 2, 3);
  const Mat<3> small = rotation_by<3>(Spin<3>(1e-7 * omega));
  CHECK(((small * x - x) / 1e-7 - cross<3>(omega, x)).norm() < 1e-6);
  CHECK((rotation_by<3>(omega) * omega - omega).norm() < 1e-15); // the axis stays
  CHECK((rotation_by<3>(Spin<3>(Vec<3>(0, 0, std::numbers::pi / 2))) * Vec<3>(1, 0, 0) -
         Vec<3>(0, 1, 0))
            .norm() < 1e-15);
  CHECK((torque<3>(x, omega) - x.cross(omega)).norm() == 0);
  CHECK(torque<2>({1, 2}, {3, 5})[0] == -1);
  RigidState<3> state;
  state.position = {1, 0, 0};
  state.velocity = {0, 1, 0};
  state.angular_velocity = omega;
  const auto motion = steady_motion<3>(state);
  const double dt = 1e-6;
  const RigidState<3> now = motion(2), soon = motion(2 + dt);
  const Vec<3> in_body(0.2, 0.3, 0.4), at = now.position + now.rotation * in_body;
  CHECK(((soon.position + soon.rotation * in_body - at) / dt - now.velocity_at(at)).norm() < 1e-5);
  CHECK((now.in_body(at) - in_body).norm() < 1e-14);
  Wrench<2> wrench;
  wrench.add({2, 0}, {0, 3});
  CHECK(wrench.torque[0] == 6);
  CHECK(wrench.torque_about({1, 0})[0] == 3);
}

TEST_CASE("nodes see a plane where it is, and half of their volume at it") {
  const Vec<2> spacing(0.1, 0.2);
  const HalfSpace<2> floor({0, 0}, {0, 1});
  const auto at = [&](double y) { return node_in_solid<2>(floor, {0.3, y}, spacing); };
  CHECK(at(0).open_fraction == doctest::Approx(0.5));
  CHECK(at(0.2).open_fraction == doctest::Approx(1));
  CHECK(at(-0.2).open_fraction == doctest::Approx(0));
  CHECK(at(0.1).open_fraction == doctest::Approx(0.875)); // ∫ of the hat above −1/2
  CHECK(at(0.05).open_fraction + at(-0.05).open_fraction == doctest::Approx(1));
  CHECK(at(0.1).contact);
  CHECK(!at(0.101).contact);
  CHECK(at(-5).contact);
  CHECK((at(0.1).normal - Vec<2>(0, 1)).norm() < 1e-9);
}

TEST_CASE("the open share of a node is the part of its volume outside: askew, round, at edges") {
  const auto check = []<int Dim>(const Shape<Dim>& solid, const Vec<Dim>& spacing, double far) {
    constexpr int cuts = Dim == 2 ? 60 : 24;
    Random random(5);
    double squares = 0;
    int count = 0;
    for (int k = 0; k < 400; ++k) {
      Vec<Dim> x;
      for (int a = 0; a < Dim; ++a)
        x[a] = far * (2 * random.uniform() - 1);
      double open = 0, all = 0; // ∫ of the shape function
      for (int n = 0; n < ipow(cuts, Dim); ++n) {
        Vec<Dim> y = x;
        double weight = 1;
        for (int a = 0, rest = n; a < Dim; ++a, rest /= cuts) {
          const double t = (2 * (rest % cuts) + 1.0) / cuts - 1;
          y[a] += t * spacing[a];
          weight *= 1 - std::abs(t);
        }
        all += weight;
        open += solid.distance(y) > 0 ? weight : 0;
      }
      if (open == 0 || open == all)
        continue;
      const double error = node_in_solid<Dim>(solid, x, spacing).open_fraction - open / all;
      squares += error * error;
      ++count;
    }
    CHECK(count > 100);
    return std::sqrt(squares / count);
  };
  const Shape<2> askew = HalfSpace<2>({0, 0}, {0.6, 0.8}), block = Box<2>({-3, -2.5}, {3, 2.5});
  CHECK(check(askew, Vec<2>(1, 1), 3) < 0.01);
  CHECK(check(askew, Vec<2>(1, 0.5), 3) < 0.01);
  CHECK(check(Shape<2>(Ball<2>({0, 0}, 2.5)), Vec<2>(1, 1), 4) < 0.035);
  CHECK(check(Shape<2>(Complement(Ball<2>({0, 0}, 4))), Vec<2>(1, 0.5), 5) < 0.02);
  CHECK(check(block, Vec<2>(1, 1), 4.5) < 0.03);
  CHECK(check(Shape<2>(Complement(block)), Vec<2>(1, 1), 4.5) < 0.03);
  CHECK(check(Shape<3>(Ball<3>({0, 0, 0}, 4)), Vec<3>(1, 1, 1), 5) < 0.03);
  CHECK(check(Shape<3>(Box<3>({-3, -2.5, -3}, {3, 2.5, 3})), Vec<3>(1, 1, 1), 4.5) < 0.05);
}

TEST_CASE("a plate is two cells thick for nodes, with a normal on either side and in its middle") {
  const Vec<2> spacing(0.1, 0.1);
  for (const double thickness : {0.0, 0.05, 0.2}) {
    const Box<2> plate({-5, -thickness / 2}, {5, thickness / 2});
    for (int k = -200; k <= 200; ++k) {
      const double y = 1e-3 * k;
      const auto node = node_in_solid<2>(plate, {0, y}, spacing);
      INFO("thickness ", thickness, ", y ", y);
      CHECK(node.contact == (std::abs(k) <= 150)); // one cell, and half a cell above that
      if (node.contact) {
        CHECK(std::abs(node.normal[1]) == doctest::Approx(1));
        if (k != 0)
          CHECK(node.normal[1] * y > 0);
      }
    }
  }
}

TEST_CASE("a thin solid counts as no thicker than two cells, whatever its distances are below") {
  struct Hollow { // two walls around a gap; above them no more than the distance to their box
    double distance(const Vec<2>& x) const { return x[1] > 1 ? x[1] - 1 : 0.5; }
  };
  CHECK_FALSE(node_in_solid<2>(Hollow{}, {0, 1.2}, {0.1, 0.1}).contact);
}

} // namespace test_shapes
