// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace talus {

/// How a region is filled with particles.
struct Seeding {
  enum class Pattern {
    jittered, ///< a lattice, each particle moved at random inside its own share of the volume
    random,   ///< independent uniform positions
  };
  int per_axis = 3; ///< particles along each edge of a cell; its power d is the number in a cell
  Pattern pattern = Pattern::jittered;
  double jitter = 0.5;    ///< in [0, 1]: 0 a regular lattice, 1 anywhere in the particle's share
  std::uint64_t seed = 1; ///< the same seed gives the same particles, on every machine

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    if (per_axis < 1 || per_axis > 100)
      throw_invalid("seeding.per_axis", per_axis, "an integer in 1..100");
    if (!(jitter >= 0 && jitter <= 1))
      throw_invalid("seeding.jitter", jitter, "a number in [0, 1]");
  }
};

/// A small generator (splitmix64, Steele, Lea & Flood 2014): the same numbers with every compiler.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  /// Uniform in [0, 1).
  double uniform() {
    state_ += 0x9e3779b97f4a7c15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    z ^= z >> 31U;
    return static_cast<double>(z >> 11U) * 0x1.0p-53;
  }

 private:
  std::uint64_t state_;
};

/// Fills the box from `lower` to `upper` (m) with particles at rest whose volumes sum up to the
/// box's exactly. The lattice is fitted to the box, at about seeding.per_axis particles per cell
/// edge. Returns the number added. Throws std::invalid_argument if the box is empty or leaves the
/// grid.
template <int Dim>
std::size_t fill_box(Particles<Dim>& particles, const Grid<Dim>& grid, const Vec<Dim>& lower,
                     const Vec<Dim>& upper, const Seeding& seeding) {
  seeding.validate();
  Index<Dim> count;
  std::size_t total = 1;
  for (int a = 0; a < Dim; ++a) {
    const double slack = 1e-9 * grid.size()[a];
    if (!(upper[a] - lower[a] > slack))
      throw_invalid("fill_box: upper - lower", upper[a] - lower[a], "a box of positive size");
    if (lower[a] < grid.origin()[a] - slack || upper[a] > grid.upper()[a] + slack)
      throw_invalid("fill_box: a bound", lower[a] < grid.origin()[a] ? lower[a] : upper[a],
                    "a box inside the grid");
    count[a] = std::max(1, static_cast<int>(std::lround((upper[a] - lower[a]) / grid.spacing()[a] *
                                                        seeding.per_axis)));
    total *= static_cast<std::size_t>(count[a]);
  }
  const double volume = (upper - lower).prod() / static_cast<double>(total);
  Random random(seeding.seed);
  for (std::size_t p = 0; p < total; ++p) {
    Vec<Dim> x;
    std::size_t rest = p;
    for (int a = Dim - 1; a >= 0; --a) {
      const std::size_t n = static_cast<std::size_t>(count[a]);
      const double share =
          seeding.pattern == Seeding::Pattern::random
              ? random.uniform()
              : (static_cast<double>(rest % n) + 0.5 + seeding.jitter * (random.uniform() - 0.5)) /
                    static_cast<double>(n);
      rest /= n;
      x[a] =
          std::clamp(lower[a] + share * (upper[a] - lower[a]), grid.origin()[a], grid.upper()[a]);
    }
    particles.add(x, Vec<Dim>::Zero(), volume);
  }
  return total;
}

} // namespace talus
