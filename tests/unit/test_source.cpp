// SPDX-License-Identifier: MIT
// Sources, sinks, add and remove: volumes, ids, room, reproducibility, wrong input.

#include "talus/boundary/floor.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/scene/source.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace test_source {

using namespace talus;
using support::about, support::contains, support::Folder, support::message_of;

namespace {

template <int Dim, class Transfer = PolyPic>
using Sim = Simulation<Dim, ConstantFriction, Transfer, GaussSeidel<>>;

/// A box of 1 cm cells, 0.2 m wide and high, with a sticking floor and an open top.
template <int Dim, class AnySim = Sim<Dim>>
typename AnySim::Params box() {
  typename AnySim::Params params;
  for (int a = 0; a < Dim; ++a) {
    params.grid.size[a] = Dim == 3 && a == 1 ? 0.06 : 0.2;
    params.grid.cells[a] = Dim == 3 && a == 1 ? 6 : 20;
  }
  params.material.density = 1500;
  params.gravity = -9.81 * Vec<Dim>::Unit(up_axis<Dim>);
  params.time_step = 2e-3;
  params.rheology.mu = 0.44;
  params.faces = Faces<Dim>::all({FaceKind::free_slip});
  params.faces.lower[up_axis<Dim>] = {FaceKind::no_slip};
  params.faces.upper[up_axis<Dim>] = {FaceKind::open};
  return params;
}

template <int Dim>
Grid<Dim> grid_of(const GridParams<Dim>& params) {
  return Grid<Dim>(params);
}

/// Down through a strip of 4 cm at the height of 18 cm.
Source<2>::Params strip(double speed) {
  return {.lower = {0.08, 0.18}, .upper = {0.12, 0.18}, .velocity = {0, -speed}};
}

/// What a run said of volumes, m², and what there was at its start and end.
struct Balance {
  double start, in = 0, out = 0, held_back = 0, end = 0;

  double error() const { return start + in - out - end; }
};

template <class AnySim>
Balance run(AnySim& sim, double end) {
  Balance balance{.start = total_volume(sim.particles())};
  while (sim.time() < end - 0.5 * sim.time_step()) {
    const std::size_t before = sim.particles().size();
    const StepReport report = sim.step();
    REQUIRE(report.completed());
    CHECK(sim.particles().size() == before + report.inflow - report.outflow);
    balance.in += report.inflow_volume;
    balance.out += report.outflow_volume;
    balance.held_back += report.held_back_volume;
  }
  balance.end = total_volume(sim.particles());
  return balance;
}

template <int Dim>
Particles<Dim> block(const Grid<Dim>& grid, double from, double to) {
  Particles<Dim> sand;
  Vec<Dim> lower = grid.origin(), upper = grid.upper();
  lower[0] = from;
  upper[0] = to;
  upper[up_axis<Dim>] = 0.05;
  fill_box(sand, grid, lower, upper, {.per_axis = 2});
  return sand;
}

/// A source, a sink and an open face at work, with every kind of source.
Sim<2> busy(int threads) {
  auto params = box<2>();
  params.threads = threads;
  params.cfl = 0.4;
  params.faces.lower[0] = {FaceKind::open};
  const Grid<2> grid(params.grid);
  params.exchange = together<2>(
      {make_source<2>(grid, strip(0.3)),
       make_source<2>(grid, {.lower = {0.01, 0.05}, .upper = {0.05, 0.1}, .flux = 5e-3}),
       make_sink<2>([](const Vec<2>& x) { return x[0] > 0.17; })});
  return Sim<2>(params, block(grid, 0.05, 0.15));
}

} // namespace

TEST_CASE("a source: what has come hangs on the time alone, for any time step") {
  for (const double flux : {4e-3, 1e-3})
    for (const double step : {1e-3, 3.7e-3, 2.3e-2}) {
      CAPTURE(flux);
      CAPTURE(step);
      auto params = box<2>();
      params.gravity.setZero();
      params.time_step = step;
      auto way_in = strip(0.1);
      way_in.lower[1] = way_in.upper[1] = 0.19;
      way_in.flux = flux;
      way_in.time = {.start = 0.05, .end = 0.55};
      const auto source = make_source<2>(Grid<2>(params.grid), way_in);
      CHECK(source->flux() == flux);
      params.exchange = source;
      Sim<2> sim(params, {});
      const double layer = 0.04 * 0.01 / 3;
      double in = 0;
      while (sim.time() < 0.7) {
        in += sim.step().inflow_volume;
        CHECK(in == about(source->volume_due(sim.time())));
        const double time = std::clamp(sim.time(), 0.05, 0.55);
        CHECK(std::abs(in - flux * (time - 0.05)) < 1.1 * layer);
      }
      CHECK(in == about(flux * 0.5));
      CHECK(total_volume(sim.particles()) == about(in));
    }
}

