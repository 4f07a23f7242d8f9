// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/io/atomic_file.hpp"
#include "talus/io/bytes.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>

namespace talus {

/// Writes a dual problem as plain algebra into a folder, in Matrix Market files that other programs
/// read: find λ with γ = H v + k, (γ, λ) in Coulomb's law cone by cone, and M (v − f) = Eᵀ λ.
///   H.mtx   rows × unknowns, sparse: the strain rate of each cone (s = d(d+1)/2 rows: normal, then
///           tangents), then the relative velocity of each contact (d rows: normal, tangents)
///   E.mtx   the same size: what λ does to the momentum. E = 2 H in the rows of cones (the
///           components of a tensor are orthonormal for τ:υ/2), E = H in those of contacts
///   M.mtx   unknowns × 1: mass of each unknown, kg; an unknown is a velocity component of a node
///           that can move
///   f.mtx   unknowns × 1: velocity without any stress or impulse, m/s
///   k.mtx   rows × 1: room to compact (cones), minus the wall's velocity (contacts), and what
///           nodes that cannot move add
///   mu.mtx  (cones + contacts) × 1: opening of each cone
///   lambda.mtx rows × 1: the stresses and impulses in the problem, a start
/// W = H M⁻¹ Eᵀ. Throws std::runtime_error if a file cannot be written,
/// std::invalid_argument for a problem with free bodies, which are left out of this form, and for
/// the part of a problem that one of several ranks has.
template <int Dim>
void write_matrix_market(const std::filesystem::path& folder, const DualProblem<Dim>& original) {
  if (!original.bodies.empty())
    throw_invalid("the number of free bodies in an exported problem", original.bodies.size(), "0");
  const Grid<Dim>& grid = original.grid;
  if (!grid.whole())
    throw_invalid("write_matrix_market: the problem", "the part of a rank", "a whole one");
  constexpr int s = symmetric_size<Dim>;
  DualProblem<Dim> problem = original;
  remove_impulses(problem, Stencil<Dim>(grid));
  problem.copies.copy(problem.velocity, Execution());

  // Numbers the unknowns: components of velocities that can change.
  Array<SmallArray<std::size_t, Dim>> unknown(problem.velocity.size());
  Array<double> mass, free;
  for (int j = 0; j < grid.node_count(); ++j)
    for (int a = 0; a < Dim && grid.owner(j) == j; ++a)
      if (problem.inverse_mass[j][a] > 0) {
        mass.push_back(1 / problem.inverse_mass[j][a]);
        free.push_back(problem.velocity[j][a]);
        unknown[j][a] = mass.size(); // from 1, as the format has it
      }

  struct Triplet {
    std::size_t row, column;
    double value;
    double momentum; // the same entry of E
  };
  Array<Triplet> entries;
  Array<double> k, mu, lambda;
  std::size_t row = 1;
  const auto add = [&](std::size_t at, int j, int a, double value, double momentum, double& fixed) {
    const std::size_t column = unknown[j][a];
    if (column > 0 && value != 0)
      entries.push_back({at, column, value, momentum});
    else if (column == 0)
      fixed += value * problem.velocity[j][a];
  };
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    SmallArray<double, s> fixed{};
    fixed[0] = problem.free_volume_rate[i];
    for (int n = 0; n < Grid<Dim>::neighbours; ++n) {
      const int j = grid.owner(problem.node[i] + grid.neighbour_offset(n));
      for (int a = 0; a < Dim; ++a) {
        const Mat<Dim> gradient =
            Vec<Dim>::Unit(a) * problem.gradient_weights[i].col(n).transpose();
        const Vec<s> rate = symmetric_to_vector<Dim, double>(gradient);
        for (int r = 0; r < s; ++r)
          add(row + static_cast<std::size_t>(r), j, a, rate[r], 2 * rate[r], fixed[r]);
      }
    }
    for (int r = 0; r < s; ++r) {
      k.push_back(fixed[r]);
      lambda.push_back(original.stress_impulse[i][r]);
    }
    mu.push_back(problem.opening[i]);
    row += s;
  }
  for (std::size_t c = 0; c < problem.contacts.size(); ++c) {
    const Contact<Dim>& contact = problem.contacts[c];
    // an orthonormal frame, the normal first
    Mat<Dim> frame = Mat<Dim>::Identity();
    frame.col(0) = contact.normal;
    int filled = 1;
    for (int axis = 0; axis < Dim && filled < Dim; ++axis) {
      Vec<Dim> t = Vec<Dim>::Unit(axis);
      for (int b = 0; b < filled; ++b)
        t -= t.dot(frame.col(b)) * frame.col(b);
      if (t.norm() > 0.5)
        frame.col(filled++) = t.normalized();
    }
    for (int r = 0; r < Dim; ++r) {
      double fixed = -contact.wall_velocity.dot(frame.col(r));
      for (int a = 0; a < Dim; ++a)
        add(row, grid.owner(contact.node), a, frame(a, r), frame(a, r), fixed);
      k.push_back(fixed);
      lambda.push_back(original.contacts[c].impulse.dot(frame.col(r)));
      ++row;
    }
    mu.push_back(contact.friction);
  }

  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const auto write = [&](const std::string& name, const std::string& text) {
    AtomicFile file(folder / name);
    file.write(text);
    file.commit();
  };
  const auto matrix = [&](bool momentum) {
    detail::ByteWriter out;
    out.text("%%MatrixMarket matrix coordinate real general\n");
    out.line(std::to_string(row - 1), mass.size(), entries.size());
    for (const Triplet& t : entries)
      out.line(std::to_string(t.row), t.column, momentum ? t.momentum : t.value);
    return out.bytes();
  };
  const auto column = [&](const Array<double>& values) {
    detail::ByteWriter out;
    out.text("%%MatrixMarket matrix array real general\n");
    out.line(std::to_string(values.size()), 1);
    for (const double value : values)
      out.line("", value);
    return out.bytes();
  };
  write("H.mtx", matrix(false));
  write("E.mtx", matrix(true));
  write("M.mtx", column(mass));
  write("f.mtx", column(free));
  write("k.mtx", column(k));
  write("mu.mtx", column(mu));
  write("lambda.mtx", column(lambda));
}

} // namespace talus
