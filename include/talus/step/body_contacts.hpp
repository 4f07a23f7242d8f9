// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/problem.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/contacts.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/solids.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>

/// \file
/// The Coulomb contacts of free bodies: with nodes, faces, obstacles and each other.

namespace talus {

/// Contacts of the free bodies with the nodes of this rank that carry cones, by body, then node,
/// without their impulses. solids: with what each cone sees.
template <int Dim>
void collect_touched_nodes(const Boundaries<Dim>& bounds, SolidsAtCones<Dim>& solids,
                           const BlockOrder<Dim>& order, DualProblem<Dim>& problem) {
  problem.body_contacts.clear();
  for (const auto& held : solids.held_by_bodies(bounds)) {
    const std::size_t b = held.first;
    const int node = problem.node[held.second];
    if (!(problem.inverse_mass[node].maxCoeff() > 0))
      continue; // it cannot move
    const Index<Dim> index = bounds.grid.node_index(node);
    const Vec<Dim> x = bounds.grid.node_position(index);
    BodyContact<Dim> contact;
    contact.body = static_cast<int>(b);
    contact.boundary_id = bounds.body_id(b);
    contact.friction = bounds.bodies[b].friction;
    contact.node = node;
    contact.place = order.place(index);
    contact.normal =
        solids.normal_in_box(bounds, bounds.obstacles.size() + b, index,
                             solids.in_body(bounds, b, x).normal, [&](const Vec<Dim>& inside) {
                               const NodeInSolid<Dim> there = solids.in_body(bounds, b, inside);
                               return there.contact ? std::optional(there.normal) : std::nullopt;
                             });
    contact.arm = minus<Dim>(x, bounds.body_states[b].position);
    problem.body_contacts.push_back(contact);
  }
}

/// An obstacle or a free body where it is now: a model of SignedDistance.
template <int Dim>
struct PlacedSolid {
  const Boundaries<Dim>& bounds;
  const SolidsAtCones<Dim>& solids;
  std::size_t number; ///< obstacles, then bodies

