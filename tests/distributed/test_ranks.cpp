// SPDX-License-Identifier: MIT
// Ranks that share a simulation get what one alone gets, to the last bit. To be run by mpirun with
// any number of ranks; each makes the whole simulation as well.
//
//     mpirun -n 3 talus_tests_distributed

#define DOCTEST_CONFIG_IMPLEMENT
#include "../support/files.hpp"
#include "scenes.hpp"

#include "talus/core/fingerprint.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/energy_budget.hpp"
#include "talus/distributed/checkpoint.hpp"
#include "talus/distributed/mpi.hpp"
#include "talus/distributed/ranks.hpp"
#include "talus/distributed/shared.hpp"
#include "talus/distributed/together.hpp"
#include "talus/distributed/vtk.hpp"
#include "talus/io/matrix_market.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/io/vtk.hpp"
#include "talus/scene/fill.hpp"
#include "talus/scene/source.hpp"
#include "talus/solver/interior_point.hpp"
#include "talus/solver/sweeps_then_interior_point.hpp"

#include <doctest/doctest.h>
#include <sys/resource.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

using namespace talus;
using support::contains, support::content, support::message_of;
namespace fs = std::filesystem;

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
  CHECK(report.inflow == one.inflow);
  CHECK(report.inflow_volume == one.inflow_volume);
  CHECK(report.held_back_volume == one.held_back_volume);
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

/// Every term of a budget, as it is.
Array<double> all_terms(const EnergyRecord& record) {
  Array<double> values;
  const auto add = [&](const char*, double value) { values.push_back(value); };
  EnergyLevels::for_each(record.now, add);
  EnergyTerms::for_each(record.total, add);
  for (const BoundaryWork& work : record.total.boundaries)
    values.insert(values.end(), {work.friction, work.motion, work.impact});
  return values;
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
  const auto budget = std::make_shared<EnergyBudget<S::dimension>>();
  const auto shared_budget = std::make_shared<EnergyBudget<S::dimension>>();
  scene.params.observer = budget;
  if (mpi->rank() == 0)
    alone.emplace(scene.params, scene.particles);
  const auto team = ranks<S>({.interval = 10, .imbalance = 1.05});
  scene.params.ranks = team;
  scene.params.observer = shared_budget;
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
      CHECK(all_terms(shared_budget->record()) == all_terms(budget->record()));
      CHECK(shared_budget->momentum().after == budget->momentum().after);
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
      shared.restore(team->take_state(distributed::broadcast(*mpi, state)));
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
  check_scene(scenes::collapse<3>(), steps_for_ranks(100));
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
  check_scene(scenes::chute<3>(), steps_for_ranks(30));
}
TEST_CASE("ranks: bodies fall on what is viscous, 2-D") {
  check_scene(scenes::viscous_impact<2>(), steps_for_ranks(60));
}
TEST_CASE("ranks: bodies fall on what is viscous, 3-D") {
  check_scene(scenes::viscous_impact<3>(), steps_for_ranks(20));
}

TEST_CASE("ranks: interior points, alone and after sweeps that miss") {
  auto block = scenes::sliding_block<3>();
  block.params.faces.lower[0].kind = block.params.faces.upper[0].kind = FaceKind::periodic;
  block.params.faces.lower[1] = block.params.faces.upper[1] = {FaceKind::frictional, 0.3};
  block.params.faces.lower[2] = {FaceKind::frictional, 0.1}; // two contacts at an edge
  check_scene(scenes::with_solver<InteriorPoint>(block, {.tolerance = 1e-7}), 4);
  check_scene(scenes::with_solver<SweepsThenInteriorPoint>(
                  scenes::impact<2>(), {.tolerance = 1e-8, .max_sweeps = 10, .lagging_starts = 2}),
              10);
}

TEST_CASE("ranks: sand comes in and goes out") {
  check_scene(scenes::fountain<2>(), steps_for_ranks(200));
  check_scene(scenes::fountain<3>(), steps_for_ranks(100));
}

