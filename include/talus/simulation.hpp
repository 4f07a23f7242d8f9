// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/node_copies.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/packing.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/flow_state.hpp"
#include "talus/rheology/inertial_number.hpp"
#include "talus/rheology/rheology.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/solver/solver.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/step/body_contacts.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/contacts.hpp"
#include "talus/step/exchange.hpp"
#include "talus/step/face_conditions.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/friction.hpp"
#include "talus/step/node_fields.hpp"
#include "talus/step/observer.hpp"
#include "talus/step/overfilled.hpp"
#include "talus/step/ranks.hpp"
#include "talus/step/report.hpp"
#include "talus/step/room.hpp"
#include "talus/step/solids.hpp"
#include "talus/step/state.hpp"
#include "talus/step/time_step.hpp"
#include "talus/step/wrenches.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/cells_to_nodes.hpp"
#include "talus/transfer/grid_to_particles.hpp"
#include "talus/transfer/material_volumes.hpp"
#include "talus/transfer/shifting.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace talus {

struct Material {
  double density = 0; ///< ρ_c of the dense packing, kg/m³; > 0
};

/// A granular flow: particles, a grid, and the policies that say how the medium yields (RheologyT),
/// how particles and grid exchange velocities (TransferT) and how the dual problem is solved
/// (SolverT). ParticleReal: what particles keep their velocities in; see Particles.
///
/// One step of the semi-implicit scheme of Rousseau et al. 2023 (their §3 and appendices; after
/// Daviet & Bertails-Descoubes 2016):
/// \f[ m_j (u_j − u^*_j) = δt \Bigl( m_j g + \sum_i Λ_i g_{ij} \Bigr), \quad
///     γ_i = \mathrm{vec}\,\mathrm{sym} \sum_j u_j ⊗ g_{ij} + k_i, \f]
/// and (γ_i, λ_i) in the Drucker–Prager law of friction μ_i.
template <int Dim, Rheology RheologyT, TransferScheme<Dim> TransferT, Solver<Dim> SolverT,
          class ParticleReal = double>
class Simulation {
 public:
  static constexpr int dimension = Dim;
  using ParticleData = Particles<Dim, ParticleReal>;

  struct Params {
    GridParams<Dim> grid{};
    Material material{}; ///< a rheology OfMaterials has densities itself
    Vec<Dim> gravity = Vec<Dim>::Constant(not_given); ///< m/s², at the start
    double time_step = 0;                             ///< δt, s; > 0; the largest one if cfl > 0
    /// Largest share of a cell that material, bodies and obstacles may cross in a step along any
    /// axis, see cfl_time_step; what a source lets in does not count before it is there. 0: δt is
    /// fixed.
    double cfl = 0;
    Faces<Dim> faces{};
    std::vector<std::shared_ptr<const Obstacle<Dim>>> obstacles{};
    std::vector<Body<Dim>> bodies{};
    std::shared_ptr<const Exchange<Dim, ParticleReal>> exchange{}; ///< sources, sinks; null: none
    std::shared_ptr<StepObserver<Dim, ParticleReal>> observer{};   ///< null: none
    typename RheologyT::Params rheology{};
    typename TransferT::Params transfer{};
    typename SolverT::Params solver{};
    ViscousParams viscous{}; ///< counts for a Viscous rheology alone
    /// Most times that a step takes μ_i from the rheology. 1: once, from the strain rate and the
    /// pressure of the last step, as in the paper. More: again from those that it has found, until
    /// the yield stress μ p changes by less than friction_tolerance, relative, in the mean square.
    int friction_updates = 1;
    double friction_tolerance = 1e-3;
    double min_relative_mass = 1e-9; ///< nodes below this share of the dense mass carry no stress
    Packing packing{};
    int threads = 1; ///< the result does not depend on it
    /// The processes that share the simulation, and no other one; null: this one alone. The result
    /// does not depend on their number. All make the same simulation and call step() and what else
    /// is collective together; particles, fields and problem are this rank's part.
    std::shared_ptr<Ranks<Dim, ParticleReal>> ranks{};
  };

