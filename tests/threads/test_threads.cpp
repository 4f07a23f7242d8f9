// SPDX-License-Identifier: MIT
// All that threads share in a step, in small scenes: the same bits with one and with four, and
// nothing for the thread sanitizer to find (preset tsan builds this program alone).

#include "talus/boundary/gate.hpp"
#include "talus/core/execution.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

using namespace talus;

namespace {

/// A column of 20 cells' width (several blocks a colour) that slumps against a rough wall and out
/// of the box behind an opening gate.
template <int Dim>
std::string slump(int threads) {
  using Sim = Simulation<Dim, MuOfI, PolyPic, GaussSeidel<>>;
  constexpr int up = Dim - 1;
  typename Sim::Params params;
  params.grid.size = 0.08 * Vec<Dim>::Ones();
  params.grid.size[0] = 0.24;
  for (int a = 0; a < Dim; ++a)
    params.grid.cells[a] = a == 0 ? 24 : 8;
  params.material.density = 1500;
  params.gravity = -9.81 * Vec<Dim>::Unit(up);
  params.time_step = 2e-3;
  params.rheology = {.law = {.mu_static = 0.38, .mu_limit = 0.64, .I_0 = 0.279},
                     .inertial = {.grain_diameter = 5e-4, .density = 1500, .strain_factor = 1}};
  params.solver.max_sweeps = 30;
  params.faces = Faces<Dim>::all({FaceKind::free_slip});
  params.faces.lower[0] = {FaceKind::frictional, 0.3};
  params.faces.lower[up] = {FaceKind::frictional, 0.5};
  params.faces.upper[0] = {FaceKind::open};
  params.obstacles.push_back(std::make_shared<Gate<Dim>>(
      typename Gate<Dim>::Params{.position = 0.2, .friction = 0.2, .motion = {}}));
  params.threads = threads;
  Particles<Dim> sand;
  const Grid<Dim> grid(params.grid);
  Vec<Dim> top = grid.upper();
  top[up] = 0.06;
  fill_box<Dim>(sand, grid, grid.origin(), top, {.per_axis = 2});
  for (Vec<Dim>& v : sand.velocity)
    v[0] = 0.2;
  Sim sim(params, sand);
  std::size_t outflow = 0;
  for (int n = 0; n < 10; ++n) {
    const StepReport report = sim.step();
    CHECK(report.completed());
    outflow += report.outflow;
  }
  CHECK(outflow > 0);
  return state_checksum(sim.particles());
}

} // namespace

TEST_CASE("the same bits with one and four threads, 2-D") {
  CHECK(slump<2>(4) == slump<2>(1));
}

TEST_CASE("the same bits with one and four threads, 3-D") {
  CHECK(slump<3>(4) == slump<3>(1));
}

TEST_CASE("the exception of the lowest item arrives, with any number of threads") {
  for (const int threads : {1, 2, 4, 7})
    for (const std::ptrdiff_t lowest : {0, 3, 50, 98}) {
      const Execution execution(threads);
      const auto throws_from = [&](std::ptrdiff_t i) {
        if (i >= lowest)
          throw i;
      };
      std::ptrdiff_t caught = -1;
      try {
        execution.for_each(99, throws_from);
      } catch (std::ptrdiff_t i) {
        caught = i;
      }
      CHECK(caught == lowest);
      caught = -1;
      try {
        execution.for_balanced(
            99, [](std::ptrdiff_t i) { return i * i; },
            [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
              for (std::ptrdiff_t i = begin; i < end; ++i)
                throws_from(i);
            });
      } catch (std::ptrdiff_t i) {
        caught = i;
      }
      CHECK(caught == lowest);
      Array<double> partials;
      CHECK_THROWS_AS(execution.reduce(
                          999, partials, 0.0,
                          [&](std::ptrdiff_t begin, std::ptrdiff_t) {
                            throws_from(begin);
                            return 1.0;
                          },
                          [](double a, double b) { return a + b; }),
                      std::ptrdiff_t);
    }
}