TEST_CASE("ranks: several materials") {
  check_scene(scenes::materials<2>(), steps_for_ranks(100));
  check_scene(scenes::materials<3>(), steps_for_ranks(60));
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
  CHECK_THROWS_AS((distributed::Ranks<2>(nullptr)), std::invalid_argument);

  scene.params.ranks = ranks<S>();
  S sim(scene.params, scene.particles);
  const support::Folder folder;
  static_cast<void>(sim.step());
  if (mpi->size() > 1) { // a part of a problem is none
    CHECK_THROWS_AS(write_problem(folder / "part.talus", sim.problem()), std::invalid_argument);
    CHECK_THROWS_AS(write_matrix_market(folder.path, sim.problem()), std::invalid_argument);
  }
}

TEST_CASE("ranks: what rank 0 asks in vain leaves the others at work") {
  using S = scenes::Sim<2>;
  const scenes::Scene<S> scene = scenes::sliding_block<2>();
  try {
    distributed::Shared<S> sim(scene.params, scene.particles); // on from here: rank 0
    const Index<2> node{2, 1};
    for (int n = 0; n < 2; ++n) { // before the first step and after restore()
      CHECK_THROWS_AS(static_cast<void>(sim.volume_fraction(node)), std::invalid_argument);
      CHECK_THROWS_AS(sim.set_gravity({std::nan(""), 0}), std::invalid_argument);
      CHECK(sim.step().completed());
      CHECK(sim.volume_fraction(node) > 0.5);
      sim.restore(sim.state());
    }
  } catch (const distributed::Served&) {
    CHECK(mpi->rank() > 0);
  }
}

namespace {

/// A folder that all ranks of a communicator use, gone afterwards.
class SharedFolder {
 public:
  SharedFolder() {
    std::int64_t number = mpi->rank() == 0 ? std::random_device{}() : 0;
    mpi->maximum(&number, 1);
    path_ = fs::temp_directory_path() / ("talus_pieces_" + std::to_string(number));
    if (mpi->rank() == 0)
      fs::create_directories(path_);
    wait();
  }
  ~SharedFolder() {
    wait();
    std::error_code ignored;
    if (mpi->rank() == 0)
      fs::remove_all(path_, ignored);
  }
  SharedFolder(const SharedFolder&) = delete;
  SharedFolder& operator=(const SharedFolder&) = delete;

  fs::path operator/(const char* name) const { return path_ / name; }
  /// The names of the files in it.
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(path_))
      names.insert(entry.path().filename().string());
    return names;
  }
  /// Until all ranks are here.
  static void wait() {
    std::int64_t nothing = 0;
    mpi->maximum(&nothing, 1);
  }

 private:
  fs::path path_;
};

/// While it is there, files of this process end after so many bytes, as on a disk that is full.
class SmallDisk {
 public:
  explicit SmallDisk(bool here, rlim_t bytes = 100) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    if (here)
      ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~SmallDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

/// A simulation on some of the ranks.
template <class S>
struct OnRanks {
  OnRanks(scenes::Scene<S> scene, std::shared_ptr<const distributed::Mpi> some)
      : talker(std::move(some)), team(std::make_shared<distributed::Ranks<S::dimension>>(talker)),
        sim(with(scene.params, team), scene.particles) {}

  void step(int steps) {
    for (int n = 0; n < steps; ++n)
      CHECK(sim.step().completed());
  }
  std::string checksum() const {
    auto sum = static_cast<std::int64_t>(state_fingerprint(sim.particles()));
    talker->sum(&sum, 1);
    return checksum_text(static_cast<std::uint64_t>(sum));
  }
  void write(const fs::path& path, const std::string& notes = {}) const {
    distributed::write_checkpoint(path, sim, *team, notes);
  }
  std::string read(const fs::path& path) { return distributed::read_checkpoint(path, sim, *team); }

  static typename S::Params with(typename S::Params params,
                                 std::shared_ptr<distributed::Ranks<S::dimension>> ranks) {
    params.ranks = std::move(ranks);
    return params;
  }

