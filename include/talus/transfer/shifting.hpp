// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>

namespace talus {

/// φ − 1 of a node that is not in the midst of dense material: at a surface, beside solids, empty.
inline constexpr double not_inside = std::numeric_limits<double>::infinity();

/// Particle shifting: in cells whose nodes all lie inside,
/// \f[ x_p ← x_p − \min(a |γ̇| δt, 1/10)\, h_b^2\, ∂_b φ, \quad |h_b\, ∂_b φ| ≤ s, \f]
/// by axis b, which evens out what shear does to the packing within some cells. It is a diffusion
/// of the packing alone: velocities stay, what is not sheared does not move, and it falls with h².
/// excess: φ − 1 or not_inside; strain: |γ̇| δt, #nodes of the grid each; rate: a, >= 0; steepest:
/// s, >= 0, beyond which a difference is no noise; lower, upper: where particles are held, m.
template <int Dim, class Real>
void shift_particles(Particles<Dim, Real>& particles, const Grid<Dim>& grid,
                     const Array<double>& excess, const Array<double>& strain, double rate,
                     double steepest, const Vec<Dim>& lower, const Vec<Dim>& upper,
                     const Execution& execution) {
  using G = Grid<Dim>;
  execution.for_ranges(
      std::ssize(particles.position), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
        for (std::ptrdiff_t p = begin; p < end; ++p) {
          Vec<Dim>& x = particles.position[static_cast<std::size_t>(p)];
          const Index<Dim> cell = grid.cell_at(x);
          const int first = grid.first_node(cell);
          double sheared = 0;
          bool inside = true;
          for (int c = 0; c < G::corners && inside; ++c) {
            const int node = first + grid.corner_offset(c);
            inside = excess[node] < not_inside;
            sheared += strain[node] / G::corners;
          }
          if (!inside)
            continue;
          const double share = std::min(0.1, rate * sheared);
          const Vec<Dim> xi = grid.local(x, cell);
          Vec<Dim> slope = Vec<Dim>::Zero(); // h ∇φ
          for (int c = 0; c < G::corners; ++c) {
            const double here = excess[first + grid.corner_offset(c)];
            for (int a = 0; a < Dim; ++a) {
              double weight = G::corner_bit(c, a) ? here : -here;
              for (int b = 0; b < Dim; ++b)
                if (b != a)
                  weight *= G::corner_bit(c, b) ? xi[b] : 1 - xi[b];
              slope[a] += weight;
            }
          }
          for (int a = 0; a < Dim; ++a)
            slope[a] = share * grid.spacing()[a] * std::clamp(slope[a], -steepest, steepest);
          for (int a = 0; a < Dim; ++a)
            x[a] = std::clamp(x[a] - slope[a], lower[a], upper[a]);
          x = grid.wrapped(x);
        }
      });
}

} // namespace talus
