// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/bytes_of.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/distributed/ranks.hpp"
#include "talus/distributed/together.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/problem.hpp"
#include "talus/io/bytes.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/io/checkpoint_pieces.hpp"
#include "talus/step/boundaries.hpp"
#include "talus/step/state.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

/// \file
/// Checkpoints of a simulation on several ranks, in pieces: each rank writes what it has, and rank
/// 0 a list of the pieces with all that belongs to no rank. The pieces have names of their own and
/// are on the disk before the list gets its name: what happens before leaves the earlier
/// checkpoint, what happens after it the new one. Nothing of the size of the whole state is ever in
/// one place.

namespace talus::distributed {

namespace detail {

inline constexpr std::string_view pieces_format = "talus-pieces 3";
inline constexpr std::string_view piece_format = "talus-piece 1";

/// What the list says of a piece.
struct PieceEntry {
  std::size_t particles = 0, stresses = 0, contacts = 0;
  std::uint64_t fingerprint = 0;
};

template <int Dim>
void put_index(talus::detail::ByteWriter& out, const Index<Dim>& index) {
  for (const int i : index.values)
    out.raw(i);
}
/// Throws std::runtime_error unless it is a node of the grid.
template <int Dim>
Index<Dim> take_node(talus::detail::ByteReader& in, const NodeBox<Dim>& all) {
  Index<Dim> index;
  for (int a = 0; a < Dim; ++a)
    in.raw(index[a]);
  if (!all.holds(index))
    in.fail("a node in it is not one of the grid");
  return index;
}

/// Writes this rank's piece.
template <class Sim>
PieceEntry write_piece(const std::filesystem::path& path, const Sim& sim, std::size_t generation) {
  constexpr int dim = Sim::dimension;
  using Real = typename Sim::ParticleData::Scalar;
  const SimulationState<dim, Real>& state = sim.state();
  const Grid<dim>& grid = sim.grid();
  const Communicator& all = sim.params().ranks->communicator();
  const auto for_each_stress = [&](const auto& visit) {
    Ranks<dim, Real>::for_each_stress(state, grid, visit);
  };
  PieceEntry entry;
  entry.particles = state.particles.size();
  entry.contacts = state.contacts.size();
  for_each_stress([&](const auto&, const auto&) { ++entry.stresses; });

  talus::detail::SealedFile<> file(path);
  talus::detail::ByteWriter& out = file.out;
  out.text(std::string(piece_format) + "\n");
  out.line("piece", generation, all.rank());
  out.line("mixed derivatives", state.particles.mixed.empty() ? 0 : 1);
  talus::detail::put_particles(file, state.particles, sim.materials());
  for_each_stress([&](const Index<dim>& index, const auto& stress) {
    put_index(out, index);
    out.raw(stress);
    file.flush_some();
  });
  for (const Contact<dim>& contact : state.contacts) {
    put_index(out, grid.node_index(contact.node));
    out.raw(contact.boundary_id);
    out.raw(contact.impulse);
    file.flush_some();
  }
  entry.fingerprint = file.commit();
  return entry;
}

/// Adds what a piece holds to this rank's share.
template <int Dim, class Real>
void read_piece(const std::filesystem::path& path, const PieceEntry& entry, std::size_t generation,
                int number, int materials, const NodeBox<Dim>& all, StateShare<Dim, Real>& share) {
  talus::detail::ByteReader in(path);
  if (talus::detail::take_format(in, "talus-piece ", piece_format) != entry.fingerprint)
    in.fail("it is a piece of another checkpoint");
  std::size_t of_generation = 0;
  int of_rank = 0, mixed = 0;
  in.line("piece", of_generation, of_rank);
  if (of_generation != generation || of_rank != number)
    in.fail("it is another piece than its name says");
  in.line("mixed derivatives", mixed);
  talus::detail::take_particles(in, entry.particles, mixed == 1, materials, share.state.particles);
  in.need(entry.stresses, sizeof(int) * Dim + sizeof(double) * symmetric_size<Dim>);
  for (std::size_t k = 0; k < entry.stresses; ++k) {
    share.nodes.push_back(take_node(in, all));
    share.state.stress_impulse.emplace_back();
    in.raw(share.state.stress_impulse.back());
  }
  in.need(entry.contacts, sizeof(int) * (Dim + 1) + sizeof(double) * Dim);
  for (std::size_t k = 0; k < entry.contacts; ++k) {
    Contact<Dim>& contact = share.state.contacts.emplace_back();
    contact.node = share.add_node(take_node(in, all));
    in.raw(contact.boundary_id);
    in.raw(contact.impulse);
  }
  if (!in.at_end())
    in.fail("there is more in it than expected");
}

/// Writes the list of the pieces.
template <class Sim>
void write_list(const std::filesystem::path& path, const Sim& sim, std::size_t generation,
                const Array<PieceEntry>& pieces, bool mixed, std::string_view notes) {
  constexpr int dim = Sim::dimension;
  const auto& state = sim.state();
  talus::detail::SealedFile<> file(path);
  talus::detail::ByteWriter& out = file.out;
  out.text(std::string(pieces_format) + "\n");
  talus::detail::put_configuration(out, sim, mixed);
  out.line("pieces", generation, pieces.size());
  for (const PieceEntry& piece : pieces)
    out.line("piece", piece.particles, piece.stresses, piece.contacts, piece.fingerprint);
  out.line("counts", state.body_contacts.size(), notes.size());
  out.text(notes);
  out.raw(state.gravity);
  talus::detail::put_bodies(out, state.bodies);
  const BlockOrder<dim> order(sim.grid());
  for (const BodyContact<dim>& contact : state.body_contacts) {
    out.raw(std::min(contact.node, 0)); // which corner, if below 0
    put_index(out, contact.node < 0 ? Index<dim>{} : order.node_at(contact.place));
    out.raw(contact.boundary_id);
    out.raw(contact.body);
    out.raw(contact.point);
    out.raw(contact.impulse);
  }
  file.commit();
}

struct PieceList {
  std::size_t generation = 0;
  Array<PieceEntry> pieces;
  std::string notes;
};

/// Reads the list, whose bytes all ranks have, and what of the state is in it.
template <class Sim, int Dim, class Real>
PieceList read_list(talus::detail::ByteReader& in, const Sim& sim, const NodeBox<Dim>& all,
                    StateShare<Dim, Real>& share) {
  PieceList list;
  SimulationState<Dim, Real>& state = share.state;
  std::size_t pieces = 0, body_contacts = 0, length = 0;
  talus::detail::take_format(in, talus::detail::pieces_kind, pieces_format);
  talus::detail::take_configuration(in, sim, state);
  in.line("pieces", list.generation, pieces);
  in.need(pieces, 1);
  list.pieces.resize(pieces);
  for (PieceEntry& piece : list.pieces)
    in.line("piece", piece.particles, piece.stresses, piece.contacts, piece.fingerprint);
  in.line("counts", body_contacts, length);
  list.notes = in.take(length);
  in.raw(state.gravity);
  talus::detail::take_bodies(in, sim.bodies().size(), state.bodies);
  in.need(body_contacts, sizeof(int) * (Dim + 4) + sizeof(double) * Dim);
  for (std::size_t k = 0; k < body_contacts; ++k) {
    BodyContact<Dim>& contact = state.body_contacts.emplace_back();
    in.raw(contact.node);
    const Index<Dim> index = take_node(in, all);
    if (contact.node >= 0)
      contact.node = share.add_node(index);
    in.raw(contact.boundary_id);
    in.raw(contact.body);
    in.raw(contact.point);
    in.raw(contact.impulse);
  }
  if (!in.at_end())
    in.fail("there is more in it than expected");
  return list;
}

template <class Sim>
void require_ranks(const Sim& sim, const void* ranks) {
  if (sim.params().ranks.get() != ranks)
    throw_invalid("the ranks of a checkpoint", "others than the simulation's", "params().ranks");
}

} // namespace detail

/// Saves the state of `sim`, which `ranks` share: a list of pieces at `path` and, beside it, a
/// piece PATH.GENERATION-RANK of each rank. All give the same path, to which all write. Files of
/// earlier checkpoints are removed when this one is complete and on the disk. notes: those of rank
/// 0 count, at most 2^20 bytes. Collective. Throws std::runtime_error on all ranks, with the
/// message of one that failed, and leaves the earlier checkpoint, if a file cannot be written or
/// the notes are longer.
template <class Sim>
void write_checkpoint(const std::filesystem::path& path, const Sim& sim,
                      const Ranks<Sim::dimension, typename Sim::ParticleData::Scalar>& ranks,
                      std::string_view notes = {}) {
  detail::require_ranks(sim, &ranks);
  const Communicator& all = ranks.communicator();
  std::int64_t generation = 0, mixed = sim.particles().mixed.empty() ? 0 : 1;
  if (all.rank() == 0) { // one that never was, so that nothing that is there is replaced
    for (const auto& piece : talus::detail::find_pieces(path))
      generation = std::max(generation, static_cast<std::int64_t>(piece.generation));
    ++generation;
  }
  all.maximum(&generation, 1);
  all.maximum(&mixed, 1);
  const auto number = static_cast<std::size_t>(generation);
  const auto own = talus::detail::piece_path(path, number, all.rank());
  try {
    detail::PieceEntry entry;
    together(all, [&] {
      if (all.rank() == 0)
        talus::detail::check_notes(notes);
      entry = detail::write_piece(own, sim, number);
    });
    Array<Message> out(1);
    put(out[0].bytes, entry);
    Array<detail::PieceEntry> pieces;
    for (const Message& message : all.deliver(out))
      pieces.push_back(Taker(message.bytes).template take<detail::PieceEntry>());
    together(all, [&] {
      if (all.rank() == 0)
        detail::write_list(path, sim, number, pieces, mixed == 1, notes);
    });
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(own, ignored);
    throw;
  }
  if (all.rank() == 0)
    for (const auto& piece : talus::detail::find_pieces(path))
      if (piece.generation != number) {
        std::error_code ignored;
        std::filesystem::remove(piece.path, ignored);
      }
}

/// Puts the state of a list of pieces into `sim`, which `ranks` share, however many ranks wrote it,
/// and returns the notes; as talus::read_checkpoint. All give the same path. Collective.
/// Throws std::runtime_error on all ranks, with the message of one that failed, and leaves `sim` as
/// it was, if a file is missing, cannot be read, is damaged, or belongs to another checkpoint,
/// minor version or configuration.
template <class Sim>
std::string read_checkpoint(const std::filesystem::path& path, Sim& sim,
                            Ranks<Sim::dimension, typename Sim::ParticleData::Scalar>& ranks) {
  constexpr int dim = Sim::dimension;
  detail::require_ranks(sim, &ranks);
  const Communicator& all = ranks.communicator();
  std::string bytes;
  together(all, [&] {
    if (all.rank() == 0)
      bytes = talus::detail::read_bytes(path);
  });
  bytes = broadcast(all, bytes);
  const auto& params = sim.params();
  const SmallArray<bool, dim> periodic = params.faces.periodic();
  const NodeBox<dim> nodes = Grid<dim>::all_nodes(params.grid, periodic);
  StateShare<dim, typename Sim::ParticleData::Scalar> share;
  detail::PieceList list;
  together(all, [&] {
    talus::detail::ByteReader in(path, std::move(bytes));
    list = detail::read_list(in, sim, nodes, share);
    for (int piece = all.rank(); piece < std::ssize(list.pieces); piece += all.size())
      detail::read_piece(talus::detail::piece_path(path, list.generation, piece),
                         list.pieces[piece], list.generation, piece, sim.materials(), nodes, share);
    const Array<double> reach; // not looked at
    const Grid<dim> nothing(params.grid, periodic, {});
    try {
      check_materials(share.state.particles, sim.materials());
      check_state(share.state,
                  Boundaries<dim>{nothing, params.faces, params.obstacles, params.bodies,
                                  share.state.bodies, reach, share.state.time},
                  static_cast<int>(share.nodes.size()));
    } catch (const std::invalid_argument& error) {
      in.fail(error.what());
    }
  });
  try {
    sim.restore_part(ranks.part_of_shares(std::move(share)));
  } catch (const std::invalid_argument& error) { // on all ranks
    talus::detail::cannot_read(path, error.what());
  }
  return list.notes;
}

/// Is the file at `path` a list of pieces?
inline bool is_in_pieces(const std::filesystem::path& path) {
  std::string begin(talus::detail::pieces_kind.size(), ' ');
  std::ifstream(path, std::ios::binary)
      .read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin == talus::detail::pieces_kind;
}

} // namespace talus::distributed
