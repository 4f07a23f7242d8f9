// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/bytes_of.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/strain_rate.hpp"
#include "talus/distributed/checkpoint.hpp"
#include "talus/distributed/mpi.hpp"
#include "talus/distributed/ranks.hpp"
#include "talus/distributed/together.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/step/report.hpp"
#include "talus/step/state.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace talus::distributed {

/// Thrown out of the constructor of Shared on all ranks but the first, when that one is done with
/// the simulation: there is nothing more to do there but to end the program with status 0.
struct Served {};

/// A simulation on all ranks of MPI that is used from rank 0 alone, as if it were there as a whole:
/// a program written for one process, whose files, tables and messages are those of one process.
///
///     distributed::Shared<Simulation<3, …>> sim(params, particles); // instead of Simulation<3, …>
///
/// Rank 0 goes on with the program; the others make the same simulation and serve it until it is
/// destroyed, then throw Served. particles(), the nodal fields and state() are gathered when they
/// are asked for, once a step, so rank 0 needs memory for all that the program looks at. A program
/// that must not gather makes its own measurements on each rank's part, see Ranks.
///
/// If a step throws, on whatever rank, the program ends on all of them with its message, by
/// MPI_Abort: what the others wait for would never come.
template <class Sim>
class Shared {
 public:
  static constexpr int dimension = Sim::dimension;
  using Params = typename Sim::Params;
  using ParticleData = typename Sim::ParticleData;
  using Real = typename ParticleData::Scalar;
  /// What each rank does with its part when rank 0 calls call(text). What it throws, it must throw
  /// on all ranks, as ParallelVtk does; all but rank 0 then go on serving.
  using OnCall = void (*)(const Sim& part, const std::string& text);

  /// As the simulation's own, on all ranks with the same arguments; params.ranks is set here.
  Shared(Params params, ParticleData particles, Dealing dealing = {}, OnCall on_call = nullptr)
      : mpi_(std::make_shared<Mpi>()),
        ranks_(std::make_shared<Ranks<dimension, Real>>(mpi_, dealing)),
        grid_(params.grid, params.faces.periodic()), on_call_(on_call) {
    params.ranks = ranks_;
    part_.emplace(std::move(params), std::move(particles));
    if (mpi_->rank() > 0) {
      serve();
      throw Served();
    }
  }
  ~Shared() {
    if (mpi_->rank() == 0)
      command(Command::end);
  }
  Shared(const Shared&) = delete;
  Shared& operator=(const Shared&) = delete;

  StepReport step() {
    return step([](const auto&) {});
  }
  /// before_solve gets rank 0's part of the problem.
  template <class BeforeSolve>
  StepReport step(const BeforeSolve& before_solve) {
    command(Command::step);
    particles_.reset();
    fields_.reset();
    return try_step(before_solve);
  }
  void set_gravity(const Vec<dimension>& gravity) {
    check_gravity("gravity", gravity);
    command(Command::gravity);
    Array<char> bytes;
    put(bytes, gravity);
    broadcast(*mpi_, std::move(bytes));
    part_->set_gravity(gravity);
  }

  double time() const { return part_->time(); }
  double time_step() const { return part_->time_step(); }
  std::size_t steps() const { return part_->steps(); }
  const Vec<dimension>& gravity() const { return part_->gravity(); }
  const Params& params() const { return part_->params(); }
  int materials() const { return part_->materials(); }
  double density(int material) const { return part_->density(material); }
  const Grid<dimension>& grid() const { return grid_; } ///< the whole one
  const auto& bodies() const { return part_->bodies(); }
  decltype(auto) face_wrench(int axis, bool upper) const { return part_->face_wrench(axis, upper); }
  decltype(auto) obstacle_wrench(std::size_t o) const { return part_->obstacle_wrench(o); }
  decltype(auto) body_wrench(std::size_t body) const { return part_->body_wrench(body); }

  /// All particles, sorted by their ids.
  const ParticleData& particles() const {
    if (!particles_) {
      command(Command::particles);
      particles_.emplace(ranks_->gather_particles(part_->state().particles));
    }
    return *particles_;
  }

  // Nodal fields, see Simulation.
  double volume_fraction(const Index<dimension>& node) const { return at(node).volume_fraction; }
  Vec<dimension> velocity(const Index<dimension>& node) const { return at(node).velocity; }
  Mat<dimension> stress(const Index<dimension>& node) const { return at(node).stress; }
  double pressure(const Index<dimension>& node) const { return stress(node).trace() / dimension; }
  double inertial_number(const Index<dimension>& node) const { return at(node).inertial_number; }
  double material_fraction(const Index<dimension>& node, int material) const {
    require_index("material_fraction: material", material, materials());
    static_cast<void>(at(node)); // gathers, if that was not done
    return fractions_[static_cast<std::ptrdiff_t>(number(node)) * materials() + material];
  }
  /// See StrainRate.
  const Mat<dimension>& strain_rate(const Index<dimension>& node) const {
    return at(node).strain_rate;
  }

