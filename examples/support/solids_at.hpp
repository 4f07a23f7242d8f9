// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/array.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

namespace support {

/// Obstacles and free bodies at one time, for pictures.
template <int Dim>
class SolidsAt {
 public:
  /// params: of the simulation, which outlive this. bodies: where they are; time: s, of the
  /// simulation.
  template <class Params>
  SolidsAt(const Params& params, const talus::Array<talus::RigidState<Dim>>& bodies, double time)
      : obstacles_(params.obstacles), bodies_(params.bodies), states_(bodies), time_(time) {
    for (const auto& obstacle : obstacles_)
      frames_.push_back(obstacle->frame(time));
  }

  /// Which part of the volume of the node at x (m) is in one of them: 1/2 on a surface. What is
  /// thinner than two cells counts as that, as for the material (talus::node_in_solid). spacing:
  /// edges of a cell, m. An obstacle without a distance is not seen.
  double fraction(const talus::Vec<Dim>& x, const talus::Vec<Dim>& spacing) const {
    double open = 1;
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const Now obstacle{*obstacles_[o], spacing, time_, frames_[o]};
      open = std::min(open, talus::node_in_solid<Dim>(obstacle, x, spacing).open_fraction);
    }
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const talus::Posed<Dim> body{bodies_[b].shape, states_[b]};
      open = std::min(open, talus::node_in_solid<Dim>(body, x, spacing).open_fraction);
    }
    return 1 - open;
  }

 private:
  /// An obstacle as a talus::SignedDistance.
  struct Now {
    const talus::Obstacle<Dim>& obstacle;
    const talus::Vec<Dim>& spacing;
    double time;
    const talus::RigidState<Dim>& frame;
    double distance(const talus::Vec<Dim>& x) const {
      return obstacle.distance(x, spacing, time, frame);
    }
  };

  const std::vector<std::shared_ptr<const talus::Obstacle<Dim>>>& obstacles_;
  const std::vector<talus::Body<Dim>>& bodies_;
  const talus::Array<talus::RigidState<Dim>>& states_;
  double time_;
  std::vector<talus::RigidState<Dim>> frames_; ///< #obstacles
};

} // namespace support
