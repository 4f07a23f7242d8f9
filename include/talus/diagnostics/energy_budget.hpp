// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/node_types.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/particles.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/observer.hpp"
#include "talus/step/wrenches.hpp"
#include "talus/transfer/particle_lanes.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace talus {

/// The energy that there is, J (2-D: J/m).
struct EnergyLevels {
  double kinetic = 0;   ///< Σ m_p |v_p|²/2
  double within = 0;    ///< of the motion within particles, Σ m_p Σ_i N_i |u_p(x_i) − v_p|²/2
  double potential = 0; ///< −Σ m_p g·x_p, without axes along which the box is periodic
  double bodies = 0;    ///< kinetic and potential, of the free bodies

  double sum() const { return kinetic + within + potential + bodies; }
  /// Calls visit(name, value) for all.
  template <class Self, class Visit>
  static void for_each(Self& self, const Visit& visit) {
    visit("kinetic", self.kinetic);
    visit("within", self.within);
    visit("potential", self.potential);
    visit("bodies", self.bodies);
  }
};

/// Work of a face, an obstacle or a free body on the material, J (2-D: J/m).
struct BoundaryWork {
  double friction = 0; ///< −Σ μ_w r_n |w_t|, <= 0
  double motion = 0;   ///< Σ r·u_b of what moves as it is told to
  double impact = 0;   ///< −Σ r·Δu/2: what it took to change the velocity, as in a collision

  double sum() const { return friction + motion + impact; }
};

/// Where the energy of a step, or of all steps, came from (> 0) and went (< 0), J (2-D: J/m). The
/// equations stand in docs/concepts/energy.md.
struct EnergyTerms {
  static constexpr int terms = 17; ///< without those of boundaries

  double to_grid = 0;   ///< particles → grid: velocities that differ at a node are averaged
  double friction = 0;  ///< of the medium: −Σ 2 μ̃ λ_N |γ_T|, <= 0
  double room = 0;      ///< −Σ 2 λ_N k: closing of voids under pressure (< 0), expansion (> 0)
  double cohesion = 0;  ///< of the constant tension c/μ
  double impact = 0;    ///< −Σ λ·B Δu: what it took the stress to change the velocity
  double viscosity = 0; ///< of the Newtonian stress
  double solver_error = 0; ///< Σ 2 λ·γ̃ and the same of contacts: 0 if they were solved exactly
  double half_step = 0;    ///< −δt Σ m g·Δu/2: gravity, half a step early
  double slope = 0;        ///< gravity along axes on which the box is periodic
  double held = 0;         ///< potential of particles that were held in the box
  double to_particles = 0; ///< grid → particles: of the grid's field, what they do not take up
  double moved = 0;        ///< of `within`, by the particles' new places in their cells
  double shifting = 0;     ///< Packing::shifting
  double turning = 0;      ///< of free bodies whose inertia turns with them (3-D)
  double exchanged = 0;    ///< what particles carried in and out: open faces, sources, sinks
  double outside = 0;      ///< changes between steps: add, remove, set_gravity
  Array<BoundaryWork> boundaries; ///< faces, obstacles, free bodies, see Boundaries
  /// Energy after − before − all of the above: 0 but for rounding.
  double closure = 0;

  /// All but `outside` and `closure`.
  double sum() const {
    double total = 0;
    for_each(*this, [&](const char*, double term) { total += term; });
    total -= outside + closure;
    for (const BoundaryWork& work : boundaries)
      total += work.sum();
    return total;
  }
  void add(const EnergyTerms& more) {
    SmallArray<double, terms> values;
    std::size_t k = 0;
    for_each(more, [&](const char*, double term) { values[k++] = term; });
    k = 0;
    for_each(*this, [&](const char*, double& term) { term += values[k++]; });
    boundaries.resize(std::max(boundaries.size(), more.boundaries.size()));
    for (std::size_t b = 0; b < more.boundaries.size(); ++b) {
      boundaries[b].friction += more.boundaries[b].friction;
      boundaries[b].motion += more.boundaries[b].motion;
      boundaries[b].impact += more.boundaries[b].impact;
    }
  }
  /// Calls visit(name, term) for all but those of boundaries.
  template <class Self, class Visit>
  static void for_each(Self& self, const Visit& visit) {
    visit("to_grid", self.to_grid);
    visit("friction", self.friction);
    visit("room", self.room);
    visit("cohesion", self.cohesion);
    visit("impact", self.impact);
    visit("viscosity", self.viscosity);
    visit("solver_error", self.solver_error);
    visit("half_step", self.half_step);
    visit("slope", self.slope);
    visit("held", self.held);
    visit("to_particles", self.to_particles);
    visit("moved", self.moved);
    visit("shifting", self.shifting);
    visit("turning", self.turning);
    visit("exchanged", self.exchanged);
    visit("outside", self.outside);
    visit("closure", self.closure);
  }
};

