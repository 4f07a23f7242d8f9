// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/step/boundaries.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

namespace talus {

/// The solids, obstacles and then bodies, at the nodes that carry cones. In a step: place() says
/// where each is, find() lists what each cone may see by the boxes around the solids, look() asks
/// those; all else reads the list. So a solid costs time where it is.
template <int Dim>
class SolidsAtCones {
 public:
  SolidsAtCones() = default;
  explicit SolidsAtCones(const Boundaries<Dim>& bounds) {
    far_ = 1e6 * bounds.grid.size().norm();
    for (const auto& obstacle : bounds.obstacles)
      half_box_.push_back(obstacle->half_box(far_));
    for (const Body<Dim>& body : bounds.bodies)
      half_box_.push_back(half_box<Dim>(body.shape, far_));
    frame_.resize(half_box_.size());
  }

  /// Where the solids are at bounds.time; throws as Obstacle::frame.
  void place(const Boundaries<Dim>& bounds) {
    const std::size_t obstacles = bounds.obstacles.size();
    for (std::size_t o = 0; o < obstacles; ++o) {
      frame_[o] = bounds.obstacles[o]->frame(bounds.time);
      check_rigid_state("an obstacle's frame", frame_[o]);
    }
    std::copy(bounds.body_states.begin(), bounds.body_states.end(),
              frame_.begin() + static_cast<std::ptrdiff_t>(obstacles));
  }

  /// Calls visit(node) for the nodes that this rank owns and the solid may touch, the last axis
  /// fastest.
  template <class Visit>
  void for_each_node_near(const Grid<Dim>& grid, std::size_t solid, const Visit& visit) const {
    const RigidState<Dim>& frame = frame_[solid];
    const Vec<Dim> to_centre =
        minus<Dim>(plus_scaled<Dim>(grid.origin(), 0.5, grid.size()), frame.position);
    const double farthest = norm<Dim>(to_centre) + 0.5 * norm<Dim>(grid.size());
    // node_in_solid looks as far as 2 Σ h; the rest: see half_box, and rounding of far away
    double next_to = farthest * farthest / (2 * far_) + 1e-15 * far_;
    for (int a = 0; a < Dim; ++a)
      next_to += 2 * grid.spacing()[a];
    Index<Dim> begin, end;
    for (int a = 0; a < Dim; ++a) {
      double reach = 0;
      for (int k = 0; k < Dim; ++k)
        if (frame.rotation(a, k) != 0) // 0 ∞ is not a number
          reach += std::abs(frame.rotation(a, k)) * (half_box_[solid][k] + next_to);
      const double from_origin = frame.position[a] - grid.origin()[a];
      const auto place = [&](double x) { // of a node, or next to the box
        return static_cast<int>(
            std::clamp(x * grid.inverse_spacing()[a], -1.0, grid.cells(a) + 1.0));
      };
      begin[a] = std::max(place(from_origin - reach), grid.own().begin[a]);
      end[a] = std::min(place(from_origin + reach) + 1, grid.own().end[a]);
      if (from_origin + reach < 0)
        end[a] = 0;
      if (begin[a] >= end[a])
        return;
    }
    Index<Dim> node = begin;
    for (int axis = 0; axis >= 0;) {
      for (node[Dim - 1] = begin[Dim - 1]; node[Dim - 1] < end[Dim - 1]; ++node[Dim - 1])
        visit(grid.node(node));
      for (axis = Dim - 2; axis >= 0 && ++node[axis] == end[axis]; --axis)
        node[axis] = begin[axis];
    }
  }

