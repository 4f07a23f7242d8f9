// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/bytes_of.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/halo.hpp"
#include "talus/core/types.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/distributed/partition.hpp"
#include "talus/distributed/window_halo.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/problem.hpp"
#include "talus/particles.hpp"
#include "talus/step/ranks.hpp"
#include "talus/step/state.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace talus::distributed {

/// How evenly work is kept.
struct Dealing {
  int interval = 50; ///< steps between two looks at the load
  /// The grid is dealt again when the largest load of a rank over the mean passes this.
  double imbalance = 1.2;

  /// Throws std::invalid_argument if a parameter is out of range.
  void validate() const {
    if (interval < 1)
      throw_invalid("dealing.interval", interval, "an integer >= 1");
    if (!(imbalance >= 1))
      throw_invalid("dealing.imbalance", imbalance, "a number >= 1");
  }
};

/// A share of a state: nodes are those of a list. stress_impulse has one for each of `nodes`, and
/// contacts the numbers of theirs in it; corners of bodies keep numbers below 0.
template <int Dim, class Real = double>
struct StateShare {
  SimulationState<Dim, Real> state;
  Array<Index<Dim>> nodes; ///< of the whole grid

  /// Adds a node without stress and returns its number.
  int add_node(const Index<Dim>& node) {
    nodes.push_back(node);
    state.stress_impulse.push_back(Vec<symmetric_size<Dim>>::Zero());
    return static_cast<int>(nodes.size()) - 1;
  }
};

/// The ranks of one simulation, on any Communicator.
template <int Dim, class Real = double>
class Ranks final : public talus::Ranks<Dim, Real> {
 public:
  /// Throws std::invalid_argument if there is no communicator or a parameter is out of range.
  explicit Ranks(std::shared_ptr<const Communicator> communicator, Dealing dealing = {})
      : communicator_(std::move(communicator)), dealing_(dealing) {
    if (!communicator_)
      throw_invalid("ranks: the communicator", "null", "a valid pointer");
    dealing_.validate();
  }

  const Communicator& communicator() const override { return *communicator_; }
  const NodeBox<Dim>& own() const override { return partition_.box(rank()); }
  Halo& halo() override { return *halo_; }
  /// Of the last look: the largest load of a rank over the mean.
  double imbalance() const { return imbalance_; }
  std::size_t times_dealt() const { return times_dealt_; }

  void deal(const GridParams<Dim>& grid, const SmallArray<bool, Dim>& periodic,
            Particles<Dim, Real>& particles) override {
    params_ = grid;
    periodic_ = periodic;
    const Grid<Dim> nothing(grid, periodic, {});
    Execution(1, communicator_.get()).check_on_all([&] { check_particles(particles, nothing); });
    for (int a = 0; a < Dim; ++a)
      edges_[a] = BlockOrder<Dim>::edges(nothing, a);
    std::size_t next_id = particles.next_id;
    const bool same = all_have_the_same(particles);
    Particles<Dim, Real> none;
    cut(load(same && rank() != 0 ? none : particles));
    if (same)
      keep_own(particles);
    else
      migrate(particles);
    particles.next_id = largest(next_id);
    check_all_ids(particles);
  }

  bool deal_again(SimulationState<Dim, Real>& state) override {
    if (communicator_->size() == 1 || state.steps == 0 ||
        state.steps % static_cast<std::size_t>(dealing_.interval) != 0 || state.steps == looked_at_)
      return false;
    looked_at_ = state.steps;
    const Load<Dim> now = load(state.particles);
    imbalance_ = imbalance_of(partition_, now);
    if (imbalance_ <= dealing_.imbalance)
      return false;
    Partition<Dim> next(now, edges_, *communicator_);
    const double reached = imbalance_of(next, now);
    if (reached > 0.95 * imbalance_) // whole blocks allow no better
      return false;
    const Grid<Dim> old_grid = window();
    imbalance_ = reached;
    use(std::move(next));
    hand_over(state, old_grid);
    migrate(state.particles);
    return true;
  }