/// The momentum of particles and free bodies, and what changed it in a step, N s (2-D: N s/m).
template <int Dim>
struct MomentumTerms {
  Vec<Dim> before = Vec<Dim>::Zero(), after = Vec<Dim>::Zero();
  Vec<Dim> weight = Vec<Dim>::Zero();    ///< Σ m g δt
  Vec<Dim> reaction = Vec<Dim>::Zero();  ///< of faces and obstacles
  Vec<Dim> exchanged = Vec<Dim>::Zero(); ///< what particles carried in and out
  /// 0 but for rounding and nodes with next to no mass (Params::min_relative_mass).
  Vec<Dim> closure() const { return after - before - weight - reaction - exchanged; }
};

/// All that a budget remembers from step to step.
struct EnergyRecord {
  bool any = false;           ///< has it seen a step?
  EnergyLevels start, now;    ///< before its first step, after its last
  EnergyTerms total;          ///< of all its steps
  double largest_closure = 0; ///< largest |closure| of a step over the largest of |levels|
};

/// Measures where the energy of a simulation goes, step by step:
///
///     auto budget = std::make_shared<EnergyBudget<2>>();
///     params.observer = budget;
///
/// All is measured by itself, none as the rest of others, so that `closure` shows whether the sum
/// is right. The run has the bits that it has without it, and all sums are exact: the same for any
/// number of threads and ranks. It costs some passes over the particles a step.
template <int Dim, class Real = double>
class EnergyBudget final : public StepObserver<Dim, Real> {
 public:
  const EnergyTerms& last() const { return last_; }                ///< of the last step
  const MomentumTerms<Dim>& momentum() const { return momentum_; } ///< of the last step
  const EnergyRecord& record() const { return record_; }
  /// Goes on from the record of an earlier run.
  void restore(const EnergyRecord& record) { record_ = record; }

  void observe(StepStage stage, const ObservedStep<Dim, Real>& step) override {
    switch (stage) {
    case StepStage::on_grid:
      start(step);
      break;
    case StepStage::on_particles:
      take_particles(step);
      break;
    case StepStage::shifted: {
      const double before = now_.sum();
      measure_levels(step);
      last_.shifting = now_.sum() - before;
      break;
    }
    case StepStage::forces:
      work_at_nodes(step);
      work_of_stress(step);
      work_of_boundaries(step);
      break;
    case StepStage::end:
      finish(step);
      break;
    }
  }

 private:
  static constexpr int corners = Grid<Dim>::corners;
  static constexpr int n = symmetric_size<Dim>;
  static constexpr int count = 9; ///< sums at once
  using Sums = SmallArray<double, count>;
  using ExactSums = SmallArray<ExactSum, count>;
  enum { kinetic, within, potential, moment, other = moment + Dim };
  using Corners = SmallArray<Vec<Dim>, corners>;

