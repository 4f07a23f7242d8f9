// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/particles.hpp"

#include <cstddef>

namespace talus {

/// What sources and sinks did to this rank's particles in one step. Volumes in m^d.
struct Turnover {
  std::size_t added = 0, removed = 0; ///< particles
  ExactSum inflow, outflow;
  ExactSum held_back; ///< of particles that were due and had no room
};

/// Something that adds particles to a running simulation, or takes them out. Models: Source and
/// Sink (talus/scene/source.hpp).
template <int Dim, class Real = double>
class Exchange {
 public:
  Exchange() = default;
  virtual ~Exchange() = default;
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  /// Changes the particles at the end of a step, and adds what it did to `turnover`. It has no
  /// memory: what happens must follow from the arguments alone, so that a run that goes on from a
  /// checkpoint gives the same bits.
  ///
  /// from, to: times of the step's start and end, s; the next step starts at `to`, to the last bit.
  /// particles: after they have moved; the simulation refuses new ones that are not in the box or
  /// have no positive volume, and must be restored then. With several ranks each has its part of
  /// them, all call this, and new ones may be added on any rank; next_id must grow by the same
  /// number on all.
  virtual void exchange(double from, double to, const Execution& execution,
                        Particles<Dim, Real>& particles, Turnover& turnover) const = 0;

  /// How many materials a simulation needs for what comes in: one above the largest index.
  virtual int materials() const { return 1; }
};

/// Takes out the particles p with leaves(p) → bool and adds their volumes to `volume`. Returns how
/// many. If leaves throws, all are still there.
template <int Dim, class Real, class Leaves>
std::size_t take_out(Particles<Dim, Real>& particles, const Leaves& leaves, ExactSum& volume) {
  Array<char> leaving(particles.size(), 0);
  for (std::size_t p = 0; p < particles.size(); ++p)
    leaving[p] = leaves(p) ? 1 : 0;
  std::size_t kept = 0;
  for (std::size_t p = 0; p < particles.size(); ++p)
    if (leaving[p]) {
      volume.add(static_cast<double>(particles.volume[p]));
    } else {
      if (kept != p)
        particles.copy(kept, particles, p);
      ++kept;
    }
  const std::size_t removed = particles.size() - kept;
  particles.resize(kept);
  return removed;
}

/// Adds copies of the particles `more`, with ids of their own; they may be the same ones.
template <int Dim, class Real>
void append(const Particles<Dim, Real>& more, Particles<Dim, Real>& particles) {
  const std::size_t before = particles.size(), count = more.size();
  if (!more.mixed.empty())
    particles.resize_mixed(before);
  if (!more.material.empty())
    particles.resize_material(before);
  particles.resize(before + count);
  if (!more.mixed.empty())
    particles.resize_mixed(before + count);
  if (!more.material.empty())
    particles.resize_material(before + count);
  for (std::size_t p = 0; p < count; ++p) {
    const std::size_t id = particles.id[before + p];
    particles.copy(before + p, more, p);
    particles.id[before + p] = id;
  }
}

} // namespace talus