TEST_CASE("a strip lets a block through: its particles are those of a lattice that moves") {
  auto params = box<2>();
  params.gravity.setZero();
  params.exchange = make_source<2>(
      Grid<2>(params.grid),
      {.lower = {0, 0.02}, .upper = {0, 0.08}, .velocity = {0.5, 0}, .seeding = {.jitter = 0}});
  params.faces.lower[0] = {FaceKind::open};
  Sim<2> sim(params, {});
  const auto [start, in, out, held_back, end] = run(sim, 0.1);
  CHECK(held_back == 0);
  CHECK(in == about(0.06 * 0.05));
  CHECK(out == 0);
  const double share = 0.01 / 3;
  for (const Vec<2>& x : sim.particles().position) {
    const double layer = (0.5 * sim.time() - x[0]) / share - 0.5, row = (x[1] - 0.02) / share - 0.5;
    CHECK(std::abs(layer - std::round(layer)) < 1e-6);
    CHECK(std::abs(row - std::round(row)) < 1e-6);
  }
  // dense, and no denser
  for (int i = 1; i < 4; ++i)
    CHECK(sim.volume_fraction({i, 5}) == about(1, 0.08));
}

TEST_CASE("volumes balance to rounding, with sources, sinks and open faces") {
  auto sim = busy(1);
  const Balance balance = run(sim, 0.4);
  CHECK(balance.in > 0.003);
  CHECK(balance.out > 0.001);
  CHECK(std::abs(balance.error()) < 1e-13 * balance.in);
}

TEST_CASE("ids never come again") {
  auto sim = busy(1);
  std::set<std::size_t> seen(sim.particles().id.begin(), sim.particles().id.end()), now = seen;
  std::size_t next = sim.particles().next_id;
  for (int n = 0; n < 100; ++n) {
    REQUIRE(sim.step().completed());
    if (n == 50)
      sim.remove([&](std::size_t p) { return p % 2 == 0; });
    if (n == 60)
      sim.add(block<2>(sim.grid(), 0, 0.02));
    std::set<std::size_t> after(sim.particles().id.begin(), sim.particles().id.end());
    CHECK(after.size() == sim.particles().size());
    for (const std::size_t id : after)
      CHECK((now.count(id) == 1 || id >= next));
    next = sim.particles().next_id;
    now = std::move(after);
  }
}

TEST_CASE("the same bits for any number of threads, and from a checkpoint on") {
  auto one = busy(1);
  run(one, 0.3);
  for (const int threads : {2, 4}) {
    auto more = busy(threads);
    run(more, 0.3);
    CHECK(state_checksum(more.particles()) == state_checksum(one.particles()));
  }
  const Folder folder;
  auto first = busy(1), second = busy(2);
  run(first, 0.1);
  write_checkpoint(folder / "half.talus", first);
  read_checkpoint(folder / "half.talus", second);
  run(second, 0.3);
  CHECK(second.steps() == one.steps());
  CHECK(state_checksum(second.particles()) == state_checksum(one.particles()));
  CHECK(second.particles().next_id == one.particles().next_id);

  auto other_seed = strip(0.3);
  other_seed.seeding.seed = 2;
  auto params = box<2>();
  const Grid<2> grid(params.grid);
  std::vector<std::string> sums;
  for (const auto& way_in : {strip(0.3), strip(0.3), other_seed}) {
    params.exchange = make_source<2>(grid, way_in);
    Sim<2> sim(params, {});
    run(sim, 0.05);
    sums.push_back(state_checksum(sim.particles()));
  }
  CHECK(sums[0] == sums[1]);
  CHECK(sums[0] != sums[2]);
}

TEST_CASE_TEMPLATE("all removed, and filled again", AnySim, Sim<2>, Sim<2, Apic>, Sim<3>) {
  constexpr int dim = AnySim::dimension;
  auto params = box<dim, AnySim>();
  const Grid<dim> grid(params.grid);
  const auto sand = block<dim>(grid, 0, 0.1);
  AnySim sim(params, {}); // empty at the start
  CHECK(sim.step().completed());
  sim.add(sand);
  CHECK(total_volume(sim.particles()) == total_volume(sand));
  CHECK(run(sim, 0.02).error() == 0);
  const Outflow gone = sim.remove([](std::size_t) { return true; });
  CHECK(gone.particles == sand.size());
  CHECK(gone.volume == about(total_volume(sand)));
  CHECK(sim.particles().empty());
  CHECK(run(sim, 0.04).end == 0);
  sim.add(sand);
  CHECK(*std::min_element(sim.particles().id.begin(), sim.particles().id.end()) == sand.size());
  CHECK(run(sim, 0.06).end == about(total_volume(sand)));
  // a part, by its place
  const Outflow part =
      sim.remove([&](std::size_t p) { return sim.particles().position[p][0] > 0.05; });
  CHECK(part.particles > 0);
  CHECK(total_volume(sim.particles()) + part.volume == about(total_volume(sand)));
  for (const auto& x : sim.particles().position)
    CHECK(x[0] <= 0.05);
}

