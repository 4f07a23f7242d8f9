// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/faces.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/solids.hpp"

#include <algorithm>
#include <compare>
#include <cstddef>
#include <iterator>
#include <optional>
#include <string>

/// \file
/// The Coulomb contacts of a step. Each goes on from the impulse that it had in the last one.

namespace talus {

/// Where a contact stands in its list: both lists are sorted by it.
struct ContactPlace {
  int body = 0;         ///< 0 for contacts of no free body
  std::size_t node = 0; ///< place of the node; corners of bodies come after all nodes
  int boundary_id = 0;
  int point = 0; ///< of a corner, see BodyContact

  friend auto operator<=>(const ContactPlace&, const ContactPlace&) = default;
};

/// The contacts of the last step, whose impulses those at the same place start from.
template <class AnyContact>
class LastImpulses {
 public:
  /// ratio: this time step over the last; impulses are forces times δt.
  LastImpulses(const Array<AnyContact>& last, double ratio) : last_(last), ratio_(ratio) {}

  /// Goes to the first contact at `first` or after it. place_of(contact): its ContactPlace.
  template <class PlaceOf>
  void seek(const ContactPlace& first, const PlaceOf& place_of) {
    next_ = static_cast<std::size_t>(
        std::partition_point(last_.begin(), last_.end(),
                             [&](const AnyContact& c) { return place_of(c) < first; }) -
        last_.begin());
  }

  /// To be called in the order of places.
  template <class PlaceOf>
  void warm_start(AnyContact& contact, const PlaceOf& place_of) {
    const ContactPlace place = place_of(contact);
    while (next_ < last_.size() && place_of(last_[next_]) < place)
      ++next_;
    if (next_ < last_.size() && place_of(last_[next_]) == place)
      contact.impulse = ratio_ * last_[next_].impulse;
  }

 private:
  const Array<AnyContact>& last_;
  double ratio_;
  std::size_t next_ = 0;
};

/// Calls visit(axis, upper, face) for the frictional faces that the node of cone i touches.
template <int Dim, class Visit>
void for_each_frictional_face(const Boundaries<Dim>& bounds, const DualProblem<Dim>& problem,
                              std::size_t i, const Visit& visit) {
  const int node = problem.node[i];
  for_each_face(bounds.grid, bounds.faces, bounds.grid.node_index(node),
                [&](int axis, bool upper, const Face& face) {
                  if (face.kind == FaceKind::frictional && problem.inverse_mass[node][axis] > 0)
                    visit(axis, upper, face);
                });
}

/// Calls visit(obstacle) for those that hold the node of cone i, if it can move.
template <int Dim, class Visit>
void for_each_holding_obstacle(const Boundaries<Dim>& bounds, const SolidsAtCones<Dim>& solids,
                               const DualProblem<Dim>& problem, std::size_t i, const Visit& visit) {
  if (problem.inverse_mass[problem.node[i]].maxCoeff() > 0)
    solids.for_each_holding_obstacle(bounds, i, visit);
}

/// Contacts of the nodes that carry cones with frictional faces and obstacles, block by block.
/// solids: with what each cone sees; node_rank: place of a node in the order of the blocks, #nodes.
/// Throws std::invalid_argument if an obstacle gives what is no contact (see check_contact), or
/// none where it gave one in this step.
template <int Dim>
void collect_contacts(const Boundaries<Dim>& bounds, const SolidsAtCones<Dim>& solids,
                      const Array<std::size_t>& node_rank,
                      const LastImpulses<Contact<Dim>>& impulses, const Execution& execution,
                      DualProblem<Dim>& problem) {
  const auto place_of = [&](const Contact<Dim>& c) {
    return ContactPlace{0, node_rank[c.node], c.boundary_id};
  };
  const std::ptrdiff_t blocks = std::ssize(problem.blocks);
  execution.for_each(blocks, [&](std::ptrdiff_t b) {
    Block& block = problem.blocks[b];
    block.contact_end = 0;
    for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
      for_each_frictional_face(bounds, problem, i,
                               [&](int, bool, const Face&) { ++block.contact_end; });
      for_each_holding_obstacle(bounds, solids, problem, i,
                                [&](std::size_t) { ++block.contact_end; });
    }
  });
  std::size_t count = 0;
  for (Block& block : problem.blocks) {
    block.contact_begin = count;
    count = block.contact_end += count;
  }
  problem.contacts.resize(count);
  execution.for_each(blocks, [&](std::ptrdiff_t b) {
    const Block& block = problem.blocks[b];
    if (block.contact_begin == block.contact_end)
      return;
    std::size_t next = block.contact_begin;
    LastImpulses<Contact<Dim>> last = impulses;
    last.seek({0, node_rank[problem.node[block.cone_begin]], 0}, place_of);
    const auto add = [&](Contact<Dim> contact) {
      last.warm_start(contact, place_of);
      problem.contacts[next++] = contact;
    };
    for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
      Contact<Dim> contact;
      contact.node = problem.node[i];
      for_each_frictional_face(bounds, problem, i, [&](int axis, bool upper, const Face& face) {
        contact.boundary_id = bounds.face_id(axis, upper);
        contact.normal.setZero();
        contact.normal[axis] = upper ? -1 : 1;
        contact.friction = face.friction;
        add(contact);
      });
      for_each_holding_obstacle(bounds, solids, problem, i, [&](std::size_t o) {
        const Index<Dim> index = bounds.grid.node_index(contact.node);
        const Vec<Dim> x = bounds.grid.node_position(index);
        const auto held = solids.at_obstacle(bounds, o, x).contact;
        if (!held)
          throw_invalid("obstacle " + std::to_string(o) + " at " + place_text<Dim>(x) +
                            ": the number of contacts that it gave and then did not",
                        1, "0: the same answer for the same arguments");
        check_contact(o, x, *held);
        contact.boundary_id = bounds.obstacle_id(o);
        contact.normal =
            solids.normal_in_box(bounds, o, index, held->normal, [&](const Vec<Dim>& inside) {
              const auto there = solids.at_obstacle(bounds, o, inside).contact;
              if (there)
                check_contact(o, inside, *there);
              return there ? std::optional(there->normal) : std::nullopt;
            });
        contact.wall_velocity = held->velocity;
        contact.friction = held->friction;
        add(contact);
      });
    }
  });
}

} // namespace talus
