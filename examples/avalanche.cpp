// SPDX-License-Identifier: MIT
//
// A level bed is tilted until it avalanches: its surface must follow the box up to the friction
// angle and stay at that angle ever after (Rousseau et al., J. Fluid Mech. 2023). Leaves
// summary.json, tables of angles and sections, and a picture.

#include "support/command_line.hpp"
#include "support/picture.hpp"
#include "support/ranks.hpp"
#include "support/run.hpp"
#include "support/run_picture.hpp"

#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/tilted_box.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace {

using nlohmann::json;

// A surface that is steeper than the friction angle by δ accelerates by about g δ. If nothing is
// faster than 5 mm/s throughout half a second, δ is less than 0.06°. Single grains on the surface
// creep at some mm/s for ever, so that a lower threshold would wait for noise.
constexpr double rest_speed = 5e-3;    // m/s
constexpr double rest_hold = 0.5;      // s
constexpr double patience = 30;        // s that a tilt may take to come to rest
constexpr double movie_interval = 0.1; // s between frames: how long the run lasts is not known
constexpr double fit_from = 0.3, fit_to = 0.7; // m: the ends influence the surface beyond

struct Options {
  std::string resolution = "coarse";
  int dimension = 2;
  double friction = 0.44, step = 0.5;
  std::optional<double> from, to;
  int per_axis = 6;
  double jitter = 0;
  talus::Packing packing{};
  double tolerance = talus::GaussSeidel<>::Params{}.tolerance;
  support::RunOptions run{.sample_interval = 0.05, .snapshot_interval = 1};
};

double degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

/// Angle of the free surface to the horizontal, degrees: of a line through its heights in the
/// middle of the box. Along the middle of the channel.
template <class Sim>
double surface_angle(const Sim& sim, double tilt_deg) {
  const int row = Sim::dimension == 3 ? sim.grid().cells(1) / 2 : 0;
  const talus::Profile profile = talus::measure_profile(sim, row);
  std::vector<double> x, height;
  for (std::size_t i = 0; i < profile.x.size(); ++i)
    if (profile.x[i] >= fit_from && profile.x[i] <= fit_to) {
      x.push_back(profile.x[i]);
      height.push_back(profile.height[i]);
    }
  return tilt_deg - degrees(std::atan(talus::fit_line(x, height).slope));
}