TEST_CASE("a source holds back what has no room, and goes on when there is some") {
  auto params = box<2>();
  params.grid.size = {0.04, 0.2};
  params.grid.cells = {4, 20};
  params.exchange = make_source<2>(
      Grid<2>(params.grid), {.lower = {0, 0.1}, .upper = {0.04, 0.1}, .velocity = {0, -0.5}});
  Sim<2> sim(params, {});
  const Balance filled = run(sim, 1);
  // it fills the box up to the strip and not above, neither much denser than dense
  CHECK(filled.held_back > 0.01);
  CHECK(filled.in + filled.held_back == about(0.04 * 0.5, 1e-3));
  CHECK(filled.end == about(0.04 * 0.1, 0.05));
  CHECK(sim.step().largest_fraction < 1.3);
  const double lower_half = 0.05;
  sim.remove([&](std::size_t p) { return sim.particles().position[p][1] < lower_half; });
  CHECK(run(sim, 2).end == about(0.04 * 0.1, 0.05));
}

TEST_CASE("what a strip on sinking material lets in is dense") {
  auto params = box<2>();
  params.grid.size = {0.04, 0.12};
  params.grid.cells = {4, 12};
  params.faces.lower[1] = {FaceKind::open};
  const double speed = 0.05, level = 0.1, end = 0.6;
  params.obstacles = {make_obstacle<Floor<2>>({.friction = 0, .sink_speed = speed})};
  const Grid<2> grid(params.grid);
  Particles<2> sand;
  fill_box<2>(sand, grid, {0, 0}, {0.04, level}, {.per_axis = 3, .jitter = 0});
  for (const double jitter : {0.0, 0.5}) {
    CAPTURE(jitter);
    params.exchange = make_source<2>(grid, {.lower = {0, level},
                                            .upper = {0.04, level},
                                            .velocity = {0, -0.5},
                                            .seeding = {.per_axis = 3, .jitter = jitter}});
    Sim<2> sim(params, sand);
    const double dense = 0.04 * speed * end;
    const double in = run(sim, end).in / dense;
    CHECK(in > 0.97);
    CHECK(in < 1.12); // layers close up as they slow down
  }
}

TEST_CASE("a strip that nothing stands in the way of lets all in, dense as it is") {
  for (const int per_axis : {2, 3, 6})
    for (const double jitter : {0.0, 0.5, 1.0}) {
      auto params = box<2>();
      params.exchange = make_source<2>(Grid<2>(params.grid),
                                       {.lower = {0.08, 0.18},
                                        .upper = {0.12, 0.18},
                                        .velocity = {0, -1},
                                        .time = {.end = 0.1},
                                        .seeding = {.per_axis = per_axis, .jitter = jitter}});
      params.gravity.setZero();
      Sim<2> sim(params, {});
      const Balance balance = run(sim, 0.1);
      CAPTURE(per_axis);
      CAPTURE(jitter);
      CHECK(balance.in == about(0.04 * 0.1, jitter < 1 ? 1e-9 : 2e-3));
    }
}

TEST_CASE("a strip across a periodic box, aslant: what passes a face comes in at the other one") {
  for (const int cells : {1, 20})
    for (const double jitter : {0.0, 0.5}) {
      auto params = box<2>();
      params.grid.size[0] = 0.01 * cells;
      params.grid.cells[0] = cells;
      params.gravity.setZero();
      params.time_step = 0.02; // 4 cm along the strip
      params.faces.lower[0] = params.faces.upper[0] = {FaceKind::periodic};
      const double width = params.grid.size[0];
      params.exchange = make_source<2>(Grid<2>(params.grid, params.faces.periodic()),
                                       {.lower = {0, 0.18},
                                        .upper = {width, 0.18},
                                        .velocity = {2, -0.3},
                                        .time = {.end = 0.2},
                                        .seeding = {.jitter = jitter}});
      Sim<2> sim(params, {});
      const Balance balance = run(sim, 0.22);
      CHECK(balance.held_back == 0);
      CHECK(balance.in == about(width * 0.06));
      CHECK(sim.step().largest_fraction < 1.1);
    }
}

