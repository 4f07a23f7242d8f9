// SPDX-License-Identifier: MIT
// What one local solve costs: policy × law × cone size × regime × condition × cold or warm start,
// on random problems and on recorded ones. Counters: iterations, misses (error above 1e-9), both
// per solve. Times are of 256 problems, `per_solve` is one.

#include "talus/cone/local_solver.hpp"
#include "talus/cone/comparison/contact.hpp"
#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/comparison/hybrid.hpp"
#include "talus/cone/comparison/projection.hpp"
#include "talus/cone/comparison/quartic.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/secular.hpp"
#include "talus/cone/secular_batch.hpp"
#include "talus/io/number.hpp"

#include "../tests/support/cone_problems.hpp"

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

using namespace talus;
using cone_problems::Problem;

namespace {

constexpr std::size_t count = 256;

template <int N>
struct Set {
  std::string name;
  std::vector<Problem<N>> problems;
  std::vector<Vec<N>> start;
};

enum class Start { cold, warm };

/// Random problems whose solution under Law is of one regime.
template <class Law, int N>
Set<N> random_problems(LocalStatus regime, double condition, Start start) {
  Set<N> set;
  cone_problems::Numbers numbers(7);
  while (set.problems.size() < count) {
    Problem<N> p;
    p.w = numbers.matrix<N>(condition);
    p.b = numbers.vector<N>();
    p.mu = numbers.uniform(0.2, 0.8);
    if (regime == LocalStatus::stick)
      p.b = -p.w *
            Vec<N>(project_on_cone<N, double>(numbers.vector<N>() + 3 * Vec<N>::Unit(0), p.mu / 2));
    Vec<N> lambda = Vec<N>::Zero();
    if (solve_local(SecularSolver{}, Law{}, p.w, p.b, p.mu, lambda).status != regime)
      continue;
    set.problems.push_back(p);
    // warm: off by a thousandth, as from one sweep to the next
    set.start.push_back(start == Start::cold
                            ? Vec<N>(Vec<N>::Zero())
                            : Vec<N>(lambda + 1e-3 * lambda.norm() * numbers.vector<N>() / N));
  }
  static constexpr const char* names[] = {"open", "stick", "slide"};
  std::ostringstream name;
  name << names[static_cast<int>(regime)] << "/cond" << condition
       << (start == Start::cold ? "/cold" : "/warm");
  set.name = name.str();
  return set;
}

/// Problems of bench/problems/local_*.csv; see record_local_problems.cpp.
template <int N>
Set<N> recorded_problems(const std::string& path) {
  Set<N> set;
  set.name = "recorded/warm";
  std::ifstream file(path);
  std::string line;
  constexpr int numbers = 1 + N + N * (N + 1) / 2 + N;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#')
      continue;
    std::vector<double> x;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');)
      if (const auto number = talus::parse_number<double>(cell))
        x.push_back(*number);
      else
        throw std::runtime_error(path + ": \"" + cell + "\" is no number");
    if (x.size() != numbers)
      throw std::runtime_error(path + ": a line has " + std::to_string(x.size()) +
                               " numbers instead of " + std::to_string(numbers));
    std::size_t i = 0;
    Problem<N> p;
    p.mu = x[i++];
    for (int k = 0; k < N; ++k)
      p.b[k] = x[i++];
    for (int k = 0; k < N; ++k)
      for (int l = 0; l <= k; ++l)
        p.w(k, l) = p.w(l, k) = x[i++];
    Vec<N> start;
    for (int k = 0; k < N; ++k)
      start[k] = x[i++];
    set.problems.push_back(p);
    set.start.push_back(start);
  }
  if (set.problems.empty())
    throw std::runtime_error(path + " cannot be read or holds no problem");
  return set;
}

template <class Law>
const char* law_name() {
  return std::is_same_v<Law, CoulombLaw> ? "coulomb" : "associated";
}

template <int N>
std::string full_name(const char* policy, const char* law, const Set<N>& set) {
  return std::string(policy) + "/" + law + "/N" + std::to_string(N) + "/" + set.name;
}

