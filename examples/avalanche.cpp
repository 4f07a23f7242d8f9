// SPDX-License-Identifier: MIT
//
// A level bed is tilted until it avalanches: its surface must follow the box up to the friction
// angle and stay at that angle ever after (Rousseau et al., J. Fluid Mech. 2023). Leaves
// summary.json, tables of angles and profiles, and a picture.

#include "support/command_line.hpp"
#include "support/picture.hpp"
#include "support/results.hpp"
#include "support/resume.hpp"

#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/io/csv.hpp"
#include "talus/io/progress.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/tilted_box.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using nlohmann::json;

// A surface that is steeper than the friction angle by δ accelerates by about g δ. If nothing is
// faster than 5 mm/s throughout half a second, δ is less than 0.06°. Single grains on the surface
// creep at some mm/s for ever, so that a lower threshold would wait for noise.
constexpr double rest_speed = 5e-3;            // m/s
constexpr double rest_hold = 0.5;              // s
constexpr double patience = 30;                // s that a tilt may take to come to rest
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
  support::ResumeOptions resume;
  support::CommonOptions common;
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
  params.threads = options.common.threads;
  params.packing = options.packing;
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
  const support::fs::path out = options.common.prepare_out();
  support::Checkpoints checkpoints(out, options.resume, inputs);
  if (checkpoints.finished()) {
    if (!options.common.quiet)
      std::printf("%s: finished already\n", (out / "summary.json").c_str());
    return 0;
  }

  struct State { // what a run hands on, besides the simulation
    int tilt = 0;
    double since = 0; // the time at which this tilt began, s
    double last_motion = 0, fastest = 0;
    json rows = json::array(); // one for each tilt: see the columns of angles.csv
    double seconds = 0;
  } state;
  support::SolverStatistics statistics;
  if (const std::optional<json> earlier = checkpoints.resume(sim)) {
    state = {earlier->at("tilt"),    earlier->at("since"), earlier->at("last_motion"),
             earlier->at("fastest"), earlier->at("rows"),  earlier->at("seconds")};
    statistics.restore(earlier->at("statistics"));
  }
  const support::Stopwatch stopwatch;
  const auto save = [&] {
    checkpoints.save(sim, {{"tilt", state.tilt},
                           {"since", state.since},
                           {"last_motion", state.last_motion},
                           {"fastest", state.fastest},
                           {"rows", state.rows},
                           {"statistics", statistics.state()},
                           {"seconds", state.seconds + stopwatch.seconds()}});
  };

  const auto write_table = [&] { // after each tilt: a run may take hours
    talus::CsvWriter table(out / "angles.csv",
                           {"tilt_deg", "surface_deg", "expected_deg", "seconds_to_rest_s",
                            "speed_max_m_s", "speed_at_rest_m_s"});
    for (const json& row : state.rows) {
      std::vector<double> values;
      for (const json& value : row)
        values.push_back(support::value_or_nan(value));
      table.row(values);
    }
    table.close();
  };
  talus::Progress progress("avalanche", {.quiet = options.common.quiet});
  const int tilts = 1 + static_cast<int>(std::lround((last - first) / options.step));
  std::string status = "completed";
  bool completed_one = false;
  for (; state.tilt < tilts && status == "completed"; ++state.tilt) {
    const double tilt = first + state.tilt * options.step;
    sim.set_gravity(setup.gravity_vector<Dim>(tilt));
    talus::RestDetector rest(rest_speed, rest_hold);
    rest.update(state.last_motion, rest_speed * 2);
    double speed = 0;
    while (true) {
      const talus::StepReport report = sim.step();
      statistics.add(report);
      if (!report.completed()) {
        if (!completed_one) // there is nothing to measure
          throw std::runtime_error("the first step failed: " + std::string(report.why()));
        status = "failed: " + std::string(report.why());
        break;
      }
      completed_one = true;
      const double time = sim.time() - state.since;
      speed = talus::largest_speed(sim);
      state.fastest = std::max(state.fastest, speed);
      rest.update(time, speed);
      state.last_motion = rest.last_motion();
      char text[96];
      std::snprintf(text, sizeof text, "%.1f°, %.2f s, fastest %.1e m/s, %d sweeps", tilt, time,
                    speed, report.solve.iterations);
      progress.update((state.tilt + std::min(1.0, time / 3)) / tilts, text);
      if (rest.at_rest())
        break;
      if (time > patience) {
        status = "not at rest after " + std::to_string(patience) + " s";
        break;
      }
      if (support::interrupted()) {
        save();
        progress.finish("interrupted");
        std::fprintf(stderr, "to go on: the same command with --resume\n");
        return 130;
      }
      if (checkpoints.due())
        save();
    }
    state.rows.push_back({tilt, surface_angle(sim, tilt), std::min(tilt, friction_angle),
                          rest.at_rest() ? json(state.last_motion) : json(nullptr), state.fastest,
                          speed});
    write_table();
    state.since = sim.time();
    state.last_motion = state.fastest = 0;
  }
  progress.finish(status);

  support::Values tilt, surface, expected, deviation, at_rest;
  double worst = 0;
  for (const json& row : state.rows) {
    tilt.push_back(row[0]);
    surface.push_back(row[1]);
    expected.push_back(row[2]);
    deviation.push_back(surface.back() - expected.back());
    at_rest.push_back(row[5]);
    worst = std::max(worst, std::abs(deviation.back()));
  }

  json summary = {{"program", "avalanche"},
                  {"versions", support::versions()},
                  {"status", status},
                  {"inputs", checkpoints.inputs()},
                  {"threads", params.threads},
                  {"measured",
                   {{"friction_angle_deg", friction_angle},
                    {"largest_deviation_deg", worst},
                    {"speed_at_rest_m_s", *std::max_element(at_rest.begin(), at_rest.end())},
                    {"tilt_deg", tilt},
                    {"surface_deg", surface}}},
                  {"solver", statistics.solver_json()},
                  {"seconds", statistics.phase_json()},
                  {"steps", sim.steps()},
                  {"wall_seconds", state.seconds + stopwatch.seconds()},
                  {"state_checksum", talus::state_checksum(sim.particles())}};
  support::write_json(out / "summary.json", summary);
  if (!options.common.quiet) {
    std::printf("tilt, surface, difference from the expected angle (degrees), at rest after (s)\n");
    for (std::size_t i = 0; i < tilt.size(); ++i)
      std::printf("%5.1f %7.2f %+6.2f %6.2f\n", tilt[i], surface[i], deviation[i],
                  support::value_or_nan(state.rows[i][3]));
    std::printf("%s; largest difference %.2f degrees\n", status.c_str(), worst);
    statistics.print(sim.steps(), state.seconds + stopwatch.seconds());
  }

  const support::Values range = {tilt.front(), tilt.back()};
  support::Panel angles({.title = "Surface against tilt",
                         .x = "tilt of the box θ (°)",
                         .y = "angle of the surface at rest φ (°)"});
  angles.add("line", "φ = min(θ, atan μ)", tilt, expected);
  angles.add("points", "talus", tilt, surface);
  support::Panel differences({.title = "The same, from the expected angle",
                              .x = "tilt of the box θ (°)",
                              .y = "φ − min(θ, atan μ) (°)"});
  differences.band("± 0.1°", range, {-0.1, -0.1}, {0.1, 0.1});
  differences.add("points", "talus", tilt, deviation);
  char title[96];
  std::snprintf(title, sizeof title, "Avalanche test, %d-D, %s resolution, μ = %g", Dim,
                options.resolution.c_str(), options.friction);
  support::draw_panels(options.common, "avalanche", title, {angles, differences});
  checkpoints.finish(status);
  return status == "completed" ? 0 : 1;
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
  support::add_resume_options(app, options.resume);
  support::add_common_options(app, options.common, "out/avalanche");
  return support::run_program(
      app, argc, argv, [&] { return options.dimension == 2 ? run<2>(options) : run<3>(options); });
}
