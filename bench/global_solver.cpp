// SPDX-License-Identifier: MIT
// Solves recorded dual problems (see docs/problem_files.md) with the global solvers:
//   bench_global_solver --problem FILE --solver NAME --tol X --threads N --json
// With --profile what residuals of 1e-4, 1e-6 and 1e-8 take, in seconds of the processor.
// With --history the residual after 1, 2, 3, 5, … sweeps and the seconds they took: each a solve of
// its own from the same start, so that measuring costs nothing of what is measured.

#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/projection_step.hpp"
#include "talus/cone/secular.hpp"
#include "talus/io/matrix_market.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/solver/interior_point.hpp"
#include "talus/solver/sweeps_then_interior_point.hpp"

#include "../examples/support/whole_numbers.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <exception>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace talus;
using nlohmann::json;

struct Options {
  std::vector<std::string> problems, solvers;
  std::string matrix_market;
  double tolerance = 1e-4;
  int threads = 1, max_sweeps = 20000, repetitions = 3;
  bool cold = false, history = false, profile = false, as_json = false;
};

struct Timed {
  SolveReport report;
  double cpu_seconds = 0;
};

/// Solves the problem, `repetitions` times; the shortest time counts. extrapolation: of sweeps.
template <int Dim, class SolverT>
Timed timed(const Options& options, const DualProblem<Dim>& problem, double tolerance,
            int max_sweeps, double extrapolation) {
  typename SolverT::Params params;
  params.tolerance = tolerance;
  if constexpr (requires { params.max_cones; }) {
    params.max_sweeps = std::min(max_sweeps, params.max_sweeps); // then something else
  } else if constexpr (requires { params.max_sweeps; }) {
    params.max_sweeps = max_sweeps;
    params.extrapolation = extrapolation;
  } else {
    params.max_iterations = std::min(max_sweeps, params.max_iterations);
  }
  const SolverT solver(params);
  typename SolverT::template Workspace<Dim> workspace;
  Timed best;
  for (int k = 0; k < options.repetitions; ++k) {
    DualProblem<Dim> copy = problem;
    const std::clock_t start = std::clock();
    const SolveReport report = solver.solve(copy, workspace, Execution(options.threads));
    const double cpu = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    if (k == 0 || report.seconds < best.report.seconds)
      best.report = report;
    best.cpu_seconds = k == 0 ? cpu : std::min(best.cpu_seconds, cpu);
    if (options.profile && cpu > 1)
      break; // long enough to be sure of
  }
  return best;
}

json to_json(const Timed& timed) {
  const SolveReport& report = timed.report;
  return {{"status", to_string(report.status)},      {"iterations", report.iterations},
          {"residual_l2", report.residual.l2},       {"residual_max", report.residual.max},
          {"local_failures", report.local_failures}, {"seconds", report.seconds},
          {"cpu_seconds", timed.cpu_seconds}};
}

template <int Dim, class SolverT>
json run(const Options& options, const DualProblem<Dim>& problem, double extrapolation) {
  const auto solve = [&](double tolerance, int max_sweeps) {
    return timed<Dim, SolverT>(options, problem, tolerance, max_sweeps, extrapolation);
  };
  if (options.profile) {
    json result, profile = json::array();
    for (const double tolerance : {1e-4, 5e-5, 1e-6, 1e-8}) {
      result = to_json(solve(tolerance, options.max_sweeps));
      profile.push_back(result);
      profile.back()["tolerance"] = tolerance;
      if (result["status"] != to_string(SolveStatus::converged))
        break; // nor will it get further
    }
    result["profile"] = profile;
    return result;
  }
  json result = to_json(solve(options.tolerance, options.max_sweeps));
  if (options.history) {
    const int most = std::max(1, result["iterations"].get<int>());
    result["history"] = json::array();
    for (double sweeps = 1; sweeps < 1.3 * most; sweeps = std::max(sweeps + 1, 1.5 * sweeps))
      result["history"].push_back(to_json(
          solve(options.tolerance, std::min(static_cast<int>(sweeps), options.max_sweeps))));
  }
  return result;
}

template <int Dim>
using Entry = std::function<json(const Options&, const DualProblem<Dim>&)>;

