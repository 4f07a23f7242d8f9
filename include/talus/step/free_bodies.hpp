// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

/// \file
/// Free bodies from step to step: their start, their unknowns in the dual problem, their motion.

namespace talus {

/// What follows from the parameters of the free bodies; #bodies each.
template <int Dim>
struct FreeBodies {
  Array<double> radius;                       ///< of their corners, m
  Array<double> reach;                        ///< of their shapes and corners, m
  Array<Mat<spin_size<Dim>>> inverse_inertia; ///< in their own frames; 0: it does not rotate
};

/// A bound of how far a shape reaches from its origin, m: the corner of the box that is free of it,
/// as seen from `far` (m) away, where a sphere of the distance there is nearly a plane. Infinite in
/// practice (of the order of `far`) for a shape that has no end.
template <int Dim>
double reach_of(const Shape<Dim>& shape, double far) {
  double reach2 = 0;
  for (int a = 0; a < Dim; ++a) {
    double along = 0;
    for (const double side : {-1.0, 1.0})
      along = std::max(along, far - shape.distance(side * far * Vec<Dim>::Unit(a)));
    reach2 += along * along;
  }
  return std::sqrt(reach2);
}

/// How far a body of this reach (m) at `position` is beyond the box along an axis, m; 0 if it is
/// not.
template <int Dim>
double gap_to_box(const Grid<Dim>& grid, const Vec<Dim>& position, double reach, int axis) {
  const double lower = grid.origin()[axis] - position[axis];
  return std::max({0.0, lower - reach, -lower - grid.size()[axis] - reach});
}

/// Has the body left the box for good, but for a push from outside? What is above the open top
/// falls back.
template <int Dim>
bool has_left(const Grid<Dim>& grid, const Vec<Dim>& position, double reach) {
  for (int a = 0; a < Dim; ++a)
    if (gap_to_box(grid, position, reach, a) > 0 &&
        !(a == up_axis<Dim> && position[a] > grid.origin()[a]))
      return true;
  return false;
}

/// Where the centre of a body's corner is, m.
template <int Dim>
Vec<Dim> corner_at(const Body<Dim>& body, const RigidState<Dim>& state, std::size_t corner) {
  return plus<Dim>(state.position, product<Dim>(state.rotation, body.corners[corner]));
}

/// Calls visit(axis, upper, gap in m) for every face that is not open: the gap to a ball.
template <int Dim, class Visit>
void for_each_face_gap(const Grid<Dim>& grid, const Faces<Dim>& faces, const Vec<Dim>& centre,
                       double radius, const Visit& visit) {
  for (int a = 0; a < Dim; ++a) {
    if (faces.lower[a].kind != FaceKind::open)
      visit(a, false, centre[a] - radius - grid.origin()[a]);
    if (faces.upper[a].kind != FaceKind::open)
      visit(a, true, grid.upper()[a] - radius - centre[a]);
  }
}

/// Throws std::invalid_argument if a parameter is out of range, a corner is outside of the box, or
/// the body is thinner than two cells: the grid would not resolve it. nodes: those of the box, or
/// of each rank.
template <int Dim>
void check_body_start(const Body<Dim>& body, const Grid<Dim>& grid, const Faces<Dim>& faces,
                      const Array<int>& nodes, const Execution& execution) {
  body.validate();
  check_rigid_state("a body", body.start);
  const Posed<Dim> placed{body.shape, body.start};
  double thickness = -2 * placed.distance(body.start.position);
  for (const int node : nodes)
    thickness = std::max(thickness, -2 * placed.distance(grid.node_position(node)));
  thickness = execution.largest(std::max(thickness, 0.0));
  const double least = 2 * grid.spacing().minCoeff();
  if (!(thickness >= least))
    throw_invalid("a body's thickness", thickness, "at least two cells, " + text_of(least) + " m");
  for (std::size_t c = 0; c < body.corners.size(); ++c)
    for_each_face_gap(grid, faces, corner_at(body, body.start, c), body.corner_radius,
                      [&](int axis, bool, double gap) {
                        if (gap < -1e-9 * grid.size()[axis])
                          throw_invalid("the distance of a body's corner to a face", gap, ">= 0");
                      });
}

/// The bodies, and their states at the start, added to `states`; throws as check_body_start.
template <int Dim>
FreeBodies<Dim> start_bodies(const std::vector<Body<Dim>>& bodies, const Grid<Dim>& grid,
                             const Faces<Dim>& faces, const Array<int>& nodes,
                             const Execution& execution, Array<RigidState<Dim>>& states) {
  FreeBodies<Dim> free;
  for (const Body<Dim>& body : bodies) {
    check_body_start(body, grid, faces, nodes, execution);
    double radius = 0;
    for (const Vec<Dim>& corner : body.corners)
      radius = std::max(radius, norm<Dim>(corner) + body.corner_radius);
    free.radius.push_back(radius);
    free.reach.push_back(std::max(radius, reach_of(body.shape, 1e3 * grid.size().norm())));
    states.push_back(body.start);
    if (body.rotates) {
      free.inverse_inertia.push_back(body.inverse_inertia());
    } else {
      free.inverse_inertia.push_back(Mat<spin_size<Dim>>::Zero());
      states.back().angular_velocity.setZero();
    }
  }
  return free;
}

/// A tensor in the body's own frame, in the box's.
template <int Dim>
Mat<spin_size<Dim>> in_box(const RigidState<Dim>& body, const Mat<spin_size<Dim>>& tensor) {
  if constexpr (Dim == 2)
    return tensor;
  else
    return matrix_product_transposed<3>(matrix_product<3>(body.rotation, tensor), body.rotation);
}

/// Puts the bodies into the problem as they would go on without contacts: with the change that
/// gravity makes, m/s.
template <int Dim>
void set_free_velocities(const std::vector<Body<Dim>>& bodies, const FreeBodies<Dim>& free,
                         const Array<RigidState<Dim>>& states, const Vec<Dim>& change,
                         DualProblem<Dim>& problem) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    FreeBody<Dim>& body = problem.bodies[b];
    body.velocity = plus<Dim>(states[b].velocity, change);
    body.angular_velocity = states[b].angular_velocity;
    body.inverse_mass = 1 / bodies[b].mass;
    body.inverse_inertia = in_box(states[b], free.inverse_inertia[b]);
  }
}