  /// Throws std::invalid_argument if a parameter is out of range, or a particle is outside the box,
  /// has no positive volume, a velocity that is not finite, the id of another or a material that is
  /// none, if some place is filled twice (Packing::densest), or if a corner of a body starts in
  /// another body or an obstacle. A box may be empty.
  explicit Simulation(Params params, ParticleData particles)
      : params_(std::move(params)),
        execution_(params_.threads, params_.ranks ? &params_.ranks->communicator() : nullptr),
        rheology_(params_.rheology), transfer_(params_.transfer), solver_(params_.solver) {
    execution_.check_on_all([&] { check_materials(particles, materials()); });
    if (params_.ranks)
      params_.ranks->deal(params_.grid, params_.faces.periodic(), particles);
    use_window();
    state_.time_step = params_.time_step;
    state_.gravity = params_.gravity;
    state_.particles = std::move(particles);
    if constexpr (!OfMaterials<RheologyT>)
      require_positive("material.density", params_.material.density);
    else if (params_.material.density != 0)
      throw_invalid("material.density", params_.material.density,
                    "nothing: the densities of several materials stand in the rheology's list");
    require_positive("time_step", params_.time_step);
    require_non_negative("cfl", params_.cfl);
    if (params_.friction_updates < 1)
      throw_invalid("friction_updates", params_.friction_updates, "an integer >= 1");
    require_positive("friction_tolerance", params_.friction_tolerance);
    if (!(params_.min_relative_mass > 0 && params_.min_relative_mass < 1))
      throw_invalid("min_relative_mass", params_.min_relative_mass, "a number in (0, 1)");
    params_.packing.validate();
    check_gravity("gravity", params_.gravity);
    params_.faces.validate();
    if constexpr (OfMaterials<RheologyT>)
      for (int m = 0; m < materials(); ++m) {
        require_positive("rheology.density(" + std::to_string(m) + ")", rheology_.density(m));
        check_law(rheology_.law(m));
      }
    else
      check_law(rheology_);
    for (int m = 0; m < materials(); ++m)
      densities_.push_back(density(m));
    if constexpr (Viscous<RheologyT>)
      require_non_negative("rheology.viscosity()", rheology_.viscosity());
    params_.viscous.validate();
    for (const auto& obstacle : params_.obstacles)
      if (!obstacle)
        throw_invalid("an obstacle", "null", "a valid pointer");
    if (grid_.any_periodic() && !params_.bodies.empty())
      throw_invalid("the number of free bodies in a box with periodic faces", params_.bodies.size(),
                    "0");
    if (params_.exchange && params_.exchange->materials() > materials())
      throw_invalid("the material of a source", params_.exchange->materials() - 1,
                    "0 to " + std::to_string(materials() - 1) +
                        ": indices into the list of materials");
    check_particles(state_.particles, grid_);
    execution_.check_on_all([&] { check_packing(); });
    bodies_ = start_bodies(params_.bodies, grid_, params_.faces, node_order_.nodes(), execution_,
                           state_.bodies);
    problem_.bodies.resize(state_.bodies.size());
    solids_ = SolidsAtCones<Dim>(boundaries());
    if (!params_.bodies.empty()) {
      solids_.place(boundaries());
      check_bodies_apart(boundaries(), solids_);
    }
    state_.stress_impulse.assign(nodes(), Vec<cone_size>::Zero());
    wrenches_.resize(boundaries().sources());
  }

  /// Advances by δt, or leaves all as it was and says why (StepReport::completed(), why()). What
  /// user code throws inside of it arrives here, from the lowest node, for any number of threads;
  /// then, too, all is as before, but for the order of the particles, and the run can go on. Only
  /// if the transfer's update, a source or a sink throws, with the particles half changed,
  /// restore() must come first.
  StepReport step();

  /// The same, and calls before_solve(problem) with the dual problem as the solver gets it, warm
  /// start included: to record it, say.
  template <class BeforeSolve>
  StepReport step(const BeforeSolve& before_solve) {
    StepReport report;
    const auto t0 = Clock::now();
    require_whole();
    if (params_.ranks && params_.ranks->deal_again(state_)) {
      use_window();
      stepped_ = false;
    }
    Attempt attempt(*this);
    particles_to_grid();
    solids_.place(boundaries());
    choose_time_step();
    observe(StepStage::on_grid);
    report.time_step = state_.time_step;
    const auto t1 = Clock::now();
    report.stands_still = !(state_.time + state_.time_step > state_.time);
    if (report.stands_still) {
      report.solve.status = SolveStatus::not_finite;
      return report;
    }
    const double ratio = state_.time_step / attempt.last_time_step();
    collect_cones(ratio);
    add_gravity();
    hold_at_faces(params_.faces, node_order_.nodes(), execution_, problem_);
    problem_.copies.copy(problem_.velocity, execution_);
    problem_.copies.copy(problem_.inverse_mass, execution_);
    collect_contacts(boundaries(), solids_, node_rank_, {state_.contacts, ratio}, execution_,
                     problem_);
    collect_touched_nodes(boundaries(), solids_, node_order_, problem_);
    if (params_.ranks)
      params_.ranks->share_contacts(problem_);
    work_.touched.clear();
    for (const BodyContact<Dim>& contact : problem_.body_contacts)
      work_.touched.push_back(contact);
    collect_body_contacts(boundaries(), solids_, work_.touched, node_order_, state_.time_step,
                          {state_.body_contacts, ratio}, problem_);
    apply_impulses(problem_, stencil_, execution_);
    if constexpr (Viscous<RheologyT>)
      report.viscous = viscous_solver_.solve(problem_, fields_.stress_volume, fields_.open_fraction,
                                             rheology_.viscosity(), params_.viscous,
                                             state_.time_step, execution_);
    add_cohesion_shift(rheology_, problem_, state_.time_step, fields_.volume_by_material.data());
    before_solve(std::as_const(problem_));
    const auto t2 = Clock::now();
    solve(report);
    if constexpr (RheologyT::rate_dependent)
      while (report.completed() && report.friction_updates < params_.friction_updates &&
             update_friction(report))
        solve(report);
    const auto t3 = Clock::now();
    report.largest_fraction = largest_fraction(problem_, fields_, execution_, work_.partials);
    report.courant = courant_number(problem_, state_.time_step, execution_, work_.partials);
    if (!std::isfinite(report.courant)) // whatever the solver says
      report.solve.status = SolveStatus::not_finite;
    if (report.completed()) {
      torn_ = true; // an exception in the next calls leaves it so
      grid_to_particles();
      observe(StepStage::on_particles);
      shift();
      torn_ = false;
      attempt.complete();
      keep_forces();
      measure_wrenches(boundaries(), solved_step(), execution_, work_.held_momentum,
                       work_.wrench_sums, wrenches_);
      observe(StepStage::forces);
      report.bodies_left =
          move_bodies(params_.bodies, bodies_, problem_, state_.time_step, state_.bodies);
      const Outflow outflow =
          remove_outflow(params_.faces, grid_, execution_, work_.counts, state_.particles);
      report.outflow = outflow.particles;
      report.outflow_volume = outflow.volume;
      const double end = state_.time + state_.time_step;
      if (params_.exchange)
        exchange(end, report);
      if (params_.ranks)
        params_.ranks->migrate(state_.particles);
      observe(StepStage::end);
      state_.time = end;
      ++state_.steps;
    }
    const auto t4 = Clock::now();
    report.cones = execution_.sum(problem_.cones());
    report.contacts = execution_.sum(problem_.contacts.size()) + problem_.body_contacts.size();
    report.seconds = {seconds(t0, t1), seconds(t1, t2), seconds(t2, t3), seconds(t3, t4)};
    return report;
  }