  /// Σ of what term(i, sums) adds for 0 ≤ i < size, over all ranks.
  template <class Term>
  Sums sum(std::ptrdiff_t size, const Execution& execution, const Term& term) {
    ExactSums total = execution.reduce(
        size, partials_, ExactSums{},
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          ExactSums part{};
          for (std::ptrdiff_t i = begin; i < end; ++i) {
            Sums of{};
            term(static_cast<std::size_t>(i), of);
            for (int k = 0; k < count; ++k)
              if (of[k] != 0) // many are not used
                part[k].add(of[k]);
          }
          for (ExactSum& each : part)
            each.normalise();
          return part;
        },
        [](ExactSums all, const ExactSums& part) {
          for (int k = 0; k < count; ++k)
            all[k].join(part[k]);
          return all;
        });
    execution.join(total.values, count);
    Sums values;
    for (int k = 0; k < count; ++k)
      values[k] = total[k].value();
    return values;
  }

  /// A particle's place in its cell, or at its edge if it has left the box, and the N_c there.
  struct Place {
    Vec<Dim> xi;
    Index<Dim> cell;
    SmallArray<double, corners> shape;
  };
  static Place place_of(const Grid<Dim>& grid, const Vec<Dim>& x) {
    Place place;
    place.cell = grid.cell_at(x);
    place.xi = grid.local(x, place.cell);
    for (int a = 0; a < Dim; ++a)
      place.xi[a] = std::clamp(place.xi[a], 0.0, 1.0);
    for (int c = 0; c < corners; ++c) {
      place.shape[c] = 1;
      for (int a = 0; a < Dim; ++a)
        place.shape[c] *= Grid<Dim>::corner_bit(c, a) ? place.xi[a] : 1 - place.xi[a];
    }
    return place;
  }

  /// What the particle's velocity field is at the corners of its cell, less v_p, m/s.
  static Corners field(const ObservedStep<Dim, Real>& step, std::size_t p, const Vec<Dim>& xi) {
    Corners u;
    const Particles<Dim, Real>& particles = step.particles;
    const bool mixed = step.field == ParticleField::multilinear && !particles.mixed.empty();
    for (int c = 0; c < corners; ++c) {
      u[c] = Vec<Dim>::Zero();
      if (step.field == ParticleField::constant)
        continue;
      Vec<Dim> r;
      for (int a = 0; a < Dim; ++a) {
        r[a] = step.bounds.grid.spacing()[a] * (Grid<Dim>::corner_bit(c, a) - xi[a]);
        for (int b = 0; b < Dim; ++b)
          u[c][b] += static_cast<double>(particles.affine[p](b, a)) * r[a];
      }
      for (std::size_t m = 0; mixed && m < mixed_terms<Dim>.size(); ++m) {
        double product = 1;
        for (int a = 0; a < Dim; ++a)
          if ((mixed_terms<Dim>[m] & axis_term<Dim>(static_cast<std::size_t>(a))) != 0)
            product *= r[a];
        for (int b = 0; b < Dim; ++b)
          u[c][b] +=
              static_cast<double>(particles.mixed[p](b, static_cast<Eigen::Index>(m))) * product;
      }
    }
    return u;
  }

  static Vec<Dim> velocity(const Particles<Dim, Real>& particles, std::size_t p) {
    return particles.velocity[p].template cast<double>();
  }
  static double mass(const ObservedStep<Dim, Real>& step, std::size_t p) {
    const auto& material = step.particles.material;
    return step.densities[material.empty() ? 0 : material[p]] *
           static_cast<double>(step.particles.volume[p]);
  }

  /// Σ_c N_c |u_c|²/2 of the motion within.
  static double energy_within(const Place& place, const Corners& u) {
    double energy = 0;
    for (int c = 0; c < corners; ++c)
      energy += place.shape[c] * dot<Dim>(u[c], u[c]) / 2;
    return energy;
  }

  /// Adds a particle's share of the levels and of the momentum.
  static void add_levels(const ObservedStep<Dim, Real>& step, std::size_t p, double own_within,
                         Sums& sums) {
    const double m = mass(step, p);
    const Vec<Dim> v = velocity(step.particles, p);
    sums[kinetic] += m * dot<Dim>(v, v) / 2;
    sums[within] += m * own_within;
    for (int a = 0; a < Dim; ++a) {
      if (!step.bounds.grid.periodic(a))
        sums[potential] -= m * step.solved.gravity[a] * step.particles.position[p][a];
      sums[moment + a] += m * v[a];
    }
  }

  /// Kinetic and potential energy of the bodies, with the velocities that they have or, in a step,
  /// that the problem has for them.
  static double energy_of_bodies(const ObservedStep<Dim, Real>& step, bool solved) {
    double energy = 0;
    for (std::size_t b = 0; b < step.bounds.bodies.size(); ++b) {
      const Body<Dim>& body = step.bounds.bodies[b];
      RigidState<Dim> state = step.bounds.body_states[b];
      if (solved) {
        state.velocity = step.solved.problem.bodies[b].velocity;
        state.angular_velocity = step.solved.problem.bodies[b].angular_velocity;
        state.position = plus_scaled<Dim>(state.position, step.solved.time_step, state.velocity);
      }
      const Spin<Dim> spin =
          product<spin_size<Dim>>(in_box(state, body.inertia), state.angular_velocity);
      energy += body.mass * (dot<Dim>(state.velocity, state.velocity) / 2 -
                             dot<Dim>(step.solved.gravity, state.position)) +
                dot<spin_size<Dim>>(spin, state.angular_velocity) / 2;
    }
    return energy;
  }
  static Vec<Dim> momentum_of_bodies(const ObservedStep<Dim, Real>& step) {
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (std::size_t b = 0; b < step.bounds.bodies.size(); ++b)
      sum = plus_scaled<Dim>(sum, step.bounds.bodies[b].mass, step.bounds.body_states[b].velocity);
    return sum;
  }

  void keep_levels(const Sums& sums) {
    now_.kinetic = sums[kinetic];
    now_.within = sums[within];
    now_.potential = sums[potential];
    for (int a = 0; a < Dim; ++a)
      momentum_of_particles_[a] = sums[moment + a];
  }

  void measure_levels(const ObservedStep<Dim, Real>& step) {
    const Grid<Dim>& grid = step.bounds.grid;
    keep_levels(
        sum(std::ssize(step.particles.position), step.execution, [&](std::size_t p, Sums& sums) {
          const Place place = place_of(grid, step.particles.position[p]);
          add_levels(step, p, energy_within(place, field(step, p, place.xi)), sums);
        }));
  }

  void start(const ObservedStep<Dim, Real>& step) {
    const Grid<Dim>& grid = step.bounds.grid;
    const Array<NodeVec<Dim>>& before = step.solved.work.velocity_before;
    position_.resize(step.particles.size());
    const Sums sums = sum(std::ssize(position_), step.execution, [&](std::size_t p, Sums& of) {
      position_[p] = step.particles.position[p];
      const Place place = place_of(grid, position_[p]);
      const Corners u = field(step, p, place.xi);
      add_levels(step, p, energy_within(place, u), of);
      const Vec<Dim> v = velocity(step.particles, p);
      const double m = mass(step, p);
      const int first = grid.first_node(place.cell);
      for (int c = 0; c < corners; ++c) {
        const Vec<Dim> node = before[first + grid.corner_offset(c)].template head<Dim>();
        const Vec<Dim> off = minus<Dim>(plus<Dim>(v, u[c]), node);
        of[other] -= m * place.shape[c] * dot<Dim>(off, off) / 2;
      }
      of[other + 1] += m;
    });
    keep_levels(sums);
    now_.bodies = energy_of_bodies(step, false);
    before_ = now_;
    const std::size_t sources = step.bounds.sources();
    Array<BoundaryWork> boundaries; // its memory is kept
    boundaries.swap(last_.boundaries);
    last_ = {};
    last_.boundaries.swap(boundaries);
    last_.boundaries.assign(sources, BoundaryWork());
    last_.to_grid = sums[other];
    last_.outside = record_.any ? before_.sum() - record_.now.sum() : 0;
    momentum_.before = plus<Dim>(momentum_of_particles_, momentum_of_bodies(step));
    double all_mass = sums[other + 1];
    for (const Body<Dim>& body : step.bounds.bodies)
      all_mass += body.mass;
    momentum_.weight = scaled<Dim>(step.solved.time_step * all_mass, step.solved.gravity);
  }

  void take_particles(const ObservedStep<Dim, Real>& step) {
    const Grid<Dim>& grid = step.bounds.grid;
    const Array<NodeVec<Dim>>& after = step.solved.problem.velocity;
    const Sums sums = sum(std::ssize(position_), step.execution, [&](std::size_t p, Sums& of) {
      const Place then = place_of(grid, position_[p]);
      const Place now = place_of(grid, step.particles.position[p]);
      const Corners u = field(step, p, then.xi);
      const double within_now = energy_within(now, field(step, p, now.xi));
      add_levels(step, p, within_now, of);
      const Vec<Dim> v = velocity(step.particles, p);
      const double m = mass(step, p);
      const int first = grid.first_node(then.cell);
      Vec<Dim> carried = Vec<Dim>::Zero(); // Σ N_c u_c
      for (int c = 0; c < corners; ++c) {
        const Vec<Dim> node = after[first + grid.corner_offset(c)].template head<Dim>();
        const Vec<Dim> own = plus<Dim>(v, u[c]);
        of[other] += m * then.shape[c] * dot<Dim>(minus<Dim>(own, node), plus<Dim>(own, node)) / 2;
        carried = plus_scaled<Dim>(carried, then.shape[c], node);
      }
      of[other + 1] += m * (within_now - energy_within(then, u));
      for (int a = 0; a < Dim; ++a)
        if (!grid.periodic(a))
          of[other + 2] -= m * step.solved.gravity[a] *
                           (step.particles.position[p][a] - position_[p][a] -
                            step.solved.time_step * carried[a]);
    });
    keep_levels(sums);
    last_.to_particles = sums[other];
    last_.moved = sums[other + 1];
    last_.held = sums[other + 2];
  }

  bool feels_stress(const ObservedStep<Dim, Real>& step, int node) const {
    return step.solved.fields.material_volume[node] >= step.least_volume;
  }

  /// Gravity and viscosity; sets change_.
  void work_at_nodes(const ObservedStep<Dim, Real>& step) {
    const SolvedStep<Dim>& solved = step.solved;
    const Array<NodeVec<Dim>>&before = solved.work.velocity_before,
          &after = solved.problem.velocity;
    change_.resize(before.size());
    step.execution.for_each(std::ssize(change_), [&](std::ptrdiff_t j) {
      change_[j] = feels_stress(step, static_cast<int>(j)) ? NodeVec<Dim>(after[j] - before[j])
                                                           : NodeVec<Dim>(2 * after[j]);
    });
    const Sums sums = sum(std::ssize(step.nodes), step.execution, [&](std::size_t k, Sums& of) {
      const int j = step.nodes[k];
      const double m = solved.mass(j);
      const Vec<Dim> viscous = solved.viscous.impulse(j);
      for (int a = 0; a < Dim; ++a) {
        const double weight = m * solved.time_step * solved.gravity[a];
        of[0] -= weight * (after[j][a] - before[j][a]) / 2;
        if (step.bounds.grid.periodic(a))
          of[1] += weight * after[j][a];
        of[2] += viscous[a] * (after[j][a] - change_[j][a] / 2);
      }
    });
    last_.half_step = sums[0];
    last_.slope = sums[1];
    last_.viscosity = sums[2];
    for (std::size_t b = 0; b < step.bounds.bodies.size(); ++b) {
      const Vec<Dim> gained =
          minus<Dim>(solved.problem.bodies[b].velocity, step.bounds.body_states[b].velocity);
      last_.half_step -=
          step.bounds.bodies[b].mass * solved.time_step * dot<Dim>(solved.gravity, gained) / 2;
    }
  }

  void work_of_stress(const ObservedStep<Dim, Real>& step) {
    const SolvedStep<Dim>& solved = step.solved;
    const DualProblem<Dim>& problem = solved.problem;
    const Stencil<Dim> stencil(problem.grid);
    const auto of_block = [&](const Block& block, double* of) {
      for (int k = 0; k < 5; ++k)
        of[k] = 0;
      for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
        const int j = problem.node[i];
        const Vec<n> strain = integrated_strain_rate(problem, stencil, i);
        const auto gradient =
            gather_gradient<Dim>(change_.data() + j, stencil, problem.gradient_weights[i]);
        const Vec<n> change = symmetric_to_vector<Dim, double>(gradient.template topRows<Dim>());
        const Vec<n>&law = problem.stress_impulse[i], &stress = solved.stress_impulse[j];
        const double k = problem.free_volume_rate[i];
        double slip2 = 0, sheared = 0;
        for (int c = 1; c < n; ++c) {
          slip2 += strain[c] * strain[c];
          sheared += law[c] * strain[c];
        }
        const double friction = problem.opening[i] * law[0] * std::sqrt(slip2);
        of[0] -= 2 * friction;
        of[1] -= 2 * law[0] * k;
        of[2] -= 2 * (law[0] - stress[0]) * strain[0];
        of[3] -= dot<n>(stress, change);
        of[4] += 2 * (law[0] * (strain[0] + k) + sheared + friction);
      }
    };
    const auto sums = sum_over_blocks<5>(problem, step.execution, numbers_, of_block);
    last_.friction = sums[0];
    last_.room = sums[1];
    last_.cohesion = sums[2];
    last_.impact = sums[3];
    last_.solver_error = sums[4];
  }

  /// Work by boundary id: three sums each, and the solver's error at the end.
  class BoundarySums {
   public:
    BoundarySums(std::size_t sources, Array<ExactSum>& sums) : sums_(sums) {
      sums.assign(3 * sources + 1, ExactSum());
    }
    void add_impact(int boundary_id, double work) { at(boundary_id, 2).add(work); }

    /// The impulse r of a contact; w: the velocity that its law is about; told: what of the
    /// velocity it is not about; change: of the velocity in the step. (m/s)
    void add(const Contact<Dim>& contact, const Vec<Dim>& w, const Vec<Dim>& change, int id) {
      const double normal = dot<Dim>(contact.impulse, contact.normal);
      const Vec<Dim> slip = plus_scaled<Dim>(w, -dot<Dim>(w, contact.normal), contact.normal);
      const double friction = contact.friction * normal * norm<Dim>(slip);
      at(id, 0).add(-friction);
      at(id, 1).add(dot<Dim>(contact.impulse, contact.wall_velocity));
      at(id, 2).add(-dot<Dim>(contact.impulse, change) / 2);
      sums_.back().add(dot<Dim>(contact.impulse, w) + friction);
    }

    void write(const Execution& execution, EnergyTerms& terms) {
      execution.join(sums_.data(), static_cast<int>(sums_.size()));
      for (std::size_t b = 0; b < terms.boundaries.size(); ++b) {
        const int id = static_cast<int>(b);
        terms.boundaries[b] = {at(id, 0).value(), at(id, 1).value(), at(id, 2).value()};
      }
      terms.solver_error += sums_.back().value();
    }

   private:
    ExactSum& at(int boundary_id, int term) { return sums_[3 * boundary_id + term]; }
    Array<ExactSum>& sums_;
  };

  void work_of_boundaries(const ObservedStep<Dim, Real>& step) {
    const SolvedStep<Dim>& solved = step.solved;
    const DualProblem<Dim>& problem = solved.problem;
    const Array<NodeVec<Dim>>& before = solved.work.velocity_before;
    BoundarySums sums(last_.boundaries.size(), exact_);
    // a component that is held goes from u* to 0; the faces take the momentum that it would have
    const auto add_to_faces = [&](int node, const Vec<Dim>& impulse) {
      for_each_holding_face(step.bounds, node, problem.inverse_mass[node],
                            [&](int a, int face, int sharing) {
                              sums.add_impact(face, -impulse[a] * before[node][a] / (2 * sharing));
                            });
    };
    for (const int node : step.nodes) {
      if (!(solved.fields.material_volume[node] > 0))
        continue;
      const int cone = solved.work.cone[node];
      Vec<Dim> momentum_there;
      bool held = false;
      for (int a = 0; a < Dim; ++a) {
        held = held || problem.inverse_mass[node][a] == 0;
        momentum_there[a] =
            solved.mass(node) * (before[node][a] + solved.time_step * solved.gravity[a]);
      }
      if (held)
        add_to_faces(node, cone >= 0 ? solved.work.held_momentum[cone] : momentum_there);
    }
    const auto change_of = [&](int node) { return Vec<Dim>(change_[node].template head<Dim>()); };
    for (const Contact<Dim>& contact : problem.contacts) {
      const Vec<Dim> u = problem.velocity[contact.node].template head<Dim>();
      sums.add(contact, minus<Dim>(u, contact.wall_velocity), change_of(contact.node),
               contact.boundary_id);
      add_to_faces(contact.node, contact.impulse);
    }
    for (const BodyContact<Dim>& contact : problem.body_contacts) { // all ranks have all of them
      if (contact.node >= 0 ? !owns_node(step.bounds.grid, contact.node)
                            : !step.execution.first_rank())
        continue;
      const auto change_of_body = [&](int b, const Vec<Dim>& arm) {
        const FreeBody<Dim>& body = problem.bodies[b];
        const RigidState<Dim>& old = step.bounds.body_states[b];
        const Spin<Dim> turned = minus<spin_size<Dim>>(body.angular_velocity, old.angular_velocity);
        return plus<Dim>(minus<Dim>(body.velocity, old.velocity), cross<Dim>(turned, arm));
      };
      Vec<Dim> change = scaled<Dim>(-1, change_of_body(contact.body, contact.arm));
      if (contact.node >= 0) {
        change = plus<Dim>(change_of(contact.node), change);
        add_to_faces(contact.node, contact.impulse);
      } else if (contact.other >= 0) {
        change = plus<Dim>(change_of_body(contact.other, contact.other_arm), change);
      }
      sums.add(contact, minus<Dim>(relative_velocity(problem, contact), contact.wall_velocity),
               change, contact.boundary_id);
    }
    sums.write(step.execution, last_);
    now_.bodies = energy_of_bodies(step, true);
    momentum_.reaction = Vec<Dim>::Zero();
    for (int b = 0; b < step.bounds.body_id(0); ++b)
      momentum_.reaction = plus_scaled<Dim>(momentum_.reaction, -solved.time_step,
                                            step.wrenches[static_cast<std::size_t>(b)].force);
  }

  void finish(const ObservedStep<Dim, Real>& step) {
    const EnergyLevels moved = now_;
    const Vec<Dim> before = momentum_of_particles_;
    measure_levels(step);
    now_.bodies = moved.bodies;
    last_.exchanged = now_.sum() - moved.sum();
    momentum_.exchanged = minus<Dim>(momentum_of_particles_, before);
    now_.bodies = energy_of_bodies(step, false);
    last_.turning = now_.bodies - moved.bodies;
    momentum_.after = plus<Dim>(momentum_of_particles_, momentum_of_bodies(step));
    last_.closure = now_.sum() - before_.sum() - last_.sum();
    if (!record_.any)
      record_.start = before_;
    record_.any = true;
    record_.now = now_;
    record_.total.add(last_);
    double scale = 0;
    for (const EnergyLevels* levels : {&before_, &now_})
      EnergyLevels::for_each(
          *levels, [&](const char*, double level) { scale = std::max(scale, std::abs(level)); });
    if (scale > 0)
      record_.largest_closure = std::max(record_.largest_closure, std::abs(last_.closure) / scale);
  }

  EnergyRecord record_;
  EnergyTerms last_;
  MomentumTerms<Dim> momentum_;
  EnergyLevels before_, now_; ///< of this step; `now` as far as it is
  Vec<Dim> momentum_of_particles_ = Vec<Dim>::Zero();
  // Workspace.
  Array<Vec<Dim>> position_;   ///< of the particles before they moved, m
  Array<NodeVec<Dim>> change_; ///< Δu of the nodes, m/s; 2 u where no stress acts, see impact
  Array<ExactSums> partials_;
  Array<ExactSum> exact_;
  Array<double> numbers_;
};

} // namespace talus