  std::shared_ptr<const distributed::Mpi> talker;
  std::shared_ptr<distributed::Ranks<S::dimension>> team;
  S sim;
};

/// Checks that a run goes on from a checkpoint with the bits that it has without one, on all ranks,
/// on one alone, and on less than all.
template <class S>
void check_pieces(const scenes::Scene<S>& scene, int before) {
  const SharedFolder folder;
  const fs::path path = folder / "checkpoint.talus";
  OnRanks<S> run(scene, mpi);
  run.step(before);
  run.write(path, "rank 0 knows");
  if (!scene.params.bodies.empty()) {
    CHECK(most_of_ranks(static_cast<std::int64_t>(run.sim.state().contacts.size())) > 0);
    CHECK(run.sim.state().body_contacts.size() > 1);
    int with_bodies = 0, with_obstacles = 0;
    for (const auto& contact : run.sim.problem().body_contacts) {
      const bool pushes = contact.impulse.norm() > 0;
      with_bodies += pushes && contact.other >= 0;
      with_obstacles += pushes && contact.boundary_id == 2 * S::dimension;
    }
    CHECK(with_bodies > 0);
    CHECK(with_obstacles > 0);
  }
  const std::string there = run.checksum();
  run.step(20);
  const std::string later = run.checksum();

  const auto goes_on = [&](const std::shared_ptr<const distributed::Mpi>& some) {
    OnRanks<S> other(scene, some);
    CHECK(other.read(path) == "rank 0 knows");
    CHECK(other.checksum() == there);
    CHECK(other.sim.steps() == static_cast<std::size_t>(before));
    other.step(20);
    CHECK(other.checksum() == later);
    CHECK(other.sim.time() == run.sim.time());
  };
  goes_on(mpi);
  goes_on(std::make_shared<distributed::Mpi>(MPI_COMM_SELF));
  MPI_Comm some; // two halves, of which each reads all
  MPI_Comm_split(MPI_COMM_WORLD, mpi->rank() % 2, 0, &some);
  goes_on(std::make_shared<distributed::Mpi>(some));
  MPI_Comm_free(&some);
}

/// Bodies on what slides on the bottom, beside an obstacle, and a block that falls on both.
template <int Dim>
scenes::Scene<scenes::Sim<Dim>> contacts() {
  auto scene = scenes::impact<Dim>();
  auto& params = scene.params;
  params.faces.lower[up_axis<Dim>] = {.kind = FaceKind::frictional, .friction = 0.3};
  Vec<Dim> centre = Vec<Dim>::Constant(0.1), size = Vec<Dim>::Constant(0.06);
  centre[0] = 0.14;
  centre[up_axis<Dim>] = 0.202;
  size[0] = 0.16;
  size[up_axis<Dim>] = 0.04;
  params.bodies.push_back(block_body<Dim>(centre, size, 2000, 0.4));
  params.bodies.back().start.velocity[up_axis<Dim>] = -1.5;
  Vec<Dim> corner = Vec<Dim>::Constant(1), foot = Vec<Dim>::Constant(-1);
  foot[0] = 0.242;
  foot[up_axis<Dim>] = 0.112;
  params.obstacles.push_back(make_obstacle<ShapeObstacle<Dim>>(
      {.shape = shapes::Box<Dim>(foot, corner), .friction = 0.2}));
  return scene;
}

} // namespace

TEST_CASE("pieces: a run goes on from them on any ranks, 2-D") {
  check_pieces(contacts<2>(), 42);
}
TEST_CASE("pieces: a run goes on from them on any ranks, 3-D") {
  check_pieces(contacts<3>(), 33);
}
TEST_CASE("pieces: a periodic run goes on from them") {
  check_pieces(scenes::chute<2>(), 20);
}

TEST_CASE("pieces: a run of several materials goes on from them") {
  check_pieces(scenes::materials<2>(), 20);
}