  double time() const { return state_.time; }           ///< s
  double time_step() const { return state_.time_step; } ///< δt of the last step, s
  std::size_t steps() const { return state_.steps; }
  const Vec<Dim>& gravity() const { return state_.gravity; } ///< of the next step, m/s²
  const Params& params() const { return params_; }
  /// How many materials there are; 1 if the rheology has no list of them.
  int materials() const {
    if constexpr (OfMaterials<RheologyT>)
      return rheology_.materials();
    else
      return 1;
  }
  /// ρ of a material, kg/m³.
  double density(int material) const {
    require_index("density: material", material, materials());
    if constexpr (OfMaterials<RheologyT>)
      return rheology_.density(material);
    else
      return params_.material.density;
  }
  const Grid<Dim>& grid() const { return grid_; }
  const ParticleData& particles() const { return state_.particles; }
  /// Place and velocities of the free bodies, in the order of params().bodies.
  const Array<RigidState<Dim>>& bodies() const { return state_.bodies; }

  // Of the last step: forces, nodal fields and problem. They are no part of a state, so these
  // functions throw std::invalid_argument before the first step and after restore(), and for an
  // index that is out of range.

  // Force and torque, the mean over δt. What the material and free bodies do to a face of the box
  // or an obstacle, and what all that it touches does to a body (gravity left out). Where several
  // faces that stick meet, they share the tangential force of their common nodes.
  const Wrench<Dim>& face_wrench(int axis, bool upper) const {
    require_step("face_wrench");
    require_index("face_wrench: axis", axis, Dim);
    return wrenches_[Bounds::face_id(axis, upper)];
  }
  const Wrench<Dim>& obstacle_wrench(std::size_t obstacle) const {
    require_step("obstacle_wrench");
    require_index("obstacle_wrench: obstacle", static_cast<std::ptrdiff_t>(obstacle),
                  std::ssize(params_.obstacles));
    return wrenches_[Bounds::obstacle_id(obstacle)];
  }
  const Wrench<Dim>& body_wrench(std::size_t body) const {
    require_step("body_wrench");
    require_index("body_wrench: body", static_cast<std::ptrdiff_t>(body),
                  std::ssize(params_.bodies));
    return wrenches_[boundaries().body_id(body)];
  }

  /// All that the next step needs of the last one. Throws as step() does after an update of the
  /// particles that did not come to its end.
  const SimulationState<Dim, ParticleReal>& state() const {
    require_whole();
    return state_;
  }

  /// Goes on from `state`, which a simulation with the same grid, faces, obstacles and bodies had:
  /// the next step gives the same bits as that one's. Forces, nodal fields and problem() are there
  /// again after that step. With several ranks all give the same state, that of the whole grid.
  /// Throws std::invalid_argument, and changes nothing, if a particle is refused (see the
  /// constructor) or the state does not fit the grid.
  void restore(SimulationState<Dim, ParticleReal> state) {
    check_materials(state.particles, materials());
    if (params_.ranks) {
      check_state(state, boundaries(Grid<Dim>(params_.grid, params_.faces.periodic())));
      restore_part(params_.ranks->part_of(std::move(state)));
      return;
    }
    check_state(state, boundaries());
    for (BodyContact<Dim>& contact : state.body_contacts)
      contact.place = place_of(grid_, node_order_, contact.node);
    state_ = std::move(state);
    stepped_ = torn_ = false;
  }

  /// The same for this rank's part of a state that params().ranks has just dealt, which is not
  /// checked. Collective.
  void restore_part(SimulationState<Dim, ParticleReal> part) {
    use_window();
    state_ = std::move(part);
    stepped_ = torn_ = false;
  }

