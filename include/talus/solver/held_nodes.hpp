// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/problem.hpp"

#include <cstddef>

namespace talus {

/// m_j per component, kg; 0 where the velocity is prescribed.
template <class Padded>
Padded mass_of(const Padded& inverse_mass) {
  return (inverse_mass.array() > 0).select(inverse_mass.cwiseInverse(), Padded::Zero());
}

/// The nodes that contacts hold while the viscous stress acts: those whose contacts bore something
/// in the last step. They move with the wall or the free body where they stuck and along it where
/// they slid. A node has one such contact at most, a wall's rather than a body's.
///
/// So the velocity of a held node is a free part and C w, w the velocity of what holds it there:
/// C w = w where it sticks, and n' (n · w)/|n'|² where it slides, without the components that faces
/// prescribe: n' is n without them. A force f on the node is f · C on what holds it.
template <int Dim>
class HeldNodes {
 public:
  using Padded = NodeVec<Dim>;
  /// Velocity and angular velocity of a body, or an impulse and its torque about the centre.
  using Motion = Vec<Dim + spin_size<Dim>>;

  /// Finds the nodes and takes them along, with bodies as in a plastic impact. The impulses of the
  /// contacts get what that takes.
  void hold(DualProblem<Dim>& problem, const Execution& execution) {
    held_.clear();
    at_.assign(problem.velocity.size(), none);
    for (std::size_t c = 0; c < problem.contacts.size(); ++c)
      add(problem, problem.contacts[c], c, -1);
    walls_ = held_.size();
    for (const Held& held : held_)
      move_along(problem, held, problem.contacts[held.contact],
                 problem.contacts[held.contact].wall_velocity);
    if (!problem.bodies.empty())
      hold_by_bodies(problem, execution);
  }

  /// Do free bodies hold nodes?
  bool bodies() const { return held_.size() > walls_; }

  /// Only what may change of a node's vector without what holds it.
  Padded free(const DualProblem<Dim>& problem, int j, const Padded& value) const {
    Padded part = (problem.inverse_mass[j].array() > 0).select(value, Padded::Zero());
    if (at_[j] < 0)
      return part;
    const Held& held = held_[at_[j]];
    if (held.sticks)
      return Padded::Zero();
    const double normal = part.template head<Dim>().dot(held.normal) / held.normal.squaredNorm();
    part.template head<Dim>() -= normal * held.normal;
    return part;
  }

  /// Finds the masses of the bodies with their nodes and what `more` has for these (kg, #nodes, per
  /// component): for precondition().
  void prepare(const DualProblem<Dim>& problem, const Array<Padded>& more) {
    prepared_ = mass_;
    for (std::size_t h = walls_; h < held_.size(); ++h)
      add_mass(problem, held_[h], more[held_[h].node], prepared_);
    fix_spins(problem, prepared_);
  }
  /// The motion of a body that an impulse makes: with the masses of prepare(), or those of its
  /// nodes.
  Motion precondition(std::size_t body, const Motion& impulse) const {
    return solve_positive<motion_size>(prepared_[body], impulse);
  }
  Motion motion_by(std::size_t body, const Motion& impulse) const {
    return solve_positive<motion_size>(mass_[body], impulse);
  }
  /// The impulse of a motion, the nodes' included.
  Motion impulse_of(std::size_t body, const Motion& motion) const {
    return product<motion_size>(mass_[body], motion);
  }

  /// Adds motions to those of the bodies.
  static void move(DualProblem<Dim>& problem, double factor, const Array<Motion>& motions) {
    for (std::size_t b = 0; b < motions.size(); ++b) {
      FreeBody<Dim>& body = problem.bodies[b];
      for (int a = 0; a < Dim; ++a)
        body.velocity[a] += factor * motions[b][a];
      for (int a = 0; a < spin_size<Dim>; ++a)
        body.angular_velocity[a] += factor * motions[b][Dim + a];
    }
  }

  /// What the bodies get of impulses on their nodes (field, #nodes, N s); #bodies.
  void gather(const DualProblem<Dim>& problem, const Array<Padded>& field,
              Array<Motion>& impulses) const {
    impulses.assign(problem.bodies.size(), Motion::Zero());
    for (std::size_t h = walls_; h < held_.size(); ++h) {
      const Held& held = held_[h];
      const BodyContact<Dim>& contact = problem.body_contacts[held.contact];
      const Vec<Dim> force = on_holder(problem, held, contact.normal, field[held.node]);
      add_moment(problem, contact, force, impulses[contact.body]);
    }
  }
  /// Adds the velocities of their bodies to the nodes; #bodies, #nodes.
  void carry(const DualProblem<Dim>& problem, const Array<Motion>& motions,
             Array<Padded>& field) const {
    for (std::size_t h = walls_; h < held_.size(); ++h) {
      const Held& held = held_[h];
      const BodyContact<Dim>& contact = problem.body_contacts[held.contact];
      field[held.node].template head<Dim>() +=
          followed(problem, held, contact.normal, velocity_of(motions[contact.body], contact.arm));
    }
  }

