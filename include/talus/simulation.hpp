// SPDX-License-Identifier: MIT
#pragma once

#include "talus/boundary/body.hpp"
#include "talus/boundary/faces.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/parallel.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/coloring.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/packing.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/rheology.hpp"
#include "talus/rheology/viscosity.hpp"
#include "talus/solver/solver.hpp"
#include "talus/solver/viscous_solver.hpp"
#include "talus/transfer/cell_moments.hpp"
#include "talus/transfer/cell_order.hpp"
#include "talus/transfer/grid_to_particles.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace talus {

struct Material {
  double density = 0; ///< ρ_c of the dense packing, kg/m³; > 0
};

/// Wall-clock seconds of one step, by phase.
struct PhaseSeconds {
  double to_grid = 0;  ///< sorting, particles to grid
  double assembly = 0; ///< boundary conditions, cones and contacts, warm start, viscosity
  double solve = 0;
  double to_particles = 0; ///< grid to particles, advection

  double total() const { return to_grid + assembly + solve + to_particles; }
};

/// What one step did.
struct [[nodiscard]] StepReport {
  SolveReport solve;     ///< iterations and seconds of all friction updates
  ViscousReport viscous; ///< of the Newtonian part, if there is one
  PhaseSeconds seconds;
  int friction_updates = 1;   ///< how often μ_i was taken from the rheology
  double friction_change = 0; ///< relative change of μ p by the last update, or by the one left out
  std::size_t cones = 0, contacts = 0;
  std::size_t invalid_friction = 0; ///< nodes whose friction law gave no finite μ ≥ 0
  std::size_t outflow = 0;          ///< particles that left through free faces in this step
  double outflow_volume = 0;        ///< m^d

  /// False if the step was refused because numbers were not finite or friction was invalid;
  /// particles and time are as before.
  bool completed() const { return solve.status != SolveStatus::not_finite; }
};

/// All that a simulation hands from one step to the next.
template <int Dim, class Real = double>
struct SimulationState {
  double time = 0;                                   ///< s
  std::size_t steps = 0;                             ///< made so far
  double time_step = 0;                              ///< δt of the last step, s
  Vec<Dim> gravity = Vec<Dim>::Zero();               ///< m/s²
  Particles<Dim, Real> particles;                    ///< their order counts: sums depend on it
  std::vector<Vec<symmetric_size<Dim>>> node_stress; ///< λ, #nodes, Pa s: the warm start
  std::vector<Contact<Dim>> contacts; ///< node, source and impulse of each: the warm start
  std::vector<RigidState<Dim>> bodies;
  std::vector<BodyContact<Dim>> body_contacts; ///< node, source, body and impulse of each
};

/// A granular flow: particles, a grid, and the policies that say how the medium yields (RheologyT),
/// how particles and grid exchange velocities (TransferT) and how the dual problem is solved
/// (SolverT). ParticleReal: what particles keep their velocities in; see Particles.
///
/// One step of the semi-implicit scheme of Rousseau et al. 2023 (their §3 and appendices; after
/// Daviet & Bertails-Descoubes 2016):
///   m_j (u_j − u*_j) = δt (m_j g + Σ_i Λ_i g_ij),  γ_i = vec(sym Σ_j u_j ⊗ g_ij) + k_i,
///   (γ_i, λ_i) in the Drucker–Prager law of friction μ_i.
template <int Dim, Rheology RheologyT, TransferScheme<Dim> TransferT, Solver<Dim> SolverT,
          class ParticleReal = double>
class Simulation {
 public:
  static constexpr int dimension = Dim;
  using ParticleData = Particles<Dim, ParticleReal>;

  struct Params {
    GridParams<Dim> grid{};
    Material material{};
    Vec<Dim> gravity = Vec<Dim>::Zero(); ///< m/s²; turn it to incline the box
    double time_step = 0;                ///< δt, s; > 0; the largest one if cfl > 0
    double cfl = 0; ///< largest share of a cell to cross in a step along any axis; 0: δt is fixed
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
  /// has no positive volume or a position or velocity that is not finite, or there is no particle
  /// at all.
  explicit Simulation(Params params, ParticleData particles)
      : params_(std::move(params)), grid_(params_.grid), rheology_(params_.rheology),
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
    for (int a = 0; a < Dim; ++a)
      require_finite("gravity", params_.gravity[a]);
    if (params_.threads < 1)
      throw_invalid("threads", params_.threads, "an integer >= 1");
    params_.faces.validate();
    time_step_ = params_.time_step;
    for (const auto& obstacle : params_.obstacles)
      if (!obstacle)
        throw_invalid("an obstacle", "null", "a valid pointer");
    check_particles(particles_);
    add_bodies();

    const std::size_t nodes = static_cast<std::size_t>(grid_.node_count());
    material_volume_.assign(nodes, 0);
    velocity_before_.assign(nodes, NodeVec<Dim>::Zero());
    node_stress_.assign(nodes, Vec<cone_size>::Zero());
    inertial_number_.assign(nodes, 0);
    open_share_.assign(nodes, 1);
    spreading_ = {std::vector<double>(nodes, 0), params_.packing.spreading};
    node_cone_.assign(nodes, -1);
    wrenches_.resize(static_cast<std::size_t>(2 * Dim) + params_.obstacles.size() + bodies_.size());
    node_rank_.assign(nodes, 0);
    for (std::size_t k = 0; k < node_order_.nodes().size(); ++k)
      node_rank_[static_cast<std::size_t>(node_order_.nodes()[k])] = k;
    problem_.grid = grid_;
    problem_.velocity.assign(nodes, NodeVec<Dim>::Zero());
    problem_.inverse_mass.assign(nodes, NodeVec<Dim>::Zero());
  }