  /// Adds copies of the particles `more` between two steps. They get ids of their own, next_id and
  /// on in their order: those of particles that left never come again. No report counts them.
  /// Collective with several ranks: all give the same particles.
  /// Throws std::invalid_argument, and changes nothing, if a particle is refused or some place
  /// would be filled twice; see the constructor.
  void add(const ParticleData& more) {
    require_whole();
    execution_.check_on_all([&] {
      check_materials(more, materials());
      check_particles(more, grid_);
    });
    ParticleData& particles = state_.particles;
    const std::size_t first_id = particles.next_id, next_id = first_id + more.size();
    if (execution_.first_rank())
      append(more, particles);
    particles.next_id = next_id;
    if (params_.ranks)
      params_.ranks->migrate(particles);
    try {
      execution_.check_on_all([&] { check_packing(); });
    } catch (...) {
      ExactSum unused;
      take_out(
          particles, [&](std::size_t p) { return particles.id[p] >= first_id; }, unused);
      particles.next_id = first_id;
      throw;
    }
  }

  /// Takes out, between two steps, the particles p of particles() with leaves(p) → bool, and
  /// returns how many and their volume (m^d). No report counts them. All may go. If leaves throws,
  /// nothing has changed. Collective with several ranks: each takes out its own, and if leaves
  /// throws on one, remove() throws on all.
  template <class Leaves>
  Outflow remove(const Leaves& leaves) {
    require_whole();
    Array<int> leaving;
    leaving.assign(state_.particles.size(), 0);
    execution_.check_on_all([&] {
      for (std::size_t p = 0; p < leaving.size(); ++p)
        leaving[p] = leaves(p) ? 1 : 0;
    });
    ExactSum volume;
    const std::size_t removed = execution_.sum(take_out(
        state_.particles, [&](std::size_t p) { return leaving[p] != 0; }, volume));
    execution_.join(&volume, 1);
    return {removed, volume.value()};
  }

  /// Changes gravity (m/s²) from the next step on: tilts the box.
  void set_gravity(const Vec<Dim>& gravity) {
    check_gravity("gravity", gravity);
    state_.gravity = gravity;
  }

  // Nodal fields of the last step. node: {i, k} or {i, j, k}, from 0 to grid().cells(a); of a
  // node's number j grid().node_index(j). They throw std::invalid_argument for a node that is not
  // there.

  /// φ_i: material volume at node i over the node's volume outside of obstacles and bodies; 1 is
  /// dense.
  double volume_fraction(const Index<Dim>& node) const {
    require_step("volume_fraction");
    const int j = node_number(node);
    return fields_.material_volume[j] / (fields_.open_fraction[j] * grid_.node_volume(node));
  }
  /// That stress acts on, of which ∇u is the mean, m^d: Σ V_p N_i, or by even packing see
  /// even_volume().
  double stress_volume(const Index<Dim>& node) const {
    require_step("stress_volume");
    return fields_.stress_volume[node_number(node)];
  }
  /// u_i, m/s; zero where there is no material.
  Vec<Dim> velocity(const Index<Dim>& node) const {
    require_step("velocity");
    return problem_.velocity[node_number(node)].template head<Dim>();
  }
  /// −σ_i = φ λ̂_i, d × d, Pa, φ ≤ 1 of the volume that stress acts on; positive in compression.
  Mat<Dim> stress(const Index<Dim>& node) const {
    require_step("stress");
    const int j = node_number(node);
    const double share =
        fields_.stress_volume[j] / (fields_.open_fraction[j] * grid_.node_volume(node));
    return std::min(1.0, share) / state_.time_step *
           vector_to_symmetric<Dim, double>(state_.stress_impulse[j]);
  }
  /// p_i = −Tr σ_i / d, Pa.
  double pressure(const Index<Dim>& node) const { return stress(node).trace() / Dim; }
  /// I_i at which the law was asked last, with friction_updates > 1 after the last solve but one or
  /// after the last; 0 for a law that does not depend on it.
  double inertial_number(const Index<Dim>& node) const {
    require_step("inertial_number");
    return fields_.inertial_number[node_number(node)];
  }

  /// V_im/V_i: which part of the material at a node is of this one; 0 where there is none.
  double material_fraction(const Index<Dim>& node, int material) const {
    require_step("material_fraction");
    require_index("material_fraction: material", material, materials());
    const int j = node_number(node);
    const double all = fields_.material_volume[j];
    if constexpr (OfMaterials<RheologyT>)
      return all > 0 ? volumes_by_material(j)[material] / all : 0;
    else
      return all > 0 ? 1 : 0;
  }

  /// The dual problem of the last step with its solution: with cohesion, λ' = λ + (c/μ) I. After a
  /// step that was not completed its cones are those of that step.
  const DualProblem<Dim>& problem() const {
    require_step("problem");
    return problem_;
  }

  /// The policies, and what the solver keeps between steps: there a solver of one's own leaves
  /// what is to be read after a step.
  const RheologyT& rheology() const { return rheology_; }
  const TransferT& transfer() const { return transfer_; }
  const SolverT& solver() const { return solver_; }
  const typename SolverT::template Workspace<Dim>& solver_workspace() const { return workspace_; }