TEST_CASE("all of a simulation's particles added to itself, where that is allowed") {
  auto params = box<2>();
  params.packing.densest = std::numeric_limits<double>::infinity();
  const auto sand = block<2>(Grid<2>(params.grid), 0, 0.1);
  Sim<2> sim(params, sand);
  REQUIRE(sim.step().completed()); // the particles have mixed derivatives now
  sim.add(sim.particles());
  REQUIRE(sim.particles().size() == 2 * sand.size());
  CHECK(sim.particles().next_id == 2 * sand.size());
  for (std::size_t p = 0; p < sand.size(); ++p) {
    CHECK(sim.particles().position[p + sand.size()] == sim.particles().position[p]);
    CHECK(sim.particles().id[p + sand.size()] == sand.size() + p);
  }
}

TEST_CASE("sources within material, and sinks with a time") {
  auto params = box<2>();
  const Grid<2> grid(params.grid);
  const auto sand = block<2>(grid, 0, 0.2);
  params.exchange = make_source<2>(
      grid, {.lower = {0.02, 0}, .upper = {0.18, 0.03}, .flux = 0.05, .time = {0, 0.05}});
  Sim<2> full(params, sand);
  const Balance held = run(full, 0.06);
  CHECK(held.in < 0.05 * held.held_back);
  CHECK(held.in + held.held_back == about(0.05 * 0.05));

  params.exchange =
      make_sink<2>(shapes::Ball<2>({0.1, 0.02}, 0.02), {.start = 0.021, .end = 0.041});
  Sim<2> sim(params, sand);
  CHECK(run(sim, 0.02).out == 0);
  CHECK(sim.step().outflow_volume == about(3.14159 * 0.02 * 0.02, 0.1));
  run(sim, 0.04);
  CHECK(run(sim, 0.08).out == 0);
}

TEST_CASE("a round strip in 3-D: the flux that was asked for") {
  auto params = box<3>();
  const Vec<3> centre(0.1, 0.03, 0.15);
  const auto source = make_source<3>(
      Grid<3>(params.grid), {.lower = {0.08, 0.01, 0.15},
                             .upper = {0.12, 0.05, 0.15},
                             .velocity = {0, 0, -0.2},
                             .flux = 1e-4,
                             .inside = [&](const Vec<3>& x) { return (x - centre).norm() < 0.02; },
                             .time = {.end = 0.05}});
  params.exchange = source;
  Sim<3> sim(params, {});
  const Balance balance = run(sim, 0.06);
  CHECK(balance.in == about(5e-6));
  CHECK(std::abs(balance.error()) < 1e-18);
  for (const auto& x : sim.particles().position)
    CHECK(std::hypot(x[0] - 0.1, x[1] - 0.03) < 0.022);
}

TEST_CASE("wrong sources and sinks are refused, by name and value") {
  const Grid<2> grid(box<2>().grid);
  const auto message = [&](Source<2>::Params params) {
    return message_of<std::invalid_argument>([&] { make_source<2>(grid, std::move(params)); });
  };
  auto wrong = strip(0.1);
  wrong.lower[0] = -0.1;
  CHECK(message(wrong) == "source.lower.x is -0.1; allowed: in the grid, 0 to 0.2");
  wrong = strip(0.1);
  wrong.upper[0] = 0.05;
  CHECK(message(wrong) ==
        "source.upper.x is 0.05; allowed: in the grid, from source.lower.x to 0.2");
  CHECK(contains(message({}), "source.lower.x is nan"));
  wrong = strip(0.1);
  wrong.upper[0] = wrong.lower[0];
  CHECK(contains(message(wrong), "source.upper - source.lower along y is 0"));
  wrong = strip(0.1);
  wrong.velocity = {0.1, 0};
  CHECK(contains(message(wrong), "source.velocity.y is 0; allowed: a speed through the strip"));
  wrong = strip(-0.1);
  wrong.lower[1] = wrong.upper[1] = 0.2;
  CHECK(contains(message(wrong), "source.velocity.y is 0.1"));
  wrong.velocity[0] = std::numeric_limits<double>::quiet_NaN();
  CHECK(contains(message(wrong), "source.velocity.x is nan"));
  wrong = strip(0.1);
  wrong.flux = 0.0041;
  CHECK(message(wrong) ==
        "source.flux is 0.0041; allowed: at most the strip's area times the speed, 0.004 m^d/s");
  wrong.flux = -1;
  CHECK(contains(message(wrong), "source.flux is -1; allowed: a finite number > 0"));
  CHECK(message({.lower = {0, 0}, .upper = {0.1, 0.1}}) ==
        "source.flux is nan, not given; allowed: a finite number > 0, m^d/s");
  wrong = strip(0.1);
  wrong.inside = [](const Vec<2>&) { return false; };
  CHECK(contains(message(wrong), "source.inside"));
  CHECK(message({.lower = {0, 0},
                 .upper = {0.1, 0.1},
                 .flux = 0.01,
                 .inside = [](const Vec<2>&) { return false; }}) ==
        "source.inside: the number of random places that it refuses is 100000; allowed: a region "
        "that has a volume");
  wrong = strip(0.1);
  wrong.time = {.start = 2, .end = 1};
  CHECK(contains(message(wrong), "source.time.end is 1; allowed: later than the start"));
  wrong.time = {.start = -1};
  CHECK(contains(message(wrong), "source.time.start is -1"));
  wrong = strip(0.1);
  wrong.seeding.per_axis = 0;
  CHECK(contains(message(wrong), "seeding.per_axis is 0"));
  CHECK(contains(message_of<std::invalid_argument>([] { Sink<2>({}); }), "sink.region is nothing"));
  CHECK(contains(message_of<std::invalid_argument>([] { together<2>({nullptr}); }),
                 "a source or sink is null"));
}