  /// Advances by δt.
  StepReport step();

  /// The same, and calls before_solve(problem) with the dual problem as the solver gets it, warm
  /// start included: to record it, say.
  template <class BeforeSolve>
  StepReport step(const BeforeSolve& before_solve) {
    StepReport report;
    const auto t0 = Clock::now();
    particles_to_grid();
    choose_time_step();
    const auto t1 = Clock::now();
    collect_cones();
    add_gravity();
    apply_faces();
    collect_contacts();
    collect_body_contacts();
    apply_impulses(problem_, stencil_);
    if constexpr (Viscous<RheologyT>)
      report.viscous = viscous_solver_.solve(problem_, material_volume_, rheology_.viscosity(),
                                             time_step_, params_.threads);
    move_apex(1);
    before_solve(std::as_const(problem_));
    const auto t2 = Clock::now();
    solve(report);
    if constexpr (RheologyT::rate_dependent)
      while (report.completed() && report.friction_updates < params_.friction_updates &&
             update_friction(report))
        solve(report);
    const auto t3 = Clock::now();
    if (report.completed()) {
      keep_stresses();
      measure_wrenches();
      grid_to_particles();
      move_bodies();
      remove_outflow(report);
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
  const std::vector<RigidState<Dim>>& bodies() const { return bodies_; }

  // Force and torque of the last step, its mean over δt; zero before the first. What the material
  // and free bodies do to a face of the box or an obstacle, and what material and faces do to a
  // body (gravity left out). Where several faces that stick meet, they share the tangential force
  // of their common nodes.
  const Wrench<Dim>& face_wrench(int axis, bool upper) const {
    return wrenches_.at(static_cast<std::size_t>(face_source(axis, upper)));
  }
  const Wrench<Dim>& obstacle_wrench(std::size_t obstacle) const {
    return wrenches_.at(static_cast<std::size_t>(obstacle_source(obstacle)));
  }
  const Wrench<Dim>& body_wrench(std::size_t body) const {
    return wrenches_.at(static_cast<std::size_t>(body_source(body)));
  }

  /// A view of the state, valid until the next step.
  struct StateView {
    double time;
    std::size_t steps;
    double time_step;
    const Vec<Dim>& gravity;
    const ParticleData& particles;
    const std::vector<Vec<symmetric_size<Dim>>>& node_stress;
    const std::vector<Contact<Dim>>& contacts;
    const std::vector<RigidState<Dim>>& bodies;
    const std::vector<BodyContact<Dim>>& body_contacts;
  };
  StateView state() const {
    return {time_,
            steps_,
            time_step_,
            params_.gravity,
            particles_,
            node_stress_,
            problem_.contacts,
            bodies_,
            problem_.body_contacts};
  }

  /// Goes on from `state`, which a simulation with the same grid, faces, obstacles and bodies had:
  /// the next step gives the same bits as that one's. Throws std::invalid_argument, and changes
  /// nothing, if a particle is refused (see the constructor) or the state does not fit the grid.
  void restore(SimulationState<Dim, ParticleReal> state) {
    require_non_negative("state.time", state.time);
    require_positive("state.time_step", state.time_step);
    for (int a = 0; a < Dim; ++a)
      require_finite("state.gravity", state.gravity[a]);
    check_particles(state.particles);
    if (state.node_stress.size() != node_stress_.size())
      throw_invalid("the number of nodes of the state", state.node_stress.size(),
                    std::to_string(node_stress_.size()));
    const int sources = 2 * Dim + static_cast<int>(params_.obstacles.size());
    for (const Contact<Dim>& contact : state.contacts) {
      if (contact.node < 0 || contact.node >= grid_.node_count())
        throw_invalid("the node of a contact", contact.node, "a node of the grid");
      if (contact.source < 0 || contact.source >= sources)
        throw_invalid("the source of a contact", contact.source,
                      "below " + std::to_string(sources));
    }
    if (state.bodies.size() != bodies_.size())
      throw_invalid("the number of bodies of the state", state.bodies.size(),
                    std::to_string(bodies_.size()));
    for (const RigidState<Dim>& body : state.bodies)
      check_body_state(body);
    for (const BodyContact<Dim>& contact : state.body_contacts) {
      if (contact.body < 0 || contact.body >= static_cast<int>(bodies_.size()))
        throw_invalid("the body of a contact", contact.body, "a body of the simulation");
      const std::size_t b = static_cast<std::size_t>(contact.body);
      const int corners = static_cast<int>(params_.bodies[b].corners.size());
      if (contact.node < -corners || contact.node >= grid_.node_count())
        throw_invalid("the node of a contact", contact.node, "a node of the grid, or a corner");
    }
    time_ = state.time;
    steps_ = state.steps;
    time_step_ = state.time_step;
    params_.gravity = state.gravity;
    particles_ = std::move(state.particles);
    node_stress_ = std::move(state.node_stress);
    problem_.contacts = std::move(state.contacts);
    bodies_ = std::move(state.bodies);
    problem_.body_contacts = std::move(state.body_contacts);
  }

  /// Changes gravity (m/s²) from the next step on: tilts the box.
  void set_gravity(const Vec<Dim>& gravity) {
    for (int a = 0; a < Dim; ++a)
      require_finite("gravity", gravity[a]);
    params_.gravity = gravity;
  }

  // Nodal fields of the last step; index with grid().node(...).

  /// φ_i: material volume at node i over the node's volume outside of obstacles and bodies; 1 is
  /// dense.
  double volume_fraction(const Index<Dim>& node) const {
    const std::size_t j = static_cast<std::size_t>(grid_.node(node));
    return material_volume_[j] / (open_share_[j] * grid_.node_volume(node));
  }
  /// u_i, m/s; zero where there is no material.
  Vec<Dim> velocity(const Index<Dim>& node) const {
    return problem_.velocity[static_cast<std::size_t>(grid_.node(node))].template head<Dim>();
  }
  /// −σ_i = φ λ̂_i, d × d, Pa; positive in compression.
  Mat<Dim> stress(const Index<Dim>& node) const {
    const Vec<cone_size>& impulse = node_stress_[static_cast<std::size_t>(grid_.node(node))];
    return std::min(1.0, volume_fraction(node)) / time_step_ *
           vector_to_symmetric<Dim, double>(impulse);
  }
  /// p_i = −Tr σ_i / d, Pa.
  double pressure(const Index<Dim>& node) const { return stress(node).trace() / Dim; }
  /// I_i that the step's friction was taken at; 0 for a law that does not depend on it.
  double inertial_number(const Index<Dim>& node) const {
    return inertial_number_[static_cast<std::size_t>(grid_.node(node))];
  }

  /// The dual problem of the last step with its solution: with cohesion, λ' = λ + (c/μ) I.
  const DualProblem<Dim>& problem() const { return problem_; }

 private:
  using Clock = std::chrono::steady_clock;
  using Wide = NodeVec<Dim>;
  static constexpr int cone_size = symmetric_size<Dim>;
  static constexpr int spin = spin_size<Dim>;
  static constexpr double least_open_share = 0.1; ///< also of what has got into a solid

  static double seconds(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double>(to - from).count();
  }

  void check_particles(const ParticleData& particles) const {
    if (particles.empty())
      throw_invalid("the number of particles", 0, "at least 1 (is the scene empty?)");
    for (const auto& [name, size] :
         {std::pair("velocities", particles.velocity.size()),
          std::pair("affine matrices", particles.affine.size()),
          std::pair("volumes", particles.volume.size()), std::pair("ids", particles.id.size())})
      if (size != particles.size())
        throw_invalid(std::string("the number of the particles' ") + name, size,
                      std::to_string(particles.size()) + ", that of their positions");
    const Vec<Dim> lower = grid_.origin(), upper = grid_.upper();
    for (std::size_t p = 0; p < particles.size(); ++p) {
      require_positive("a particle's volume", particles.volume[p]);
      for (int a = 0; a < Dim; ++a) {
        require_finite("a particle's velocity", particles.velocity[p][a]);
        const double x = particles.position[p][a];
        if (!(x >= lower[a] && x <= upper[a]))
          throw_invalid("a particle's coordinate", x, "a position in the box of the grid");
        for (int b = 0; b < Dim; ++b)
          require_finite("a particle's affine matrix", particles.affine[p](a, b));
      }
    }
  }

  static void check_body_state(const RigidState<Dim>& body) {
    for (int a = 0; a < Dim; ++a) {
      require_finite("a body's position", body.position[a]);
      require_finite("a body's velocity", body.velocity[a]);
    }
    for (int a = 0; a < spin_size<Dim>; ++a)
      require_finite("a body's angular velocity", body.angular_velocity[a]);
    const double error = (body.rotation * body.rotation.transpose() - Mat<Dim>::Identity()).norm();
    if (!(error < 1e-9))
      throw_invalid("a body's |R Rᵀ - I|", error, "a rotation, < 1e-9");
  }

  /// Takes the bodies' start. Refuses what a cell cannot resolve, and corners outside of the box.
  void add_bodies() {
    for (const Body<Dim>& body : params_.bodies) {
      body.validate();
      check_body_state(body.start);
      const Placed<Dim> placed{body.shape, body.start};
      double thickness = -2 * placed.distance(body.start.position);
      for (const int node : node_order_.nodes())
        thickness = std::max(thickness, -2 * placed.distance(grid_.node_position(node)));
      const double least = 2 * grid_.spacing().minCoeff();
      if (!(thickness >= least))
        throw_invalid("a body's thickness", thickness,
                      "at least two cells, " + std::to_string(least) + " m");
      for_each_corner_gap(body, body.start, [&](std::size_t, int axis, bool, double gap) {
        if (gap < -1e-9 * grid_.size()[axis])
          throw_invalid("the distance of a body's corner to a face", gap, ">= 0");
      });
      double radius = 0;
      for (const Vec<Dim>& corner : body.corners)
        radius = std::max(radius, corner.norm() + body.corner_radius);
      body_radius_.push_back(radius);
      bodies_.push_back(body.start);
      body_inverse_inertia_.push_back(body.rotates ? body.inverse_inertia()
                                                   : Mat<spin>(Mat<spin>::Zero()));
      if (!body.rotates)
        bodies_.back().angular_velocity.setZero();
    }
    problem_.bodies.resize(bodies_.size());
  }

  /// Calls visit(corner, axis, upper, gap in m) for every corner and every face that is not free.
  template <class Visit>
  void for_each_corner_gap(const Body<Dim>& body, const RigidState<Dim>& state,
                           const Visit& visit) const {
    for (std::size_t c = 0; c < body.corners.size(); ++c) {
      const Vec<Dim> x = state.position + state.rotation * body.corners[c];
      for (int a = 0; a < Dim; ++a) {
        const std::size_t s = static_cast<std::size_t>(a);
        if (params_.faces.lower[s].kind != FaceKind::free)
          visit(c, a, false, x[a] - body.corner_radius - grid_.origin()[a]);
        if (params_.faces.upper[s].kind != FaceKind::free)
          visit(c, a, true, grid_.upper()[a] - body.corner_radius - x[a]);
      }
    }
  }

  static int face_source(int axis, bool upper) { return 2 * axis + (upper ? 1 : 0); }
  static int obstacle_source(std::size_t obstacle) { return 2 * Dim + static_cast<int>(obstacle); }
  int body_source(std::size_t body) const {
    return obstacle_source(params_.obstacles.size() + body);
  }

  double node_mass(std::size_t node) const {
    return params_.material.density * material_volume_[node];
  }

  /// m_i, u*_i and φ_i from the particles.
  void particles_to_grid() {
    order_.update(particles_, grid_, params_.threads);
    all_cell_moments(particles_, order_, grid_, TransferT::affine, params_.threads, moments_);
    const std::vector<int>& nodes = node_order_.nodes();
    parallel_chunks(
        params_.threads, static_cast<std::ptrdiff_t>(nodes.size()), 64,
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          for (std::ptrdiff_t k = begin; k < end; ++k) {
            const std::size_t j = static_cast<std::size_t>(nodes[static_cast<std::size_t>(k)]);
            double volume = 0;
            Vec<Dim> momentum = Vec<Dim>::Zero();
            for_each_cell_of_node(
                grid_, grid_.node_index(static_cast<int>(j)), [&](int cell, int corner) {
                  if (order_.empty(cell))
                    return;
                  const CellMoments<Dim>& m = moments_[static_cast<std::size_t>(cell)];
                  volume += corner_volume(m, corner);
                  momentum += m.momentum[static_cast<std::size_t>(corner)];
                });
            material_volume_[j] = volume;
            Wide u = Wide::Zero();
            if (volume > 0)
              u.template head<Dim>() = momentum / volume;
            velocity_before_[j] = problem_.velocity[j] = u;
          }
        });
  }

  /// With cfl > 0: δt = cfl / max_i,a (|u*_a| + |g_a| δt_max)/h_a, at most δt_max. Impulses of the
  /// warm start are forces times δt.
  void choose_time_step() {
    if (params_.cfl == 0)
      return;
    double rate = params_.cfl / params_.time_step; // cells a second
    for (const int node : node_order_.nodes())
      for (int a = 0; a < Dim; ++a) {
        const double speed = std::abs(velocity_before_[static_cast<std::size_t>(node)][a]) +
                             std::abs(params_.gravity[a]) * params_.time_step;
        rate = std::max(rate, speed * grid_.inverse_spacing()[a]);
      }
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      for (int a = 0; a < Dim; ++a) {
        const double speed = std::abs(bodies_[b].velocity[a]) +
                             std::abs(params_.gravity[a]) * params_.time_step +
                             bodies_[b].angular_velocity.norm() * body_radius_[b];
        rate = std::max(rate, speed * grid_.inverse_spacing()[a]);
      }
    const double next = params_.cfl / rate, ratio = next / time_step_;
    time_step_ = next;
    for (Vec<cone_size>& stress : node_stress_)
      stress *= ratio;
    for (Contact<Dim>& contact : problem_.contacts)
      contact.impulse *= ratio;
    for (BodyContact<Dim>& contact : problem_.body_contacts)
      contact.impulse *= ratio;
  }

  /// One cone per node with enough mass, in the order of the blocks: g_ij, k_i, μ_i, last stress.
  void collect_cones() {
    const double least_volume = params_.min_relative_mass * grid_.cell_volume();
    problem_.node.clear();
    for (const int node : node_order_.nodes()) {
      const std::size_t j = static_cast<std::size_t>(node);
      problem_.inverse_mass[j] = Wide::Zero();
      open_share_[j] = 1;
      node_cone_[j] = -1;
      spreading_.excess[j] = 0;
      if (material_volume_[j] >= least_volume) {
        problem_.inverse_mass[j].template head<Dim>().setConstant(1 / node_mass(j));
        node_cone_[j] = static_cast<int>(problem_.node.size());
        problem_.node.push_back(node);
      } else {
        node_stress_[j].setZero();
        inertial_number_[j] = 0;
      }
    }
    assign_blocks(node_order_, problem_);

    const std::size_t cones = problem_.node.size();
    problem_.coupling.resize(cones);
    problem_.void_rate.resize(cones);
    problem_.friction.resize(cones);
    problem_.volume.resize(cones);
    problem_.stress.resize(cones);
    parallel_chunks(params_.threads, static_cast<std::ptrdiff_t>(cones), 32,
                    [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
                      for (std::ptrdiff_t i = begin; i < end; ++i)
                        fill_cone(static_cast<std::size_t>(i));
                    });
  }

  void fill_cone(std::size_t i) {
    const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
    const Index<Dim> index = grid_.node_index(problem_.node[i]);
    Coupling<Dim>& g = problem_.coupling[i];
    g.setZero();
    for_each_cell_of_node(grid_, index, [&](int cell, int corner) {
      if (!order_.empty(cell))
        add_coupling(moments_[static_cast<std::size_t>(cell)], corner, grid_.inverse_spacing(), g);
    });
    open_share_[j] = open_share(grid_.node_position(index));
    problem_.volume[i] = open_share_[j] * grid_.node_volume(index);
    problem_.stress[i] = node_stress_[j];
    // k_i = (v_i − Σ V_p N_i)/(d δt) I: the room that is left
    const double volume = problem_.volume[i];
    const double room = params_.packing.room(volume - material_volume_[j], volume);
    problem_.void_rate[i] = normal_from_mean<Dim>(room / (Dim * time_step_));
    // Next to solids overpacking mostly is what the grid does not resolve: nothing is moved there.
    spreading_.excess[j] =
        open_share_[j] < 1 ? -1 : params_.packing.excess(material_volume_[j] / volume);
    problem_.friction[i] = friction(i);
  }

  /// Share of the volume of the node at x that obstacles and bodies leave to the material.
  double open_share(const Vec<Dim>& x) const {
    double share = 1;
    for (const auto& obstacle : params_.obstacles)
      share *= obstacle->open_share(x, grid_.spacing(), time_);
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      share *= node_in_body(b, x).open_share;
    return std::max(share, least_open_share);
  }

  NodeInSolid<Dim> node_in_body(std::size_t b, const Vec<Dim>& x) const {
    return node_in_solid<Dim>(Placed<Dim>{params_.bodies[b].shape, bodies_[b]}, x, grid_.spacing());
  }

  /// μ̃_i from the velocities and the stress that the problem has.
  double friction(std::size_t i) {
    const std::size_t j = static_cast<std::size_t>(problem_.node[i]);
    if constexpr (RheologyT::rate_dependent) {
      const double rate = strain_rate(problem_, stencil_, i).norm() / material_volume_[j];
      const double share = std::min(1.0, material_volume_[j] / problem_.volume[i]); // φ
      double pressure = share / time_step_ * mean_from_normal<Dim>(problem_.stress[i][0]);
      if (cohesion(i) > 0) // what presses the grains together
        pressure += cohesion(i) / rheology_.friction(0);
      inertial_number_[j] = rheology_.inertial_number()(rate, pressure);
    }
    return cone_friction<Dim>(rheology_.friction(inertial_number_[j]));
  }

  /// Takes μ_i from the velocities and stresses of the last solve. Returns false if they would not
  /// change enough for another one.
  bool update_friction(StepReport& report) {
    move_apex(-1);
    next_friction_.resize(problem_.cones());
    double change2 = 0, sum2 = 0;
    for (std::size_t i = 0; i < problem_.cones(); ++i) {
      next_friction_[i] = friction(i);
      const double pressure = problem_.stress[i][0];
      const double by = (next_friction_[i] - problem_.friction[i]) * pressure;
      const double yield = problem_.friction[i] * pressure;
      change2 += by * by;
      sum2 += yield * yield;
    }
    const double change = sum2 > 0 ? std::sqrt(change2 / sum2) : 0;
    if (report.friction_updates == 1)
      friction_share_ = 1;
    else if (change > report.friction_change / 2) // too slow, or going back and forth
      friction_share_ /= 2;
    report.friction_change = change;
    const bool update = !(change <= params_.friction_tolerance);
    if (update) {
      for (std::size_t i = 0; i < problem_.cones(); ++i)
        problem_.friction[i] += friction_share_ * (next_friction_[i] - problem_.friction[i]);
      ++report.friction_updates;
    }
    move_apex(1);
    return update;
  }

  /// c_i, Pa: where the medium is dense.
  double cohesion(std::size_t i) const {
    if constexpr (Cohesive<RheologyT>)
      return problem_.void_rate[i] <= 0 ? rheology_.cohesion() : 0;
    static_cast<void>(i);
    return 0;
  }

  /// Normal component of δt (c_i/μ_i) I, Pa s: how far the apex of the cone lies from no stress.
  double apex(std::size_t i) const {
    const double c = cohesion(i);
    return c > 0 ? time_step_ * c / problem_.friction[i] : 0;
  }

  /// Cohesion: from λ to the λ' = λ + (c/μ) I that the cone law holds for, or back (sign: ±1). The
  /// velocities stay, so the constant tension becomes a part of u_free.
  void move_apex(double sign) {
    if constexpr (Cohesive<RheologyT>)
      for (std::size_t i = 0; i < problem_.cones(); ++i)
        problem_.stress[i][0] += sign * apex(i);
  }

  /// Nodes where the rheology gave no finite μ ≥ 0, or no μ > 0 where there is cohesion.
  std::size_t count_invalid_friction() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < problem_.cones(); ++i) {
      const double mu = problem_.friction[i];
      count += std::isfinite(mu) && (cohesion(i) > 0 ? mu > 0 : mu >= 0) ? 0 : 1;
    }
    return count;
  }

  /// Solves the dual problem, or says why not.
  void solve(StepReport& report) {
    report.invalid_friction = count_invalid_friction();
    if (report.invalid_friction > 0) {
      report.solve.status = SolveStatus::not_finite;
      return;
    }
    const SolveReport before = report.solve;
    report.solve = solver_.solve(problem_, workspace_, params_.threads);
    report.solve.iterations += before.iterations;
    report.solve.seconds += before.seconds;
  }

  void add_gravity() {
    Wide change = Wide::Zero();
    change.template head<Dim>() = time_step_ * params_.gravity;
    double largest2 = 0;
    for (const int node : node_order_.nodes()) {
      const std::size_t j = static_cast<std::size_t>(node);
      if (material_volume_[j] > 0) {
        largest2 = std::max(largest2, problem_.velocity[j].squaredNorm());
        problem_.velocity[j] += change;
      }
    }
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const double speed =
          bodies_[b].velocity.norm() + bodies_[b].angular_velocity.norm() * body_radius_[b];
      largest2 = std::max(largest2, speed * speed);
      FreeBody<Dim>& body = problem_.bodies[b];
      body.velocity = bodies_[b].velocity + time_step_ * params_.gravity;
      body.angular_velocity = bodies_[b].angular_velocity;
      body.inverse_mass = 1 / params_.bodies[b].mass;
      body.inverse_inertia = in_box(b, body_inverse_inertia_[b]);
    }
    problem_.velocity_scale = std::max(change.norm(), 1e-3 * std::sqrt(largest2));
  }

  /// A tensor of body b from its own frame to the box's.
  Mat<spin> in_box(std::size_t b, const Mat<spin>& tensor) const {
    if constexpr (Dim == 2)
      return tensor;
    else
      return bodies_[b].rotation * tensor * bodies_[b].rotation.transpose();
  }

  /// Calls visit(node number, axis, face) for every node of the box's faces.
  template <class Visit>
  void for_each_face(const Index<Dim>& index, const Visit& visit) const {
    for (int a = 0; a < Dim; ++a) {
      const std::size_t s = static_cast<std::size_t>(a);
      if (index[a] == 0)
        visit(a, false, params_.faces.lower[s]);
      if (index[a] == grid_.cells(a))
        visit(a, true, params_.faces.upper[s]);
    }
  }

  /// u = 0 on sticking faces, u·n = 0 on slipping ones; there the inverse mass is 0 as well.
  void apply_faces() {
    for (const int node : node_order_.nodes()) {
      const std::size_t j = static_cast<std::size_t>(node);
      for_each_face(grid_.node_index(node), [&](int axis, bool, const Face& face) {
        if (face.kind == FaceKind::stick) {
          problem_.velocity[j].setZero();
          problem_.inverse_mass[j].setZero();
        } else if (face.kind == FaceKind::slip) {
          problem_.velocity[j][axis] = 0;
          problem_.inverse_mass[j][axis] = 0;
        }
      });
    }
  }

  /// Gives `contact` the impulse that it had in `last`, from `cursor` on, if it is there. Both
  /// lists are in the order of `key`.
  template <class AnyContact, class Key>
  static void inherit_impulse(AnyContact& contact, const std::vector<AnyContact>& last,
                              std::size_t& cursor, const Key& key) {
    while (cursor < last.size() && key(last[cursor]) < key(contact))
      ++cursor;
    if (cursor < last.size() && key(last[cursor]) == key(contact))
      contact.impulse = last[cursor].impulse;
  }

  /// Contacts of the active nodes with frictional faces and obstacles, with their last impulses.
  void collect_contacts() {
    std::swap(last_contacts_, problem_.contacts);
    problem_.contacts.clear();
    std::size_t last = 0;
    const auto add = [&](Contact<Dim> contact) {
      inherit_impulse(contact, last_contacts_, last, [&](const Contact<Dim>& c) {
        return std::pair(node_rank_[static_cast<std::size_t>(c.node)], c.source);
      });
      problem_.contacts.push_back(contact);
    };
    for (Block& block : problem_.blocks) {
      block.contact_begin = problem_.contacts.size();
      for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
        const int node = problem_.node[i];
        const Wide& inverse_mass = problem_.inverse_mass[static_cast<std::size_t>(node)];
        const Index<Dim> index = grid_.node_index(node);
        for_each_face(index, [&](int axis, bool upper, const Face& face) {
          if (face.kind != FaceKind::frictional || !(inverse_mass[axis] > 0))
            return;
          Contact<Dim> contact;
          contact.node = node;
          contact.source = face_source(axis, upper);
          contact.normal[axis] = upper ? -1 : 1;
          contact.friction = face.friction;
          add(contact);
        });
        if (!(inverse_mass.maxCoeff() > 0))
          continue;
        for (std::size_t o = 0; o < params_.obstacles.size(); ++o) {
          const auto held =
              params_.obstacles[o]->contact(grid_.node_position(index), grid_.spacing(), time_);
          if (!held)
            continue;
          Contact<Dim> contact;
          contact.node = node;
          contact.source = obstacle_source(o);
          contact.normal = held->normal;
          contact.wall_velocity = held->velocity;
          contact.friction = held->friction;
          add(contact);
        }
      }
      block.contact_end = problem_.contacts.size();
    }
  }

  /// Contacts of the free bodies with active nodes, and of their corners with faces.
  void collect_body_contacts() {
    std::swap(last_body_contacts_, problem_.body_contacts);
    problem_.body_contacts.clear();
    std::size_t last = 0;
    const auto add = [&](BodyContact<Dim>& contact) {
      inherit_impulse(contact, last_body_contacts_, last, [&](const BodyContact<Dim>& c) {
        const bool corner = c.node < 0;
        const std::size_t place = corner ? static_cast<std::size_t>(-1 - c.node)
                                         : node_rank_[static_cast<std::size_t>(c.node)];
        return std::tuple(c.body, corner, place, c.source);
      });
      contact.inverse_mass = contact_inverse_mass(problem_, contact);
      problem_.body_contacts.push_back(contact);
    };
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Body<Dim>& body = params_.bodies[b];
      BodyContact<Dim> contact;
      contact.body = static_cast<int>(b);
      contact.source = body_source(b);
      contact.friction = body.friction;
      for (const int node : problem_.node) {
        const std::size_t j = static_cast<std::size_t>(node);
        if (open_share_[j] == 1 || !(problem_.inverse_mass[j].maxCoeff() > 0))
          continue; // too far away, or it cannot move
        const Vec<Dim> x = grid_.node_position(node);
        const NodeInSolid<Dim> seen = node_in_body(b, x);
        if (!seen.contact)
          continue;
        contact.node = node;
        contact.normal = seen.normal;
        contact.arm = x - bodies_[b].position;
        contact.impulse.setZero();
        add(contact);
      }
      for_each_corner_gap(body, bodies_[b], [&](std::size_t c, int axis, bool upper, double gap) {
        if (gap > grid_.spacing()[axis])
          return; // nothing crosses a cell in a step
        const std::size_t s = static_cast<std::size_t>(axis);
        const Face& face = upper ? params_.faces.upper[s] : params_.faces.lower[s];
        BodyContact<Dim> touch;
        touch.node = -1 - static_cast<int>(c);
        touch.source = face_source(axis, upper);
        touch.body = static_cast<int>(b);
        touch.normal[axis] = upper ? 1 : -1;
        touch.arm = bodies_[b].rotation * body.corners[c] + body.corner_radius * touch.normal;
        touch.wall_velocity = -gap / time_step_ * touch.normal; // it may come as near as that
        touch.friction = face.kind == FaceKind::stick        ? body.friction
                         : face.kind == FaceKind::frictional ? face.friction
                                                             : 0;
        add(touch);
      });
    }
  }

  /// Keeps λ per node for the next step's warm start, and for output.
  void keep_stresses() {
    for (std::size_t i = 0; i < problem_.cones(); ++i) {
      Vec<cone_size>& stress = node_stress_[static_cast<std::size_t>(problem_.node[i])];
      stress = problem_.stress[i];
      stress[0] -= apex(i);
    }
  }

  /// What every face, obstacle and body feels: the impulses of its contacts, and on faces that
  /// stick or slip the momentum that the nodes on them would have without them.
  void measure_wrenches() {
    std::fill(wrenches_.begin(), wrenches_.end(), Wrench<Dim>());
    const auto wrench = [&](int source) -> Wrench<Dim>& {
      return wrenches_[static_cast<std::size_t>(source)];
    };
    // gives component a of the momentum of a node to the faces that hold it
    const auto hold = [&](int node, int a, double momentum) {
      const Index<Dim> index = grid_.node_index(node);
      std::array<int, static_cast<std::size_t>(Dim)> sources{};
      std::size_t count = 0;
      bool normal = false;
      for_each_face(index, [&](int axis, bool upper, const Face& face) {
        const bool holds = face.kind == FaceKind::stick || face.kind == FaceKind::slip;
        if (holds && axis == a) {
          sources[0] = face_source(axis, upper);
          count = 1;
          normal = true;
        } else if (!normal && face.kind == FaceKind::stick) {
          sources[count++] = face_source(axis, upper);
        }
      });
      for (std::size_t k = 0; k < count; ++k)
        wrench(sources[k])
            .add(grid_.node_position(index),
                 momentum / static_cast<double>(count) * Vec<Dim>::Unit(a));
    };
    const auto hold_held = [&](int node, const Vec<Dim>& momentum) {
      for (int a = 0; a < Dim; ++a)
        if (problem_.inverse_mass[static_cast<std::size_t>(node)][a] == 0)
          hold(node, a, momentum[a]);
    };

    for (const int node : problem_.node) {
      const std::size_t j = static_cast<std::size_t>(node);
      if (problem_.inverse_mass[j].template head<Dim>().minCoeff() > 0)
        continue;
      const Vec<Dim> before = velocity_before_[j].template head<Dim>();
      Vec<Dim> momentum = node_mass(j) * (before + time_step_ * params_.gravity);
      for (int k = 0; k < Grid<Dim>::neighbours; ++k) {
        const std::size_t other = static_cast<std::size_t>(node + grid_.neighbour_offset(k));
        const int cone = node_cone_[other];
        if (cone < 0)
          continue;
        momentum +=
            vector_to_symmetric<Dim, double>(node_stress_[other]) *
            problem_.coupling[static_cast<std::size_t>(cone)].col(Grid<Dim>::neighbours - 1 - k);
      }
      if constexpr (Viscous<RheologyT>)
        momentum += viscous_solver_.impulse(j);
      hold_held(node, momentum);
    }
    for (const Contact<Dim>& contact : problem_.contacts) {
      wrench(contact.source).add(grid_.node_position(contact.node), -contact.impulse);
      hold_held(contact.node, contact.impulse);
    }
    for (const BodyContact<Dim>& contact : problem_.body_contacts) {
      const std::size_t b = static_cast<std::size_t>(contact.body);
      const Vec<Dim> x = bodies_[b].position + contact.arm;
      wrench(body_source(b)).add(x, -contact.impulse);
      if (contact.node >= 0)
        hold_held(contact.node, contact.impulse);
      else
        wrench(contact.source).add(x, contact.impulse);
    }
    for (Wrench<Dim>& w : wrenches_) {
      w.force /= time_step_;
      w.torque /= time_step_;
    }
  }

  /// The bodies' place and velocities after the step. Without torque J ω stays: ω follows J, which
  /// turns with the body.
  void move_bodies() {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      RigidState<Dim>& body = bodies_[b];
      body.velocity = problem_.bodies[b].velocity;
      body.angular_velocity = problem_.bodies[b].angular_velocity;
      const Spin<Dim> momentum = in_box(b, params_.bodies[b].inertia) * body.angular_velocity;
      body.advance(time_step_);
      if (Dim == 3 && params_.bodies[b].rotates)
        body.angular_velocity = in_box(b, body_inverse_inertia_[b]) * momentum;
    }
  }

  /// v_p, C_p and x_p from the grid's new velocities.
  void grid_to_particles() {
    // A wall lets nothing through, not even what a contact's residual would.
    Vec<Dim> lower = grid_.origin(), upper = grid_.upper();
    for (int a = 0; a < Dim; ++a) {
      const std::size_t s = static_cast<std::size_t>(a);
      if (params_.faces.lower[s].kind == FaceKind::free)
        lower[a] = -std::numeric_limits<double>::infinity();
      if (params_.faces.upper[s].kind == FaceKind::free)
        upper[a] = std::numeric_limits<double>::infinity();
    }
    talus::grid_to_particles(particles_, order_, grid_, transfer_, problem_.velocity,
                             velocity_before_, spreading_, time_step_, lower, upper,
                             params_.threads);
  }

  /// Takes out the particles that passed a free face.
  void remove_outflow(StepReport& report) {
    bool open = false;
    for (std::size_t a = 0; a < static_cast<std::size_t>(Dim); ++a)
      open = open || params_.faces.lower[a].kind == FaceKind::free ||
             params_.faces.upper[a].kind == FaceKind::free;
    if (!open)
      return;
    const Vec<Dim> lower = grid_.origin(), upper = grid_.upper();
    std::size_t kept = 0;
    for (std::size_t p = 0; p < particles_.size(); ++p) {
      const Vec<Dim>& x = particles_.position[p];
      if ((x.array() >= lower.array()).all() && (x.array() <= upper.array()).all()) {
        if (kept != p)
          particles_.copy(kept, particles_, p);
        ++kept;
      } else {
        ++report.outflow;
        report.outflow_volume += particles_.volume[p];
      }
    }
    particles_.resize(kept);
  }

  Params params_;
  Grid<Dim> grid_;
  RheologyT rheology_;
  TransferT transfer_;
  SolverT solver_;
  Stencil<Dim> stencil_;
  BlockOrder<Dim> node_order_;
  std::vector<std::size_t> node_rank_; ///< place of a node in node_order_
  ParticleData particles_;
  std::vector<RigidState<Dim>> bodies_;         ///< #bodies
  std::vector<double> body_radius_;             ///< of their corners, #bodies, m
  std::vector<Mat<spin>> body_inverse_inertia_; ///< in their own frames, #bodies
  double time_ = 0;
  std::size_t steps_ = 0;
  double time_step_ = 0; ///< δt of this step, s

  // Workspace, and what one step leaves for the next.
  CellOrder<Dim> order_;
  std::vector<CellMoments<Dim>> moments_;     ///< #cells
  std::vector<double> material_volume_;       ///< Σ V_p N_i, #nodes, m^d
  std::vector<NodeVec<Dim>> velocity_before_; ///< u*, #nodes, m/s
  std::vector<Vec<cone_size>> node_stress_;   ///< λ, #nodes, Pa s
  std::vector<double> inertial_number_;       ///< #nodes
  std::vector<double> open_share_;            ///< of a node's volume, #nodes
  Spreading spreading_;                       ///< of what is overpacked
  std::vector<int> node_cone_;                ///< the cone of a node or −1, #nodes
  std::vector<Wrench<Dim>> wrenches_;         ///< #faces + #obstacles + #bodies
  std::vector<Contact<Dim>> last_contacts_;
  std::vector<BodyContact<Dim>> last_body_contacts_;
  DualProblem<Dim> problem_;
  typename SolverT::template Workspace<Dim> workspace_;
  ViscousSolver<Dim> viscous_solver_;
  std::vector<double> next_friction_; ///< μ̃, #cones
  double friction_share_ = 1;         ///< of the way to next_friction_ that an update goes
};

// Not in the class, which would make it inline: extern templates (talus/precompiled.hpp) save
// nothing of what is inline.
template <int Dim, Rheology RheologyT, TransferScheme<Dim> TransferT, Solver<Dim> SolverT,
          class ParticleReal>
StepReport Simulation<Dim, RheologyT, TransferT, SolverT, ParticleReal>::step() {
  return step([](const DualProblem<Dim>&) {});
}

} // namespace talus
