// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/scene/blue_noise.hpp"
#include "talus/scene/region.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace talus {

/// How a region is filled with particles.
struct Seeding {
  enum class Pattern {
    jittered,   ///< a lattice, each particle moved at random inside its own share of the volume
    random,     ///< independent uniform positions
    blue_noise, ///< random, but none close to another
  };
  int per_axis = 3; ///< particles along each edge of a cell; its power d is the number in a cell
  Pattern pattern = Pattern::jittered;
  double jitter = 0.5;    ///< in [0, 1]: 0 a regular lattice, 1 anywhere in the particle's share
  std::uint64_t seed = 1; ///< the same seed gives the same particles, on every machine
  int material = 0;       ///< index into the list of materials, see Materials

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    if (per_axis < 1 || per_axis > 100)
      throw_invalid("seeding.per_axis", per_axis, "an integer in 1..100");
    if (!(jitter >= 0 && jitter <= 1))
      throw_invalid("seeding.jitter", jitter, "a number in [0, 1]");
    if (material < 0)
      throw_invalid("seeding.material", material, "an index, >= 0");
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

/// Throws std::invalid_argument if there are particles in what is to be filled: what is filled
/// twice is twice as dense as dense. what: is filled; inside(x): Vec<Dim> in m → bool.
template <int Dim, class Real, class Inside>
void require_no_particles(const Particles<Dim, Real>& particles, const char* what,
                          const Inside& inside) {
  const auto count = std::count_if(particles.position.begin(), particles.position.end(), inside);
  if (count > 0)
    throw_invalid(std::string(what) + ": the number of particles that are there already", count,
                  "0: what is filled twice is too dense");
}

/// Fills the box from `lower` to `upper` (m) with particles at rest whose volumes sum up to the
/// box's exactly. The lattice is fitted to the box, at about seeding.per_axis particles per cell
/// edge. Returns the number added. Throws std::invalid_argument if the box is empty, leaves the
/// grid or holds particles already.
template <int Dim, class Real>
std::size_t fill_box(Particles<Dim, Real>& particles, const Grid<Dim>& grid, const Vec<Dim>& lower,
                     const Vec<Dim>& upper, const Seeding& seeding) {
  seeding.validate();
  Index<Dim> count;
  std::size_t total = 1;
  for (int a = 0; a < Dim; ++a) {
    const double slack = 1e-9 * grid.size()[a];
    if (!(upper[a] - lower[a] > slack))
      throw_invalid("fill_box: upper - lower", upper[a] - lower[a],
                    "more than " + text_of(slack) + " m, 1e-9 of the grid's size");
    if (lower[a] < grid.origin()[a] - slack || upper[a] > grid.upper()[a] + slack)
      throw_invalid("fill_box: a bound", lower[a] < grid.origin()[a] ? lower[a] : upper[a],
                    "a box inside the grid");
    count[a] = std::max(1, static_cast<int>(std::lround((upper[a] - lower[a]) / grid.spacing()[a] *
                                                        seeding.per_axis)));
    total *= static_cast<std::size_t>(count[a]);
  }
  require_no_particles(particles, "fill_box", [&](const Vec<Dim>& x) {
    return (x.array() > lower.array()).all() && (x.array() < upper.array()).all();
  });
  const double volume = (upper - lower).prod() / static_cast<double>(total);
  Random random(seeding.seed);
  if (seeding.pattern == Seeding::Pattern::blue_noise) {
    const Vec<Dim> from = lower.cwiseMax(grid.origin()), to = upper.cwiseMin(grid.upper());
    const auto draw = [&] {
      Vec<Dim> x;
      for (int a = 0; a < Dim; ++a)
        x[a] = from[a] + random.uniform() * (to[a] - from[a]);
      return x;
    };
    Vec<Dim> spacing = to - from;
    for (int a = 0; a < Dim; ++a)
      spacing[a] /= count[a];
    for (const Vec<Dim>& x : blue_noise_points<Dim>(total, from, to, spacing, draw))
      particles.add(x, Vec<Dim>::Zero(), volume, seeding.material);
    return total;
  }
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
    particles.add(x, Vec<Dim>::Zero(), volume, seeding.material);
  }
  return total;
}

/// Fills the box of the grid up to `depth` (m) above its floor, as fill_box does.
template <int Dim, class Real>
std::size_t fill_bed(Particles<Dim, Real>& particles, const Grid<Dim>& grid, double depth,
                     const Seeding& seeding) {
  Vec<Dim> upper = grid.upper();
  upper[up_axis<Dim>] = grid.origin()[up_axis<Dim>] + depth;
  return fill_box(particles, grid, grid.origin(), upper, seeding);
}

