// SPDX-License-Identifier: MIT
// Ranks that share a simulation get what one alone gets, to the last bit. To be run by mpirun with
// any number of ranks; each makes the whole simulation as well.
//
//     mpirun -n 3 talus_tests_distributed

#define DOCTEST_CONFIG_IMPLEMENT
#include "scenes.hpp"

#include "talus/diagnostics/checksum.hpp"
#include "talus/distributed/mpi.hpp"
#include "talus/distributed/ranks.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

using namespace talus;

namespace {

std::shared_ptr<const distributed::Mpi> mpi;

/// The fingerprint of all ranks' particles.
template <class S>
std::string checksum(const S& sim) {
  auto sum = static_cast<std::int64_t>(state_fingerprint(sim.particles()));
  if (sim.params().ranks)
    mpi->sum(&sum, 1);
  return checksum_text(static_cast<std::uint64_t>(sum));
}

template <class S>
std::shared_ptr<distributed::Ranks<S::dimension>> ranks(distributed::Dealing dealing = {}) {
  return std::make_shared<distributed::Ranks<S::dimension>>(mpi, dealing);
}

std::int64_t most_of_ranks(std::int64_t value) {
  mpi->maximum(&value, 1);
  return value;
}

/// What a step leaves that is not in the particles.
template <class S>
void check_same(const S& alone, const StepReport& one, const S& shared, const StepReport& report) {
  CHECK(report.solve.iterations == one.solve.iterations);
  CHECK(report.solve.residual.l2 == one.solve.residual.l2);
  CHECK(report.solve.residual.max == one.solve.residual.max);
  CHECK(report.time_step == one.time_step);
  CHECK(report.cones == one.cones);
  CHECK(report.contacts == one.contacts);
  CHECK(report.courant == one.courant);
  CHECK(report.largest_fraction == one.largest_fraction);
  CHECK(report.outflow == one.outflow);
  CHECK(report.outflow_volume == one.outflow_volume);
  CHECK(report.friction_updates == one.friction_updates);
  CHECK(report.viscous.iterations == one.viscous.iterations);
  for (int a = 0; a < S::dimension; ++a)
    for (const bool upper : {false, true}) {
      CHECK(shared.face_wrench(a, upper).force == alone.face_wrench(a, upper).force);
      CHECK(shared.face_wrench(a, upper).torque == alone.face_wrench(a, upper).torque);
    }
  for (std::size_t o = 0; o < alone.params().obstacles.size(); ++o)
    CHECK(shared.obstacle_wrench(o).torque == alone.obstacle_wrench(o).torque);
  for (std::size_t b = 0; b < alone.bodies().size(); ++b) {
    CHECK(shared.body_wrench(b).force == alone.body_wrench(b).force);
    CHECK(shared.bodies()[b].position == alone.bodies()[b].position);
    CHECK(shared.bodies()[b].angular_velocity == alone.bodies()[b].angular_velocity);
  }
}

/// What rank 0 has, on all ranks.
Array<char> broadcast(const Array<char>& bytes) {
  Array<Message> out;
  for (int to = 0; to < mpi->size() && mpi->rank() == 0; ++to) {
    out.emplace_back();
    out.back().rank = to;
    out.back().bytes = bytes;
  }
  return mpi->deliver(out)[0].bytes;
}

/// Many ranks on few cores wait most of the time: there the long runs are cut short, unless
/// TALUS_LONG_TESTS is set.
int steps_for_ranks(int steps) {
  const bool short_one = mpi->size() == 1 || mpi->size() > available_threads();
  return short_one && std::getenv("TALUS_LONG_TESTS") == nullptr ? std::max(20, steps / 10) : steps;
}

/// Steps a scene on rank 0 alone and on all, and goes on from the state of that one half way.
/// Returns how often the grid was dealt.
template <class S>
std::size_t check_scene(scenes::Scene<S> scene, int steps) {
  std::optional<S> alone;
  if (mpi->rank() == 0)
    alone.emplace(scene.params, scene.particles);
  const auto team = ranks<S>({.interval = 10, .imbalance = 1.05});
  scene.params.ranks = team;
  scene.params.threads = 1 + mpi->rank() % 2; // every other rank has two
  S shared(scene.params, scene.particles);
  CHECK(team->communicator().size() == mpi->size());
  CHECK(shared.grid().node_count() <= Grid<S::dimension>(scene.params.grid).node_count());
  for (int step = 1; step <= steps; ++step) {
    const StepReport report = shared.step();
    const std::string found = checksum(shared);
    if (alone) {
      const StepReport one = alone->step();
      check_same(*alone, one, shared, report);
      REQUIRE(found == checksum(*alone));
    }
    if (step == steps / 2) {
      const SimulationState<S::dimension> whole = team->gather(shared.state());
      Array<char> state;
      if (alone) {
        CHECK(whole.particles.size() == alone->particles().size());
        CHECK(whole.contacts.size() == alone->state().contacts.size());
        for (std::size_t j = 0; j < whole.stress_impulse.size(); ++j) {
          const Index<S::dimension> index = alone->grid().node_index(static_cast<int>(j));
          if (alone->grid().owner(index) == index) // not a copy
            CHECK(whole.stress_impulse[j] == alone->state().stress_impulse[j]);
        }
        team->put_state(alone->state(), state);
      }
      shared.restore(team->take_state(broadcast(state)));
      CHECK(checksum(shared) == found);
    }
  }
  return team->times_dealt();
}

} // namespace

