// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/communicator.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"
#include "talus/particles.hpp"
#include "talus/step/state.hpp"

namespace talus {

/// How a simulation is shared by several processes: which nodes, cells and particles are whose. A
/// model: distributed::Ranks. Functions that are not const are collective.
template <int Dim, class Real = double>
class Ranks {
 public:
  Ranks() = default;
  virtual ~Ranks() = default;
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  virtual const Communicator& communicator() const = 0;
  /// What this rank owns, and how its window is kept up to date; of the last call that dealt.
  virtual const NodeBox<Dim>& own() const = 0;
  virtual Halo& halo() = 0;

  /// Deals the grid to the ranks by where particles are, and gives each its own ones. Every rank
  /// has all particles of the scene before, or each has others. Throws std::invalid_argument if the
  /// grid is refused, or if some but not all particles of two ranks are the same.
  virtual void deal(const GridParams<Dim>& grid, const SmallArray<bool, Dim>& periodic,
                    Particles<Dim, Real>& particles) = 0;
  /// Deals again if the load has become uneven, and turns the state of the old window into that of
  /// the new one. Returns whether it did.
  virtual bool deal_again(SimulationState<Dim, Real>& state) = 0;
  /// Deals the state of a whole grid, which all ranks have, and returns this rank's part.
  virtual SimulationState<Dim, Real> part_of(SimulationState<Dim, Real> whole) = 0;

  /// Sends particles to the ranks in whose cells they are.
  virtual void migrate(Particles<Dim, Real>& particles) = 0;

  /// Gives all ranks all of problem.body_contacts, by body, then place. Nodes that are not in the
  /// window get numbers beyond it, and `velocity` and `inverse_mass` of the problem entries there;
  /// Halo::share_touched keeps them up to date.
  virtual void share_contacts(DualProblem<Dim>& problem) = 0;
};

} // namespace talus
