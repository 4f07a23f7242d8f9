// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cstddef>

namespace talus {

/// The impulse of a contact, the node's other impulses being frozen: Coulomb's law with the
/// isotropic W = w I has the closed form
/// \f[ r_n = \max(0, −b_n/w), \quad r_t = −b_t/w \ \text{shortened to}\ μ_w r_n. \f]
/// u: d, the node's velocity with the contact's present impulse in it; inverse_mass: w, 1/kg.
template <int Dim>
Vec<Dim> contact_impulse(const Contact<Dim>& contact, const Vec<Dim>& u, double inverse_mass) {
  Vec<Dim> stop; // −b/w
  for (int a = 0; a < Dim; ++a)
    stop[a] = contact.impulse[a] - (u[a] - contact.wall_velocity[a]) / inverse_mass;
  const double stop_normal = dot<Dim>(stop, contact.normal), normal = std::max(0.0, stop_normal);
  Vec<Dim> tangent = plus_scaled<Dim>(stop, -stop_normal, contact.normal);
  const double size = norm<Dim>(tangent), largest = contact.friction * normal;
  if (size > largest)
    tangent = scaled<Dim>(largest / size, tangent);
  return plus_scaled<Dim>(tangent, normal, contact.normal);
}

/// The largest component of a node's inverse mass: a component is 0 where u is prescribed.
template <int Dim>
double contact_inverse_mass(const DualProblem<Dim>& problem, const Contact<Dim>& contact) {
  return problem.inverse_mass[contact.node].maxCoeff();
}

/// Gives all nodes of a node's place its velocity, after a change.
template <int Dim>
void share_velocity(DualProblem<Dim>& problem, int node) {
  if (problem.copies.near_copy(node))
    problem.copies.share(problem.velocity, node);
}

/// Solves one contact and puts the change of its impulse into the node's velocity; returns w |Δr|²,
/// w the inverse mass.
template <int Dim>
double update_contact(DualProblem<Dim>& problem, Contact<Dim>& contact) {
  const int j = contact.node;
  const Vec<Dim> u = problem.velocity[j].template head<Dim>();
  const double inverse_mass = contact_inverse_mass(problem, contact);
  const Vec<Dim> impulse = contact_impulse<Dim>(contact, u, inverse_mass);
  const Vec<Dim> change = minus<Dim>(impulse, contact.impulse);
  for (int a = 0; a < Dim; ++a)
    problem.velocity[j][a] += problem.inverse_mass[j][a] * change[a];
  share_velocity(problem, contact.node);
  contact.impulse = impulse;
  return inverse_mass * dot<Dim>(change, change);
}

} // namespace talus
