// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
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

/// V + ω × arm, m/s.
template <int Dim>
Vec<Dim> velocity_at(const FreeBody<Dim>& body, const Vec<Dim>& arm) {
  return plus<Dim>(body.velocity, cross<Dim>(body.angular_velocity, arm));
}

/// Adds `impulse` (Dim, N s), on `arm` (m), to a body.
template <int Dim>
void push(FreeBody<Dim>& body, const Vec<Dim>& arm, const Vec<Dim>& impulse) {
  body.velocity = plus_scaled<Dim>(body.velocity, body.inverse_mass, impulse);
  const Spin<Dim> turn = product<spin_size<Dim>>(body.inverse_inertia, torque<Dim>(arm, impulse));
  body.angular_velocity = plus<spin_size<Dim>>(body.angular_velocity, turn);
}

/// u − V − ω × arm, m/s: u is 0 at a face or an obstacle.
template <int Dim>
Vec<Dim> relative_velocity(const DualProblem<Dim>& problem, const BodyContact<Dim>& contact) {
  const Vec<Dim> of_body = velocity_at(problem.bodies[contact.body], contact.arm);
  if (contact.node >= 0)
    return minus<Dim>(problem.velocity[contact.node].template head<Dim>(), of_body);
  if (contact.other >= 0)
    return minus<Dim>(velocity_at(problem.bodies[contact.other], contact.other_arm), of_body);
  return scaled<Dim>(-1, of_body);
}

/// Adds `impulse` (Dim, N s) to the node or the other body, and takes it from the body.
template <int Dim>
void apply_impulse(DualProblem<Dim>& problem, const BodyContact<Dim>& contact,
                   const Vec<Dim>& impulse) {
  push<Dim>(problem.bodies[contact.body], contact.arm, scaled<Dim>(-1, impulse));
  if (contact.other >= 0)
    push(problem.bodies[contact.other], contact.other_arm, impulse);
  if (contact.node < 0)
    return;
  const int j = contact.node;
  for (int a = 0; a < Dim; ++a)
    problem.velocity[j][a] += problem.inverse_mass[j][a] * impulse[a];
}

/// A bound of the eigenvalues of I/M − [arm]× J⁻¹ [arm]×, 1/kg: the trace of the last term.
template <int Dim>
double inverse_mass_at(const FreeBody<Dim>& body, const Vec<Dim>& arm) {
  double sum = body.inverse_mass;
  for (int a = 0; a < Dim; ++a) { // column a of [arm]×
    const Spin<Dim> column = torque<Dim>(arm, Vec<Dim>(Vec<Dim>::Unit(a)));
    sum += dot<spin_size<Dim>>(column, product<spin_size<Dim>>(body.inverse_inertia, column));
  }
  return sum;
}

/// See BodyContact::inverse_mass.
template <int Dim>
double contact_inverse_mass(const DualProblem<Dim>& problem, const BodyContact<Dim>& contact) {
  const double of_body = inverse_mass_at(problem.bodies[contact.body], contact.arm);
  if (contact.node >= 0)
    return of_body + problem.inverse_mass[contact.node].maxCoeff();
  if (contact.other >= 0)
    return of_body + inverse_mass_at(problem.bodies[contact.other], contact.other_arm);
  return of_body;
}

/// All ranks visit all contacts of free bodies, each in its own copy: what the nodes that they
/// touch have (field, #nodes) comes from the owners before.
template <int Dim, class Value>
void share_touched(const DualProblem<Dim>& problem, Array<Value>& field) {
  if (const Halo* const halo = problem.copies.halo(); halo && !problem.bodies.empty())
    halo->share_touched(field.data(), sizeof(Value));
}

/// One visit of each contact in their order: a projected step r ← P(r − w/L), exact where W = L I,
/// put into the velocities at once. Returns Σ L |Δr|².
template <int Dim>
double update_body_contacts(DualProblem<Dim>& problem) {
  double change2 = 0;
  share_touched(problem, problem.velocity);
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