TEST_CASE("pieces: a checkpoint replaces the one before, and what was left of others") {
  using S = scenes::Sim<2>;
  const SharedFolder folder;
  const fs::path path = folder / "checkpoint.talus";
  OnRanks<S> run(scenes::impact<2>(), mpi);
  run.write(path);
  std::set<std::string> expected{"checkpoint.talus"};
  for (int rank = 0; rank < mpi->size(); ++rank)
    expected.insert("checkpoint.talus.1-" + std::to_string(rank));
  SharedFolder::wait();
  CHECK(folder.files() == expected);
  SharedFolder::wait();
  if (mpi->rank() == 0) {
    std::ofstream(folder / "checkpoint.talus.4-9") << "of a rank that was killed";
    std::ofstream(folder / "checkpoint.talus.5-0.tmp") << "as well";
    std::ofstream(folder / "checkpoint.talus.mine-0") << "not ours";
  }
  SharedFolder::wait();
  run.step(1);
  run.write(path);
  expected = {"checkpoint.talus", "checkpoint.talus.mine-0"};
  for (int rank = 0; rank < mpi->size(); ++rank)
    expected.insert("checkpoint.talus.6-" + std::to_string(rank));
  SharedFolder::wait();
  CHECK(folder.files() == expected);
  SharedFolder::wait();
  if (mpi->rank() == 0) {
    CHECK(distributed::is_in_pieces(path));
    S::Params params = run.sim.params();
    params.ranks = nullptr;
    S alone(params, {});
    CHECK(contains(message_of<std::runtime_error>([&] { read_checkpoint(path, alone); }),
                   "the pieces of a run on several ranks"));
    remove_checkpoint(path);
    CHECK(folder.files() == std::set<std::string>{"checkpoint.talus.mine-0"});
  }
  SharedFolder::wait();
}

TEST_CASE("pieces: what cannot be written is an error on all ranks, and leaves what was there") {
  using S = scenes::Sim<2>;
  const SharedFolder folder;
  const fs::path path = folder / "checkpoint.talus";
  OnRanks<S> run(scenes::impact<2>(), mpi);
  run.write(path, "the first");
  const std::set<std::string> files = folder.files();
  const std::string there = run.checksum();
  run.step(1);
  const auto refused = [&](const std::string& notes, const std::string& reason) {
    SharedFolder::wait();
    const std::string message = message_of<std::runtime_error>([&] { run.write(path, notes); });
    INFO(message);
    CHECK(contains(message, reason));
    SharedFolder::wait();
    CHECK(folder.files() == files);
    OnRanks<S> other(scenes::impact<2>(), mpi);
    CHECK(other.read(path) == "the first");
    CHECK(other.checksum() == there);
  };
  const int last = mpi->size() - 1;
  const std::string piece = path.string() + ".2-" + std::to_string(last);
  {
    const SmallDisk disk(mpi->rank() == last);
    refused({}, "cannot write " + piece + ": File too large");
  }
  {
    const SmallDisk disk(mpi->rank() == 0, 1000000);
    refused(std::string(1000000, 'x'), "cannot write " + path.string() + ": File too large");
  }
  refused(std::string((std::size_t{1} << 20U) + 1, 'x'), "notes");
}

TEST_CASE("pieces: what is no whole checkpoint of this simulation is refused on all ranks") {
  using S = scenes::Sim<2>;
  const SharedFolder folder;
  const fs::path path = folder / "checkpoint.talus";
  OnRanks<S> run(scenes::impact<2>(), mpi);
  run.write(path);
  const fs::path piece = path.string() + ".2-" + std::to_string(mpi->size() - 1);
  SharedFolder::wait();
  const std::string earlier = content(path.string() + ".1-" + std::to_string(mpi->size() - 1));
  run.step(20);
  run.write(path);
  SharedFolder::wait();
  const std::string list = content(path), last = content(piece);

  scenes::Scene<S> scene = scenes::impact<2>();
  OnRanks<S> other(scene, mpi), undisturbed(scene, mpi);
  const auto refuse = [&](OnRanks<S>& by, const std::string& reason) {
    SharedFolder::wait();
    const std::string message = message_of<std::runtime_error>([&] { by.read(path); });
    INFO(message);
    CHECK(contains(message, reason));
    SharedFolder::wait();
  };
  const auto refused = [&](const fs::path& file, const std::string& instead,
                           const std::string& reason) {
    SharedFolder::wait();
    const std::string right = file == path ? list : last;
    if (mpi->rank() == 0) {
      if (instead.empty())
        fs::remove(file);
      else
        std::ofstream(file, std::ios::binary) << instead;
    }
    refuse(other, reason);
    if (mpi->rank() == 0)
      std::ofstream(file, std::ios::binary) << right;
  };
  const auto damaged = [](std::string bytes, std::size_t at) {
    bytes[at] = static_cast<char>(bytes[at] ^ 1);
    return bytes;
  };
  const std::string name = piece.string();
  refused(piece, {}, "cannot read " + name + ": No such file");
  refused(piece, damaged(last, last.size() / 2), name + ": its checksum does not fit");
  refused(piece, damaged(last, last.size() - 1), name + ": its checksum does not fit");
  refused(piece, last.substr(0, last.size() / 2), name + ": its checksum does not fit");
  refused(piece, earlier, name + ": it is a piece of another checkpoint");
  refused(piece, list, name + ": it is no checkpoint");
  refused(path, {}, "cannot read " + path.string() + ": No such file");
  refused(path, damaged(list, list.size() / 2), path.string() + ": its checksum does not fit");
  refused(path, last, path.string() + ": it is no checkpoint");

  if (mpi->rank() == mpi->size() - 1) // on one rank alone
    scene.params.bodies[0].friction += 0.1;
  OnRanks<S> another(scene, mpi);
  refuse(another, "its bodies.0.friction is 0.3, this simulation's is 0.4");

  CHECK(other.checksum() == undisturbed.checksum());
  other.step(5);
  undisturbed.step(5);
  CHECK(other.checksum() == undisturbed.checksum());
  other.read(path);
  CHECK(other.checksum() == run.checksum());
  CHECK_THROWS_AS(distributed::read_checkpoint(path, other.sim, *run.team), std::invalid_argument);
}