 private:
  using Clock = std::chrono::steady_clock;
  using Padded = NodeVec<Dim>;
  static constexpr int cone_size = symmetric_size<Dim>;
  using Bounds = Boundaries<Dim>;

  /// One try to make a step. It works in the arrays of the step before the last and puts things
  /// back when it ends without complete(), by an exception, say.
  class Attempt {
   public:
    explicit Attempt(Simulation& sim) : sim_(sim), last_time_step_(sim.state_.time_step) {
      sim.swap_last();
    }
    ~Attempt() {
      if (completed_)
        return;
      sim_.swap_last();
      sim_.state_.time_step = last_time_step_;
    }
    Attempt(const Attempt&) = delete;
    Attempt& operator=(const Attempt&) = delete;

    void complete() { completed_ = sim_.stepped_ = true; }
    double last_time_step() const { return last_time_step_; } ///< s

   private:
    Simulation& sim_;
    double last_time_step_;
    bool completed_ = false;
  };

  /// Exchanges the arrays that a step works in and those of the last one; does it twice: nothing.
  void swap_last() noexcept {
    fields_.swap(last_fields_);
    problem_.velocity.swap(last_velocity_);
  }

  void require_whole() const {
    if (torn_)
      throw_invalid("the last update of the particles", "broken off by an exception",
                    "restore() of a state first");
  }

  void require_step(const char* what) const {
    if (!stepped_)
      throw_invalid(std::string(what) + "(): the number of steps since the start or a restore", 0,
                    "at least 1: it belongs to the last step");
  }

  void check_packing() const {
    check_overfilled(state_.particles, grid_, params_.packing.densest, &problem_.copies,
                     &execution_);
  }

  template <class Law>
  static void check_law(const Law& law) {
    if constexpr (Law::rate_dependent && !SeesFlow<Law, Dim>)
      InertialNumber(law.inertial_number()).validate();
    if constexpr (Cohesive<Law>)
      require_non_negative("rheology.cohesion()", law.cohesion());
  }

  /// Sizes all for the nodes that this rank has.
  void use_window() {
    const SmallArray<bool, Dim> periodic = params_.faces.periodic();
    Halo* const halo = params_.ranks ? &params_.ranks->halo() : nullptr;
    grid_ = params_.ranks ? Grid<Dim>(params_.grid, periodic, params_.ranks->own())
                          : Grid<Dim>(params_.grid, periodic);
    stencil_ = Stencil<Dim>(grid_);
    node_order_ = BlockOrder<Dim>(grid_);
    fields_.start(nodes());
    last_fields_.start(nodes());
    work_.start(nodes());
    if (halo)
      work_.order.find_others(grid_);
    last_velocity_.assign(nodes(), NodeVec<Dim>::Zero());
    node_rank_.assign(nodes(), 0);
    for (std::size_t k = 0; k < node_order_.nodes().size(); ++k)
      node_rank_[node_order_.nodes()[k]] = k;
    problem_.grid = grid_;
    problem_.copies = NodeCopies<Dim>(grid_, halo);
    problem_.velocity.assign(nodes(), NodeVec<Dim>::Zero());
    problem_.inverse_mass.assign(nodes(), NodeVec<Dim>::Zero());
  }

  std::size_t nodes() const { return static_cast<std::size_t>(grid_.node_count()); }
  int node_number(const Index<Dim>& node) const { return grid_.node_in_window(node); }

  static double seconds(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double>(to - from).count();
  }

  Bounds boundaries() const { return boundaries(grid_); }
  Bounds boundaries(const Grid<Dim>& grid) const {
    return {grid,          params_.faces, params_.obstacles, params_.bodies,
            state_.bodies, bodies_.reach, state_.time};
  }
  SolvedStep<Dim> solved_step() const {
    return {problem_,        state_.stress_impulse,    fields_,          work_,
            viscous_solver_, params_.material.density, state_.time_step, state_.gravity};
  }

  /// Calls body(node) for all nodes of the box.
  template <class Body>
  void for_each_node(const Body& body) {
    execution_.for_each(std::ssize(node_order_.nodes()),
                        [&](std::ptrdiff_t k) { body(node_order_.nodes()[k]); });
  }
  /// Calls body(cone) for all cones.
  template <class Body>
  void for_each_cone(const Body& body) {
    execution_.for_each(static_cast<std::ptrdiff_t>(problem_.cones()),
                        [&](std::ptrdiff_t i) { body(static_cast<std::size_t>(i)); });
  }

  /// Σ V_p N_i from which on a node carries a cone, m^d.
  double least_volume() const { return params_.min_relative_mass * grid_.cell_volume(); }
  double node_mass(int node) const {
    if constexpr (OfMaterials<RheologyT>)
      return fields_.mass[node];
    else
      return params_.material.density * fields_.material_volume[node];
  }