TEST_CASE("what add refuses, and remove's predicate throws, changes nothing") {
  auto params = box<2>();
  const Grid<2> grid(params.grid);
  const auto sand = block<2>(grid, 0, 0.1);
  Sim<2> sim(params, sand);
  REQUIRE(sim.step().completed());
  const auto before = state_checksum(sim.particles());
  const auto unchanged = [&] {
    return state_checksum(sim.particles()) == before && sim.particles().next_id == sand.size() &&
           sim.particles().size() == sand.size();
  };
  CHECK(
      contains(message_of<std::invalid_argument>([&] { sim.add(sand); }), "what is filled twice"));
  CHECK(unchanged());
  CHECK(contains(message_of<std::invalid_argument>([&] { sim.add(sim.particles()); }),
                 "what is filled twice"));
  CHECK(unchanged());
  Particles<2> outside;
  outside.add({0.5, 0.1}, {0, 0}, 1e-6);
  CHECK(contains(message_of<std::invalid_argument>([&] { sim.add(outside); }),
                 "a particle's coordinate is 0.5"));
  CHECK(unchanged());
  int calls = 0;
  CHECK_THROWS_AS(sim.remove([&](std::size_t) {
    if (++calls > 5)
      throw std::runtime_error("no");
    return true;
  }),
                  std::runtime_error);
  CHECK(unchanged());
  CHECK(sim.step().completed());

  // a sink that throws leaves a state that must be restored
  bool throws = false;
  params.exchange = make_sink<2>([&](const Vec<2>&) {
    if (throws)
      throw std::runtime_error("no place");
    return false;
  });
  Sim<2> other(params, sand);
  REQUIRE(other.step().completed());
  const auto state = other.state();
  throws = true;
  CHECK_THROWS_AS(static_cast<void>(other.step()), std::runtime_error);
  throws = false;
  CHECK_THROWS_AS(static_cast<void>(other.step()), std::invalid_argument);
  CHECK_THROWS_AS(other.add(sand), std::invalid_argument);
  other.restore(state);
  CHECK(other.step().completed());
}

namespace {

/// Adds one particle a step.
class Drip final : public Exchange<2> {
 public:
  explicit Drip(const Vec<2>& x, double volume = 1e-6) : x_(x), volume_(volume) {}
  void exchange(double, double, const Execution&, Particles<2>& particles,
                Turnover& turnover) const override {
    particles.add(x_, {0, 0}, volume_);
    ++turnover.added;
  }

 private:
  Vec<2> x_;
  double volume_;
};

} // namespace

TEST_CASE("an exchange of one's own: what it adds wrongly is named") {
  const auto message = [&](const Vec<2>& x, double volume) {
    auto params = box<2>();
    params.exchange = std::make_shared<Drip>(x, volume);
    Sim<2> sim(params, Particles<2>());
    return message_of<std::invalid_argument>([&] { static_cast<void>(sim.step()); });
  };
  CHECK(message({0.1, 0.1}, 1e-6) == "(nothing thrown)");
  CHECK(contains(message({0.1, 0.3}, 1e-6), "a particle's coordinate is 0.3"));
  CHECK(contains(message({0.1, 0.1}, -1e-6), "a particle's volume is -1e-06"));
}

} // namespace test_source
