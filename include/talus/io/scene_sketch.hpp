// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

/// \file
/// What obstacles and shapes are, told from what they do: they may be any code of the user. Sums
/// over random places, so that rounding, which differs between machines, hardly changes them.

namespace talus::detail {

/// Σ w s over samples s with weights w in [−1/2, 1/2], and Σ |w s|.
struct WeightedSum {
  double sum = 0, size = 0;

  void add(double term) {
    sum += term;
    size += std::abs(term);
  }
  /// Is `other` the same sum, but for rounding?
  bool same(double other) const { return std::abs(sum - other) <= 1e-6 * size; }
};

/// Random numbers that are the same everywhere: std::minstd_rand.
class SketchRandom {
 public:
  /// In [−1/2, 1/2].
  double centred() { return static_cast<double>(next() - 1) / (modulus - 2) - 0.5; }
  int below(int count) { return static_cast<int>(next() % static_cast<unsigned>(count)); }

 private:
  static constexpr unsigned modulus = (1U << 31U) - 1;

  unsigned next() {
    state_ = static_cast<unsigned>(std::uint64_t{state_} * 48271 % modulus);
    return state_;
  }

  unsigned state_ = 1;
};

/// An obstacle at random nodes, at times up to `now` and at some after it.
struct ObstacleSketch {
  std::size_t held = 0; ///< samples where it holds a node
  WeightedSum friction, normal, velocity, open_fraction;
};

/// time: now, s; time_step: s.
template <int Dim>
ObstacleSketch sketch_obstacle(const Obstacle<Dim>& obstacle, const Grid<Dim>& grid, double time,
                               double time_step) {
  constexpr int past = 4, future = 28, nodes = 2048;
  ObstacleSketch sketch;
  SketchRandom random;
  for (int n = 0; n <= past + future; ++n) {
    const double when =
        n <= past ? time * n / past : time + time_step * std::pow(1.5, n - past - 1);
    for (int k = 0; k < nodes; ++k) {
      Index<Dim> node;
      for (int a = 0; a < Dim; ++a)
        node[a] = random.below(grid.cells(a) + 1);
      std::array<double, std::size_t{2 + 2 * Dim}> weight;
      for (double& w : weight)
        w = random.centred();
      const Vec<Dim> x = grid.node_position(node);
      std::optional<ObstacleContact<Dim>> contact;
      double open = 1;
      try { // a motion may have an end
        contact = obstacle.contact(x, grid.spacing(), when);
        open = obstacle.open_fraction(x, grid.spacing(), when);
        check_open_share<Dim>(0, x, open);
        if (contact)
          check_contact<Dim>(0, x, *contact);
      } catch (...) {
        continue;
      }
      sketch.open_fraction.add(weight[0] * (1 - open));
      if (!contact)
        continue;
      ++sketch.held;
      sketch.friction.add(weight[1] * contact->friction);
      for (int a = 0; a < Dim; ++a) {
        sketch.normal.add(weight[static_cast<std::size_t>(2 + a)] * contact->normal[a]);
        sketch.velocity.add(weight[static_cast<std::size_t>(2 + Dim + a)] * contact->velocity[a]);
      }
    }
  }
  return sketch;
}

/// A shape by its distances at random points within `reach` (m) of its origin along each axis.
template <int Dim>
WeightedSum sketch_shape(const Shape<Dim>& shape, double reach) {
  WeightedSum sketch;
  SketchRandom random;
  for (int k = 0; k < 64; ++k) {
    Vec<Dim> x;
    for (int a = 0; a < Dim; ++a)
      x[a] = 2 * reach * random.centred();
    const double distance = shape.distance(x), weight = random.centred();
    if (std::isfinite(distance))
      sketch.add(weight * distance);
  }
  return sketch;
}

} // namespace talus::detail