TEST_CASE("pieces: particles with one id on two ranks are refused on all") {
  using S = scenes::Sim<2>;
  OnRanks<S> run(scenes::sliding_block<2>(), mpi);
  distributed::StateShare<2> share;
  share.state = run.sim.state();
  share.state.particles.resize(1);
  share.state.particles.id[0] = 7;
  share.state.stress_impulse.clear();
  if (mpi->size() > 1)
    CHECK_THROWS_AS(run.team->part_of_shares(share), std::invalid_argument);
  run.step(1);
  CHECK(run.sim.steps() == 1);
}

namespace {

/// The numbers that follow `key=` in a file, in order.
std::vector<std::size_t> counts(const fs::path& path, const std::string& key) {
  std::vector<std::size_t> found;
  const std::string text = content(path), begin = key + "=\"";
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1))
    found.push_back(std::stoul(text.substr(at + begin.size())));
  return found;
}

/// Σ over the particles of the ranks of a fingerprint of the id and the field's numbers.
template <class S>
std::int64_t fingerprint(const OnRanks<S>& run, const VtkField& field) {
  std::uint64_t sum = 0;
  const auto components = static_cast<std::size_t>(field.components);
  for (std::size_t p = 0; p < run.sim.particles().size(); ++p) {
    Fingerprint one;
    one.add(std::uint64_t{run.sim.particles().id[p]});
    for (std::size_t k = 0; k < components; ++k)
      one.add(std::bit_cast<std::uint64_t>(field.values.at(components * p + k)));
    sum += one.value();
  }
  auto of_all = static_cast<std::int64_t>(sum);
  run.talker->sum(&of_all, 1);
  return of_all;
}

