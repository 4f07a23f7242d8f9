// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/bytes_of.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/node_copies.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/problem.hpp"

#include <cstddef>

/// \file
/// The problem of all ranks on each of them, for solvers that need it in one piece.

namespace talus {

namespace detail {

/// What a rank tells the others of one of its nodes.
template <int Dim>
struct NodeOfPart {
  Index<Dim> index;
  NodeVec<Dim> velocity, inverse_mass;
};
template <int Dim>
struct ConeOfPart {
  Index<Dim> index;
  GradientWeights<Dim> gradient_weights;
  double free_volume_rate, opening, node_volume;
  Vec<symmetric_size<Dim>> stress_impulse;
};

/// The cone of each node, −1: none; #nodes.
template <int Dim>
Array<int> cones_of_nodes(const DualProblem<Dim>& problem) {
  Array<int> cone(static_cast<std::size_t>(problem.grid.node_count()), -1);
  for (std::size_t i = 0; i < problem.cones(); ++i)
    cone[problem.node[i]] = static_cast<int>(i);
  return cone;
}

} // namespace detail

/// The problem of which each rank has a part, the same on all: what one rank alone would have, bit
/// for bit. Collective.
template <int Dim>
DualProblem<Dim> gathered(const DualProblem<Dim>& part, const Communicator& communicator) {
  using Node = detail::NodeOfPart<Dim>;
  using Cone = detail::ConeOfPart<Dim>;
  const Grid<Dim>& window = part.grid;
  Array<char> nodes, cones, contacts;
  for (int j = 0; j < window.node_count(); ++j)
    if (const Index<Dim> index = window.node_index(j); window.own().holds(index))
      put(nodes, Node{index, part.velocity[j], part.inverse_mass[j]});
  for (std::size_t i = 0; i < part.cones(); ++i)
    put(cones,
        Cone{window.node_index(part.node[i]), part.gradient_weights[i], part.free_volume_rate[i],
             part.opening[i], part.node_volume[i], part.stress_impulse[i]});
  for (const Contact<Dim>& contact : part.contacts) {
    put(contacts, window.node_index(contact.node));
    put(contacts, contact);
  }

  GridParams<Dim> params{.origin = window.origin(), .size = window.size()};
  SmallArray<bool, Dim> periodic{};
  for (int a = 0; a < Dim; ++a) {
    params.cells[a] = window.cells(a);
    periodic[a] = window.periodic(a);
  }
  DualProblem<Dim> whole;
  whole.grid = Grid<Dim>(params, periodic);
  whole.copies = NodeCopies<Dim>(whole.grid);
  const std::size_t count = static_cast<std::size_t>(whole.grid.node_count());
  whole.velocity.assign(count, NodeVec<Dim>::Zero());
  whole.inverse_mass.assign(count, NodeVec<Dim>::Zero());
  for (const Message& message : told_to_all(nodes, communicator))
    for (Taker taker(message.bytes); !taker.at_end();) {
      const auto node = taker.template take<Node>();
      whole.velocity[whole.grid.node(node.index)] = node.velocity;
      whole.inverse_mass[whole.grid.node(node.index)] = node.inverse_mass;
    }
  whole.copies.copy(whole.velocity, Execution());
  whole.copies.copy(whole.inverse_mass, Execution());

  Array<char> carries(count, 0);
  const auto all_cones = told_to_all(cones, communicator);
  const auto for_each_told = [&](const auto& visit) {
    for (const Message& message : all_cones)
      for (Taker taker(message.bytes); !taker.at_end();) {
        const auto cone = taker.template take<Cone>();
        visit(whole.grid.node(cone.index), cone);
      }
  };
  for_each_told([&](int node, const Cone&) { carries[node] = 1; });
  const BlockOrder<Dim> order(whole.grid);
  Array<std::size_t> counts;
  collect_cones(
      order, [&](int node) { return carries[node] != 0; }, Execution(), counts, whole);
  whole.gradient_weights.resize(whole.cones());
  whole.free_volume_rate.resize(whole.cones());
  whole.opening.resize(whole.cones());
  whole.node_volume.resize(whole.cones());
  whole.stress_impulse.resize(whole.cones());
  const Array<int> number = detail::cones_of_nodes(whole);
  for_each_told([&](int node, const Cone& cone) {
    const int i = number[node];
    whole.gradient_weights[i] = cone.gradient_weights;
    whole.free_volume_rate[i] = cone.free_volume_rate;
    whole.opening[i] = cone.opening;
    whole.node_volume[i] = cone.node_volume;
    whole.stress_impulse[i] = cone.stress_impulse;
  });

  Array<Array<Contact<Dim>>> of_cone(whole.cones());
  for (const Message& message : told_to_all(contacts, communicator))
    for (Taker taker(message.bytes); !taker.at_end();) {
      const auto index = taker.template take<Index<Dim>>();
      auto contact = taker.template take<Contact<Dim>>();
      contact.node = whole.grid.node(index);
      of_cone[number[contact.node]].push_back(contact);
    }
  for (Block& block : whole.blocks) {
    block.contact_begin = whole.contacts.size();
    for (std::size_t i = block.cone_begin; i < block.cone_end; ++i)
      whole.contacts.insert(whole.contacts.end(), of_cone[i].begin(), of_cone[i].end());
    block.contact_end = whole.contacts.size();
  }

  whole.bodies = part.bodies;
  whole.body_contacts = part.body_contacts; // all ranks have all of them
  for (BodyContact<Dim>& contact : whole.body_contacts)
    if (contact.node >= 0)
      contact.node = whole.grid.node(order.node_at(contact.place));
  whole.velocity_scale = part.velocity_scale;
  return whole;
}

/// Gives a rank's part the stresses, impulses and velocities of the problem that gathered() made.
/// Collective.
template <int Dim>
void give_part(const DualProblem<Dim>& whole, DualProblem<Dim>& part) {
  const Array<int> number = detail::cones_of_nodes(whole);
  const auto in_whole = [&](int node) {
    return whole.grid.node(whole.grid.owner(part.grid.node_index(node)));
  };
  for (std::size_t i = 0; i < part.cones(); ++i)
    part.stress_impulse[i] = whole.stress_impulse[number[in_whole(part.node[i])]];
  Array<std::size_t> first(whole.cones()); // contact of each cone
  for (std::size_t c = whole.contacts.size(); c-- > 0;)
    first[number[whole.contacts[c].node]] = c;
  for (Contact<Dim>& contact : part.contacts)
    contact.impulse = whole.contacts[first[number[in_whole(contact.node)]]++].impulse;
  part.bodies = whole.bodies;
  for (std::size_t c = 0; c < part.body_contacts.size(); ++c)
    part.body_contacts[c].impulse = whole.body_contacts[c].impulse;
  for (int j = 0; j < part.grid.node_count(); ++j)
    part.velocity[j] = whole.velocity[in_whole(j)];
  share_touched(part, part.velocity);
}

} // namespace talus
