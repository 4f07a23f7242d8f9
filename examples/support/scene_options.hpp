// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"
#include "run.hpp"

#include "talus/boundary/faces.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>

/// \file
/// Options of the programs that show one scene each, and the simulation that goes with them.

namespace support {

/// The simulation of these programs: one law, one solver, so that they compile fast.
template <int Dim, class Solver = talus::GaussSeidel<>>
using SceneSimulation =
    OnRanks<talus::Simulation<Dim, talus::ConstantFriction, talus::PolyPic, Solver>>;

/// What it holds when add_scene_options is called is the default.
struct SceneOptions {
  int dimension = 2;
  double cell = 0.01; ///< m
  double friction = 0.44, wall_friction = 0.23;
  double density = 1500;             ///< kg/m³
  std::optional<double> time_step{}; ///< s; else 0.05 sqrt(cell/g)
  talus::Seeding seeding{};
  talus::Packing packing{};
  RunOptions run{};
};

inline void add_scene_options(CLI::App& app, SceneOptions& options,
                              const std::string& default_out) {
  using Pattern = talus::Seeding::Pattern;
  static const std::map<std::string, Pattern> patterns{{"jittered", Pattern::jittered},
                                                       {"random", Pattern::random},
                                                       {"blue-noise", Pattern::blue_noise}};
  app.add_option("--cell", options.cell, "Edge of a cell, m")->capture_default_str();
  auto* step = app.add_option("--time-step", options.time_step,
                              options.time_step ? "s" : "s; default: 0.05 sqrt(cell/g)");
  if (options.time_step)
    step->default_str(talus::text_of(*options.time_step));
  app.add_option("--friction", options.friction, "Of the material")->capture_default_str();
  app.add_option("--wall-friction", options.wall_friction, "Of the walls")->capture_default_str();
  app.add_option("--packing-slack", options.packing.slack, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-dilatancy", options.packing.dilatancy, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-even", options.packing.even, "See talus::Packing")
      ->capture_default_str();
  app.add_option("--packing-surfaces", options.packing.surfaces, "See talus::Packing")
      ->capture_default_str();
  // no transform: it would leave a number in the place of the word, another than the default's
  app.add_option_function<std::string>(
         "--seeding",
         [&options](const std::string& name) { options.seeding.pattern = patterns.at(name); },
         "Initial positions")
      ->check(CLI::IsMember(patterns))
      ->default_str("jittered");
  app.add_option("--jitter", options.seeding.jitter, "Of the lattice, 0 to 1")
      ->capture_default_str();
  app.add_option("--particles-per-edge", options.seeding.per_axis, "Along a cell's edge")
      ->capture_default_str();
  app.add_option("--seed", options.seeding.seed, "Of the random numbers")->capture_default_str();
  add_run_options(app, options.run, default_out);
}

/// A box of the given size (along, across, up; m) with frictional walls, a rough floor and an open
/// top, under gravity; the law is set where it is one constant.
template <int Dim, class Sim = SceneSimulation<Dim>>
typename Sim::Params box_params(const SceneOptions& options, const talus::Vec<3>& size) {
  constexpr int up = talus::up_axis<Dim>;
  constexpr double gravity = 9.81; // m/s²
  talus::require_positive("--cell", options.cell);
  typename Sim::Params params;
  for (int a = 0; a < Dim; ++a) {
    params.grid.size[a] = size[a == up ? 2 : a];
    const double cells = std::round(params.grid.size[a] / options.cell);
    constexpr int most = std::numeric_limits<int>::max();
    if (!(cells <= most))
      talus::throw_invalid("--cell", options.cell,
                           "a part of the box: at most " + std::to_string(most) + " on " +
                               talus::text_of(params.grid.size[a]) + " m");
    params.grid.cells[a] = std::max(1, static_cast<int>(cells));
    const auto side = static_cast<std::size_t>(a);
    params.faces.lower[side] =
        params.faces.upper[side] = {talus::FaceKind::frictional, options.wall_friction};
  }
  params.faces.lower[up] = {talus::FaceKind::no_slip};
  params.faces.upper[up] = {talus::FaceKind::open};
  params.gravity = -gravity * talus::Vec<Dim>::Unit(up);
  if constexpr (!requires { params.rheology.list; }) // of several materials
    params.material.density = options.density;
  params.time_step = options.time_step.value_or(0.05 * std::sqrt(options.cell / gravity));
  if constexpr (requires { params.rheology.mu; })
    params.rheology.mu = options.friction;
  params.solver.max_sweeps = 5000;
  params.packing = options.packing;
  params.threads = options.run.common.threads;
  watch_budget<Sim>(options.run, params);
  return params;
}

/// The inputs that all these programs share, for summary.json.
template <class Sim>
nlohmann::json scene_inputs(const SceneOptions& options, const Sim& sim) {
  constexpr int Dim = Sim::dimension;
  nlohmann::json size, cells;
  for (int a = 0; a < Dim; ++a) {
    size.push_back(sim.grid().size()[a]);
    cells.push_back(sim.grid().cells(a));
  }
  return {{"dimension", Dim},
          {"domain_m", size},
          {"cells", cells},
          {"particles", sim.particles().size()},
          {"friction", options.friction},
          {"wall_friction", options.wall_friction},
          {"density", options.density},
          {"time_step_s", sim.params().time_step},
          {"packing_slack", options.packing.slack},
          {"packing_dilatancy", options.packing.dilatancy},
          {"packing_even", options.packing.even},
          {"packing_surfaces", options.packing.surfaces},
          {"seeding", static_cast<int>(options.seeding.pattern)},
          {"jitter", options.seeding.jitter},
          {"seed", options.seeding.seed}};
}

} // namespace support
