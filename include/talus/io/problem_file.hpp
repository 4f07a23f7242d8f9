// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/problem.hpp"
#include "talus/io/atomic_file.hpp"
#include "talus/io/bytes.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// \file
/// Dual problems in files: saved from any step, read back to be solved by any solver. The format is
/// described in docs/problem_files.md; matrix_market.hpp exports them as plain algebra.

namespace talus {

namespace detail {

template <int Dim>
Contact<Dim> read_contact(ByteReader& reader) {
  Contact<Dim> contact;
  reader.raw(contact.node);
  reader.raw(contact.boundary_id);
  reader.raw(contact.normal);
  reader.raw(contact.wall_velocity);
  reader.raw(contact.friction);
  reader.raw(contact.impulse);
  if (!(contact.friction >= 0) || std::abs(contact.normal.norm() - 1) > 1e-6)
    reader.fail("a contact has a negative friction or a normal that is not of length 1");
  return contact;
}

} // namespace detail

/// Saves a dual problem with its present stresses and impulses: in Simulation::step(before_solve),
/// the warm start; after the step, the solution. Throws std::invalid_argument for the part of a
/// problem that one of several ranks has, std::runtime_error if the file cannot be written; an
/// earlier file of that name is replaced only by a complete one.
template <int Dim>
void write_problem(const std::filesystem::path& path, const DualProblem<Dim>& problem) {
  const auto& grid = problem.grid;
  if (!grid.whole())
    throw_invalid("write_problem: the problem", "the part of a rank", "a whole one");
  Array<int> points; // whose velocity or mass is not zero
  for (int node = 0; node < grid.node_count(); ++node) {
    const std::size_t j = static_cast<std::size_t>(node);
    if (grid.owner(node) == node &&
        !(problem.velocity[j].isZero(0) && problem.inverse_mass[j].isZero(0)))
      points.push_back(node);
  }

  detail::ByteWriter out;
  const auto vector_line = [&](std::string_view key, const auto& value) {
    out.text(key);
    for (int a = 0; a < Dim; ++a)
      out.number(value(a));
    out.text("\n");
  };
  const bool bodies = !problem.bodies.empty(); // in a box without periodic faces
  out.line("talus-problem", bodies ? 3 : grid.any_periodic() ? 2 : 1);
  out.line("dimension", Dim);
  vector_line("cells", [&](int a) { return grid.cells(a); });
  vector_line("origin", grid.origin());
  vector_line("size", grid.size());
  if (grid.any_periodic())
    vector_line("periodic", [&](int a) { return grid.periodic(a) ? 1 : 0; });
  out.line("velocity_scale", problem.velocity_scale);
  out.line("points", points.size());
  out.line("cones", problem.cones());
  out.line("contacts", problem.contacts.size());
  if (bodies) {
    out.line("bodies", problem.bodies.size());
    out.line("body_contacts", problem.body_contacts.size());
  }
  for (const int point : points) {
    const std::size_t j = static_cast<std::size_t>(point);
    out.raw(static_cast<std::int32_t>(point));
    out.raw(problem.velocity[j].template head<Dim>());
    out.raw(problem.inverse_mass[j].template head<Dim>());
  }
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    out.raw(static_cast<std::int32_t>(problem.node[i]));
    out.raw(problem.gradient_weights[i]);
    out.raw(problem.free_volume_rate[i]);
    out.raw(problem.opening[i]);
    out.raw(problem.node_volume[i]);
    out.raw(problem.stress_impulse[i]);
  }
  const auto write_contact = [&](const Contact<Dim>& contact) {
    out.raw(static_cast<std::int32_t>(contact.node));
    out.raw(static_cast<std::int32_t>(contact.boundary_id));
    out.raw(contact.normal);
    out.raw(contact.wall_velocity);
    out.raw(contact.friction);
    out.raw(contact.impulse);
  };
  for (const Contact<Dim>& contact : problem.contacts)
    write_contact(contact);
  for (const FreeBody<Dim>& body : problem.bodies) {
    out.raw(body.velocity);
    out.raw(body.angular_velocity);
    out.raw(body.inverse_mass);
    out.raw(body.inverse_inertia);
  }
  for (const BodyContact<Dim>& contact : problem.body_contacts) {
    write_contact(contact);
    out.raw(static_cast<std::int32_t>(contact.body));
    out.raw(static_cast<std::int32_t>(contact.other));
    out.raw(contact.arm);
    out.raw(contact.other_arm);
    out.raw(contact.inverse_mass);
  }
  out.seal();
  AtomicFile file(path);
  file.write(out.bytes());
  file.commit();
}