  SimulationState<Dim, Real> part_of(SimulationState<Dim, Real> whole) override {
    const Grid<Dim> all(params_, periodic_);
    Particles<Dim, Real> none;
    cut(load(rank() == 0 ? whole.particles : none));
    keep_own(whole.particles);
    const Grid<Dim> grid = window();
    Array<Vec<symmetric_size<Dim>>> stress(static_cast<std::size_t>(grid.node_count()),
                                           Vec<symmetric_size<Dim>>::Zero());
    const BlockOrder<Dim> order(grid);
    for (const int node : order.nodes())
      stress[node] = whole.stress_impulse[all.node(grid.node_index(node))];
    whole.stress_impulse.swap(stress);
    Array<Contact<Dim>> contacts;
    for (Contact<Dim> contact : whole.contacts) {
      const Index<Dim> index = all.node_index(contact.node);
      if (!grid.own().holds(index))
        continue;
      contact.node = grid.node(index);
      contacts.push_back(contact);
    }
    sort(order, grid, contacts);
    whole.contacts.swap(contacts);
    for (BodyContact<Dim>& contact : whole.body_contacts)
      contact.place = place_of(all, order, contact.node);
    looked_at_ = whole.steps;
    return whole;
  }

  /// Deals a state of which each rank has a share, and returns this rank's part. Particles,
  /// stresses and contacts are in one share alone, all else is the same in all of them; it is taken
  /// to fit the grid. Throws std::invalid_argument, and deals nothing, if two particles of all
  /// shares have the same id. Collective.
  SimulationState<Dim, Real> part_of_shares(StateShare<Dim, Real> share) {
    SimulationState<Dim, Real>& state = share.state;
    check_all_ids(state.particles);
    cut(load(state.particles));
    migrate(state.particles);
    ToOwners out;
    for (std::size_t n = 0; n < share.nodes.size(); ++n)
      put_stress(share.nodes[n], state.stress_impulse[n], out);
    for (const Contact<Dim>& contact : state.contacts)
      put_contact(share.nodes[contact.node], contact, out);
    deliver_nodes(out, state);
    const Grid<Dim> grid = window();
    const BlockOrder<Dim> order(grid);
    for (BodyContact<Dim>& contact : state.body_contacts)
      contact.place = contact.node < 0 ? place_of(grid, order, contact.node)
                                       : order.place(share.nodes[contact.node]);
    looked_at_ = state.steps;
    return std::move(state);
  }

  /// Calls visit(index, λ) for all nodes of this rank where λ is not zero. grid: its window.
  template <class Visit>
  static void for_each_stress(const SimulationState<Dim, Real>& state, const Grid<Dim>& grid,
                              const Visit& visit) {
    const BlockOrder<Dim> order(grid);
    for (const int node : order.nodes())
      if (!state.stress_impulse[node].isZero(0))
        visit(grid.node_index(node), state.stress_impulse[node]);
  }

  /// All particles on rank 0, sorted by their ids; on the others none. Collective.
  Particles<Dim, Real> gather_particles(const Particles<Dim, Real>& part) const {
    Array<Message> out(1);
    put_particles(part, all_of(part), out[0].bytes);
    Particles<Dim, Real> all = sorted_by_id(communicator_->deliver(out));
    all.next_id = part.next_id;
    return all;
  }

