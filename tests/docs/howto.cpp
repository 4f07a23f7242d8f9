// SPDX-License-Identifier: MIT
// The programs of docs/how-to: a scene of one's own, files for ParaView, checkpoints, and what to
// do when the solver does not converge.

#include <talus/talus.hpp>

#include <talus/io/problem_file.hpp>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <numbers>

// [ramp]
/// A plane through `point` with the unit vector `normal` into the material: a ramp at rest.
class Ramp : public talus::Obstacle<2> {
 public:
  Ramp(const talus::Vec<2>& point, const talus::Vec<2>& normal, double friction)
      : point_(point), normal_(normal), friction_(friction) {}

  std::optional<talus::ObstacleContact<2>> contact(const talus::Vec<2>& x, const talus::Vec<2>&,
                                                   double) const override {
    if ((x - point_).dot(normal_) > 0)
      return std::nullopt; // above the plane: free
    return talus::ObstacleContact<2>{
        .normal = normal_, .velocity = talus::Vec<2>::Zero(), .friction = friction_};
  }

 private:
  talus::Vec<2> point_, normal_;
  double friction_;
};
// [ramp]

using Sim = talus::Simulation<2, talus::MuOfI, talus::PolyPic, talus::GaussSeidel<>>;

Sim make_scene() {
  // [scene]
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.5, 0.3}, .cells = {50, 30}}; // m
  params.material.density = 1540;                                          // kg/m³, dense
  params.gravity = {0, -9.81};                                             // m/s²
  params.time_step = 1e-3;                                                 // s
  params.rheology = {.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279},
                     .inertial = {.grain_diameter = 5e-4, .density = 2500, .strain_factor = 2}};
  params.faces.lower[0] = {talus::FaceKind::frictional, 0.3};
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[0] = {talus::FaceKind::open}; // what passes it is gone
  params.faces.upper[1] = {talus::FaceKind::open};

  const double angle = std::numbers::pi / 6;
  params.obstacles.push_back(talus::make_obstacle<Ramp>(
      talus::Vec<2>(0.2, 0), talus::Vec<2>(std::sin(angle), std::cos(angle)), 0.4));

  const talus::Grid<2> grid(params.grid);
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, grid, {0.02, 0.14}, {0.12, 0.26}, {.per_axis = 3, .seed = 7});
  Sim sim(params, sand);
  // [scene]
  return sim;
}

// [vtk]
void write_frame(const Sim& sim, const std::filesystem::path& file) {
  talus::write_vtk_particles<2>(file, sim.particles().position,
                                {talus::vtk_field("id", sim.particles().id),
                                 talus::vtk_field("velocity", sim.particles().velocity),
                                 talus::vtk_field("volume", sim.particles().volume)});
}
// [vtk]

// [stop-signal]
volatile std::sig_atomic_t stop_requested = 0;
extern "C" void request_stop(int) {
  stop_requested = 1;
}
// [stop-signal]

int main() {
  try {
    Sim sim = make_scene();

    // [checkpoint]
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) // SIGHUP: its terminal was closed
      std::signal(signal, request_stop);
    const std::filesystem::path checkpoint = "run.talus";
    if (std::filesystem::exists(checkpoint))
      talus::read_checkpoint(checkpoint, sim); // throws if it does not fit this simulation
    while (sim.time() < 0.1 && !stop_requested) {
      if (!sim.step().completed())
        return 1;
      if (sim.steps() % 50 == 0)
        talus::write_checkpoint(checkpoint, sim);
    }
    talus::write_checkpoint(checkpoint, sim);
    // [checkpoint]

    // [vtk-series]
    talus::VtkSeries series("ramp.pvd");
    for (int frame = 0; frame < 3; ++frame) {
      const std::string file = "ramp_" + std::to_string(frame) + ".vtu";
      write_frame(sim, file);
      series.add(sim.time(), file);
      for (int n = 0; n < 10; ++n)
        if (!sim.step().completed())
          return 1;
    }
    // [vtk-series]

    // [measure]
    const talus::StrainRate strain_rate(sim); // at the nodes, of the last step
    double fastest = 0;
    for (int node = 0; node < sim.grid().node_count(); ++node)
      fastest = std::max(fastest, strain_rate.norm(sim.grid().node_index(node)));
    std::printf("largest shear rate: %.1f 1/s\n", 2 * fastest);
    std::printf("through x = 0.1 m flow %.2e m2/s\n", talus::section_flux(sim, 0, 0.1));
    // [measure]

    // [record-problem]
    const talus::StepReport recorded = sim.step([](const talus::DualProblem<2>& problem) {
      talus::write_problem("step.talus", problem); // as the solver gets it
    });
    // [record-problem]

    // [not-converged]
    const talus::StepReport report = sim.step();
    switch (report.solve.status) {
    case talus::SolveStatus::converged:
      break;
    case talus::SolveStatus::not_converged: // the step was taken; how bad is it?
      std::printf("t = %.4f s: residual %.1e after %d sweeps\n", sim.time(),
                  report.solve.residual.l2, report.solve.iterations);
      break;
    case talus::SolveStatus::not_finite: // the step was refused: particles and time are as before
      std::printf("t = %.4f s: %s\n", sim.time(), std::string(report.why()).c_str());
      return 1;
    }
    // [not-converged]

    std::printf("t = %.3f s, %zu particles, fastest %.2f m/s, %zu cones in step.talus\n",
                sim.time(), sim.particles().size(), talus::largest_speed(sim), recorded.cones);
    return recorded.completed() ? 0 : 1;
    // [errors]
  } catch (const std::exception& error) { // a wrong parameter, or a file
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  // [errors]
}