  /// Lists for each cone the solids that it may see, by their number. node_cone: the cone of a node
  /// or −1, #nodes.
  void find(const Grid<Dim>& grid, const Array<int>& node_cone, std::size_t cones) {
    const auto for_each_pair = [&](const auto& visit) {
      for (std::size_t s = 0; s < frame_.size(); ++s)
        for_each_node_near(grid, s, [&](int node) {
          if (const int cone = node_cone[node]; cone >= 0)
            visit(static_cast<std::size_t>(cone), static_cast<int>(s));
        });
    };
    begin_.assign(cones + 2, 0);
    for_each_pair([&](std::size_t cone, int) { ++begin_[cone + 2]; });
    for (std::size_t i = 2; i < begin_.size(); ++i)
      begin_[i] += begin_[i - 1];
    entries_.resize(begin_.back());
    // begin_[i + 1] runs from the begin of cone i to its end, the begin of the next one
    for_each_pair([&](std::size_t cone, int solid) { entries_[begin_[cone + 1]++].solid = solid; });
  }

  /// Asks the solids that the node of a cone may see. Returns the share of the node's volume in the
  /// box that they leave to the material: at least 0.1, also for what has got into a solid. May
  /// be called for several cones at once. Throws std::invalid_argument if an obstacle gives
  /// something else than a share, or a shape no distance.
  double look(const Boundaries<Dim>& bounds, std::size_t cone, const Index<Dim>& index) {
    const Grid<Dim>& grid = bounds.grid;
    const Vec<Dim> x = grid.node_position(index);
    // Of a node on a face the box has half. That half of its shape function has its middle at h/3,
    // and the mean square about it that one of width h/√3 has.
    Vec<Dim> middle = x, extent = grid.spacing();
    bool on_face = false;
    for (int a = 0; a < Dim; ++a)
      if (!grid.periodic(a) && (index[a] == 0 || index[a] == grid.cells(a))) {
        on_face = true;
        middle[a] += (index[a] == 0 ? 1.0 / 3 : -1.0 / 3) * grid.spacing()[a];
        extent[a] /= std::sqrt(3.0);
      }
    double share = 1;
    for (std::size_t e = begin_[cone]; e < begin_[cone + 1]; ++e) {
      const std::size_t s = static_cast<std::size_t>(entries_[e].solid);
      double open;
      if (s < bounds.obstacles.size()) {
        const ObstacleAtNode<Dim> seen = at_obstacle(bounds, s, x);
        entries_[e].holds = seen.contact.has_value();
        open =
            on_face
                ? bounds.obstacles[s]->at_node(middle, extent, bounds.time, frame_[s]).open_fraction
                : seen.open_fraction;
        check_open_share<Dim>(s, x, open);
      } else {
        const std::size_t b = s - bounds.obstacles.size();
        const NodeInSolid<Dim> seen = in_body(bounds, b, x);
        entries_[e].holds = seen.contact;
        open = on_face ? node_in_solid<Dim>(posed(bounds, b), middle, extent).open_fraction
                       : seen.open_fraction;
      }
      share *= open;
    }
    return std::max(share, 0.1);
  }

  /// The share of the volume of a node at x (m), next to that of a cone, that the solids which this
  /// cone may see leave: 0 deep inside of one.
  double open_share(const Boundaries<Dim>& bounds, std::size_t cone, const Vec<Dim>& x) const {
    double share = 1;
    for (std::size_t e = begin_[cone]; e < begin_[cone + 1]; ++e) {
      const std::size_t s = static_cast<std::size_t>(entries_[e].solid);
      share *= s < bounds.obstacles.size()
                   ? at_obstacle(bounds, s, x).open_fraction
                   : in_body(bounds, s - bounds.obstacles.size(), x).open_fraction;
    }
    return share;
  }

  /// How obstacle o sees a node at x (m).
  ObstacleAtNode<Dim> at_obstacle(const Boundaries<Dim>& bounds, std::size_t o,
                                  const Vec<Dim>& x) const {
    return bounds.obstacles[o]->at_node(x, bounds.grid.spacing(), bounds.time, frame_[o]);
  }
  /// How body b sees a node at x (m).
  NodeInSolid<Dim> in_body(const Boundaries<Dim>& bounds, std::size_t b, const Vec<Dim>& x) const {
    return node_in_solid<Dim>(posed(bounds, b), x, bounds.grid.spacing());
  }