  /// The state of the whole grid on rank 0, as a simulation on one rank has it, particles sorted by
  /// their ids; on the others an empty one. Collective.
  SimulationState<Dim, Real> gather(const SimulationState<Dim, Real>& part) const {
    const Grid<Dim> grid = window();
    Particles<Dim, Real> particles = gather_particles(part.particles);
    Array<Message> out(1);
    for_each_stress(part, grid, [&](const Index<Dim>& index, const auto& stress) {
      put(out[0].bytes, index);
      put(out[0].bytes, stress);
    });
    const Array<Message> stresses = communicator_->deliver(out);
    out[0].bytes.clear();
    for (const Contact<Dim>& contact : part.contacts) {
      put(out[0].bytes, grid.node_index(contact.node));
      put(out[0].bytes, contact);
    }
    const Array<Message> contacts = communicator_->deliver(out);

    SimulationState<Dim, Real> whole;
    if (rank() != 0)
      return whole;
    whole.time = part.time;
    whole.steps = part.steps;
    whole.time_step = part.time_step;
    whole.gravity = part.gravity;
    whole.bodies = part.bodies;
    whole.body_contacts = part.body_contacts;
    whole.particles = std::move(particles);
    const Grid<Dim> all(params_, periodic_);
    const BlockOrder<Dim> order(all);
    whole.stress_impulse.assign(static_cast<std::size_t>(all.node_count()),
                                Vec<symmetric_size<Dim>>::Zero());
    for (const Message& message : stresses)
      for (Taker taker(message.bytes); !taker.at_end();) {
        const int node = all.node(taker.template take<Index<Dim>>());
        taker.take(whole.stress_impulse[node]);
      }
    for (const Message& message : contacts)
      for (Taker taker(message.bytes); !taker.at_end();) {
        const Index<Dim> index = taker.template take<Index<Dim>>();
        whole.contacts.push_back(taker.template take<Contact<Dim>>());
        whole.contacts.back().node = all.node(index);
      }
    sort(order, all, whole.contacts);
    for (BodyContact<Dim>& contact : whole.body_contacts)
      if (contact.node >= 0)
        contact.node = all.node(order.node_at(contact.place));
    return whole;
  }

  void migrate(Particles<Dim, Real>& particles) override {
    const std::size_t next_id = particles.next_id;
    const Grid<Dim> grid = window();
    std::map<int, Array<std::size_t>> leaving;
    Array<std::size_t> staying;
    for (std::size_t p = 0; p < particles.size(); ++p) {
      const int owner = partition_.owner(grid.cell_at(particles.position[p]), rank());
      (owner == rank() ? staying : leaving[owner]).push_back(p);
    }
    Array<Message> out;
    for (const auto& [to, which] : leaving) {
      out.emplace_back();
      out.back().rank = to;
      put_particles(particles, which, out.back().bytes);
    }
    if (staying.size() < particles.size())
      keep(particles, staying);
    for (const Message& message : communicator_->deliver(out))
      add_particles(message.bytes, particles);
    particles.next_id = next_id;
  }

  void share_contacts(DualProblem<Dim>& problem) override {
    if (problem.bodies.empty())
      return;
    struct Touched {
      BodyContact<Dim> contact;
      Index<Dim> index;
      NodeVec<Dim> inverse_mass;
      int owner = 0;
    };
    const Grid<Dim>& grid = problem.grid;
    Array<char> mine;
    for (const BodyContact<Dim>& contact : problem.body_contacts)
      put(mine, Touched{contact, grid.node_index(contact.node), problem.inverse_mass[contact.node],
                        rank()});
    Array<Touched> all;
    for (const Message& message : told_to_all(mine, *communicator_))
      for (Taker taker(message.bytes); !taker.at_end();)
        all.push_back(taker.template take<Touched>());
    std::sort(all.begin(), all.end(), [](const Touched& a, const Touched& b) {
      return std::pair(a.contact.body, a.contact.place) <
             std::pair(b.contact.body, b.contact.place);
    });

    // Every rank goes through the same list, so that what one sends fits what another receives.
    Array<typename WindowHalo<Dim>::Touched> peers;
    for (int other = 0; other < communicator_->size(); ++other) {
      peers.emplace_back();
      peers.back().rank = other;
    }
    std::map<std::size_t, int> number; // of the nodes by place
    problem.body_contacts.clear();
    problem.inverse_mass.resize(static_cast<std::size_t>(grid.node_count())); // no others' any more
    for (Touched& touched : all) {
      const auto [at, added] = number.emplace(touched.contact.place, -1);
      if (added) {
        const bool here = window_of(grid, own()).holds(touched.index);
        at->second = here ? grid.node(touched.index) : static_cast<int>(problem.velocity.size());
        if (!here) {
          problem.velocity.push_back(NodeVec<Dim>::Zero());
          problem.inverse_mass.push_back(touched.inverse_mass);
          peers[touched.owner].receive.push_back(at->second);
        }
        if (touched.owner == rank())
          for (int other = 0; other < communicator_->size(); ++other)
            if (!window_of(grid, partition_.box(other)).holds(touched.index))
              peers[other].send.push_back(at->second);
      }
      touched.contact.node = at->second;
      problem.body_contacts.push_back(touched.contact);
    }
    std::erase_if(peers,
                  [](const auto& peer) { return peer.send.empty() && peer.receive.empty(); });
    halo_->set_touched(std::move(peers));
  }