  double distance(const Vec<Dim>& x) const { return solids.distance(bounds, number, x); }
};

/// Calls visit(point, centre, radius, normal, gap) for a ball's contacts with a solid, if the gap
/// (m) is at most `within`: those of a ball within it that would touch at the same place. There is
/// one, the nearest, or where `all` are asked for as many as there are walls in reach: a ball in a
/// groove touches two, in a hopper three or more. From points in all directions
/// n ← normal(centre − n radius/4) is repeated until it stays: that is where a wall is
/// perpendicular to the line to the centre. Walls count as one up to 8° apart; and the distance
/// must fall along n: in the midst between two walls it does not. step: for differences, m.
template <int Dim, class Visit>
void for_each_touch(const PlacedSolid<Dim>& solid, const Vec<Dim>& centre, double radius,
                    double within, bool all, double step, const Visit& visit) {
  const double nearest = distance_to<Dim>(solid, centre) - radius;
  if (!(nearest <= within))
    return;
  constexpr double same = 0.99; // cos 8°
  constexpr int directions = ipow(3, Dim);
  SmallArray<Vec<Dim>, directions> normals;
  int found = 0;
  for (int k = 0; all && radius > 0 && k < directions; ++k) {
    Vec<Dim> inner = centre, normal = Vec<Dim>::Zero();
    for (int a = 0, digits = k; a < Dim; ++a, digits /= 3)
      inner[a] += radius / 2 * (digits % 3 - 1);
    double change = 1;
    for (int times = 0; times < 16 && change > 1e-12; ++times) { // each leaves a third, or less
      const Vec<Dim> next = surface_normal<Dim>(solid, inner, step);
      change = 1 - dot<Dim>(next, normal);
      normal = next;
      inner = plus_scaled<Dim>(centre, -radius / 4, normal);
    }
    const double distance = distance_to<Dim>(solid, inner), gap = distance - 0.75 * radius;
    const Vec<Dim> further = plus_scaled<Dim>(inner, -radius / 4, normal);
    bool is_new = gap <= within && change < 1 - same &&
                  distance - distance_to<Dim>(solid, further) > same * radius / 4;
    for (int f = 0; f < found; ++f)
      is_new = is_new && dot<Dim>(normal, normals[f]) < same;
    if (!is_new)
      continue;
    normals[found] = normal;
    visit(found++, inner, 0.75 * radius, normal, gap);
  }
  if (found == 0)
    visit(0, centre, radius, surface_normal<Dim>(solid, centre, step), nearest);
}

/// What of a solid a body's corner touches, and how.
template <int Dim>
struct Touched {
  Vec<Dim> velocity = Vec<Dim>::Zero(); ///< m/s; of an obstacle
  double friction = 0;                  ///< an obstacle's; of two bodies the lower one
  bool holds = true;                    ///< does the obstacle hold anything there?
};

/// A body and a solid that touch at x (m), a little below the surface of the solid: what an
/// obstacle holds may end there. Throws std::invalid_argument if an obstacle gives what is no
/// contact, see check_contact.
template <int Dim>
Touched<Dim> touched_at(const Boundaries<Dim>& bounds, const SolidsAtCones<Dim>& solids,
                        std::size_t body, std::size_t solid, const Vec<Dim>& x) {
  Touched<Dim> touched;
  const std::size_t obstacles = bounds.obstacles.size();
  if (solid >= obstacles) {
    touched.friction =
        std::min(bounds.bodies[body].friction, bounds.bodies[solid - obstacles].friction);
    return touched;
  }
  const auto held = solids.at_obstacle(bounds, solid, x).contact;
  touched.holds = held.has_value();
  if (held) {
    check_contact(solid, x, *held);
    touched.velocity = held->velocity;
    touched.friction = held->friction;
  }
  return touched;
}

/// Throws std::invalid_argument if a corner of a free body is in an obstacle or in another body.
/// solids: where they are.
template <int Dim>
void check_bodies_apart(const Boundaries<Dim>& bounds, const SolidsAtCones<Dim>& solids) {
  const double step = 1e-3 * bounds.grid.spacing().minCoeff();
  const double rounding = 1e-9 * norm<Dim>(bounds.grid.size());
  const std::size_t obstacles = bounds.obstacles.size(), bodies = bounds.bodies.size();
  const auto check = [&](std::size_t b, std::size_t c, std::size_t s) {
    const auto refuse_if_held = [&](int, const Vec<Dim>& centre, double radius,
                                    const Vec<Dim>& normal, double gap) {
      const Vec<Dim> foot = plus_scaled<Dim>(centre, -gap - radius - step, normal);
      if (touched_at(bounds, solids, b, s, foot).holds)
        throw_invalid("the distance of corner " + std::to_string(c) + " of body " +
                          std::to_string(b) + " to " +
                          (s < obstacles ? "obstacle " + std::to_string(s)
                                         : "body " + std::to_string(s - obstacles)),
                      gap, ">= 0: it must not start inside of it");
    };
    const Body<Dim>& body = bounds.bodies[b];
    for_each_touch<Dim>({bounds, solids, s}, corner_at(body, bounds.body_states[b], c),
                        body.corner_radius, -rounding, false, step, refuse_if_held);
  };
  for (std::size_t b = 0; b < bodies; ++b)
    for (std::size_t c = 0; c < bounds.bodies[b].corners.size(); ++c)
      for (std::size_t s = 0; s < obstacles + bodies; ++s)
        if (s != obstacles + b)
          check(b, c, s);
}

/// Contacts of the free bodies with the nodes that `touched` has, by body, then place, and of their
/// corners with faces, obstacles and other bodies. solids: where they are; time_step: s.
template <int Dim>
void collect_body_contacts(const Boundaries<Dim>& bounds, const SolidsAtCones<Dim>& solids,
                           const Array<BodyContact<Dim>>& touched, const BlockOrder<Dim>& order,
                           double time_step, LastImpulses<BodyContact<Dim>> impulses,
                           DualProblem<Dim>& problem) {
  const Grid<Dim>& grid = bounds.grid;
  const double cell = grid.spacing().minCoeff(), step = 1e-3 * cell;
  const std::size_t obstacles = bounds.obstacles.size();
  problem.body_contacts.clear();
  const auto add = [&](BodyContact<Dim> contact) {
    impulses.warm_start(contact, [](const BodyContact<Dim>& c) {
      return ContactPlace{c.body, c.place, c.boundary_id, c.point};
    });
    contact.inverse_mass = contact_inverse_mass(problem, contact);
    problem.body_contacts.push_back(contact);
  };
  const auto way_of = [&](std::size_t b) { // the longest of one of its points in this step, m
    const FreeBody<Dim>& body = problem.bodies[b];
    return time_step * (norm<Dim>(body.velocity) +
                        norm<spin_size<Dim>>(body.angular_velocity) * bounds.body_reach[b]);
  };
  auto next = touched.begin();
  for (std::size_t b = 0; b < bounds.bodies.size(); ++b) {
    const Body<Dim>& body = bounds.bodies[b];
    const RigidState<Dim>& state = bounds.body_states[b];
    for (; next != touched.end() && next->body == static_cast<int>(b); ++next)
      add(*next);
    if (has_left(grid, state.position, bounds.body_reach[b]))
      continue; // there is nothing out there
    const double way = way_of(b);
    for (std::size_t c = 0; c < body.corners.size(); ++c) {
      const Vec<Dim> corner = corner_at(body, state, c);
      BodyContact<Dim> touch;
      touch.node = -1 - static_cast<int>(c);
      touch.place = place_of(grid, order, touch.node);
      touch.body = static_cast<int>(b);
      for_each_face_gap(
          grid, bounds.faces, corner, body.corner_radius, [&](int axis, bool upper, double gap) {
            if (gap > std::max(grid.spacing()[axis], 2 * way))
              return; // it does not come there in this step
            const Face& face = upper ? bounds.faces.upper[axis] : bounds.faces.lower[axis];
            touch.boundary_id = bounds.face_id(axis, upper);
            touch.normal.setZero();
            touch.normal[axis] = upper ? 1 : -1;
            touch.arm = plus_scaled<Dim>(product<Dim>(state.rotation, body.corners[c]),
                                         body.corner_radius, touch.normal);
            touch.wall_velocity =
                scaled<Dim>(-gap / time_step, touch.normal); // it may come as near as that
            touch.friction = face.kind == FaceKind::no_slip      ? body.friction
                             : face.kind == FaceKind::frictional ? face.friction
                                                                 : 0;
            add(touch);
          });
      for (std::size_t s = 0; s < obstacles + bounds.bodies.size(); ++s) {
        const bool is_body = s >= obstacles;
        const RigidState<Dim>& frame = solids.frame(s);
        double within = std::max(cell, 2 * way);
        if (is_body) {
          const std::size_t o = s - obstacles;
          within += 2 * way_of(o);
          const double apart = norm<Dim>(minus<Dim>(frame.position, state.position));
          // Two balls touch once, or their one contact would be there twice, not quite the same.
          const bool seen =
              o < b && body.corners.size() == 1 && bounds.bodies[o].corners.size() == 1;
          if (o == b || seen || has_left(grid, frame.position, bounds.body_reach[o]) ||
              apart > bounds.body_reach[b] + bounds.body_reach[o] + within)
            continue;
          touch.other = static_cast<int>(o);
        } else {
          within += 2 * time_step * norm<Dim>(frame.velocity_at(corner));
        }
        touch.boundary_id = bounds.obstacle_id(s); // bodies follow obstacles
        for_each_touch<Dim>({bounds, solids, s}, corner, body.corner_radius, within, !is_body, step,
                            [&](int point, const Vec<Dim>& centre, double radius,
                                const Vec<Dim>& normal, double gap) {
                              const Touched<Dim> there = touched_at(
                                  bounds, solids, b, s,
                                  plus_scaled<Dim>(centre, -gap - radius - step, normal));
                              if (!there.holds)
                                return;
                              const Vec<Dim> x = plus_scaled<Dim>(centre, -radius, normal);
                              touch.point = point;
                              touch.normal = scaled<Dim>(-1, normal);
                              touch.arm = minus<Dim>(x, state.position);
                              touch.other_arm = minus<Dim>(x, frame.position); // of a body
                              touch.wall_velocity =
                                  minus<Dim>(scaled<Dim>(gap / time_step, normal), there.velocity);
                              touch.friction = there.friction;
                              add(touch);
                            });
      }
    }
  }
}

} // namespace talus
