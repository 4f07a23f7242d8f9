// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/halo.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/problem.hpp"

#include <cstddef>

/// \file
/// Contacts of free bodies: what they do to the velocities of node and body, and their visit.

namespace talus {

/// u_j − V − ω × arm, m/s; a face of the box does not move.
template <int Dim>
Vec<Dim> relative_velocity(const DualProblem<Dim>& problem, const BodyContact<Dim>& contact) {
  const FreeBody<Dim>& body = problem.bodies[contact.body];
  const Vec<Dim> of_body = plus<Dim>(body.velocity, cross<Dim>(body.angular_velocity, contact.arm));
  if (contact.node < 0)
    return scaled<Dim>(-1, of_body);
  return minus<Dim>(problem.velocity[contact.node].template head<Dim>(), of_body);
}

/// Adds `impulse` (Dim, N s) to the node and takes it from the body.
template <int Dim>
void apply_impulse(DualProblem<Dim>& problem, const BodyContact<Dim>& contact,
                   const Vec<Dim>& impulse) {
  FreeBody<Dim>& body = problem.bodies[contact.body];
  body.velocity = plus_scaled<Dim>(body.velocity, -body.inverse_mass, impulse);
  const Spin<Dim> turn =
      product<spin_size<Dim>>(body.inverse_inertia, torque<Dim>(contact.arm, impulse));
  body.angular_velocity = minus<spin_size<Dim>>(body.angular_velocity, turn);
  if (contact.node < 0)
    return;
  const int j = contact.node;
  for (int a = 0; a < Dim; ++a)
    problem.velocity[j][a] += problem.inverse_mass[j][a] * impulse[a];
}

/// A bound of the eigenvalues of W = M_j⁻¹ + I/M − [arm]× J⁻¹ [arm]×, 1/kg: the trace of the last
/// term, and the largest of the others.
template <int Dim>
double contact_inverse_mass(const DualProblem<Dim>& problem, const BodyContact<Dim>& contact) {
  const FreeBody<Dim>& body = problem.bodies[contact.body];
  double of_body = body.inverse_mass;
  for (int a = 0; a < Dim; ++a) { // column a of [arm]×
    const Spin<Dim> arm = torque<Dim>(contact.arm, Vec<Dim>(Vec<Dim>::Unit(a)));
    of_body += dot<spin_size<Dim>>(arm, product<spin_size<Dim>>(body.inverse_inertia, arm));
  }
  if (contact.node < 0)
    return of_body;
  return of_body + problem.inverse_mass[contact.node].maxCoeff();
}

/// All ranks visit all contacts of free bodies, each in its own copy: the velocities of the nodes
/// that they touch come from the owners before.
template <int Dim>
void share_touched(DualProblem<Dim>& problem) {
  if (const Halo* const halo = problem.copies.halo(); halo && !problem.bodies.empty())
    halo->share_touched(problem.velocity.data(), sizeof(NodeVec<Dim>));
}

/// One visit of each contact in their order: a projected step r ← P(r − w/L), exact where W = L I,
/// put into the velocities at once. Returns Σ L |Δr|².
template <int Dim>
double update_body_contacts(DualProblem<Dim>& problem) {
  double change2 = 0;
  share_touched(problem);
  for (BodyContact<Dim>& contact : problem.body_contacts) {
    const Vec<Dim> impulse =
        contact_impulse<Dim>(contact, relative_velocity(problem, contact), contact.inverse_mass);
    const Vec<Dim> change = minus<Dim>(impulse, contact.impulse);
    apply_impulse(problem, contact, change);
    contact.impulse = impulse;
    change2 += contact.inverse_mass * dot<Dim>(change, change);
  }
  return change2;
}

} // namespace talus