/// Turns a body on for `time` (s) without torque: its angular momentum L = J ω stays, and ω follows
/// J, which turns with the body,
/// \f[ R' = e^{δt\, \bar ω} R, \quad \bar ω = J(e^{δt\, \bar ω/2} R)^{-1} L. \f]
/// The rule is the same backwards in time, so that the energy does not drift.
template <int Dim>
void turn_freely(const Mat<spin_size<Dim>>& inertia, const Mat<spin_size<Dim>>& inverse_inertia,
                 double time, RigidState<Dim>& body) {
  constexpr int n = spin_size<Dim>;
  const Spin<Dim> momentum = product<n>(in_box(body, inertia), body.angular_velocity);
  const auto spin = [&](const RigidState<Dim>& at) {
    return product<n>(in_box(at, inverse_inertia), momentum);
  };
  Spin<Dim> mean = body.angular_velocity;
  for (int k = 0; k < 20; ++k) { // each gains a factor of |ω| δt
    RigidState<Dim> half = body;
    half.angular_velocity = mean;
    half.advance(time / 2);
    const Spin<Dim> last = mean;
    mean = spin(half);
    if (norm<n>(minus<n>(mean, last)) <= 1e-15 * norm<n>(mean))
      break;
  }
  body.angular_velocity = mean;
  body.advance(time);
  body.angular_velocity = spin(body);
}

/// Moves the bodies on for `time` (s) with the velocities that the solve found. Returns how many
/// left the box.
template <int Dim>
std::size_t move_bodies(const std::vector<Body<Dim>>& bodies, const FreeBodies<Dim>& free,
                        const DualProblem<Dim>& problem, double time,
                        Array<RigidState<Dim>>& states) {
  std::size_t left = 0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    RigidState<Dim>& body = states[b];
    const bool was_out = has_left(problem.grid, body.position, free.reach[b]);
    body.velocity = problem.bodies[b].velocity;
    body.angular_velocity = problem.bodies[b].angular_velocity;
    if (Dim == 3 && bodies[b].rotates)
      turn_freely(bodies[b].inertia, free.inverse_inertia[b], time, body);
    else
      body.advance(time);
    if (!was_out && has_left(problem.grid, body.position, free.reach[b]))
      ++left;
  }
  return left;
}

} // namespace talus