  /// Gives the contacts what the nodes keep of impulses −f on them (#nodes, N s), having moved
  /// since hold() as problem.velocity says.
  void keep(DualProblem<Dim>& problem, const Array<Padded>& f) const {
    for (std::size_t h = 0; h < held_.size(); ++h) {
      const Held& held = held_[h];
      Contact<Dim>& contact = contact_of(problem, held);
      Padded kept = f[held.node];
      if (held.body >= 0)
        kept += mass_of(problem.inverse_mass[held.node])
                    .cwiseProduct(problem.velocity[held.node] - held.start);
      contact.impulse += on_holder(problem, held, contact.normal, kept);
    }
  }

  /// Gives all ranks and all copies the owners' values at the nodes that bodies touch.
  template <class Value>
  static void share(const DualProblem<Dim>& problem, const Execution& execution,
                    Array<Value>& field) {
    problem.copies.copy(field, execution);
    share_touched(problem, field);
  }

 private:
  static constexpr int motion_size = Dim + spin_size<Dim>, none = -1;

  struct Held {
    int node = 0;
    std::size_t contact = 0; ///< index into contacts or body_contacts
    int body = -1;           ///< or −1: a wall
    bool sticks = false;
    Vec<Dim> normal;               ///< n'
    Padded start = Padded::Zero(); ///< velocity after hold(); of bodies
  };

  static Contact<Dim>& contact_of(DualProblem<Dim>& problem, const Held& held) {
    if (held.body < 0)
      return problem.contacts[held.contact];
    return problem.body_contacts[held.contact];
  }

  void add(const DualProblem<Dim>& problem, const Contact<Dim>& contact, std::size_t number,
           int body) {
    // What interior points leave of an open contact is no pressure, and what slides is at its bound
    // but for their tolerance and for the turn of the normal since.
    constexpr double little = 1e-3, nearly = 1e-2;
    const double pressed = contact.impulse.dot(contact.normal);
    if (!(pressed * contact_inverse_mass<Dim>(problem, contact) > little * problem.velocity_scale))
      return;
    const Vec<Dim> along_wall = contact.impulse - pressed * contact.normal;
    Held held;
    held.node = contact.node;
    held.contact = number;
    held.body = body;
    held.sticks = along_wall.norm() < (1 - nearly) * contact.friction * pressed;
    held.normal = without_faces(problem, contact.node, contact.normal);
    if (held.normal.squaredNorm() < 0.5) // faces hold it rather than the contact
      return;
    int& at = at_[contact.node];
    if (at < 0) {
      at = static_cast<int>(held_.size());
      held_.push_back(held);
    } else if (held.sticks && !held_[at].sticks) {
      held_[at] = held;
    }
  }

  /// Moves a node with what holds it, of velocity w there, and gives the contact the impulse.
  void move_along(DualProblem<Dim>& problem, const Held& held, Contact<Dim>& contact,
                  const Vec<Dim>& w) {
    const Vec<Dim> slip = w - problem.velocity[held.node].template head<Dim>();
    Padded change = Padded::Zero();
    change.template head<Dim>() = followed(problem, held, contact.normal, slip);
    problem.velocity[held.node] += change;
    const Padded momentum = change.cwiseProduct(mass_of(problem.inverse_mass[held.node]));
    contact.impulse += on_holder(problem, held, contact.normal, momentum);
  }

  void hold_by_bodies(DualProblem<Dim>& problem, const Execution& execution) {
    // a rank knows the walls at its own nodes alone
    by_wall_.assign(problem.velocity.size(), 0);
    for (const Held& held : held_)
      by_wall_[held.node] = 1;
    share(problem, execution, by_wall_);
    for (std::size_t c = 0; c < problem.body_contacts.size(); ++c) {
      const BodyContact<Dim>& contact = problem.body_contacts[c];
      if (contact.node >= 0 && by_wall_[contact.node] == 0)
        add(problem, contact, c, contact.body);
    }
    mass_.clear();
    for (const FreeBody<Dim>& body : problem.bodies)
      mass_.push_back(own_mass(body));
    gained_.assign(problem.bodies.size(), Motion::Zero());
    for (std::size_t h = walls_; h < held_.size(); ++h) {
      const Held& held = held_[h];
      const BodyContact<Dim>& contact = problem.body_contacts[held.contact];
      const Padded mass = mass_of(problem.inverse_mass[held.node]);
      add_mass(problem, held, mass, mass_);
      Padded slip = Padded::Zero();
      slip.template head<Dim>() =
          followed(problem, held, contact.normal, relative_velocity(problem, contact));
      const Vec<Dim> gained = on_holder(problem, held, contact.normal, mass.cwiseProduct(slip));
      add_moment(problem, contact, gained, gained_[contact.body]);
    }
    fix_spins(problem, mass_);
    for (std::size_t b = 0; b < mass_.size(); ++b)
      gained_[b] = motion_by(b, gained_[b]);
    move(problem, 1, gained_);
    for (std::size_t h = walls_; h < held_.size(); ++h) {
      Held& held = held_[h];
      BodyContact<Dim>& contact = problem.body_contacts[held.contact];
      move_along(problem, held, contact, velocity_at(problem.bodies[contact.body], contact.arm));
      held.start = problem.velocity[held.node];
    }
  }