void set_counters(benchmark::State& state, std::size_t problems, double iterations, int misses) {
  const double solves = static_cast<double>(problems);
  state.counters["per_solve"] = benchmark::Counter(
      solves, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["iterations"] = iterations / solves;
  state.counters["misses"] = misses / solves;
}

/// One problem after the other with what is prepared of W at hand, as in a sweep.
template <class Solver, class Law, int N>
void add(const char* policy, const Set<N>& set) {
  benchmark::RegisterBenchmark(
      full_name(policy, law_name<Law>(), set).c_str(), [set](benchmark::State& state) {
        const Solver solver{};
        const std::size_t problems = set.problems.size();
        std::vector<typename Solver::template Prepared<Law, N>> prepared;
        for (const Problem<N>& p : set.problems)
          prepared.push_back(solver.prepare(Law{}, p.w, p.mu));
        for (auto _ : state)
          for (std::size_t i = 0; i < problems; ++i) {
            Vec<N> lambda = set.start[i];
            benchmark::DoNotOptimize(solver.solve(prepared[i], set.problems[i].b, lambda));
            benchmark::DoNotOptimize(lambda.data());
          }
        double iterations = 0;
        int misses = 0;
        for (std::size_t i = 0; i < problems; ++i) {
          Vec<N> lambda = set.start[i];
          iterations += solver.solve(prepared[i], set.problems[i].b, lambda).iterations;
          misses += !(cone_problems::error<Law, N>(set.problems[i], lambda) < 1e-9);
        }
        set_counters(state, problems, iterations, misses);
      });
}

/// What a step pays once per cone.
template <class Solver, class Law, int N>
void add_prepare(const char* policy, const Set<N>& set) {
  const std::string name =
      std::string(policy) + "_prepare/" + law_name<Law>() + "/N" + std::to_string(N);
  benchmark::RegisterBenchmark(name.c_str(), [set](benchmark::State& state) {
    const Solver solver{};
    for (auto _ : state)
      for (const Problem<N>& p : set.problems)
        benchmark::DoNotOptimize(solver.prepare(Law{}, p.w, p.mu));
    set_counters(state, set.problems.size(), 0, 0);
  });
}

template <class Law, int N, int Width>
void add_batch(const Set<N>& set) {
  const std::string policy = "secular_batch" + std::to_string(Width);
  benchmark::RegisterBenchmark(
      full_name(policy.c_str(), law_name<Law>(), set).c_str(), [set](benchmark::State& state) {
        using Batch = SecularBatch<Law, N, Width>;
        const std::size_t batches = set.problems.size() / Width;
        std::vector<Batch> batch(batches);
        std::vector<typename Batch::Vector> b(batches), start(batches);
        for (std::size_t i = 0; i < batches * Width; ++i) {
          batch[i / Width].set(static_cast<int>(i % Width), set.problems[i].w, set.problems[i].mu);
          for (std::size_t k = 0; k < N; ++k) {
            b[i / Width][k][i % Width] = set.problems[i].b[static_cast<Eigen::Index>(k)];
            start[i / Width][k][i % Width] = set.start[i][static_cast<Eigen::Index>(k)];
          }
        }
        for (auto _ : state)
          for (std::size_t g = 0; g < batches; ++g) {
            auto lambda = start[g];
            benchmark::DoNotOptimize(batch[g].solve(b[g], lambda));
            benchmark::DoNotOptimize(lambda.data());
          }
        double iterations = 0;
        int misses = 0;
        for (std::size_t g = 0; g < batches; ++g) {
          auto lambda = start[g];
          const auto reports = batch[g].solve(b[g], lambda);
          for (std::size_t l = 0; l < Width; ++l) {
            Vec<N> x;
            for (std::size_t k = 0; k < N; ++k)
              x[static_cast<Eigen::Index>(k)] = lambda[k][l];
            iterations += reports[l].iterations;
            misses += !(cone_problems::error<Law, N>(set.problems[g * Width + l], x) < 1e-9);
          }
        }
        set_counters(state, batches * Width, iterations, misses);
      });
}

/// A policy on all sets of one size. Yours: one line of this in main().
template <class Solver, class Law, int N>
void add_all(const char* policy, const std::vector<Set<N>>& sets) {
  for (const Set<N>& set : sets)
    add<Solver, Law>(policy, set);
}

template <class Law, int Width>
void add_batches(const std::vector<Set<2>>& two, const std::vector<Set<3>>& three,
                 const std::vector<Set<6>>& six) {
  for (const auto& set : two)
    add_batch<Law, 2, Width>(set);
  for (const auto& set : three)
    add_batch<Law, 3, Width>(set);
  for (const auto& set : six)
    add_batch<Law, 6, Width>(set);
}

template <class Law, int N>
std::vector<Set<N>> all_sets(const std::string& folder) {
  std::vector<Set<N>> sets{random_problems<Law, N>(LocalStatus::open, 10, Start::cold),
                           random_problems<Law, N>(LocalStatus::stick, 10, Start::cold)};
  for (const double condition : {10.0, 1e4, 1e8})
    sets.push_back(random_problems<Law, N>(LocalStatus::slide, condition, Start::cold));
  sets.push_back(random_problems<Law, N>(LocalStatus::slide, 10, Start::warm));
  if (N == 3)
    sets.push_back(recorded_problems<N>(folder + "/local_2d.csv"));
  if (N == 6)
    sets.push_back(recorded_problems<N>(folder + "/local_3d.csv"));
  return sets;
}

template <class Law>
void add_law(const std::string& folder) {
  const auto two = all_sets<Law, 2>(folder);
  const auto three = all_sets<Law, 3>(folder);
  const auto six = all_sets<Law, 6>(folder);
  add_all<FischerBurmeisterNewton, Law>("newton", two);
  add_all<FischerBurmeisterNewton, Law>("newton", three);
  add_all<FischerBurmeisterNewton, Law>("newton", six);
  add_all<SecularSolver, Law>("secular", two);
  add_all<SecularSolver, Law>("secular", three);
  add_all<SecularSolver, Law>("secular", six);
  add_all<QuarticSolver, Law>("quartic", three);
  add_all<HybridSolver<>, Law>("hybrid", three);
  add_all<ProjectionSolver, Law>("projection", six);
  add_batches<Law, 4>(two, three, six);
#ifdef __AVX512F__
  add_batches<Law, 8>(two, three, six);
#endif
  add<ContactSolver, Law>("contact", random_problems<Law, 2>(LocalStatus::slide, 1, Start::cold));
  add<ContactSolver, Law>("contact", random_problems<Law, 3>(LocalStatus::slide, 1, Start::cold));
  add_prepare<SecularSolver, Law>("secular", three[2]);
  add_prepare<SecularSolver, Law>("secular", six[2]);
  add_prepare<FischerBurmeisterNewton, Law>("newton", six[2]);
}

} // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv))
    return 2;
  try {
    add_law<CoulombLaw>(TALUS_BENCH_PROBLEMS);
    add_law<AssociatedLaw>(TALUS_BENCH_PROBLEMS);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