  /// A state as bytes, for other ranks.
  static void put_state(const SimulationState<Dim, Real>& state, Array<char>& bytes) {
    put(bytes, state.time);
    put(bytes, state.steps);
    put(bytes, state.time_step);
    put(bytes, state.gravity);
    put(bytes, state.particles.next_id);
    Array<char> particles;
    put_particles(state.particles, all_of(state.particles), particles);
    put_all(bytes, particles);
    put_all(bytes, state.stress_impulse);
    put_all(bytes, state.contacts);
    put_all(bytes, state.bodies);
    put_all(bytes, state.body_contacts);
  }
  static SimulationState<Dim, Real> take_state(const Array<char>& bytes) {
    SimulationState<Dim, Real> state;
    Taker taker(bytes);
    taker.take(state.time);
    taker.take(state.steps);
    taker.take(state.time_step);
    taker.take(state.gravity);
    const auto next_id = taker.template take<std::size_t>();
    Array<char> particles;
    take_all(taker, particles);
    if (!particles.empty())
      add_particles(particles, state.particles);
    state.particles.next_id = next_id;
    take_all(taker, state.stress_impulse);
    take_all(taker, state.contacts);
    take_all(taker, state.bodies);
    take_all(taker, state.body_contacts);
    return state;
  }

 private:
  int rank() const { return communicator_->rank(); }

  template <class Value>
  static void put_all(Array<char>& bytes, const Array<Value>& values) {
    put(bytes, values.size());
    for (const Value& value : values)
      put(bytes, value);
  }
  template <class Value>
  static void take_all(Taker& taker, Array<Value>& values) {
    values.resize(taker.template take<std::size_t>());
    for (Value& value : values)
      taker.take(value);
  }

  Grid<Dim> window() const { return Grid<Dim>(params_, periodic_, own()); }

  std::size_t largest(std::size_t value) const {
    auto of_all = static_cast<std::int64_t>(value);
    communicator_->maximum(&of_all, 1);
    return static_cast<std::size_t>(of_all);
  }

  Load<Dim> load(const Particles<Dim, Real>& particles) const {
    return Load<Dim>(Grid<Dim>(params_, periodic_, {}), edges_, particles.position);
  }

  void cut(const Load<Dim>& load) {
    use(Partition<Dim>(load, edges_, *communicator_));
    imbalance_ = imbalance_of(partition_, load);
  }
  void use(Partition<Dim> partition) {
    partition_ = std::move(partition);
    halo_.emplace(window(), partition_, *communicator_);
    ++times_dealt_;
  }

  double imbalance_of(const Partition<Dim>& partition, const Load<Dim>& load) const {
    Array<std::int64_t> loads(static_cast<std::size_t>(communicator_->size()), 0);
    for (const auto& entry : load.entries) {
      Index<Dim> node;
      for (int a = 0; a < Dim; ++a)
        node[a] = edges_[a][entry.block[a]];
      loads[partition.owner(node, rank())] += entry.weight;
    }
    communicator_->sum(loads.data(), static_cast<int>(loads.size()));
    std::int64_t most = 0, all = 0;
    for (const std::int64_t of : loads) {
      most = std::max(most, of);
      all += of;
    }
    return all > 0 ? static_cast<double>(most) * static_cast<double>(loads.size()) /
                         static_cast<double>(all)
                   : 1;
  }

  /// Have all ranks the same particles, and some? Not the same ids alone: each rank may have
  /// counted its own particles from 0, which check_all_ids() then refuses.
  bool all_have_the_same(const Particles<Dim, Real>& particles) const {
    const auto count = static_cast<std::int64_t>(particles.size());
    const auto sum = static_cast<std::int64_t>(state_fingerprint(particles) >> 1U);
    std::int64_t values[] = {count, -count, sum, -sum};
    communicator_->maximum(values, 4);
    return count > 0 && values[0] == -values[1] && values[2] == -values[3];
  }

