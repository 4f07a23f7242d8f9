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
#include <memory>
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

/// Steps a scene on one rank and on all, and goes on from the shared state with both half way.
template <class S>
void check_scene(scenes::Scene<S> scene, int steps) {
  S alone(scene.params, scene.particles);
  const auto team = ranks<S>({.interval = 10, .imbalance = 1.05});
  scene.params.ranks = team;
  S shared(scene.params, scene.particles);
  std::size_t here = shared.particles().size();
  CHECK(team->communicator().size() == mpi->size());
  for (int step = 1; step <= steps; ++step) {
    const StepReport one = alone.step(), report = shared.step();
    check_same(alone, one, shared, report);
    REQUIRE(checksum(shared) == checksum(alone));
    if (step == steps / 2) {
      SimulationState<S::dimension> whole = team->gather(shared.state());
      if (mpi->rank() == 0) {
        CHECK(whole.particles.size() == alone.particles().size());
        CHECK(whole.contacts.size() == alone.state().contacts.size());
        for (std::size_t j = 0; j < whole.stress_impulse.size(); ++j) {
          const Index<S::dimension> index = alone.grid().node_index(static_cast<int>(j));
          if (alone.grid().owner(index) == index) // not a copy
            CHECK(whole.stress_impulse[j] == alone.state().stress_impulse[j]);
        }
      }
      shared.restore(alone.state());
      CHECK(checksum(shared) == checksum(alone));
    }
  }
  here = std::max(here, shared.particles().size());
  MESSAGE("rank " << mpi->rank() << " of " << mpi->size() << ": up to " << here << " of "
                  << scene.particles.size() << " particles, dealt " << team->times_dealt()
                  << " times");
}

} // namespace

TEST_CASE("ranks: a collapse behind a gate, 2-D") { check_scene(scenes::collapse<2>(), 200); }
TEST_CASE("ranks: a collapse behind a gate, 3-D") { check_scene(scenes::collapse<3>(), 200); }
TEST_CASE("ranks: bodies fall on what runs out, 2-D") { check_scene(scenes::impact<2>(), 100); }
TEST_CASE("ranks: bodies fall on what runs out, 3-D") { check_scene(scenes::impact<3>(), 60); }
TEST_CASE("ranks: an endless chute, 2-D") { check_scene(scenes::chute<2>(), 200); }
TEST_CASE("ranks: an endless chute, 3-D") { check_scene(scenes::chute<3>(), 40); }

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  mpi = std::make_shared<distributed::Mpi>();
  doctest::Context context(argc, argv);
  const int failed = context.run();
  mpi.reset();
  MPI_Finalize();
  return failed;
}