/// Files of all ranks beside those of one.
template <class S>
void check_vtk(const scenes::Scene<S>& scene) {
  constexpr int dim = S::dimension;
  const SharedFolder folder;
  OnRanks<S> run(scene, mpi), alone(scene, std::make_shared<distributed::Mpi>(MPI_COMM_SELF));
  run.step(10);
  alone.step(10);
  const auto write = [&](const OnRanks<S>& by, const char* particles, const char* cells) {
    const auto stress = [&](const Index<dim>& node) { return by.sim.stress(node); };
    const auto fraction = [&](const Index<dim>& node) { return by.sim.volume_fraction(node); };
    const distributed::ParallelVtk vtk(by.sim);
    const VtkField at_particles = vtk.particle_field("stress", stress);
    vtk.write_particles(folder / particles, {vtk_field("id", by.sim.particles().id), at_particles});
    vtk.write_cells(folder / cells,
                    {vtk.node_field("stress", stress), vtk.node_field("fraction", fraction)});
    return fingerprint(by, at_particles);
  };
  const std::int64_t written = write(run, "particles.pvtu", "cells.pvtu");
  SharedFolder::wait();
  if (mpi->rank() == 0) {
    CHECK(write(alone, "all_particles.pvtu", "all_cells.pvtu") == written);
    std::size_t particles = 0, cells = 0;
    for (int rank = 0; rank < mpi->size(); ++rank) {
      const std::string end = "_" + std::to_string(rank) + ".vtu";
      particles += counts(folder / ("particles" + end).c_str(), "NumberOfPoints").at(0);
      cells += counts(folder / ("cells" + end).c_str(), "NumberOfCells").at(0);
      CHECK(contains(content(folder / "cells.pvtu"), "<Piece Source=\"cells" + end + "\"/>"));
      CHECK(contains(content(folder / "particles.pvtu"), "\"particles" + end + "\""));
    }
    CHECK(particles == alone.sim.particles().size());
    CHECK(cells == counts(folder / "all_cells_0.vtu", "NumberOfCells").at(0));
    CHECK(cells > 0);
    CHECK(counts(folder / "cells.pvtu", "NumberOfComponents") == std::vector<std::size_t>{9, 1, 3});
    if (const char* const kept = std::getenv("TALUS_VTK_SAMPLES")) { // for tests/tools/check_vtk.py
      const fs::path samples = fs::path(kept) / (std::to_string(dim) + "d");
      fs::create_directories(samples);
      for (const std::string& name : folder.files())
        fs::copy_file(folder / name.c_str(), samples / name, fs::copy_options::overwrite_existing);
    }
    fs::create_directories(folder / "cells.pvtu.tmp"); // in the way
  }
  SharedFolder::wait();
  CHECK(
      contains(message_of<std::runtime_error>([&] { write(run, "particles.pvtu", "cells.pvtu"); }),
               "cells.pvtu"));
}

} // namespace

TEST_CASE("parallel VTK: each particle and each cell with material in one piece") {
  check_vtk(contacts<2>());
  check_vtk(contacts<3>());
  check_vtk(scenes::chute<2>());
}

TEST_CASE("ranks: what one refuses is refused on all") { // or the others would wait for it
  using S = scenes::Sim<2>;
  const scenes::Scene<S> scene = scenes::sliding_block<2>();
  const auto rank = static_cast<std::size_t>(mpi->rank());
  const auto ranks_count = static_cast<std::size_t>(mpi->size());
  const auto refused = [&](const S::Params& params, const S::ParticleData& particles,
                           const char* reason) {
    S::Params with = params;
    with.ranks = ranks<S>();
    const std::string message = message_of<std::invalid_argument>([&] { S(with, particles); });
    INFO(message);
    CHECK(contains(message, reason));
    SharedFolder::wait();
  };
  // filled twice where one rank looks
  S::ParticleData twice = scene.particles;
  for (std::size_t p = 0; p < scene.particles.size(); ++p)
    if (scene.particles.position[p][0] > 0.28)
      for (int n = 0; n < 3; ++n)
        twice.add(scene.particles.position[p], {0, 0}, scene.particles.volume[p]);
  refused(scene.params, twice, "what is filled twice has 2");
  CHECK(contains(
      message_of<std::invalid_argument>([&] { distributed::Shared<S>(scene.params, twice); }),
      "what is filled twice has 2"));
  SharedFolder::wait();
  // particles of one rank alone
  S::ParticleData mine;
  for (std::size_t p = rank; p < scene.particles.size(); p += ranks_count) {
    mine.resize(mine.size() + 1);
    mine.copy(mine.size() - 1, scene.particles, p);
  }
  mine.next_id = scene.particles.next_id;
  S::ParticleData wrong = mine;
  if (rank + 1 == ranks_count)
    wrong.velocity[0][0] = std::nan("");
  refused(scene.params, wrong, "a particle's velocity");
  wrong = mine;
  if (rank + 1 == ranks_count) {
    wrong.resize_material(wrong.size());
    wrong.material[0] = 7;
  }
  refused(scene.params, wrong, "a particle's material");

  S::Params params = scene.params;
  params.ranks = ranks<S>();
  S sim(params, mine);
  const std::string before = checksum(sim);
  CHECK_THROWS_AS(sim.add(wrong), std::invalid_argument);
  const auto leaves = [&](std::size_t p) {
    if (sim.particles().id[p] == 3)
      throw std::invalid_argument("it stays");
    return true;
  };
  CHECK(message_of<std::invalid_argument>([&] { sim.remove(leaves); }) == "it stays");
  CHECK(checksum(sim) == before);
  CHECK(sim.step().completed());
}

