// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/node_copies.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"

#include <cstddef>

/// \file
/// The dual problem of one time step: nodal velocities, one cone (stress) per active node, and
/// contacts. See docs/architecture.md for how it comes about.

namespace talus {

/// A Coulomb contact at one node:
/// \f[ 0 ≤ w·n ⊥ r·n ≥ 0, \quad |r_t| ≤ μ_w\, r·n, \quad w = u_j − u_b, \f]
/// r_t opposite to w_t while it slides.
template <int Dim>
struct Contact {
  int node = 0;                       ///< node number on the grid
  int boundary_id = 0;                ///< of the face, obstacle or body: its key for the warm start
  Vec<Dim> normal = Vec<Dim>::Zero(); ///< n, unit, towards the material
  Vec<Dim> wall_velocity = Vec<Dim>::Zero(); ///< u_b, m/s
  double friction = 0;                       ///< μ_w
  Vec<Dim> impulse = Vec<Dim>::Zero();       ///< r, N s (per metre in 2-D); the unknown
};

/// A free rigid body: its velocities are unknowns like those of the nodes.
template <int Dim>
struct FreeBody {
  Vec<Dim> velocity = Vec<Dim>::Zero();                              ///< of the centre of mass, m/s
  Spin<Dim> angular_velocity = Spin<Dim>::Zero();                    ///< rad/s
  double inverse_mass = 0;                                           ///< 1/kg (m/kg in 2-D)
  Mat<spin_size<Dim>> inverse_inertia = Mat<spin_size<Dim>>::Zero(); ///< in the box's frame
};

/// A contact of a free body with a node, or of one of its corners with a face of the box, an
/// obstacle or another body: the law of Contact with w = u − V − ω × arm − wall_velocity, u the
/// velocity of the node, of the other body there, or 0; −r acts on the body, r on what it touches.
/// n points out of the body.
template <int Dim>
struct BodyContact : Contact<Dim> { ///< node: < 0 of a corner, −1 − its number
  int body = 0;
  int point = 0;                   ///< which of the contacts of a corner with one solid
  int other = -1;                  ///< the other body, or −1
  std::size_t place = 0;           ///< of the node in BlockOrder::place; corners come after all
  Vec<Dim> arm = Vec<Dim>::Zero(); ///< from the centre of mass, m
  Vec<Dim> other_arm = Vec<Dim>::Zero(); ///< from that of the other body, m
  double inverse_mass = 0; ///< a bound of the eigenvalues of W, 1/kg: the sum of M_j⁻¹ and
                           ///< I/M − [arm]× J⁻¹ [arm]× of what moves
};

/// Cones and contacts that one thread visits in sequence; see dual/colouring.hpp.
struct Block {
  std::size_t cone_begin = 0, cone_end = 0;
  std::size_t contact_begin = 0, contact_end = 0;
};

/// The dual problem of a time step. Find λ and r such that, with
/// \f[ u_j = u_{\text{free},j} + M_j^{-1} \Bigl( \sum_i Λ_i g_{ij} + r_j \Bigr), \quad
///     γ_i = \mathrm{vec}\,\mathrm{sym} \sum_j u_j ⊗ g_{ij} + k_i e_N, \f]
/// (γ_i, λ_i) is in Coulomb's law of opening μ̃_i, and the contacts hold. λ_i = δt λ̂_i is an impulse
/// (Pa s); Λ_i is its tensor; the cone law does not mind the factor. (Rousseau et al. 2023; Daviet
/// & Bertails-Descoubes 2016.)
///
/// `velocity` always is the velocity that goes with the current λ and r: solvers keep it so.
template <int Dim>
struct DualProblem {
  static constexpr int cone_size = symmetric_size<Dim>;

  Grid<Dim> grid;
  NodeCopies<Dim> copies;           ///< of the grid; `velocity` is the same at all nodes of a place
  Array<NodeVec<Dim>> velocity;     ///< u, #nodes, m/s
  Array<NodeVec<Dim>> inverse_mass; ///< 1/m_j per component, 1/kg; 0 where u is prescribed

  // One entry a cone, in the order of the blocks.
  Array<int> node;                              ///< node number
  Array<GradientWeights<Dim>> gradient_weights; ///< g_ij, m^(d-1)
  Array<double> free_volume_rate;               ///< normal component of k_i, m^d/s; < 0: overpacked
  Array<double> opening;                        ///< μ̃_i = sqrt(2/d) μ_i
  Array<double> node_volume;                    ///< v_i, m^d
  Array<Vec<cone_size>> stress_impulse;         ///< λ_i, Pa s; the unknown

  Array<Contact<Dim>> contacts; ///< sorted by block

  Array<FreeBody<Dim>> bodies;
  Array<BodyContact<Dim>> body_contacts; ///< visited one after the other: they share bodies

  Array<Block> blocks;             ///< blocks of one colour share no velocity
  Array<std::size_t> colour_begin; ///< blocks of colour c: colour_begin[c]..colour_begin[c+1]−1
  /// Where the blocks end, in each colour, whose visits change what other ranks have; they come
  /// first. #colours.
  Array<std::size_t> border_end;

  /// A velocity typical of this step, max(|g| δt, |u|_max/1000), m/s: what residuals are compared
  /// with where there is no stress to compare with.
  double velocity_scale = 0;

  std::size_t cones() const { return node.size(); }
};

} // namespace talus
