// SPDX-License-Identifier: MIT
#pragma once

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
  const Vec<Dim> stop = contact.impulse - (u - contact.wall_velocity) / inverse_mass; // −b/w
  const double normal = std::max(0.0, stop.dot(contact.normal));
  Vec<Dim> tangent = stop - stop.dot(contact.normal) * contact.normal;
  const double size = tangent.norm(), largest = contact.friction * normal;
  if (size > largest)
    tangent *= largest / size;
  return normal * contact.normal + tangent;
}

/// The largest component of a node's inverse mass: a component is 0 where u is prescribed.
template <int Dim>
double contact_inverse_mass(const DualProblem<Dim>& problem, const Contact<Dim>& contact) {
  return problem.inverse_mass[static_cast<std::size_t>(contact.node)].maxCoeff();
}

/// Solves one contact and puts the change of its impulse into the node's velocity; returns w |Δr|²,
/// w the inverse mass.
template <int Dim>
double update_contact(DualProblem<Dim>& problem, Contact<Dim>& contact) {
  const std::size_t j = static_cast<std::size_t>(contact.node);
  auto u = problem.velocity[j].template head<Dim>();
  const double inverse_mass = contact_inverse_mass(problem, contact);
  const Vec<Dim> impulse = contact_impulse<Dim>(contact, u, inverse_mass);
  const Vec<Dim> change = impulse - contact.impulse;
  u += problem.inverse_mass[j].template head<Dim>().cwiseProduct(change);
  contact.impulse = impulse;
  return inverse_mass * change.squaredNorm();
}

} // namespace talus