  /// Throws std::invalid_argument if two ranks have particles of one id. Each rank looks at those
  /// that are its number modulo the number of ranks.
  void check_all_ids(const Particles<Dim, Real>& particles) const {
    Array<Message> out(static_cast<std::size_t>(communicator_->size()));
    for (int r = 0; r < communicator_->size(); ++r)
      out[r].rank = r;
    for (const std::size_t id : particles.id)
      put(out[id % out.size()].bytes, id);
    Array<std::size_t> ids;
    for (const Message& message : communicator_->deliver(out))
      for (Taker taker(message.bytes); !taker.at_end();)
        ids.push_back(taker.template take<std::size_t>());
    std::sort(ids.begin(), ids.end());
    const auto twice = std::adjacent_find(ids.begin(), ids.end());
    if (largest(twice != ids.end() ? 1 : 0) > 0)
      throw_invalid("the id of particles of two ranks",
                    twice != ids.end() ? std::to_string(*twice) : "one that another rank saw",
                    "all ranks give the whole scene, or each gives other particles");
  }

  static Array<std::size_t> all_of(const Particles<Dim, Real>& particles) {
    Array<std::size_t> all(particles.size());
    for (std::size_t p = 0; p < all.size(); ++p)
      all[p] = p;
    return all;
  }

  void keep_own(Particles<Dim, Real>& particles) const {
    const std::size_t next_id = particles.next_id;
    const Grid<Dim> grid = window();
    Array<std::size_t> kept;
    for (std::size_t p = 0; p < particles.size(); ++p)
      if (own().holds(grid.cell_at(particles.position[p])))
        kept.push_back(p);
    keep(particles, kept);
    particles.next_id = next_id;
  }
  static void keep(Particles<Dim, Real>& particles, const Array<std::size_t>& kept) {
    for (std::size_t k = 0; k < kept.size(); ++k)
      if (kept[k] != k)
        particles.copy(k, particles, kept[k]);
    particles.resize(kept.size());
  }

  static void put_particles(const Particles<Dim, Real>& particles, const Array<std::size_t>& which,
                            Array<char>& bytes) {
    if (which.empty())
      return;
    put(bytes, particles.mixed.empty() ? char{0} : char{1});
    put(bytes, particles.material.empty() ? char{0} : char{1});
    for (const std::size_t p : which) {
      put(bytes, particles.id[p]);
      put(bytes, particles.position[p]);
      put(bytes, particles.velocity[p]);
      put(bytes, particles.affine[p]);
      put(bytes, particles.volume[p]);
      if (!particles.material.empty())
        put(bytes, particles.material[p]);
      if (!particles.mixed.empty())
        put(bytes, particles.mixed[p]);
    }
  }
  static void add_particles(const Array<char>& bytes, Particles<Dim, Real>& particles) {
    Taker taker(bytes);
    const bool mixed = taker.template take<char>() != 0;
    const bool materials = taker.template take<char>() != 0;
    if (mixed)
      particles.resize_mixed(particles.size());
    if (materials)
      particles.resize_material(particles.size());
    while (!taker.at_end()) {
      const std::size_t id = taker.template take<std::size_t>();
      particles.position.push_back(taker.template take<Vec<Dim>>());
      particles.velocity.push_back(taker.template take<Vec<Dim, Real>>());
      particles.affine.push_back(taker.template take<Mat<Dim, Real>>());
      particles.volume.push_back(taker.template take<Real>());
      if (materials)
        particles.material.push_back(taker.template take<int>());
      else if (!particles.material.empty())
        particles.resize_material(particles.size());
      particles.id.push_back(id);
      if (mixed)
        particles.mixed.push_back(taker.template take<MixedDerivatives<Dim, Real>>());
      else if (!particles.mixed.empty())
        particles.resize_mixed(particles.size());
    }
  }
  static Particles<Dim, Real> sorted_by_id(const Array<Message>& messages) {
    Particles<Dim, Real> unsorted, sorted;
    for (const Message& message : messages)
      add_particles(message.bytes, unsorted);
    Array<std::size_t> order = all_of(unsorted);
    std::sort(order.begin(), order.end(),
              [&](std::size_t p, std::size_t q) { return unsorted.id[p] < unsorted.id[q]; });
    sorted.resize(order.size());
    if (!unsorted.mixed.empty())
      sorted.resize_mixed(order.size());
    if (!unsorted.material.empty())
      sorted.resize_material(order.size());
    for (std::size_t k = 0; k < order.size(); ++k)
      sorted.copy(k, unsorted, order[k]);
    return sorted;
  }