/// The dimension of a problem file, 2 or 3. Throws std::runtime_error as read_problem does.
inline int problem_dimension(const std::filesystem::path& path) {
  detail::ByteReader in(path);
  int version = 0, dimension = 0;
  in.line("talus-problem", version);
  in.line("dimension", dimension);
  if (dimension != 2 && dimension != 3)
    in.fail("its dimension is " + std::to_string(dimension) + "; allowed: 2 or 3");
  return dimension;
}

/// Reads what write_problem wrote, bit for bit. Throws std::runtime_error that names the file and
/// the reason if it cannot be read, is damaged, truncated, of another version or dimension, or
/// holds numbers that make no problem.
template <int Dim>
DualProblem<Dim> read_problem(const std::filesystem::path& path) {
  detail::ByteReader in(path);
  int version = 0, dimension = 0;
  in.line("talus-problem", version);
  if (version < 1 || version > 3)
    in.fail("its version is " + std::to_string(version) + "; allowed: 1, 2 or 3");
  in.line("dimension", dimension);
  if (dimension != Dim)
    in.fail("its dimension is " + std::to_string(dimension) + "; expected: " + std::to_string(Dim));
  in.check_fingerprint();

  DualProblem<Dim> problem;
  GridParams<Dim> box;
  std::size_t points = 0, cones = 0, contacts = 0;
  if constexpr (Dim == 2) {
    in.line("cells", box.cells[0], box.cells[1]);
    in.line("origin", box.origin[0], box.origin[1]);
    in.line("size", box.size[0], box.size[1]);
  } else {
    in.line("cells", box.cells[0], box.cells[1], box.cells[2]);
    in.line("origin", box.origin[0], box.origin[1], box.origin[2]);
    in.line("size", box.size[0], box.size[1], box.size[2]);
  }
  Index<Dim> periodic{};
  if (version == 2) {
    if constexpr (Dim == 2)
      in.line("periodic", periodic[0], periodic[1]);
    else
      in.line("periodic", periodic[0], periodic[1], periodic[2]);
  }
  in.line("velocity_scale", problem.velocity_scale);
  in.line("points", points);
  in.line("cones", cones);
  in.line("contacts", contacts);
  std::size_t bodies = 0, body_contacts = 0;
  if (version == 3) {
    in.line("bodies", bodies);
    in.line("body_contacts", body_contacts);
  }
  try {
    SmallArray<bool, Dim> axes{};
    for (int a = 0; a < Dim; ++a)
      axes[a] = periodic[a] != 0;
    problem.grid = Grid<Dim>(box, axes);
    problem.copies = NodeCopies<Dim>(problem.grid);
  } catch (const std::invalid_argument& error) {
    in.fail(error.what());
  }
  if (!(problem.velocity_scale >= 0 && std::isfinite(problem.velocity_scale)))
    in.fail("its velocity_scale is not a finite number >= 0");
  in.need(points, sizeof(std::int32_t) + 2 * sizeof(Vec<Dim>));
  in.need(cones, sizeof(std::int32_t) + sizeof(GradientWeights<Dim>));
  in.need(contacts, 2 * sizeof(std::int32_t));

  const auto& grid = problem.grid;
  const std::size_t nodes = static_cast<std::size_t>(grid.node_count());
  problem.velocity.assign(nodes, NodeVec<Dim>::Zero());
  problem.inverse_mass.assign(nodes, NodeVec<Dim>::Zero());
  const auto take_node = [&] {
    std::int32_t node = -1;
    in.raw(node);
    bool inside = node >= 0 && node < grid.node_count();
    if (inside) {
      const Index<Dim> index = grid.node_index(node);
      for (int a = 0; a < Dim; ++a)
        inside = inside && index[a] >= 0 && index[a] <= grid.cells(a);
    }
    if (!inside)
      in.fail("node " + std::to_string(node) + " is not on the grid");
    return int{node};
  };
  for (std::size_t p = 0; p < points; ++p) {
    const std::size_t j = static_cast<std::size_t>(take_node());
    Vec<Dim> u, w;
    in.raw(u);
    in.raw(w);
    if (!(w.array() >= 0).all())
      in.fail("a mass is negative");
    problem.velocity[j].template head<Dim>() = u;
    problem.inverse_mass[j].template head<Dim>() = w;
  }
  problem.copies.copy(problem.velocity, Execution());
  problem.copies.copy(problem.inverse_mass, Execution());
  problem.node.resize(cones);
  problem.gradient_weights.resize(cones);
  problem.free_volume_rate.resize(cones);
  problem.opening.resize(cones);
  problem.node_volume.resize(cones);
  problem.stress_impulse.resize(cones);
  for (std::size_t i = 0; i < cones; ++i) {
    problem.node[i] = take_node();
    in.raw(problem.gradient_weights[i]);
    in.raw(problem.free_volume_rate[i]);
    in.raw(problem.opening[i]);
    in.raw(problem.node_volume[i]);
    in.raw(problem.stress_impulse[i]);
    if (!(problem.opening[i] >= 0 && problem.node_volume[i] > 0))
      in.fail("cone " + std::to_string(i) + " has a negative friction or volume");
  }
  const Array<int> as_read = problem.node;
  std::vector<bool> carries(static_cast<std::size_t>(grid.node_count()));
  for (const int node : as_read)
    carries[static_cast<std::size_t>(node)] = true;
  Array<std::size_t> counts;
  collect_cones(
      BlockOrder<Dim>(grid), [&](int node) { return carries[static_cast<std::size_t>(node)]; },
      Execution(), counts, problem);
  if (problem.node != as_read)
    in.fail("its cones are not in the order of the blocks");
  std::size_t taken = 0;
  Contact<Dim> contact;
  if (contacts > 0)
    contact = detail::read_contact<Dim>(in);
  for (Block& block : problem.blocks) {
    block.contact_begin = problem.contacts.size();
    for (std::size_t i = block.cone_begin; i < block.cone_end; ++i)
      while (taken < contacts && contact.node == problem.node[i]) {
        problem.contacts.push_back(contact);
        if (++taken < contacts)
          contact = detail::read_contact<Dim>(in);
      }
    block.contact_end = problem.contacts.size();
  }
  if (taken != contacts)
    in.fail("its contacts are not in the order of the blocks, or at nodes without a cone");
  for (const Contact<Dim>& c : problem.contacts)
    if (!(contact_inverse_mass(problem, c) > 0))
      in.fail("a contact is at a node that cannot move");
  in.need(bodies, sizeof(Vec<Dim>));
  in.need(body_contacts, sizeof(Vec<Dim>));
  for (std::size_t b = 0; b < bodies; ++b) {
    FreeBody<Dim> body;
    in.raw(body.velocity);
    in.raw(body.angular_velocity);
    in.raw(body.inverse_mass);
    in.raw(body.inverse_inertia);
    if (!(body.inverse_mass >= 0))
      in.fail("the mass of a body is negative");
    problem.bodies.push_back(body);
  }
  for (std::size_t c = 0; c < body_contacts; ++c) {
    BodyContact<Dim> of_body;
    static_cast<Contact<Dim>&>(of_body) = detail::read_contact<Dim>(in);
    std::int32_t body = -1, other = -1;
    in.raw(body);
    in.raw(other);
    in.raw(of_body.arm);
    in.raw(of_body.other_arm);
    in.raw(of_body.inverse_mass);
    const auto count = static_cast<std::ptrdiff_t>(bodies);
    if (body < 0 || body >= count || other < -1 || other >= count || other == body ||
        of_body.node >= grid.node_count() || !(of_body.inverse_mass > 0))
      in.fail("a contact of a body has no body, no node or no mass");
    of_body.body = body;
    of_body.other = other;
    problem.body_contacts.push_back(of_body);
  }
  if (!in.at_end())
    in.fail("it is longer than it says");
  return problem;
}

} // namespace talus
