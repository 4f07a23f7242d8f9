// SPDX-License-Identifier: MIT
// The program of docs/tutorial.md, step by step.

#include <talus/talus.hpp>

#include <talus/dual/body_contact.hpp>
#include <talus/dual/contact_law.hpp>
#include <talus/dual/operator.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

// [params]
using Heap = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>;

template <class Sim>
typename Sim::Params heap_params() {
  typename Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {40, 20}}; // m
  params.material.density = 1500;                                          // kg/m³, dense
  params.gravity = {0, -9.81};                                             // m/s²
  params.time_step = 1e-3;                                                 // s
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[1] = {talus::FaceKind::open};
  return params;
}
// [params]

// [particles]
talus::Particles<2> heap_particles(const talus::Grid<2>& grid) {
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, grid, {0, 0}, {0.1, 0.1}, {.per_axis = 3});
  return sand;
}
// [particles]

// [run]
template <class Sim>
double front_after(Sim& sim, double seconds) {
  while (sim.time() < seconds) {
    const talus::StepReport report = sim.step();
    if (!report.completed()) {
      std::printf("t = %.3f s: stopped, numbers are not finite\n", sim.time());
      break;
    }
  }
  return talus::front_position(talus::measure_profile(sim), 0.01); // where it is 1 cm high
}
// [run]

// [own-law]
/// Friction that weakens with the rate: μ(I) = μ_0 − Δμ min(I/I_w, 1).
struct Weakening {
  double mu_0 = 0.5, drop = 0.1, I_w = 0.1;
  double operator()(double I) const { return mu_0 - drop * std::min(I / I_w, 1.0); }
};
using WeakeningFriction = talus::FrictionLaw<Weakening>;
// [own-law]

// [own-solver]
/// Plain sweeps over the cones, each solved exactly for the non-associated law, with the others
/// frozen. One thread; keeps the velocities consistent, as every solver must.
class PlainSweeps {
 public:
  struct Params {
    double tolerance = 1e-3; ///< of the l2 residual
    int max_sweeps = 500;
  };
  template <int Dim>
  struct Workspace {
    std::vector<talus::Mat<talus::symmetric_size<Dim>>> diagonal; ///< W_ii, #cones
    std::vector<double> inverse_scale;                            ///< s/tr W_ii, #cones
    talus::ResidualMeter<Dim> meter;
  };

  explicit PlainSweeps(const Params& params) : params_(params) {
    talus::require_positive("solver.tolerance", params_.tolerance);
  }

  template <int Dim>
  talus::SolveReport solve(talus::DualProblem<Dim>& problem, Workspace<Dim>& work,
                           const talus::Execution& execution) const {
    constexpr int s = talus::symmetric_size<Dim>;
    const talus::Stencil<Dim> stencil(problem.grid);
    work.diagonal.resize(problem.cones());
    work.inverse_scale.resize(problem.cones());
    for (std::size_t i = 0; i < problem.cones(); ++i) {
      work.diagonal[i] = talus::diagonal_block(problem, stencil, i);
      const double trace = work.diagonal[i].trace();
      work.inverse_scale[i] = trace > 0 ? s / trace : 0;
    }

    talus::SolveReport report;
    report.status = talus::SolveStatus::not_converged;
    while (report.iterations < params_.max_sweeps) {
      for (std::size_t i = 0; i < problem.cones(); ++i) {
        talus::Vec<s> gamma = talus::integrated_strain_rate(problem, stencil, i);
        gamma[0] += problem.free_volume_rate[i];
        const talus::Vec<s> old = problem.stress_impulse[i], b = gamma - work.diagonal[i] * old;
        talus::solve_local(talus::SecularSolver{}, talus::CoulombLaw{}, work.diagonal[i], b,
                           problem.opening[i], problem.stress_impulse[i]);
        talus::scatter_stress<Dim>(problem, stencil, i, problem.stress_impulse[i] - old);
      }
      for (talus::Contact<Dim>& contact : problem.contacts)
        talus::update_contact(problem, contact);
      talus::update_body_contacts(problem);
      ++report.iterations;

      report.residual = work.meter(problem, stencil, work.inverse_scale, execution);
      if (!report.residual.finite())
        report.status = talus::SolveStatus::not_finite;
      else if (report.residual.l2 <= params_.tolerance)
        report.status = talus::SolveStatus::converged;
      if (report.status != talus::SolveStatus::not_converged)
        break;
    }
    return report;
  }

 private:
  Params params_;
};
static_assert(talus::Solver<PlainSweeps, 2> && talus::Solver<PlainSweeps, 3>);
// [own-solver]

int main() {
  // [first-run]
  Heap::Params params = heap_params<Heap>();
  params.rheology.mu = 0.44;
  Heap heap(params, heap_particles(talus::Grid<2>(params.grid)));
  std::printf("front: %.3f m\n", front_after(heap, 0.2));
  // [first-run]

  // [profile]
  talus::CsvWriter table("profile.csv", {"x_m", "height_m"});
  const talus::Profile profile = talus::measure_profile(heap);
  for (std::size_t i = 0; i < profile.x.size(); ++i)
    table.row(profile.x[i], profile.height[i]);
  table.close();

  talus::write_vtk_particles<2>(
      "heap.vtp", heap.particles().position,
      {talus::vtk_field("velocity", heap.particles().velocity),
       talus::vtk_field("pressure", talus::at_particles(heap, [&](const talus::Index<2>& node) {
                          return heap.pressure(node);
                        }))});
  // [profile]

  // [mistake]
  try {
    params.time_step = 0;
    const Heap wrong(params, heap_particles(talus::Grid<2>(params.grid)));
  } catch (const std::invalid_argument& error) {
    std::printf("%s\n", error.what()); // time_step is 0; allowed: a finite number > 0
  }
  // [mistake]

  // [use-law]
  using Weak = talus::Simulation<2, WeakeningFriction, talus::PolyPic, talus::GaussSeidel<>>;
  Weak::Params weak_params = heap_params<Weak>();
  weak_params.rheology.law = {.mu_0 = 0.5, .drop = 0.2, .I_w = 0.05};
  weak_params.rheology.inertial = {.grain_diameter = 5e-4, .density = 2500, .strain_factor = 1};
  Weak weak(weak_params, heap_particles(talus::Grid<2>(weak_params.grid)));
  std::printf("front, with friction that weakens: %.3f m\n", front_after(weak, 0.2));
  // [use-law]

  // [use-solver]
  using Plain = talus::Simulation<2, talus::ConstantFriction, talus::PolyPic, PlainSweeps>;
  Plain::Params plain_params = heap_params<Plain>();
  plain_params.rheology.mu = 0.44;
  Plain plain(plain_params, heap_particles(talus::Grid<2>(plain_params.grid)));
  std::printf("front, with plain sweeps: %.3f m\n", front_after(plain, 0.2));
  // [use-solver]
}