  /// The state of the whole grid, as restore() takes it on any number of ranks.
  SimulationState<dimension, Real> state() const {
    command(Command::state);
    return ranks_->gather(part_->state());
  }
  void restore(SimulationState<dimension, Real> state) {
    command(Command::restore);
    Array<char> bytes;
    ranks_->put_state(state, bytes);
    broadcast(*mpi_, std::move(bytes));
    part_->restore(std::move(state)); // throws on all ranks or on none
    particles_.reset();
    fields_.reset();
  }

  /// Saves the state in pieces, or goes on from them, without gathering: see
  /// distributed::write_checkpoint and read_checkpoint. Here a checkpoint of a program for one
  /// process is read, too.
  void write_checkpoint(const std::filesystem::path& path, std::string_view notes = {}) const {
    command(Command::write);
    static_cast<void>(broadcast(*mpi_, path.string()));
    distributed::write_checkpoint(path, *part_, *ranks_, notes);
  }
  std::string read_checkpoint(const std::filesystem::path& path) {
    if (!is_in_pieces(path))
      return talus::read_checkpoint(path, *this);
    command(Command::read);
    static_cast<void>(broadcast(*mpi_, path.string()));
    std::string notes = distributed::read_checkpoint(path, *part_, *ranks_);
    particles_.reset();
    fields_.reset();
    return notes;
  }

  /// Calls the constructor's on_call on all ranks. Throws std::invalid_argument if there is none.
  void call(const std::string& text) const {
    if (on_call_ == nullptr)
      throw_invalid("on_call", "null", "what the ranks do when they are called");
    command(Command::call);
    static_cast<void>(broadcast(*mpi_, text));
    on_call_(*part_, text);
  }

  /// Largest |v_p|, m/s, and how high the highest particle is, m, without gathering them.
  double largest_speed() const {
    command(Command::largest_speed);
    return largest_speed_of_all();
  }
  double highest_particle() const {
    command(Command::highest_particle);
    return highest_of_all();
  }
  /// See state_fingerprint().
  std::uint64_t fingerprint() const {
    command(Command::fingerprint);
    return fingerprint_of_all();
  }

  /// Ranks, messages and bytes that this one has sent, and the largest load over the mean.
  const Mpi& mpi() const { return *mpi_; }
  const Ranks<dimension, Real>& ranks() const { return *ranks_; }

 private:
  enum class Command : std::int64_t {
    end = 1,
    step,
    gravity,
    particles,
    fields,
    state,
    restore,
    write,
    read,
    call,
    largest_speed,
    highest_particle,
    fingerprint
  };

  struct Node {
    double volume_fraction = 0;
    Vec<dimension> velocity = Vec<dimension>::Zero();
    Mat<dimension> stress = Mat<dimension>::Zero();
    Mat<dimension> strain_rate = Mat<dimension>::Zero();
    double inertial_number = 0;
  };

  /// Tells the other ranks what is done next.
  void command(Command what) const {
    auto code = static_cast<std::int64_t>(what);
    mpi_->sum(&code, 1);
  }
  Command next_command() const {
    std::int64_t code = 0;
    mpi_->sum(&code, 1);
    return static_cast<Command>(code);
  }

  void serve() {
    for (Command what = next_command(); what != Command::end; what = next_command()) {
      switch (what) {
      case Command::step:
        static_cast<void>(try_step([](const auto&) {}));
        break;
      case Command::gravity: {
        const Array<char> bytes = broadcast(*mpi_);
        part_->set_gravity(Taker(bytes).template take<Vec<dimension>>());
        break;
      }
      case Command::particles:
        static_cast<void>(ranks_->gather_particles(part_->state().particles));
        break;
      case Command::fields:
        static_cast<void>(gather_fields());
        break;
      case Command::state:
        static_cast<void>(ranks_->gather(part_->state()));
        break;
      case Command::restore: {
        const Array<char> bytes = broadcast(*mpi_);
        try {
          part_->restore(ranks_->take_state(bytes));
        } catch (const std::invalid_argument&) { // NOLINT: rank 0 has thrown the same
        }
        break;
      }
      case Command::write:
      case Command::read:
      case Command::call: {
        const std::string text = broadcast(*mpi_, std::string());
        try {
          if (what == Command::call)
            on_call_(*part_, text);
          else if (what == Command::write)
            distributed::write_checkpoint(text, *part_, *ranks_);
          else
            static_cast<void>(distributed::read_checkpoint(text, *part_, *ranks_));
        } catch (const std::exception&) { // NOLINT: rank 0 has thrown the same
        }
        break;
      }
      case Command::largest_speed:
        static_cast<void>(largest_speed_of_all());
        break;
      case Command::highest_particle:
        static_cast<void>(highest_of_all());
        break;
      case Command::fingerprint:
        static_cast<void>(fingerprint_of_all());
        break;
      case Command::end:
        break;
      }
    }
  }