TEST_CASE("ranks: particles that each has counted from 0 are refused, not lost") {
  using S = scenes::Sim<2>;
  scenes::Scene<S> scene = scenes::sliding_block<2>();
  scene.params.ranks = ranks<S>();
  S::ParticleData mine; // as many on each, from right to left: most are not in the rank's own nodes
  const double width = 0.48 / mpi->size(), right = 0.48 - width * mpi->rank();
  fill_box<2>(mine, Grid<2>(scene.params.grid), {right - width, 0}, {right, 0.06}, {.per_axis = 2});
  if (mpi->size() > 1)
    CHECK(contains(message_of<std::invalid_argument>([&] { S(scene.params, mine); }),
                   "the id of particles of two ranks"));
}

TEST_CASE("ranks: the first particles of one of them count as for one process") {
  using S = scenes::Sim<2>;
  scenes::Scene<S> scene = scenes::sliding_block<2>();
  const Grid<2> grid(scene.params.grid);
  const double volume = grid.cell_volume() / 4; // one a step
  const auto source = [&](double x, double start) {
    return make_source<2>(grid, {.lower = {x, 0},
                                 .upper = {x + 0.06, 0.08},
                                 .flux = volume / scene.params.time_step,
                                 .time = {.start = start},
                                 .seeding = {.per_axis = 2}});
  };
  scene.params.exchange = together<2>({source(0.9, 0), source(0, 5 * scene.params.time_step)});
  S alone(scene.params, {});
  scene.params.ranks = ranks<S>();
  S shared(scene.params, {}); // the right end is not the rank's that has the left one
  for (int n = 0; n < 10; ++n) {
    const StepReport one = alone.step();
    check_same(alone, one, shared, shared.step());
    CHECK(checksum(shared) == checksum(alone));
  }
  CHECK(alone.particles().size() > 8);
}

TEST_CASE("ranks: fields of a shared simulation are those of one process, rounding included") {
  using S = scenes::Sim<2>;
  scenes::Scene<S> scene = scenes::sliding_block<2>();
  scene.params.grid = {.origin = {3.33, 0}, .size = {0.16, 0.08}, .cells = {8, 4}};
  scene.particles = {};
  for (int k = 0; k < 40; ++k) // on a face: the nodes a cell before it get nothing but rounding
    scene.particles.add({3.33 + 0.16, 0.002 * k}, {0, 0}, 1e-6);
  S alone(scene.params, scene.particles);
  static_cast<void>(alone.step());
  try {
    distributed::Shared<S> sim(scene.params, scene.particles);
    static_cast<void>(sim.step());
    int below = 0;
    for (int i = 0; i <= 8; ++i)
      for (int k = 0; k <= 4; ++k) {
        const Index<2> node{i, k};
        below += alone.volume_fraction(node) < 0;
        CHECK(sim.volume_fraction(node) == alone.volume_fraction(node));
        CHECK(sim.velocity(node) == alone.velocity(node));
        CHECK(sim.stress(node) == alone.stress(node));
      }
    CHECK(below > 0);
  } catch (const distributed::Served&) {
    CHECK(mpi->rank() > 0);
  }
}

TEST_CASE("ranks: a checkpoint of one process is not made of a part") {
  using S = scenes::Sim<2>;
  const SharedFolder folder;
  OnRanks<S> run(scenes::sliding_block<2>(), mpi);
  if (mpi->size() > 1)
    CHECK_THROWS_AS(write_checkpoint(folder / "part.talus", run.sim), std::invalid_argument);
  SharedFolder::wait();
  CHECK(folder.files() == std::set<std::string>());
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