TEST_CASE("ranks: a collapse behind a gate, 2-D") {
  check_scene(scenes::collapse<2>(), steps_for_ranks(200));
}
TEST_CASE("ranks: a collapse behind a gate, 3-D") {
  check_scene(scenes::collapse<3>(), steps_for_ranks(200));
}
TEST_CASE("ranks: bodies fall on what runs out, 2-D") {
  check_scene(scenes::impact<2>(), steps_for_ranks(100));
}
TEST_CASE("ranks: bodies fall on what runs out, 3-D") {
  check_scene(scenes::impact<3>(), steps_for_ranks(60));
}
TEST_CASE("ranks: an endless chute, 2-D") {
  check_scene(scenes::chute<2>(), steps_for_ranks(200));
}
TEST_CASE("ranks: an endless chute, 3-D") {
  check_scene(scenes::chute<3>(), steps_for_ranks(40));
}

TEST_CASE("ranks: the grid is dealt again when the load has moved") {
  // once at the start and once for the restored state
  CHECK((check_scene(scenes::sliding_block<2>(), 120) > 2) == (mpi->size() > 1));
  CHECK((check_scene(scenes::sliding_block<3>(), 60) > 2) == (mpi->size() > 1));
}

TEST_CASE("ranks: each gives others' particles, its own, or all; never some twice") {
  using S = scenes::Sim<2>;
  scenes::Scene<S> scene = scenes::sliding_block<2>();
  const std::string all = state_checksum(scene.particles);
  const auto shared_out = [&](const auto& is_mine) {
    S::ParticleData mine;
    for (std::size_t p = 0; p < scene.particles.size(); ++p)
      if (is_mine(p)) {
        mine.resize(mine.size() + 1);
        mine.copy(mine.size() - 1, scene.particles, p);
      }
    mine.next_id = scene.particles.next_id;
    scene.params.ranks = ranks<S>();
    return S(scene.params, mine);
  };
  const auto ranks_count = static_cast<std::size_t>(mpi->size());
  const auto rank = static_cast<std::size_t>(mpi->rank());
  CHECK(checksum(shared_out([](std::size_t) { return true; })) == all);
  CHECK(checksum(shared_out([&](std::size_t p) { return p % ranks_count == rank; })) == all);
  CHECK(checksum(shared_out([&](std::size_t) { return rank == 0; })) == all);
  if (mpi->size() > 1)
    CHECK_THROWS_AS(shared_out([&](std::size_t p) { return rank == 0 || p < 3; }),
                    std::invalid_argument);
}

TEST_CASE("ranks: an empty box, and one that holds less blocks than there are ranks") {
  using S = scenes::Sim<2>;
  scenes::Scene<S> scene = scenes::sliding_block<2>();
  scene.params.grid.size = {0.06, 0.06};
  scene.params.grid.cells = {3, 3}; // one block
  scene.params.ranks = ranks<S>();
  S empty(scene.params, {});
  CHECK(empty.step().completed());
  S::ParticleData one;
  one.add({0.03, 0.03}, {0.1, 0}, 1e-4);
  scene.params.ranks = nullptr;
  S alone(scene.params, one);
  scene.params.ranks = ranks<S>();
  S shared(scene.params, one);
  for (int step = 0; step < 20; ++step) {
    const StepReport report = alone.step();
    check_same(alone, report, shared, shared.step());
  }
  CHECK(checksum(shared) == checksum(alone));
  const std::int64_t owners = shared.particles().empty() ? 0 : 1;
  CHECK(most_of_ranks(owners) == 1);
}

TEST_CASE("ranks: wrong input is refused on all of them") {
  using S = scenes::Sim<2>;
  scenes::Scene<S> scene = scenes::sliding_block<2>();
  CHECK_THROWS_AS(ranks<S>({.interval = 0}), std::invalid_argument);
  CHECK_THROWS_AS(ranks<S>({.interval = 1, .imbalance = 0.9}), std::invalid_argument);
  const auto refused = [&](const auto& change) {
    scenes::Scene<S> wrong = scene;
    change(wrong);
    wrong.params.ranks = ranks<S>();
    CHECK_THROWS_AS(S(wrong.params, wrong.particles), std::invalid_argument);
  };
  refused([](auto& wrong) { wrong.params.grid.cells[0] = 0; });
  refused([](auto& wrong) { wrong.particles.position[5][0] = 7; });
  refused([](auto& wrong) { wrong.particles.id[5] = wrong.particles.id[6]; });
  refused([](auto& wrong) { wrong.params.time_step = -1; });
}

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  mpi = std::make_shared<distributed::Mpi>();
  doctest::Context context(argc, argv);
  const int failed = context.run();
  mpi.reset();
  MPI_Finalize();
  return failed;
}