  /// C w.
  static Vec<Dim> followed(const DualProblem<Dim>& problem, const Held& held,
                           const Vec<Dim>& normal, const Vec<Dim>& w) {
    if (held.sticks)
      return without_faces(problem, held.node, w);
    return w.dot(normal) / held.normal.squaredNorm() * held.normal;
  }
  /// f · C.
  static Vec<Dim> on_holder(const DualProblem<Dim>& problem, const Held& held,
                            const Vec<Dim>& normal, const Padded& f) {
    const Vec<Dim> force = f.template head<Dim>();
    if (held.sticks)
      return without_faces(problem, held.node, force);
    return force.dot(held.normal) / held.normal.squaredNorm() * normal;
  }
  /// The components that no face holds.
  static Vec<Dim> without_faces(const DualProblem<Dim>& problem, int j, const Vec<Dim>& value) {
    Vec<Dim> part;
    for (int a = 0; a < Dim; ++a)
      part[a] = problem.inverse_mass[j][a] > 0 ? value[a] : 0;
    return part;
  }

  static Vec<Dim> velocity_of(const Motion& motion, const Vec<Dim>& arm) {
    Spin<Dim> spin;
    Vec<Dim> velocity;
    for (int a = 0; a < Dim; ++a)
      velocity[a] = motion[a];
    for (int a = 0; a < spin_size<Dim>; ++a)
      spin[a] = motion[Dim + a];
    return plus<Dim>(velocity, cross<Dim>(spin, arm));
  }
  static bool rotates(const FreeBody<Dim>& body) { return body.inverse_inertia(0, 0) > 0; }
  static void add_moment(const DualProblem<Dim>& problem, const BodyContact<Dim>& contact,
                         const Vec<Dim>& force, Motion& sum) {
    for (int a = 0; a < Dim; ++a)
      sum[a] += force[a];
    if (!rotates(problem.bodies[contact.body]))
      return;
    const Spin<Dim> turn = torque<Dim>(contact.arm, force);
    for (int a = 0; a < spin_size<Dim>; ++a)
      sum[Dim + a] += turn[a];
  }

  static Mat<motion_size> own_mass(const FreeBody<Dim>& body) {
    Mat<motion_size> mass = Mat<motion_size>::Zero();
    for (int a = 0; a < Dim; ++a)
      mass(a, a) = 1 / body.inverse_mass;
    for (int c = 0; c < spin_size<Dim> && rotates(body); ++c) {
      const Spin<Dim> column =
          solve_positive<spin_size<Dim>>(body.inverse_inertia, Spin<Dim>(Spin<Dim>::Unit(c)));
      for (int r = 0; r < spin_size<Dim>; ++r)
        mass(Dim + r, Dim + c) = column[r];
    }
    return mass;
  }
  /// Adds a held node of this mass (kg, per component) to that of its body.
  static void add_mass(const DualProblem<Dim>& problem, const Held& held, const Padded& mass,
                       Array<Mat<motion_size>>& masses) {
    const BodyContact<Dim>& contact = problem.body_contacts[held.contact];
    for (int c = 0; c < motion_size; ++c) {
      Padded momentum = Padded::Zero();
      momentum.template head<Dim>() = followed(problem, held, contact.normal,
                                               velocity_of(Motion(Motion::Unit(c)), contact.arm));
      momentum = momentum.cwiseProduct(mass);
      Motion column = Motion::Zero();
      add_moment(problem, contact, on_holder(problem, held, contact.normal, momentum), column);
      for (int r = 0; r < motion_size; ++r)
        masses[contact.body](r, c) += column[r];
    }
  }
  /// A body that does not rotate has no spin: an equation of its own, without a force.
  void fix_spins(const DualProblem<Dim>& problem, Array<Mat<motion_size>>& masses) const {
    for (std::size_t b = 0; b < masses.size(); ++b)
      for (int k = Dim; k < motion_size && !rotates(problem.bodies[b]); ++k) {
        for (int r = 0; r < motion_size; ++r)
          masses[b](r, k) = masses[b](k, r) = 0;
        masses[b](k, k) = 1;
      }
  }

  Array<Held> held_;                        ///< those of walls come first
  std::size_t walls_ = 0;                   ///< how many
  Array<int> at_;                           ///< index into held_ or none, #nodes
  Array<double> by_wall_;                   ///< 1 or 0, #nodes
  Array<Mat<motion_size>> mass_, prepared_; ///< #bodies
  Array<Motion> gained_;                    ///< #bodies
};

} // namespace talus