  /// Sorts contacts as collect_contacts has them.
  static void sort(const BlockOrder<Dim>& order, const Grid<Dim>& grid,
                   Array<Contact<Dim>>& contacts) {
    Array<std::size_t> rank(static_cast<std::size_t>(grid.node_count()), 0);
    for (std::size_t k = 0; k < order.nodes().size(); ++k)
      rank[order.nodes()[k]] = k;
    std::sort(contacts.begin(), contacts.end(), [&](const Contact<Dim>& a, const Contact<Dim>& b) {
      return std::pair(rank[a.node], a.boundary_id) < std::pair(rank[b.node], b.boundary_id);
    });
  }

  /// Stresses and contacts on their way to the owners of their nodes.
  struct ToOwners {
    std::map<int, Message> stresses, contacts; ///< by rank
  };

  Array<char>& bytes_to_owner(std::map<int, Message>& messages, const Index<Dim>& index) const {
    const int owner = partition_.owner(index, rank());
    messages[owner].rank = owner;
    return messages[owner].bytes;
  }
  void put_stress(const Index<Dim>& index, const Vec<symmetric_size<Dim>>& stress,
                  ToOwners& out) const {
    if (stress.isZero(0))
      return;
    Array<char>& bytes = bytes_to_owner(out.stresses, index);
    put(bytes, index);
    put(bytes, stress);
  }
  void put_contact(const Index<Dim>& index, const Contact<Dim>& contact, ToOwners& out) const {
    Array<char>& bytes = bytes_to_owner(out.contacts, index);
    put(bytes, index);
    put(bytes, contact);
  }

  /// Replaces the nodes of a state by what all ranks have put out for this one.
  void deliver_nodes(ToOwners& out, SimulationState<Dim, Real>& state) const {
    const Grid<Dim> grid = window();
    const auto deliver = [&](std::map<int, Message>& messages) {
      Array<Message> ready;
      for (auto& [to, message] : messages)
        ready.push_back(std::move(message));
      return communicator_->deliver(ready);
    };
    state.stress_impulse.assign(static_cast<std::size_t>(grid.node_count()),
                                Vec<symmetric_size<Dim>>::Zero());
    for (const Message& message : deliver(out.stresses))
      for (Taker taker(message.bytes); !taker.at_end();) {
        const int node = grid.node(taker.template take<Index<Dim>>());
        taker.take(state.stress_impulse[node]);
      }
    state.contacts.clear();
    for (const Message& message : deliver(out.contacts))
      for (Taker taker(message.bytes); !taker.at_end();) {
        const int node = grid.node(taker.template take<Index<Dim>>());
        state.contacts.push_back(taker.template take<Contact<Dim>>());
        state.contacts.back().node = node;
      }
    sort(BlockOrder<Dim>(grid), grid, state.contacts);
  }

  /// Gives stresses and contacts of the nodes of the window before to their new owners.
  void hand_over(SimulationState<Dim, Real>& state, const Grid<Dim>& old_grid) const {
    ToOwners out;
    for_each_stress(state, old_grid, [&](const Index<Dim>& index, const auto& stress) {
      put_stress(index, stress, out);
    });
    for (const Contact<Dim>& contact : state.contacts)
      put_contact(old_grid.node_index(contact.node), contact, out);
    deliver_nodes(out, state);
  }

  std::shared_ptr<const Communicator> communicator_;
  Dealing dealing_;
  GridParams<Dim> params_;
  SmallArray<bool, Dim> periodic_{};
  SmallArray<Array<int>, Dim> edges_;
  Partition<Dim> partition_;
  std::optional<WindowHalo<Dim>> halo_;
  double imbalance_ = 1;
  std::size_t times_dealt_ = 0, looked_at_ = 0;
};

} // namespace talus::distributed