  template <class BeforeSolve>
  StepReport try_step(const BeforeSolve& before_solve) {
    if (mpi_->size() == 1)
      return part_->step(before_solve);
    try {
      return part_->step(before_solve);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "rank %d: %s\n", mpi_->rank(), error.what());
    } catch (...) {
      std::fprintf(stderr, "rank %d: an exception of unknown type\n", mpi_->rank());
    }
    std::fflush(nullptr);
    MPI_Abort(MPI_COMM_WORLD, 1);
    std::terminate();
  }

  double largest_speed_of_all() const {
    double largest2 = 0;
    for (const auto& v : part_->particles().velocity)
      largest2 = std::max(largest2, v.template cast<double>().squaredNorm());
    return std::sqrt(Execution(1, mpi_.get()).largest(largest2));
  }
  double highest_of_all() const {
    double highest = -std::numeric_limits<double>::infinity();
    for (const Vec<dimension>& x : part_->particles().position)
      highest = std::max(highest, x[up_axis<dimension>]);
    // numbers below 0 are ordered against their bits
    auto key = std::bit_cast<std::int64_t>(highest);
    const std::int64_t below = std::numeric_limits<std::int64_t>::min();
    key = key < 0 ? below - key : key;
    mpi_->maximum(&key, 1);
    return std::bit_cast<double>(key < 0 ? below - key : key);
  }
  std::uint64_t fingerprint_of_all() const {
    auto sum = static_cast<std::int64_t>(state_fingerprint(part_->particles()));
    mpi_->sum(&sum, 1);
    return static_cast<std::uint64_t>(sum);
  }

  const Node& at(const Index<dimension>& node) const {
    number(node);
    if (!fields_) {
      part_->problem(); // throws before the others are called if there are no fields
      command(Command::fields);
      fields_.emplace(gather_fields());
    }
    return (*fields_)[number(node)];
  }
  int number(const Index<dimension>& node) const { return grid_.node_in_window(node); }
  Array<Node> gather_fields() const {
    Array<Message> out(1);
    const StrainRate<dimension> strain_rate(*part_);
    const BlockOrder<dimension> order(part_->grid());
    for (const int node : order.nodes()) {
      const Index<dimension> index = part_->grid().node_index(node);
      const double fraction = part_->volume_fraction(index);
      if (fraction == 0) // not below: rounding may leave some, and one process shows it
        continue;
      put(out[0].bytes, index);
      put(out[0].bytes, Node{fraction, part_->velocity(index), part_->stress(index),
                             strain_rate(index), part_->inertial_number(index)});
      for (int m = 0; m < materials(); ++m)
        put(out[0].bytes, part_->material_fraction(index, m));
    }
    const Array<Message> in = mpi_->deliver(out);
    Array<Node> fields;
    if (mpi_->rank() != 0)
      return fields;
    const auto nodes = static_cast<std::size_t>(grid_.node_count());
    fields.assign(nodes, Node());
    fractions_.assign(nodes * static_cast<std::size_t>(materials()), 0);
    for (const Message& message : in)
      for (Taker taker(message.bytes); !taker.at_end();) {
        const int node = grid_.node(taker.template take<Index<dimension>>());
        taker.take(fields[node]);
        for (int m = 0; m < materials(); ++m)
          taker.take(fractions_[static_cast<std::ptrdiff_t>(node) * materials() + m]);
      }
    return fields;
  }

  std::shared_ptr<Mpi> mpi_;
  std::shared_ptr<Ranks<dimension, Real>> ranks_;
  Grid<dimension> grid_;
  OnCall on_call_;
  std::optional<Sim> part_; ///< this rank's
  mutable std::optional<ParticleData> particles_;
  mutable std::optional<Array<Node>> fields_;
  mutable Array<double> fractions_; ///< of materials, #nodes × #materials; gathered with fields_
};

} // namespace talus::distributed
