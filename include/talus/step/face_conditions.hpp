// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/faces.hpp"
#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/particles.hpp"

#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

/// \file
/// What the faces of the box do to nodes and particles, but for friction: see contacts.hpp.

namespace talus {

/// u = 0 at nodes on no-slip faces, u·n = 0 on free-slip ones; there the inverse mass is 0 as well.
template <int Dim>
void hold_at_faces(const Faces<Dim>& faces, const Array<int>& nodes, const Execution& execution,
                   DualProblem<Dim>& problem) {
  execution.for_each(std::ssize(nodes), [&](std::ptrdiff_t k) {
    const int node = nodes[k];
    for_each_face(problem.grid, faces, problem.grid.node_index(node),
                  [&](int axis, bool, const Face& face) {
                    if (face.kind == FaceKind::no_slip) {
                      problem.velocity[node].setZero();
                      problem.inverse_mass[node].setZero();
                    } else if (face.kind == FaceKind::free_slip) {
                      problem.velocity[node][axis] = 0;
                      problem.inverse_mass[node][axis] = 0;
                    }
                  });
  });
}

/// Between which positions (m) particles may be: a wall lets nothing through, not even what a
/// contact's residual would. Infinite where a face is free or periodic.
template <int Dim>
std::pair<Vec<Dim>, Vec<Dim>> particle_bounds(const Faces<Dim>& faces, const Grid<Dim>& grid) {
  Vec<Dim> lower = grid.origin(), upper = grid.upper();
  for (int a = 0; a < Dim; ++a) {
    if (faces.lower[a].kind == FaceKind::open || grid.periodic(a))
      lower[a] = -std::numeric_limits<double>::infinity();
    if (faces.upper[a].kind == FaceKind::open || grid.periodic(a))
      upper[a] = std::numeric_limits<double>::infinity();
  }
  return {lower, upper};
}

/// Particles that left all ranks, and their volume, m^d.
struct Outflow {
  std::size_t particles = 0;
  double volume = 0;
};

/// Takes out the particles that are outside of the box: they have passed an open face. partials:
/// workspace.
template <int Dim, class Real>
Outflow remove_outflow(const Faces<Dim>& faces, const Grid<Dim>& grid, const Execution& execution,
                       Array<std::size_t>& partials, Particles<Dim, Real>& particles) {
  Outflow outflow;
  bool open = false;
  for (int a = 0; a < Dim; ++a)
    open = open || faces.lower[a].kind == FaceKind::open || faces.upper[a].kind == FaceKind::open;
  if (!open)
    return outflow;
  const Vec<Dim> lower = grid.origin(), upper = grid.upper();
  const auto inside = [&](std::size_t p) {
    const Vec<Dim>& x = particles.position[p];
    bool is = true;
    for (int a = 0; a < Dim; ++a)
      is = is && x[a] >= lower[a] && x[a] <= upper[a];
    return is;
  };
  const std::size_t leaving = execution.reduce(
      static_cast<std::ptrdiff_t>(particles.size()), partials, std::size_t{0},
      [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        std::size_t left = 0;
        for (std::ptrdiff_t p = begin; p < end; ++p)
          left += inside(static_cast<std::size_t>(p)) ? 0U : 1U;
        return left;
      },
      std::plus<>());
  outflow.particles = execution.sum(leaving);
  if (outflow.particles == 0)
    return outflow;
  ExactSum volume;
  std::size_t kept = 0;
  for (std::size_t p = 0; p < particles.size(); ++p)
    if (inside(p)) {
      if (kept != p)
        particles.copy(kept, particles, p);
      ++kept;
    } else {
      volume.add(particles.volume[p]);
    }
  particles.resize(kept);
  execution.join(&volume, 1);
  outflow.volume = volume.value();
  return outflow;
}

} // namespace talus