template <int Dim>
int run(const Options& options) {
  using Sim = support::OnRanks<
      talus::Simulation<Dim, talus::ConstantFriction, talus::PolyPic, talus::GaussSeidel<>>>;
  const bool reference = options.resolution == "reference";
  const double friction_angle = degrees(std::atan(options.friction));
  // Whole multiples of the step around the friction angle.
  const auto whole = [&](double angle) { return options.step * std::floor(angle / options.step); };
  const double first = options.from.value_or(whole(friction_angle - (reference ? 3 : 1)));
  const double last = options.to.value_or(whole(friction_angle + (reference ? 6.5 : 2)));
  if (!(last >= first))
    talus::throw_invalid("--to", last, "at least --from, " + talus::text_of(first));

  const talus::TiltedBoxSetup setup;
  setup.validate();
  typename Sim::Params params;
  using Cells = talus::Index<3>; // along, across, up
  if constexpr (Dim == 2)
    params.grid = setup.grid<Dim>(reference ? Cells{250, 1, 150} : Cells{100, 1, 60});
  else
    params.grid = setup.grid<Dim>(reference ? Cells{100, 10, 30} : Cells{50, 5, 15});
  params.material.density = 1470;
  params.gravity = setup.gravity_vector<Dim>(first);
  params.time_step = 1e-3;
  params.faces = setup.faces<Dim>();
  params.rheology.mu = options.friction;
  params.solver.tolerance = options.tolerance;
  params.threads = options.run.common.threads;
  params.packing = options.packing;
  support::watch_budget<Sim>(options.run, params);
  // Few particles, or random positions, leave soft spots that creep below the friction angle.
  const talus::Seeding seeding{.per_axis = options.per_axis, .jitter = options.jitter};
  Sim sim(params, setup.particles<Dim>(talus::Grid<Dim>(params.grid), seeding));

  json cells = json::array();
  for (int a = 0; a < Dim; ++a)
    cells.push_back(params.grid.cells[a]);
  const json inputs = {{"resolution", options.resolution},
                       {"dimension", Dim},
                       {"friction", options.friction},
                       {"tilts_deg", {first, last, options.step}},
                       {"cells", cells},
                       {"particles", sim.particles().size()},
                       {"particles_per_cell_edge", seeding.per_axis},
                       {"jitter", seeding.jitter},
                       {"packing_slack", params.packing.slack},
                       {"packing_dilatancy", params.packing.dilatancy},
                       {"packing_even", params.packing.even},
                       {"packing_surfaces", params.packing.surfaces},
                       {"time_step_s", params.time_step},
                       {"tolerance", options.tolerance},
                       {"rest_speed_m_s", rest_speed},
                       {"rest_hold_s", rest_hold}};
  const double steps = std::floor((last - first) / options.step + 1e-9); // none beyond --to
  if (!(steps < 1e5))
    talus::throw_invalid("--step", options.step, "so large that there are at most 100000 tilts");
  const int tilts = 1 + static_cast<int>(steps);
  support::RunOptions run_options = options.run;
  run_options.end_time = tilts * (patience + params.time_step); // at the latest
  if (run_options.movie)
    run_options.snapshot_interval = std::min(run_options.snapshot_interval, movie_interval);
  support::Run run(sim, "avalanche", run_options, inputs);
  if (run.finished())
    return 0;
  int done = 0;                  // tilts that are over
  double since = 0, fastest = 0; // s, m/s: of this tilt
  talus::RestDetector rest(rest_speed, rest_hold);
  run.keep("done", done);
  run.keep("since", since);
  run.keep("fastest", fastest);
  run.keep(
      "last_motion", [&] { return json(rest.last_motion()); },
      [&](const json& time) { rest.update(time, std::numeric_limits<double>::infinity()); });
  auto& angles =
      run.series("angles.csv", {"tilt_deg", "surface_deg", "expected_deg", "seconds_to_rest_s",
                                "speed_max_m_s", "speed_at_rest_m_s"});
  auto& motion = run.series("motion.csv", {"time_s", "tilt_deg", "surface_deg", "speed_max_m_s"});
  while (run.advance()) {
    const double tilt = first + done * options.step;
    const double time = run.time() - since, speed = talus::largest_speed(sim);
    fastest = std::max(fastest, speed);
    rest.update(time, speed);
    run.text = support::text("%.1f°, %.2f s, fastest %.1e m/s, %d sweeps", tilt, time, speed,
                             run.report().solve.iterations);
    run.done = (done + std::min(1.0, time / 3)) / tilts;
    if (run.sample_due())
      motion.row(run.time_before(), tilt, surface_angle(sim, tilt), speed);
    if (!rest.at_rest() && time <= patience)
      continue;
    angles.row(tilt, surface_angle(sim, tilt), std::min(tilt, friction_angle),
               rest.at_rest() ? rest.last_motion() : std::numeric_limits<double>::quiet_NaN(),
               fastest, speed);
    if (++done == tilts) {
      run.stop();
    } else {
      since = run.time();
      fastest = 0;
      rest = talus::RestDetector(rest_speed, rest_hold);
      sim.set_gravity(setup.gravity_vector<Dim>(first + done * options.step));
    }
  }

  using support::Values;
  const Values &tilt = angles["tilt_deg"], &surface = angles["surface_deg"],
               &expected = angles["expected_deg"], &to_rest = angles["seconds_to_rest_s"];
  Values deviation;
  double worst = 0, at_rest = 0;
  std::string moving; // tilts
  for (std::size_t i = 0; i < tilt.size(); ++i) {
    deviation.push_back(surface[i] - expected[i]);
    worst = std::max(worst, std::abs(deviation.back()));
    at_rest = std::max(at_rest, angles["speed_at_rest_m_s"][i]);
    if (std::isnan(to_rest[i]))
      moving += (moving.empty() ? "" : ", ") + support::text("%g°", tilt[i]);
  }
  if (!moving.empty() && run.status == "completed")
    run.status = support::text("not at rest after %g s: ", patience) + moving;
  run.write_summary({{"measured",
                      {{"friction_angle_deg", friction_angle},
                       {"largest_deviation_deg", worst},
                       {"speed_at_rest_m_s", at_rest},
                       {"tilt_deg", tilt},
                       {"surface_deg", surface}}}});
  if (!options.run.common.quiet) {
    std::printf("tilt, surface, difference from the expected angle (degrees), at rest after (s)\n");
    for (std::size_t i = 0; i < tilt.size(); ++i)
      std::printf("%5.1f %7.2f %+6.2f %6.2f\n", tilt[i], surface[i], deviation[i], to_rest[i]);
    std::printf("%s; largest difference %.2f degrees\n", run.status.c_str(), worst);
  }

  support::Panel both({.title = "Surface against tilt",
                       .x = "tilt of the box θ (°)",
                       .y = "angle of the surface at rest φ (°)"});
  both.add("line", "φ = min(θ, atan μ)", tilt, expected);
  both.add("points", "talus", tilt, surface);
  support::Panel differences({.title = "The same, from the expected angle",
                              .x = "tilt of the box θ (°)",
                              .y = "φ − min(θ, atan μ) (°)"});
  differences.band("± 0.1°", {first, last}, {-0.1, -0.1}, {0.1, 0.1});
  differences.add("points", "talus", tilt, deviation);
  support::write_panels(run.folder(), "avalanche",
                        support::text("Avalanche test, %d-D, %s resolution, μ = %g", Dim,
                                      options.resolution.c_str(), options.friction),
                        {both, differences});
  const int status = run.finish("plot_study.py");
  return status == 0 && run.status != "completed" ? 1 : status;
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("A level bed is tilted until it avalanches (Rousseau et al. 2023).");
  app.add_option("--dim", options.dimension, "Dimension")
      ->check(CLI::IsMember({2, 3}))
      ->capture_default_str();
  app.add_option("--resolution", options.resolution,
                 "coarse: angles around the friction angle only; reference: the paper's grid")
      ->check(CLI::IsMember({"coarse", "reference"}))
      ->capture_default_str();
  app.add_option("--friction", options.friction, "Friction coefficient μ")->capture_default_str();
  app.add_option("--from", options.from, "First tilt, degrees");
  app.add_option("--to", options.to, "Last tilt, degrees");
  app.add_option("--step", options.step, "Of the tilt, degrees")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--particles-per-edge", options.per_axis, "Particles along a cell's edge")
      ->capture_default_str();
  app.add_option("--jitter", options.jitter, "Of the lattice of particles, 0 to 1")
      ->capture_default_str();
  app.add_option("--packing-slack", options.packing.slack, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-dilatancy", options.packing.dilatancy, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-even", options.packing.even, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-surfaces", options.packing.surfaces, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--tolerance", options.tolerance, "Solver: relative residual")
      ->capture_default_str();
  support::add_snapshot_options(app, options.run);
  support::add_resume_options(app, options.run.resume);
  support::add_common_options(app, options.run.common, "out/avalanche");
  return support::run_program(
      app, argc, argv, [&] { return options.dimension == 2 ? run<2>(options) : run<3>(options); });
}