/// Add a line for a solver of your own.
template <int Dim>
std::map<std::string, Entry<Dim>> solvers() {
  const double extrapolation = GaussSeidel<>::Params{}.extrapolation;
  return {
      {"accelerated",
       [=](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, GaussSeidel<>>(o, p, extrapolation);
       }},
      {"accelerated-secular",
       [=](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, GaussSeidel<SecularSolver>>(o, p, extrapolation);
       }},
      {"plain", [](const Options& o,
                   const DualProblem<Dim>& p) { return run<Dim, GaussSeidel<>>(o, p, 0); }},
      {"plain-secular",
       [](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, GaussSeidel<SecularSolver>>(o, p, 0);
       }},
      {"coulomb-secular",
       [](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, GaussSeidel<SecularSolver, CoulombLaw>>(o, p, 0);
       }},
      {"coulomb-newton",
       [](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, GaussSeidel<FischerBurmeisterNewton, CoulombLaw>>(o, p, 0);
       }},
      {"interior-point",
       [](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, InteriorPoint>(o, p, 0);
       }},
      {"sweeps-then-interior-point",
       [](const Options& o, const DualProblem<Dim>& p) {
         return run<Dim, SweepsThenInteriorPoint>(o, p, 0);
       }},
  };
}

template <int Dim>
void run_file(const Options& options, const std::string& file, json& results) {
  DualProblem<Dim> problem = read_problem<Dim>(file);
  if (!options.matrix_market.empty())
    write_matrix_market<Dim>(options.matrix_market, problem);
  if (options.cold)
    remove_impulses(problem, Stencil<Dim>(problem.grid));
  for (const auto& [name, solve] : solvers<Dim>()) {
    if (!options.solvers.empty() &&
        std::ranges::find(options.solvers, name) == options.solvers.end())
      continue;
    json result = solve(options, problem);
    result["microseconds_per_cone_and_sweep"] = 1e6 * result["seconds"].get<double>() /
                                                static_cast<double>(problem.cones()) /
                                                std::max(1, result["iterations"].get<int>());
    result["problem"] = file;
    result["solver"] = name;
    result["start"] = options.cold ? "cold" : "warm";
    result["dimension"] = Dim;
    result["cones"] = problem.cones();
    result["contacts"] = problem.contacts.size();
    result["threads"] = options.threads;
    result["tolerance"] = options.tolerance;
    if (!options.as_json)
      std::printf("%-40s %-20s %s: %s, %d sweeps, %.4f s, residual %.1e (max %.1e), %.3f us a cone "
                  "and sweep\n",
                  file.c_str(), name.c_str(), options.cold ? "cold" : "warm",
                  result["status"].get<std::string>().c_str(), result["iterations"].get<int>(),
                  result["seconds"].get<double>(), result["residual_l2"].get<double>(),
                  result["residual_max"].get<double>(),
                  result["microseconds_per_cone_and_sweep"].get<double>());
    results.push_back(std::move(result));
  }
}

} // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Solves recorded dual problems with the global solvers.");
  std::vector<std::string> names;
  for (const auto& entry : solvers<2>())
    names.push_back(entry.first);
  app.add_option("--problem", options.problems, "Problem files")
      ->required()
      ->check(CLI::ExistingFile);
  app.add_option("--solver", options.solvers, "Solvers (default: all)")
      ->check(CLI::IsMember(names));
  app.add_option("--tol", options.tolerance, "l2 residual to reach")->capture_default_str();
  app.add_option("--max-sweeps", options.max_sweeps, "Most sweeps")->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "Solves, of which the fastest counts")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "Threads")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_flag("--cold", options.cold, "Start from no stress instead of the recorded one");
  app.add_flag("--profile", options.profile, "What residuals of 1e-4, 5e-5, 1e-6, 1e-8 take");
  app.add_flag("--history", options.history, "Residual and seconds after 1, 2, 3, 5, ... sweeps");
  app.add_flag("--json", options.as_json, "Print JSON");
  app.add_option("--matrix-market", options.matrix_market,
                 "Also write the problem's plain algebra into this folder");
  try {
    support::check_numbers(app);
    app.parse(argc, argv);
    if (options.repetitions < 1)
      throw_invalid("--repetitions", options.repetitions, "an integer >= 1");
    json results = json::array();
    for (const std::string& file : options.problems) {
      if (problem_dimension(file) == 2)
        run_file<2>(options, file, results);
      else
        run_file<3>(options, file, results);
    }
    if (options.as_json)
      std::printf("%s\n", results.dump(1).c_str());
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