/// Fills the part of `region` that is in the box of the grid with particles at rest. A lattice of
/// seeding.per_axis shares along a cell's edge is laid over the grid. Jittered: each share that is
/// inside or cut holds one particle of the volume inside, moved at random within it. Random and
/// blue noise: as many particles of equal volume as fill the region, wherever it is.
///
/// The volumes sum up to that of the region as measured with 4 points along each edge of a share:
/// exact to rounding where the region's faces lie on the lattice, to about 1e-3 for balls and boxes
/// ten shares across that have a distance (tested), to about a tenth of a share at the surface
/// without. A face that cuts less than an eighth off a layer of shares leaves that out: no particle
/// has room there. Of a region that reaches out of the grid the part inside is filled.
///
/// Returns the number added. Throws std::invalid_argument if a parameter is out of range, if the
/// region is empty, outside of the grid or too thin to hold a particle, holds particles already, or
/// gives no distance somewhere; then, and if the region itself throws, no particle is added.
template <int Dim, class Real, Region<Dim> R>
std::size_t fill(Particles<Dim, Real>& particles, const Grid<Dim>& grid, const R& region,
                 const Seeding& seeding) {
  seeding.validate();
  constexpr int samples = 4; // along each edge of a share
  require_no_particles(particles, "fill", [&](const Vec<Dim>& x) { return contains(region, x); });
  const Vec<Dim> edge = grid.spacing() / seeding.per_axis;
  const Vec<Dim> sample_edge = edge / samples;
  Random random(seeding.seed);
  const auto inside = [&](const Vec<Dim>& x) {
    return contains(region, x) && (x.array() >= grid.origin().array()).all() &&
           (x.array() <= grid.upper().array()).all();
  };
  const auto draw_from = [&](const Vec<Dim>& centre, double extent) {
    Vec<Dim> x = centre;
    for (int a = 0; a < Dim; ++a)
      x[a] += extent * edge[a] * (random.uniform() - 0.5);
    return x;
  };

  // The shares of the lattice with their filled part, and the middle of that.
  struct Share {
    Vec<Dim> centre, middle;
    double volume; // m^d
  };
  std::vector<Share> shares;
  double total = 0;
  Index<Dim> count;
  std::size_t lattice = 1;
  for (int a = 0; a < Dim; ++a) {
    count[a] = grid.cells(a) * seeding.per_axis;
    lattice *= static_cast<std::size_t>(count[a]);
  }
  for (std::size_t k = 0; k < lattice; ++k) {
    Share share;
    std::size_t rest = k;
    for (int a = Dim - 1; a >= 0; --a) {
      const std::size_t n = static_cast<std::size_t>(count[a]);
      share.centre[a] = grid.origin()[a] + edge[a] * (static_cast<double>(rest % n) + 0.5);
      rest /= n;
    }
    share.middle = share.centre;
    share.volume = edge.prod();
    bool whole = false;
    if constexpr (requires { region.distance(share.centre); }) {
      const double distance = distance_to<Dim>(region, share.centre);
      if (distance >= edge.norm() / 2)
        continue;
      whole = distance <= -edge.norm() / 2;
    }
    if (!whole) {
      double part = 0;
      Vec<Dim> sum = Vec<Dim>::Zero();
      std::vector<Vec<Dim>> held;
      for (int j = 0; j < ipow(samples, Dim); ++j) {
        Vec<Dim> x = share.centre;
        for (int a = 0, digits = j; a < Dim; ++a, digits /= samples)
          x[a] += sample_edge[a] * (digits % samples - 0.5 * (samples - 1));
        const double sample = share_inside<Dim>(region, x, sample_edge);
        part += sample;
        sum += sample * x;
        if (contains(region, x))
          held.push_back(x);
      }
      if (held.empty())
        continue;
      share.volume *= part / ipow(samples, Dim);
      share.middle = sum / part;
      if (!inside(share.middle)) // of something hollow
        share.middle =
            *std::min_element(held.begin(), held.end(), [&](const Vec<Dim>& x, const Vec<Dim>& y) {
              return (x - share.middle).squaredNorm() < (y - share.middle).squaredNorm();
            });
    }
    total += share.volume;
    shares.push_back(share);
  }
  if (shares.empty())
    throw_invalid("fill: the number of particles that fit the region", 0,
                  "a region inside the grid, thicker than a quarter of a particle's share");

  std::vector<Vec<Dim>> points;
  const auto add_all = [&](const auto& volume_of) {
    for (std::size_t p = 0; p < points.size(); ++p)
      particles.add(points[p], Vec<Dim>::Zero(), volume_of(p), seeding.material);
    return points.size();
  };
  if (seeding.pattern == Seeding::Pattern::jittered) {
    for (const Share& share : shares) {
      // Jitter that leaves the region or the share is drawn again, and given up if there is little
      // room.
      Vec<Dim> x = share.middle;
      for (int tries = 0; tries < 20; ++tries) {
        const Vec<Dim> moved = draw_from(share.middle, seeding.jitter);
        if (((moved - share.centre).cwiseAbs().array() <= edge.array() / 2).all() &&
            inside(moved)) {
          x = moved;
          break;
        }
      }
      points.push_back(x);
    }
    return add_all([&](std::size_t p) { return shares[p].volume; });
  }

  // Uniform in the region: a share by chance, a place in it, and again if that is outside. A share
  // has one of its 4^d samples inside, so about as many draws find a place if it has a volume.
  constexpr int most_draws = 100000;
  const auto draw = [&] {
    for (int n = 0; n < most_draws; ++n) {
      const auto k =
          static_cast<std::size_t>(random.uniform() * static_cast<double>(shares.size()));
      const Vec<Dim> x = draw_from(shares[k].centre, 1);
      if (inside(x))
        return x;
    }
    throw_invalid("fill: the number of random points, all outside of the region", most_draws,
                  "a region that has a volume");
  };
  const auto number =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(total / edge.prod())));
  if (seeding.pattern == Seeding::Pattern::blue_noise)
    points = blue_noise_points<Dim>(number, grid.origin(), grid.upper(), edge, draw);
  else
    for (std::size_t p = 0; p < number; ++p)
      points.push_back(draw());
  return add_all([&](std::size_t) { return total / static_cast<double>(number); });
}

} // namespace talus