  /// The signed distance of x (m) from a solid, m; infinite if bodies pass through it.
  double distance(const Boundaries<Dim>& bounds, std::size_t solid, const Vec<Dim>& x) const {
    const std::size_t obstacles = bounds.obstacles.size();
    if (solid < obstacles)
      return bounds.obstacles[solid]->distance(x, bounds.grid.spacing(), bounds.time,
                                               frame_[solid]);
    return Posed<Dim>{bounds.bodies[solid - obstacles].shape, frame_[solid]}.distance(x);
  }
  const RigidState<Dim>& frame(std::size_t solid) const { return frame_[solid]; }

  /// The normal of a solid at a node that it holds. On a face that is not open, a solid that ends
  /// there has an edge, or the end that it turns to the face: where its normal turns to the face by
  /// more than 30°, it is that of the next node inside, if that one does not turn to it. Else
  /// material would sink in along the face. normal: at the node itself; normal_at(x in m) →
  /// optional, elsewhere where it holds.
  template <class NormalAt>
  Vec<Dim> normal_in_box(const Boundaries<Dim>& bounds, std::size_t solid, const Index<Dim>& index,
                         const Vec<Dim>& normal, const NormalAt& normal_at) const {
    constexpr double steep = 0.5, little = 0.01; // of a unit vector; of a cell's edge, too
    const Grid<Dim>& grid = bounds.grid;
    const Vec<Dim> x = grid.node_position(index);
    Vec<Dim> into_box = Vec<Dim>::Zero(), next = x;
    for_each_face(grid, bounds.faces, index, [&](int axis, bool upper, const Face& face) {
      const double way = upper ? -1 : 1;
      if (face.kind == FaceKind::open || face.kind == FaceKind::periodic ||
          way * normal[axis] > -steep)
        return;
      into_box[axis] = way;
      next[axis] += way * grid.spacing()[axis];
    });
    if (into_box.isZero(0) ||
        distance(bounds, solid, x) > little * grid.spacing().minCoeff()) // a gap before the face
      return normal;
    const std::optional<Vec<Dim>> inside = normal_at(next);
    if (!inside)
      return normal;
    for (int a = 0; a < Dim; ++a)
      if (into_box[a] * (*inside)[a] < -little)
        return normal;
    return *inside;
  }

  /// Calls visit(obstacle) for those that hold the node of a cone, by their number.
  template <class Visit>
  void for_each_holding_obstacle(const Boundaries<Dim>& bounds, std::size_t cone,
                                 const Visit& visit) const {
    for (std::size_t e = begin_[cone]; e < begin_[cone + 1]; ++e)
      if (entries_[e].holds && entries_[e].solid < static_cast<int>(bounds.obstacles.size()))
        visit(static_cast<std::size_t>(entries_[e].solid));
  }

  /// The pairs of a body and a cone whose node it holds, by body, then cone.
  const Array<std::pair<std::size_t, std::size_t>>& held_by_bodies(const Boundaries<Dim>& bounds) {
    by_body_.clear();
    if (bounds.bodies.empty())
      return by_body_;
    for (std::size_t cone = 0; cone + 2 < begin_.size(); ++cone)
      for (std::size_t e = begin_[cone]; e < begin_[cone + 1]; ++e)
        if (const std::size_t s = static_cast<std::size_t>(entries_[e].solid);
            entries_[e].holds && s >= bounds.obstacles.size())
          by_body_.emplace_back(s - bounds.obstacles.size(), cone);
    std::sort(by_body_.begin(), by_body_.end());
    return by_body_;
  }

 private:
  static Posed<Dim> posed(const Boundaries<Dim>& bounds, std::size_t body) {
    return {bounds.bodies[body].shape, bounds.body_states[body]};
  }

  struct Entry {
    int solid = 0;
    bool holds = false; ///< the node: it is a contact
  };

  double far_ = 0;               ///< m
  Array<Vec<Dim>> half_box_;     ///< #solids, m
  Array<RigidState<Dim>> frame_; ///< #solids
  Array<std::size_t> begin_;     ///< of each cone's entries, #cones + 2
  Array<Entry> entries_;
  Array<std::pair<std::size_t, std::size_t>> by_body_;
};

} // namespace talus