  /// m_i, u*_i and φ_i from the particles.
  void particles_to_grid() {
    ParticleData& particles = state_.particles;
    if constexpr (TransferT::field == ParticleField::multilinear)
      particles.resize_mixed(particles.size());
    if constexpr (OfMaterials<RheologyT>)
      particles.resize_material(particles.size());
    work_.order.update(particles, grid_, execution_);
    const Halo* const halo = problem_.copies.halo();
    const auto add_moments = [&](const auto&... density) {
      all_cell_moments<TransferT::field>(particles, work_.order, grid_, execution_, work_.moments,
                                         params_.packing.even, halo, density...);
    };
    if constexpr (OfMaterials<RheologyT>)
      add_moments([&](std::size_t p) { return rheology_.density(particles.material[p]); });
    else
      add_moments();
    cells_to_nodes(work_.moments, work_.order, grid_, node_order_.nodes(), execution_,
                   fields_.material_volume, work_.velocity_before);
    if constexpr (OfMaterials<RheologyT>) {
      material_corner_volumes(particles, work_.order, grid_, materials(), execution_,
                              work_.corner_volumes, halo);
      materials_to_nodes(
          work_.corner_volumes, materials(), [&](int m) { return rheology_.density(m); },
          work_.order, grid_, node_order_.nodes(), execution_, fields_.material_volume,
          fields_.volume_by_material, fields_.mass, work_.velocity_before);
    }
    problem_.copies.copy(fields_.material_volume, execution_);
    problem_.copies.copy(work_.velocity_before, execution_);
    problem_.velocity.resize(work_.velocity_before.size());
    execution_.for_ranges(
        std::ssize(work_.velocity_before), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          std::copy(work_.velocity_before.begin() + begin, work_.velocity_before.begin() + end,
                    problem_.velocity.begin() + begin);
        });
  }

  void choose_time_step() {
    state_.time_step = params_.cfl == 0
                           ? params_.time_step
                           : cfl_time_step(params_.cfl, params_.time_step, boundaries(), solids_,
                                           node_order_.nodes(), work_.velocity_before, bodies_,
                                           state_.gravity, execution_, work_.partials);
  }

  /// One cone per node with enough mass, in the order of the blocks: g_ij, k_i, μ_i, last stress.
  /// ratio: this time step over the last: λ is a stress times δt.
  void collect_cones(double ratio) {
    const double least = least_volume();
    const auto carries = [&](int node) { return fields_.material_volume[node] >= least; };
    for_each_node([&](int j) {
      problem_.inverse_mass[j] = Padded::Zero();
      fields_.open_fraction[j] = 1;
      work_.cone[j] = -1;
      work_.excess[j] = not_inside;
      work_.excess_beside[j] = not_inside;
      work_.divergence[j] = 0;
      fields_.stress_volume[j] = 0;
      if (carries(j))
        problem_.inverse_mass[j].template head<Dim>().setConstant(1 / node_mass(j));
      else
        fields_.inertial_number[j] = 0;
    });
    talus::collect_cones(node_order_, carries, execution_, work_.counts, problem_);

    const std::size_t cones = problem_.node.size();
    problem_.gradient_weights.resize(cones);
    problem_.free_volume_rate.resize(cones);
    problem_.opening.resize(cones);
    problem_.node_volume.resize(cones);
    problem_.stress_impulse.resize(cones);
    for_each_cone([&](std::size_t i) { work_.cone[problem_.node[i]] = static_cast<int>(i); });
    solids_.find(grid_, work_.cone, cones);
    const Room<Dim> room{boundaries(),     solids_, params_.packing, stencil_,
                         state_.time_step, fields_, work_,           problem_};
    for_each_cone([&](std::size_t i) { fill_cone(i, ratio, room); });
    problem_.copies.copy(fields_.stress_volume, execution_);
    if (params_.packing.even || has_cohesion<RheologyT>()) {
      problem_.copies.copy(work_.excess, execution_);
      problem_.copies.copy(work_.strain, execution_);
      if constexpr (has_cohesion<RheologyT>()) {
        problem_.copies.copy(work_.excess_beside, execution_);
        problem_.copies.copy(fields_.open_fraction, execution_);
      }
      for_each_cone([&](std::size_t i) { room.set_inside(i, coheres(problem_.node[i])); });
    }
    find_friction(problem_.opening);
    problem_.copies.copy_here(work_.cone, execution_);
  }

  void fill_cone(std::size_t i, double ratio, const Room<Dim>& room) {
    const int j = problem_.node[i];
    const Index<Dim> index = grid_.node_index(j);
    const Vec<Dim> first_moment =
        gather_coupling(grid_, index, work_.order, work_.moments, problem_.gradient_weights[i],
                        fields_.stress_volume[j]);
    fields_.open_fraction[j] = solids_.look(boundaries(), i, index);
    problem_.node_volume[i] = fields_.open_fraction[j] * grid_.node_volume(index);
    problem_.stress_impulse[i] = ratio * state_.stress_impulse[j];
    room.set(i, index, first_moment, coheres(j));
  }

  /// Has any of a node's material cohesion?
  bool coheres([[maybe_unused]] int node) const {
    const double* volumes = nullptr;
    if constexpr (OfMaterials<RheologyT>)
      volumes = volumes_by_material(node);
    return node_cohesion(rheology_, volumes) > 0;
  }
  /// V_jm, #materials.
  const double* volumes_by_material(int node) const {
    return fields_.volume_by_material.data() + std::ptrdiff_t{node} * materials();
  }

  /// μ̃ of all cones from the velocities, the stress and the k_i that the problem has; #cones.
  void find_friction(Array<double>& found) {
    if constexpr (sees_pressure<RheologyT, Dim>()) {
      for_each_cone([&](std::size_t i) {
        const int j = problem_.node[i];
        work_.pressure[j] = cone_pressure(problem_, i, fields_.stress_volume[j], state_.time_step);
      });
      problem_.copies.copy(work_.pressure, execution_);
    }
    for_each_cone([&](std::size_t i) { found[i] = friction(i); });
  }

  /// μ̃_i, see find_friction.
  double friction(std::size_t i) {
    const int j = problem_.node[i];
    if constexpr (OfMaterials<RheologyT> || SeesFlow<RheologyT, Dim>) {
      FlowState<Dim> flow = this->flow(i);
      flow.position = grid_.node_position(j);
      const bool dense = problem_.free_volume_rate[i] <= 0;
      FlowFriction found;
      if constexpr (OfMaterials<RheologyT>)
        found = flow_friction(rheology_, flow, dense, volumes_by_material(j));
      else
        found = flow_friction(rheology_, flow, dense);
      fields_.inertial_number[j] = found.inertial_number;
      return cone_friction<Dim>(found.friction);
    } else {
      if constexpr (RheologyT::rate_dependent)
        fields_.inertial_number[j] =
            flow_inertial_number(rheology_, flow(i), cone_cohesion(rheology_, problem_, i));
      return cone_friction<Dim>(rheology_.friction(fields_.inertial_number[j]));
    }
  }

  FlowState<Dim> flow(std::size_t i) const {
    const int j = problem_.node[i];
    const double pressure = sees_pressure<RheologyT, Dim>()
                                ? mean_pressure(grid_, j, work_.pressure, fields_.stress_volume)
                                : 0;
    return cone_flow(problem_, stencil_, i, fields_.material_volume[j], fields_.stress_volume[j],
                     pressure);
  }

  /// Takes μ_i from the velocities and stresses of the last solve. Returns false if they would not
  /// change enough for another one.
  bool update_friction(StepReport& report) {
    const double* const volumes = fields_.volume_by_material.data();
    remove_cohesion_shift(rheology_, problem_, state_.time_step, volumes);
    friction_iteration_.next.resize(problem_.cones());
    find_friction(friction_iteration_.next);
    const double change = friction_iteration_.change(problem_, execution_);
    friction_iteration_.choose_relaxation(report.friction_updates == 1, change,
                                          report.friction_change);
    report.friction_change = change;
    const bool update = !(change <= params_.friction_tolerance);
    if (update) {
      friction_iteration_.update(problem_);
      ++report.friction_updates;
    }
    add_cohesion_shift(rheology_, problem_, state_.time_step, volumes);
    return update;
  }

  /// Solves the dual problem, or says why not.
  void solve(StepReport& report) {
    report.invalid_friction = count_invalid_friction(rheology_, problem_, execution_, work_.counts,
                                                     fields_.volume_by_material.data());
    if (report.invalid_friction > 0) {
      report.solve.status = SolveStatus::not_finite;
      return;
    }
    const SolveReport before = report.solve;
    report.solve = solver_.solve(problem_, workspace_, execution_);
    report.solve.iterations += before.iterations;
    report.solve.seconds += before.seconds;
  }

  void add_gravity() {
    Padded change = Padded::Zero();
    change.template head<Dim>() = state_.time_step * state_.gravity;
    double largest2 = execution_.reduce(
        std::ssize(node_order_.nodes()), work_.partials, 0.0,
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          double largest = 0;
          for (std::ptrdiff_t k = begin; k < end; ++k) {
            const int j = node_order_.nodes()[k];
            if (fields_.material_volume[j] > 0) {
              largest = std::max(largest, problem_.velocity[j].squaredNorm());
              problem_.velocity[j] += change;
            }
          }
          return largest;
        },
        [](double a, double b) { return std::max(a, b); });
    largest2 = execution_.largest(largest2);
    for (std::size_t b = 0; b < state_.bodies.size(); ++b) {
      const RigidState<Dim>& body = state_.bodies[b];
      if (has_left(grid_, body.position, bodies_.reach[b]))
        continue;
      const double speed = body.velocity.norm() + body.angular_velocity.norm() * bodies_.radius[b];
      largest2 = std::max(largest2, speed * speed);
    }
    const Vec<Dim> gained = change.template head<Dim>();
    set_free_velocities(params_.bodies, bodies_, state_.bodies, gained, problem_);
    problem_.velocity_scale = std::max(change.norm(), 1e-3 * std::sqrt(largest2));
  }

  /// Keeps λ per node and the contacts' impulses, for the next step's warm start and for output.
  void keep_forces() {
    for_each_node([&](int j) {
      if (work_.cone[j] < 0)
        state_.stress_impulse[j].setZero();
    });
    for_each_cone([&](std::size_t i) {
      Vec<cone_size>& stress = state_.stress_impulse[problem_.node[i]];
      stress = problem_.stress_impulse[i];
      stress[0] -=
          cone_apex(rheology_, problem_, state_.time_step, i, fields_.volume_by_material.data());
    });
    problem_.copies.copy(state_.stress_impulse, execution_);
    state_.contacts.resize(problem_.contacts.size());
    for (std::size_t c = 0; c < problem_.contacts.size(); ++c)
      state_.contacts[c] = problem_.contacts[c];
    state_.body_contacts.clear();
    for (const BodyContact<Dim>& contact : problem_.body_contacts)
      state_.body_contacts.push_back(contact);
  }

  /// The particles' velocity fields and places from the grid's new velocities.
  void grid_to_particles() {
    const auto [lower, upper] = particle_bounds(params_.faces, grid_);
    if constexpr (requires { transfer_.prepare(TransferStep{}); })
      transfer_.prepare(
          {state_.time_step, std::sqrt(norm<Dim>(state_.gravity) / grid_.spacing().minCoeff())});
    if constexpr (TransferT::field == ParticleField::multilinear)
      for_each_cone([&](std::size_t i) {
        const int j = problem_.node[i];
        // Tr D = d · mean of what normal_from_mean made the normal component
        work_.divergence[j] =
            Dim * mean_from_normal<Dim>(integrated_strain_rate(problem_, stencil_, i)[0]) /
            fields_.stress_volume[j];
      });
    problem_.copies.copy(work_.divergence, execution_);
    talus::grid_to_particles(state_.particles, work_.order, grid_, transfer_, problem_.velocity,
                             work_.velocity_before, work_.divergence, work_.moments,
                             state_.time_step, lower, upper, execution_);
  }

  /// Evens out the packing, if that is asked for.
  void shift() {
    if (!params_.packing.even || params_.packing.shifting == 0)
      return;
    if (params_.ranks) // to where the nodes around them are
      params_.ranks->migrate(state_.particles);
    const auto [lower, upper] = particle_bounds(params_.faces, grid_);
    shift_particles(state_.particles, grid_, work_.excess, work_.strain, params_.packing.shifting,
                    params_.packing.slack, lower, upper, execution_);
    observe(StepStage::shifted);
  }

  /// Shows the step to the observer, if there is one.
  void observe(StepStage stage) {
    if (!params_.observer)
      return;
    const bool torn = torn_;
    torn_ = stage != StepStage::on_grid; // so that an exception leaves it
    const SolvedStep<Dim> solved = solved_step();
    const Bounds bounds = boundaries();
    params_.observer->observe(stage, {solved, bounds, state_.particles, TransferT::field,
                                      node_order_.nodes(), wrenches_, least_volume(), densities_,
                                      execution_});
    torn_ = torn;
  }

  /// Sources and sinks at the end of the step, at the time `end` (s).
  void exchange(double end, StepReport& report) {
    Turnover turnover;
    const std::size_t first_id = state_.particles.next_id;
    torn_ = true;
    params_.exchange->exchange(state_.time, end, execution_, state_.particles, turnover);
    check_added(state_.particles, first_id, grid_);
    check_materials(state_.particles, materials());
    torn_ = false;
    execution_.join(&turnover.inflow, 1);
    execution_.join(&turnover.outflow, 1);
    execution_.join(&turnover.held_back, 1);
    report.inflow = execution_.sum(turnover.added);
    report.inflow_volume = turnover.inflow.value();
    report.outflow += execution_.sum(turnover.removed);
    report.outflow_volume += turnover.outflow.value();
    report.held_back_volume = turnover.held_back.value();
  }

  Params params_;
  Execution execution_;
  Grid<Dim> grid_;
  RheologyT rheology_;
  TransferT transfer_;
  SolverT solver_;
  Stencil<Dim> stencil_;
  BlockOrder<Dim> node_order_;
  Array<std::size_t> node_rank_; ///< place of a node in node_order_
  FreeBodies<Dim> bodies_;
  Array<double> densities_; ///< for an observer, kg/m³

  SimulationState<Dim, ParticleReal> state_;
  bool stepped_ = false; ///< there is a last step that fields and forces belong to
  bool torn_ = false;    ///< the last update of the particles did not come to its end

  // Of this step or, between steps, of the last one that was completed.
  NodeFields fields_;
  DualProblem<Dim> problem_;
  Array<Wrench<Dim>> wrenches_; ///< #faces + #obstacles + #bodies
  // Of the step before, to go back to.
  NodeFields last_fields_;
  Array<NodeVec<Dim>> last_velocity_;

  StepWorkspace<Dim> work_;
  SolidsAtCones<Dim> solids_;
  typename SolverT::template Workspace<Dim> workspace_;
  ViscousSolver<Dim> viscous_solver_;
  FrictionIteration friction_iteration_;
};

// Not in the class, which would make it inline: extern templates (talus/precompiled.hpp) save
// nothing of what is inline.
template <int Dim, Rheology RheologyT, TransferScheme<Dim> TransferT, Solver<Dim> SolverT,
          class ParticleReal>
StepReport Simulation<Dim, RheologyT, TransferT, SolverT, ParticleReal>::step() {
  return step([](const DualProblem<Dim>&) {});
}

} // namespace talus
