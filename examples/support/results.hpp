// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"

#include "talus/diagnostics/checksum.hpp"
#include "talus/simulation.hpp"
#include "talus/version.hpp"

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

/// \file
/// What all example programs leave behind: summary.json, solver statistics, a picture.

namespace support {

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

inline nlohmann::json versions() {
  return {{"talus", TALUS_VERSION},
          {"eigen", std::to_string(EIGEN_WORLD_VERSION) + "." +
                        std::to_string(EIGEN_MAJOR_VERSION) + "." +
                        std::to_string(EIGEN_MINOR_VERSION)},
          {"compiler",
#ifdef __clang__
           std::string("clang ") + __clang_version__
#else
           std::string("gcc ") + __VERSION__
#endif
          }};
}

/// Sums up the reports of the steps of a run.
class SolverStatistics {
 public:
  void add(const talus::StepReport& report) {
    ++steps_;
    iterations_ += report.solve.iterations;
    iterations_max_ = std::max(iterations_max_, report.solve.iterations);
    residual_max_ = std::max(residual_max_, report.solve.residual.l2);
    not_converged_ += report.solve.status != talus::SolveStatus::converged;
    local_misses_ += report.solve.local_failures;
    cones_max_ = std::max(cones_max_, report.cones);
    fraction_max_ = std::max(fraction_max_, report.largest_fraction);
    courant_max_ = std::max(courant_max_, report.courant);
    outflow_ += report.outflow;
    outflow_volume_ += report.outflow_volume;
    seconds_.to_grid += report.seconds.to_grid;
    seconds_.assembly += report.seconds.assembly;
    seconds_.solve += report.seconds.solve;
    seconds_.to_particles += report.seconds.to_particles;
  }

  /// All sums, to go on with after a restart.
  nlohmann::json state() const {
    return {
        {"steps", steps_},
        {"not_converged", not_converged_},
        {"local_failures", local_misses_},
        {"cones_max", cones_max_},
        {"outflow", outflow_},
        {"outflow_volume", outflow_volume_},
        {"iterations", iterations_},
        {"iterations_max", iterations_max_},
        {"residual_max", residual_max_},
        {"fraction_max", fraction_max_},
        {"courant_max", courant_max_},
        {"seconds", {seconds_.to_grid, seconds_.assembly, seconds_.solve, seconds_.to_particles}}};
  }
  void restore(const nlohmann::json& state) {
    state.at("steps").get_to(steps_);
    state.at("not_converged").get_to(not_converged_);
    state.at("local_failures").get_to(local_misses_);
    state.at("cones_max").get_to(cones_max_);
    state.at("outflow").get_to(outflow_);
    state.at("outflow_volume").get_to(outflow_volume_);
    state.at("iterations").get_to(iterations_);
    state.at("iterations_max").get_to(iterations_max_);
    state.at("residual_max").get_to(residual_max_);
    state.at("fraction_max").get_to(fraction_max_);
    state.at("courant_max").get_to(courant_max_);
    const auto& seconds = state.at("seconds");
    seconds_ = {seconds.at(0), seconds.at(1), seconds.at(2), seconds.at(3)};
  }

  /// What left through free faces, m^d.
  double outflow_volume() const { return outflow_volume_; }

  nlohmann::json solver_json() const {
    return {{"iterations_mean", iterations_mean()}, {"iterations_max", iterations_max_},
            {"residual_max", residual_max_},        {"steps_not_converged", not_converged_},
            {"local_failures", local_misses_},      {"cones_max", cones_max_},
            {"outflow_particles", outflow_},        {"fraction_max", fraction_max_},
            {"courant_max", courant_max_}};
  }
  nlohmann::json phase_json() const {
    return {{"to_grid", seconds_.to_grid},
            {"assembly", seconds_.assembly},
            {"solve", seconds_.solve},
            {"to_particles", seconds_.to_particles}};
  }

  void print(std::size_t steps, double wall_seconds) const {
    const double total = std::max(seconds_.total(), 1e-300);
    std::printf(
        "%zu steps in %.1f s; grid %.0f%%, assembly %.0f%%, solve %.0f%%, particles %.0f%%\n",
        steps, wall_seconds, 100 * seconds_.to_grid / total, 100 * seconds_.assembly / total,
        100 * seconds_.solve / total, 100 * seconds_.to_particles / total);
    std::printf("solver: %.0f sweeps a step, largest residual %.1e", iterations_mean(),
                residual_max_);
    if (not_converged_ > 0)
      std::printf(", WARNING: %zu steps stopped above the tolerance", not_converged_);
    if (fraction_max_ > 1.5)
      std::printf(", WARNING: the fullest node holds %.1f times the dense volume", fraction_max_);
    std::printf("\n");
  }

 private:
  double iterations_mean() const {
    return steps_ > 0 ? static_cast<double>(iterations_) / static_cast<double>(steps_) : 0;
  }
  std::size_t steps_ = 0, not_converged_ = 0, local_misses_ = 0, cones_max_ = 0, outflow_ = 0;
  long iterations_ = 0;
  int iterations_max_ = 0;
  double residual_max_ = 0, outflow_volume_ = 0, fraction_max_ = 0, courant_max_ = 0;
  talus::PhaseSeconds seconds_;
};

/// A measured value, not a number if there is none (null): pictures and tables leave it out.
inline double value_or_nan(const nlohmann::json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

/// Writes a file whole or not at all. Throws std::runtime_error.
inline void write_json(const fs::path& path, const nlohmann::json& json) {
  const fs::path temporary = path.string() + ".tmp";
  {
    std::ofstream file(temporary);
    file << json.dump(2) << '\n';
    file.flush();
    if (!file)
      throw std::runtime_error(temporary.string() + " cannot be written");
  }
  fs::rename(temporary, path);
}

/// Runs a plot script on the results: a picture is welcome, but no reason to fail.
inline void draw(const CommonOptions& options, const std::string& script, const fs::path& out) {
  if (options.no_plot)
    return;
  const std::string arguments =
      " " + shell_quoted((examples_folder() / script).string()) + " " + shell_quoted(out.string());
  for (const char* python : {"python3", "/usr/bin/python3"}) {
    const std::string check =
        std::string(python) + " -c 'import matplotlib, numpy' >/dev/null 2>&1";
    if (std::system(check.c_str()) != 0)
      continue;
    const std::string command = python + arguments + (options.quiet ? " >/dev/null" : "");
    if (std::system(command.c_str()) != 0)
      std::fprintf(stderr, "the picture could not be drawn; to try again: python3%s\n",
                   arguments.c_str());
    return;
  }
  std::fprintf(stderr,
               "no picture: python3 with matplotlib and numpy was not found; later: python3%s\n",
               arguments.c_str());
}

} // namespace support
