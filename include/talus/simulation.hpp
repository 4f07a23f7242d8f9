// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/coloring.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/packing.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/inertial_number.hpp"
#include "talus/rheology/rheology.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/solver/solver.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/contacts.hpp"
#include "talus/step/face_conditions.hpp"
#include "talus/step/free_bodies.hpp"
#include "talus/step/friction.hpp"
#include "talus/step/overfilled.hpp"
#include "talus/step/report.hpp"
#include "talus/step/solids.hpp"
#include "talus/step/state.hpp"
#include "talus/step/time_step.hpp"
#include "talus/step/wrenches.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/cells_to_nodes.hpp"
#include "talus/transfer/grid_to_particles.hpp"
#include "talus/transfer/shifting.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <algorithm>
#include <array>
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
    Material material{};
    Vec<Dim> gravity = Vec<Dim>::Constant(not_given); ///< m/s²; turn it to incline the box
    double time_step = 0;                             ///< δt, s; > 0; the largest one if cfl > 0
    /// Largest share of a cell that material, bodies and obstacles may cross in a step along any
    /// axis, see cfl_time_step; 0: δt is fixed.
    double cfl = 0;
    Faces<Dim> faces{};
    std::vector<std::shared_ptr<const Obstacle<Dim>>> obstacles{};
    std::vector<Body<Dim>> bodies{};
    typename RheologyT::Params rheology{};
    typename TransferT::Params transfer{};
    typename SolverT::Params solver{};
    /// Most times that a step takes μ_i from the rheology. 1: once, from the strain rate and the
    /// pressure of the last step, as in the paper. More: again from those that it has found, until
    /// the yield stress μ p changes by less than friction_tolerance, relative, in the mean square.
    int friction_updates = 1;
    double friction_tolerance = 1e-3;
    double min_relative_mass = 1e-9; ///< nodes below this share of the dense mass carry no stress
    Packing packing{};
    int threads = 1; ///< the result does not depend on it
  };

  /// Throws std::invalid_argument if a parameter is out of range, or a particle is outside the box,
  /// has no positive volume, a velocity that is not finite or the id of another, or if some place
  /// is filled twice (Packing::densest). A box may be empty.
  explicit Simulation(Params params, ParticleData particles)
      : params_(std::move(params)), execution_(params_.threads),
        grid_(params_.grid, params_.faces.periodic()), rheology_(params_.rheology),
        transfer_(params_.transfer), solver_(params_.solver), stencil_(grid_), node_order_(grid_),
        particles_(std::move(particles)) {
    require_positive("material.density", params_.material.density);
    require_positive("time_step", params_.time_step);
    require_non_negative("cfl", params_.cfl);
    if (params_.friction_updates < 1)
      throw_invalid("friction_updates", params_.friction_updates, "an integer >= 1");
    require_positive("friction_tolerance", params_.friction_tolerance);
    require_positive("min_relative_mass", params_.min_relative_mass);
    params_.packing.validate();
    check_gravity("gravity", params_.gravity);
    params_.faces.validate();
    if constexpr (RheologyT::rate_dependent)
      InertialNumber(rheology_.inertial_number()).validate();
    if constexpr (Cohesive<RheologyT>)
      require_non_negative("rheology.cohesion()", rheology_.cohesion());
    if constexpr (Viscous<RheologyT>)
      Viscosity(rheology_.viscosity()).validate();
    time_step_ = params_.time_step;
    for (const auto& obstacle : params_.obstacles)
      if (!obstacle)
        throw_invalid("an obstacle", "null", "a valid pointer");
    if (grid_.any_periodic() && !params_.bodies.empty())
      throw_invalid("the number of free bodies in a box with periodic faces", params_.bodies.size(),
                    "0");
    check_particles(particles_, grid_);
    check_overfilled(particles_, grid_, params_.packing.densest);
    bodies_ = start_bodies(params_.bodies, grid_, params_.faces, node_order_.nodes());
    problem_.bodies.resize(bodies_.state.size());
    solids_ = SolidsAtCones<Dim>(boundaries());

    const std::size_t nodes = static_cast<std::size_t>(grid_.node_count());
    material_volume_.assign(nodes, 0);
    last_.material_volume.assign(nodes, 0);
    last_.velocity.assign(nodes, NodeVec<Dim>::Zero());
    last_.inertial_number.assign(nodes, 0);
    last_.open_share.assign(nodes, 1);
    velocity_before_.assign(nodes, NodeVec<Dim>::Zero());
    node_stress_.assign(nodes, Vec<cone_size>::Zero());
    inertial_number_.assign(nodes, 0);
    open_share_.assign(nodes, 1);
    divergence_.assign(nodes, 0);
    node_cone_.assign(nodes, -1);
    node_excess_.assign(nodes, not_inside);
    node_strain_.assign(nodes, 0);
    wrenches_.resize(boundaries().sources());
    node_rank_.assign(nodes, 0);
    for (std::size_t k = 0; k < node_order_.nodes().size(); ++k)
      node_rank_[static_cast<std::size_t>(node_order_.nodes()[k])] = k;
    problem_.grid = grid_;
    problem_.periodic = PeriodicNodes<Dim>(grid_);
    problem_.velocity.assign(nodes, NodeVec<Dim>::Zero());
    problem_.inverse_mass.assign(nodes, NodeVec<Dim>::Zero());
  }

  /// Advances by δt, or leaves all as it was and says why (StepReport::completed(), why()). What
  /// user code throws inside of it arrives here, from the lowest node, for any number of threads;
  /// then, too, all is as before, but for the order of the particles, and the run can go on. Only
  /// if the transfer's update throws, with the particles half moved, restore() must come first.
  StepReport step();

  /// The same, and calls before_solve(problem) with the dual problem as the solver gets it, warm
  /// start included: to record it, say.
  template <class BeforeSolve>
  StepReport step(const BeforeSolve& before_solve) {
    StepReport report;
    const auto t0 = Clock::now();
    require_whole();
    Attempt attempt(*this);
    particles_to_grid();
    solids_.place(boundaries());
    choose_time_step();
    report.time_step = time_step_;
    const auto t1 = Clock::now();
    report.stands_still = !(time_ + time_step_ > time_);
    if (report.stands_still) {
      report.solve.status = SolveStatus::not_finite;
      return report;
    }
    const double ratio = time_step_ / attempt.last_time_step();
    collect_cones(ratio);
    add_gravity();
    hold_at_faces(params_.faces, node_order_.nodes(), execution_, problem_);
    problem_.periodic.copy(problem_.velocity, execution_);
    problem_.periodic.copy(problem_.inverse_mass, execution_);
    collect_contacts(boundaries(), solids_, node_rank_, {last_.contacts, ratio}, problem_);
    collect_body_contacts(boundaries(), solids_, node_rank_, time_step_,
                          {last_.body_contacts, ratio}, problem_);
    apply_impulses(problem_, stencil_, execution_);
    if constexpr (Viscous<RheologyT>)
      report.viscous = viscous_solver_.solve(problem_, material_volume_, rheology_.viscosity(),
                                             time_step_, execution_);
    move_apex(rheology_, problem_, time_step_, 1);
    before_solve(std::as_const(problem_));
    const auto t2 = Clock::now();
    solve(report);
    if constexpr (RheologyT::rate_dependent)
      while (report.completed() && report.friction_updates < params_.friction_updates &&
             update_friction(report))
        solve(report);
    const auto t3 = Clock::now();
    report.largest_fraction =
        largest_fraction(problem_, open_share_, material_volume_, execution_, partials_);
    report.courant = courant_number(problem_, time_step_, execution_, partials_);
    if (!std::isfinite(report.courant)) // whatever the solver says
      report.solve.status = SolveStatus::not_finite;
    if (report.completed()) {
      torn_ = true; // an exception in the next call leaves it so
      grid_to_particles();
      torn_ = false;
      attempt.complete();
      keep_stresses();
      measure_wrenches(boundaries(), solved_step(), wrenches_);
      report.bodies_left = move_bodies(params_.bodies, problem_, time_step_, bodies_);
      const Outflow outflow = remove_outflow(params_.faces, grid_, particles_);
      report.outflow = outflow.particles;
      report.outflow_volume = outflow.volume;
      time_ += time_step_;
      ++steps_;
    }
    const auto t4 = Clock::now();
    report.cones = problem_.cones();
    report.contacts = problem_.contacts.size() + problem_.body_contacts.size();
    report.seconds = {seconds(t0, t1), seconds(t1, t2), seconds(t2, t3), seconds(t3, t4)};
    return report;
  }

  double time() const { return time_; }           ///< s
  double time_step() const { return time_step_; } ///< δt of the last step, s
  std::size_t steps() const { return steps_; }
  const Params& params() const { return params_; }
  const Grid<Dim>& grid() const { return grid_; }
  const ParticleData& particles() const { return particles_; }
  /// Place and velocities of the free bodies, in the order of params().bodies.
  const std::vector<RigidState<Dim>>& bodies() const { return bodies_.state; }

  // Of the last step: forces, nodal fields and problem. They are no part of a state, so these
  // functions throw std::invalid_argument before the first step and after restore().

  // Force and torque, the mean over δt. What the material and free bodies do to a face of the box
  // or an obstacle, and what material and faces do to a body (gravity left out). Where several
  // faces that stick meet, they share the tangential force of their common nodes.
  const Wrench<Dim>& face_wrench(int axis, bool upper) const {
    require_step("face_wrench");
    return wrenches_.at(static_cast<std::size_t>(Bounds::face_source(axis, upper)));
  }
  const Wrench<Dim>& obstacle_wrench(std::size_t obstacle) const {
    require_step("obstacle_wrench");
    return wrenches_.at(static_cast<std::size_t>(boundaries().obstacle_source(obstacle)));
  }
  const Wrench<Dim>& body_wrench(std::size_t body) const {
    require_step("body_wrench");
    return wrenches_.at(static_cast<std::size_t>(boundaries().body_source(body)));
  }

  /// A view, valid until the next step. Throws as step() does after an update of the particles that
  /// did not come to its end.
  using StateView = SimulationStateView<Dim, ParticleReal>;
  StateView state() const {
    require_whole();
    return {time_,
            steps_,
            time_step_,
            params_.gravity,
            particles_,
            node_stress_,
            problem_.contacts,
            bodies_.state,
            problem_.body_contacts};
  }

  /// Goes on from `state`, which a simulation with the same grid, faces, obstacles and bodies had:
  /// the next step gives the same bits as that one's. Forces, nodal fields and problem() are there
  /// again after that step. Throws std::invalid_argument, and changes nothing, if a particle is
  /// refused (see the constructor) or the state does not fit the grid.
  void restore(SimulationState<Dim, ParticleReal> state) {
    check_state(state, boundaries());
    time_ = state.time;
    steps_ = state.steps;
    time_step_ = state.time_step;
    params_.gravity = state.gravity;
    particles_ = std::move(state.particles);
    node_stress_ = std::move(state.node_stress);
    problem_.contacts = std::move(state.contacts);
    bodies_.state = std::move(state.bodies);
    problem_.body_contacts = std::move(state.body_contacts);
    stepped_ = torn_ = false;
  }

  /// Changes gravity (m/s²) from the next step on: tilts the box.
  void set_gravity(const Vec<Dim>& gravity) {
    check_gravity("gravity", gravity);
    params_.gravity = gravity;
  }

  // Nodal fields of the last step; index with grid().node(...).

  /// φ_i: material volume at node i over the node's volume outside of obstacles and bodies; 1 is
  /// dense.
  double volume_fraction(const Index<Dim>& node) const {
    require_step("volume_fraction");
    const std::size_t j = node_number(node);
    return material_volume_[j] / (open_share_[j] * grid_.node_volume(node));
  }
  /// u_i, m/s; zero where there is no material.
  Vec<Dim> velocity(const Index<Dim>& node) const {
    require_step("velocity");
    return problem_.velocity[node_number(node)].template head<Dim>();
  }
  /// −σ_i = φ λ̂_i, d × d, Pa; positive in compression.
  Mat<Dim> stress(const Index<Dim>& node) const {
    require_step("stress");
    const Vec<cone_size>& impulse = node_stress_[node_number(node)];
    return std::min(1.0, volume_fraction(node)) / time_step_ *
           vector_to_symmetric<Dim, double>(impulse);
  }
  /// p_i = −Tr σ_i / d, Pa.
  double pressure(const Index<Dim>& node) const { return stress(node).trace() / Dim; }
  /// I_i that the step's friction was taken at; 0 for a law that does not depend on it.
  double inertial_number(const Index<Dim>& node) const {
    require_step("inertial_number");
    return inertial_number_[node_number(node)];
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
  using Wide = NodeVec<Dim>;
  static constexpr int cone_size = symmetric_size<Dim>;
  using Bounds = Boundaries<Dim>;

  /// What a step overwrites and must give back if it is not completed: #nodes each.
  struct LastStep {
    std::vector<double> material_volume, inertial_number, open_share;
    std::vector<NodeVec<Dim>> velocity;
    std::vector<Contact<Dim>> contacts;
    std::vector<BodyContact<Dim>> body_contacts;
  };

  /// One try to make a step. It works in the arrays of the step before the last and puts things
  /// back when it ends without complete(), by an exception, say.
  class Attempt {
   public:
    explicit Attempt(Simulation& sim) : sim_(sim), last_time_step_(sim.time_step_) {
      sim.swap_last();
    }
    ~Attempt() {
      if (completed_)
        return;
      sim_.swap_last();
      sim_.time_step_ = last_time_step_;
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
    std::swap(material_volume_, last_.material_volume);
    std::swap(inertial_number_, last_.inertial_number);
    std::swap(open_share_, last_.open_share);
    std::swap(problem_.velocity, last_.velocity);
    std::swap(problem_.contacts, last_.contacts);
    std::swap(problem_.body_contacts, last_.body_contacts);
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

  std::size_t node_number(const Index<Dim>& node) const {
    return static_cast<std::size_t>(grid_.node(grid_.owner(node)));
  }

  static double seconds(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double>(to - from).count();
  }

  Bounds boundaries() const {
    return {grid_,         params_.faces, params_.obstacles, params_.bodies, bodies_.state,
            bodies_.reach, time_};
  }
  SolvedStep<Dim> solved_step() const {
    return {problem_,
            node_stress_,
            node_cone_,
            material_volume_,
            velocity_before_,
            viscous_solver_,
            params_.material.density,
            time_step_,
            params_.gravity};
  }

  /// Calls body(node) for all nodes of the box.
  template <class Body>
  void for_each_node(const Body& body) {
    execution_.for_each(std::ssize(node_order_.nodes()), [&](std::ptrdiff_t k) {
      body(static_cast<std::size_t>(node_order_.nodes()[static_cast<std::size_t>(k)]));
    });
  }
  /// Calls body(cone) for all cones.
  template <class Body>
  void for_each_cone(const Body& body) {
    execution_.for_each(static_cast<std::ptrdiff_t>(problem_.cones()),
                        [&](std::ptrdiff_t i) { body(static_cast<std::size_t>(i)); });
  }

  double node_mass(std::size_t node) const {
    return params_.material.density * material_volume_[node];
  }

  /// m_i, u*_i and φ_i from the particles.
  void particles_to_grid() {
    if constexpr (TransferT::field == ParticleField::multilinear)
      particles_.resize_mixed(particles_.size());
    order_.update(particles_, grid_, execution_);
    all_cell_moments<TransferT::field>(particles_, order_, grid_, execution_, moments_,
                                       params_.packing.even);
    cells_to_nodes(moments_, order_, grid_, node_order_.nodes(), execution_, material_volume_,
                   velocity_before_);
    problem_.periodic.copy(material_volume_, execution_);
    problem_.periodic.copy(velocity_before_, execution_);
    problem_.velocity.resize(velocity_before_.size());
    execution_.for_ranges(
        std::ssize(velocity_before_), [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          std::copy(velocity_before_.begin() + begin, velocity_before_.begin() + end,
                    problem_.velocity.begin() + begin);
        });
  }

  void choose_time_step() {
    time_step_ = params_.cfl == 0 ? params_.time_step
                                  : cfl_time_step(params_.cfl, params_.time_step, boundaries(),
                                                  solids_, node_order_.nodes(), velocity_before_,
                                                  bodies_, params_.gravity);
  }

  /// One cone per node with enough mass, in the order of the blocks: g_ij, k_i, μ_i, last stress.
  /// ratio: this time step over the last: λ is a stress times δt.
  void collect_cones(double ratio) {
    const double least_volume = params_.min_relative_mass * grid_.cell_volume();
    for_each_node([&](std::size_t j) {
      problem_.inverse_mass[j] = Wide::Zero();
      open_share_[j] = 1;
      node_cone_[j] = -1;
      node_excess_[j] = not_inside;
      divergence_[j] = 0;
      if (material_volume_[j] >= least_volume)
        problem_.inverse_mass[j].template head<Dim>().setConstant(1 / node_mass(j));
      else
        inertial_number_[j] = 0;
    });
    talus::collect_cones(
        node_order_,
        [&](int node) { return material_volume_[static_cast<std::size_t>(node)] >= least_volume; },
        execution_, counts_, problem_);

    const std::size_t cones = problem_.node.size();
    problem_.coupling.resize(cones);
    problem_.void_rate.resize(cones);
    problem_.friction.resize(cones);
    problem_.volume.resize(cones);
    problem_.stress.resize(cones);
    for_each_cone([&](std::size_t i) {
      node_cone_[static_cast<std::size_t>(problem_.node[i])] = static_cast<int>(i);
    });
    solids_.find(grid_, node_cone_, cones);
    for_each_cone([&](std::size_t i) { fill_cone(i, ratio); });
    if (params_.packing.even) {
      problem_.periodic.copy(node_excess_, execution_);
      problem_.periodic.copy(node_strain_, execution_);
      for_each_cone([&](std::size_t i) { set_room_inside(i); });
    }
    problem_.periodic.copy(node_cone_, execution_);
  }

  void fill_cone(std::size_t i, double ratio) {
    const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
    const Index<Dim> index = grid_.node_index(problem_.node[i]);
    Coupling<Dim>& g = problem_.coupling[i];
    g.setZero();
    Vec<Dim> first_moment = Vec<Dim>::Zero();
    for_each_cell_of_node(grid_, index, [&](int cell, int corner) {
      if (order_.empty(cell))
        return;
      const CellMoments<Dim>& m = moments_[static_cast<std::size_t>(cell)];
      add_coupling(m, corner, grid_.inverse_spacing(), g);
      first_moment += corner_first_moment(m, corner);
    });
    fold_neighbours(index, g);
    open_share_[j] = solids_.look(boundaries(), i, grid_.node_position(index));
    problem_.volume[i] = open_share_[j] * grid_.node_volume(index);
    problem_.stress[i] = ratio * node_stress_[j];
    pack(i, index, first_moment);
    problem_.friction[i] = friction(i);
  }

  /// Along a periodic axis of one or two cells two or three neighbours are the same node, which
  /// then gets what all of them have.
  void fold_neighbours(const Index<Dim>& index, Coupling<Dim>& g) const {
    for (int a = 0; a < Dim; ++a) {
      if (!grid_.periodic(a) || grid_.cells(a) > 2)
        continue;
      const int stride = ipow(3, Dim - 1 - a);
      const int kept = grid_.cells(a) == 1 ? 1 : index[a] == 0 ? 2 : 0; // of −1, 0, 1
      for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
        const int place = k / stride % 3;
        if (place == kept || (grid_.cells(a) == 2 && place == 1))
          continue;
        g.col(k + (kept - place) * stride) += g.col(k);
        g.col(k).setZero();
      }
    }
  }

  /// Does the material of node j end at a free surface along `axis`: is the next node that way (±1)
  /// emptier than that of a dense layer a cell thick (1/2), but for noise? What is empty before a
  /// closed face is a gap, not a surface.
  bool surface_towards(std::size_t j, const Index<Dim>& index, int axis, int way) const {
    Index<Dim> next = index;
    next[axis] += way;
    if (grid_.periodic(axis))
      return material_volume_[node_number(next)] < 0.45 * grid_.node_volume(next);
    if (next[axis] < 0 || next[axis] > grid_.cells(axis))
      return false;
    const std::size_t s = static_cast<std::size_t>(axis);
    if ((next[axis] == 0 && params_.faces.lower[s].kind != FaceKind::free) ||
        (next[axis] == grid_.cells(axis) && params_.faces.upper[s].kind != FaceKind::free))
      return false;
    const std::size_t k =
        j + static_cast<std::size_t>(static_cast<std::ptrdiff_t>(way) * grid_.node_stride(axis));
    return material_volume_[k] < 0.45 * grid_.node_volume(next);
  }

  /// φ of node j if it were dense, from where its material lies. mean: see dense_fraction.
  double dense_at(std::size_t j, const Index<Dim>& index, Vec<Dim> mean) const {
    std::array<NodeSide, std::size_t{Dim}> side;
    for (int a = 0; a < Dim; ++a) {
      NodeSide& here = side[static_cast<std::size_t>(a)];
      here = grid_.periodic(a)            ? NodeSide::inside
             : index[a] == 0              ? NodeSide::on_lower_face
             : index[a] == grid_.cells(a) ? NodeSide::on_upper_face
                                          : NodeSide::inside;
      const int way = here == NodeSide::on_lower_face   ? 1
                      : here == NodeSide::on_upper_face ? -1
                      : mean[a] > 0                     ? -1
                                                        : 1;
      if (!surface_towards(j, index, a, way))
        mean[a] = here == NodeSide::inside ? 0 : 1;
    }
    return dense_fraction<Dim>(mean, side);
  }

  /// Sets k_i of a cone at a surface or beside solids, or else what set_room_inside() needs.
  /// first_moment: Σ V_p N_i (x_p − x_i)/h by axis, m^d.
  void pack(std::size_t i, const Index<Dim>& index, const Vec<Dim>& first_moment) {
    const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
    const double material = material_volume_[j], volume = problem_.volume[i];
    const bool in_the_open = open_share_[j] == 1; // beside solids the plain rule holds
    double dense = 1, strain = 0;
    // Cohesion would hang what is below a surface on the air above it.
    const bool surfaces = in_the_open && params_.packing.surfaces && !Cohesive<RheologyT>;
    if (surfaces)
      dense = dense_at(j, index, scaled<Dim>(1 / material, first_moment));
    if (in_the_open && (material > volume || params_.packing.even)) {
      const Vec<cone_size> rate = strain_rate(problem_, stencil_, i);
      double shear2 = 0;
      for (int k = 1; k < cone_size; ++k)
        shear2 += rate[k] * rate[k];
      strain = 2 * std::sqrt(shear2) / material * time_step_; // |γ̇|² = 4 γ_T²
      node_strain_[j] = strain;
      if (surfaces && dense == 1 && params_.packing.even)
        node_excess_[j] = material / volume - 1;
    }
    set_room(i, material / volume, dense, strain);
  }

  /// k_i of a cone in the midst of dense material, from the packing of its neighbours as well.
  void set_room_inside(std::size_t i) {
    const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
    if (!(node_excess_[j] < not_inside))
      return;
    double sum = 0, weights = 0;
    for (int k = 0; k < Grid<Dim>::neighbours; ++k) { // ghosts are never inside
      const double other =
          node_excess_[static_cast<std::size_t>(problem_.node[i] + grid_.neighbour_offset(k))];
      if (!(other < not_inside))
        continue;
      double weight = 1; // 1, 2, 1 along each axis
      for (int rest = k, a = 0; a < Dim; ++a, rest /= 3)
        weight *= rest % 3 == 1 ? 2 : 1;
      sum += weight * other;
      weights += weight;
    }
    set_room(i, Packing::agreed(1 + node_excess_[j], 1 + sum / weights), 1, node_strain_[j]);
  }

  void set_room(std::size_t i, double fraction, double dense, double strain) {
    problem_.void_rate[i] = normal_from_mean<Dim>(params_.packing.room(fraction, dense, strain) *
                                                  problem_.volume[i] / (Dim * time_step_));
  }

  /// μ̃_i from the velocities and the stress that the problem has.
  double friction(std::size_t i) {
    const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
    if constexpr (RheologyT::rate_dependent)
      inertial_number_[j] =
          cone_inertial_number(rheology_, problem_, stencil_, i, material_volume_[j], time_step_);
    return cone_friction<Dim>(rheology_.friction(inertial_number_[j]));
  }

  /// Takes μ_i from the velocities and stresses of the last solve. Returns false if they would not
  /// change enough for another one.
  bool update_friction(StepReport& report) {
    move_apex(rheology_, problem_, time_step_, -1);
    friction_iteration_.next.resize(problem_.cones());
    for_each_cone([&](std::size_t i) { friction_iteration_.next[i] = friction(i); });
    const double change = friction_iteration_.change(problem_);
    friction_iteration_.choose_share(report.friction_updates == 1, change, report.friction_change);
    report.friction_change = change;
    const bool update = !(change <= params_.friction_tolerance);
    if (update) {
      friction_iteration_.update(problem_);
      ++report.friction_updates;
    }
    move_apex(rheology_, problem_, time_step_, 1);
    return update;
  }

  /// Solves the dual problem, or says why not.
  void solve(StepReport& report) {
    report.invalid_friction = count_invalid_friction(rheology_, problem_);
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
    Wide change = Wide::Zero();
    change.template head<Dim>() = time_step_ * params_.gravity;
    double largest2 = execution_.reduce(
        std::ssize(node_order_.nodes()), partials_, 0.0,
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          double largest = 0;
          for (std::ptrdiff_t k = begin; k < end; ++k) {
            const std::size_t j =
                static_cast<std::size_t>(node_order_.nodes()[static_cast<std::size_t>(k)]);
            if (material_volume_[j] > 0) {
              largest = std::max(largest, problem_.velocity[j].squaredNorm());
              problem_.velocity[j] += change;
            }
          }
          return largest;
        },
        [](double a, double b) { return std::max(a, b); });
    for (std::size_t b = 0; b < bodies_.state.size(); ++b) {
      const RigidState<Dim>& body = bodies_.state[b];
      if (has_left(grid_, body.position, bodies_.reach[b]))
        continue;
      const double speed = body.velocity.norm() + body.angular_velocity.norm() * bodies_.radius[b];
      largest2 = std::max(largest2, speed * speed);
    }
    const Vec<Dim> gained = change.template head<Dim>();
    set_free_velocities(params_.bodies, bodies_, gained, problem_);
    problem_.velocity_scale = std::max(change.norm(), 1e-3 * std::sqrt(largest2));
  }

  /// Keeps λ per node for the next step's warm start, and for output.
  void keep_stresses() {
    for_each_node([&](std::size_t j) {
      if (node_cone_[j] < 0)
        node_stress_[j].setZero();
    });
    for_each_cone([&](std::size_t i) {
      Vec<cone_size>& stress = node_stress_[static_cast<std::size_t>(problem_.node[i])];
      stress = problem_.stress[i];
      stress[0] -= cone_apex(rheology_, problem_, time_step_, i);
    });
    problem_.periodic.copy(node_stress_, execution_);
  }

  /// The particles' velocity fields and places from the grid's new velocities.
  void grid_to_particles() {
    const auto [lower, upper] = particle_bounds(params_.faces, grid_);
    if constexpr (requires { transfer_.prepare(TransferStep{}); })
      transfer_.prepare(
          {time_step_, std::sqrt(norm<Dim>(params_.gravity) / grid_.spacing().minCoeff())});
    if constexpr (TransferT::field == ParticleField::multilinear)
      for_each_cone([&](std::size_t i) {
        const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
        // Tr D = d · mean of what normal_from_mean made the normal component
        divergence_[j] = Dim * mean_from_normal<Dim>(strain_rate(problem_, stencil_, i)[0]) /
                         material_volume_[j];
      });
    problem_.periodic.copy(divergence_, execution_);
    talus::grid_to_particles(particles_, order_, grid_, transfer_, problem_.velocity,
                             velocity_before_, divergence_, moments_, time_step_, lower, upper,
                             execution_);
    if (params_.packing.even && params_.packing.shifting > 0)
      shift_particles(particles_, order_, grid_, node_excess_, node_strain_,
                      params_.packing.shifting, lower, upper, execution_);
  }

  Params params_;
  Execution execution_;
  Grid<Dim> grid_;
  RheologyT rheology_;
  TransferT transfer_;
  SolverT solver_;
  Stencil<Dim> stencil_;
  BlockOrder<Dim> node_order_;
  std::vector<std::size_t> node_rank_; ///< place of a node in node_order_
  ParticleData particles_;
  FreeBodies<Dim> bodies_;
  SolidsAtCones<Dim> solids_;
  double time_ = 0;
  std::size_t steps_ = 0;
  double time_step_ = 0; ///< δt of this step, s
  bool stepped_ = false; ///< there is a last step that fields and forces belong to
  bool torn_ = false;    ///< the last update of the particles did not come to its end

  // Workspace, and what one step leaves for the next.
  CellOrder<Dim> order_;
  std::vector<CellMoments<Dim>> moments_;     ///< #cells
  std::vector<double> material_volume_;       ///< Σ V_p N_i, #nodes, m^d
  std::vector<NodeVec<Dim>> velocity_before_; ///< u*, #nodes, m/s
  std::vector<Vec<cone_size>> node_stress_;   ///< λ, #nodes, Pa s
  std::vector<double> inertial_number_;       ///< #nodes
  std::vector<double> open_share_;            ///< of a node's volume, #nodes
  std::vector<double> divergence_;            ///< mean tr ∇u around a node, #nodes, 1/s
  std::vector<std::size_t> counts_;           ///< of cones, by block
  std::vector<double> partials_;              ///< of sums and maxima
  std::vector<int> node_cone_;                ///< the cone of a node or −1, #nodes
  std::vector<double> node_excess_;           ///< φ − 1 or not_inside, #nodes
  std::vector<double> node_strain_;           ///< |γ̇| δt, #nodes
  std::vector<Wrench<Dim>> wrenches_;         ///< #faces + #obstacles + #bodies
  LastStep last_;
  DualProblem<Dim> problem_;
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