TEST_CASE("ranges of equal weight cover each item once") {
  // weights 0 to 9, then nothing for a while, then one item that weighs as much as all others
  std::vector<std::ptrdiff_t> before{0};
  for (std::ptrdiff_t i = 0; i < 10; ++i)
    before.push_back(before.back() + i);
  before.insert(before.end(), 5, before.back());
  before.push_back(2 * before.back());
  const std::ptrdiff_t count = std::ssize(before) - 1;
  const auto weight = [&](std::ptrdiff_t i) { return before[static_cast<std::size_t>(i)]; };
  for (const int threads : {1, 2, 3, 4, 8, 40}) {
    CAPTURE(threads);
    const Execution execution(threads);
    std::vector<int> visits(static_cast<std::size_t>(count), 0);
    execution.for_balanced(count, weight, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i)
        ++visits[static_cast<std::size_t>(i)];
      // no more than its share and the item that crosses its end; no more ranges than items
      const std::ptrdiff_t ranges = std::min<std::ptrdiff_t>(threads, count);
      CHECK(weight(end - 1) - weight(begin) <= weight(count) / ranges + 1);
    });
    CHECK(std::ranges::count(visits, 1) == count);
  }
  int visits = 0;
  Execution(4).for_ranges(0, [&](std::ptrdiff_t, std::ptrdiff_t) { ++visits; });
  CHECK(visits == 0);
}

TEST_CASE("loop after loop sees what other threads wrote, and each item once") {
  constexpr std::ptrdiff_t count = 97;
  std::vector<double> expected(count, 0);
  for (std::ptrdiff_t round = 0; round < 2000; ++round)
    for (std::ptrdiff_t i = 0; i < count; ++i)
      expected[static_cast<std::size_t>(i)] += static_cast<double>((i + round) % 7);
  for (const int threads : {1, 2, 5, 40}) {
    CAPTURE(threads);
    const Execution execution(threads);
    Array<double> values(count, 0), next(count, 0);
    for (std::ptrdiff_t round = 0; round < 2000; ++round) {
      execution.for_each(count, [&](std::ptrdiff_t i) {
        next[count - 1 - i] = values[i] + static_cast<double>((i + round) % 7);
      });
      execution.for_each(count, [&](std::ptrdiff_t i) { values[i] = next[count - 1 - i]; });
    }
    CHECK(values == expected);
  }
}

TEST_CASE("a thread that is kept from its work is waited for, then done without for a while") {
  const Execution execution(3);
  const auto caller = std::this_thread::get_id();
  std::vector<int> visits(50, 0);
  const auto loop = [&](std::chrono::milliseconds late) {
    std::atomic<bool> slept = false;
    std::vector<std::thread::id> who(visits.size());
    execution.for_each(std::ssize(visits), [&](std::ptrdiff_t i) {
      const auto item = static_cast<std::size_t>(i);
      ++visits[item];
      who[item] = std::this_thread::get_id();
      if (who[item] != caller) {
        if (late.count() > 0 && !slept.exchange(true))
          std::this_thread::sleep_for(late);
      } else {
        std::this_thread::sleep_for(std::chrono::microseconds(20)); // so that others come
      }
    });
    return std::ranges::count(who, caller) == std::ssize(who);
  };
  bool alone = true;
  for (int tries = 0; alone && tries < 200; ++tries) // until a helper has come and been late
    alone = loop(std::chrono::milliseconds(0));
  CHECK(!alone);
  const int before = visits[0];
  int rounds = 0;
  do
    ++rounds;
  while (loop(std::chrono::milliseconds(60)) && rounds < 200);
  CHECK(loop(std::chrono::milliseconds(0))); // a second later it would have help again
  for (const int n : visits)
    CHECK(n == before + rounds + 1);
}

TEST_CASE("copies have threads of their own and may loop side by side") {
  const Execution one(2);
  const Execution other = one;
  CHECK(other.threads() == 2);
  const auto count = [](const Execution& execution) {
    std::vector<int> visits(100, 0);
    for (int round = 0; round < 200; ++round)
      execution.for_each(100, [&](std::ptrdiff_t i) { ++visits[static_cast<std::size_t>(i)]; });
    return std::ranges::count(visits, 200);
  };
  std::ptrdiff_t of_other = 0;
  std::thread beside([&] { of_other = count(other); });
  const std::ptrdiff_t of_one = count(one);
  beside.join();
  CHECK(of_one == 100);
  CHECK(of_other == 100);
}

TEST_CASE("a wrong number of threads is refused") {
  CHECK_THROWS_WITH_AS(Execution(0), doctest::Contains("threads is 0"), std::invalid_argument);
}
