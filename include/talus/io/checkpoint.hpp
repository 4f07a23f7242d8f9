// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/fingerprint.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"
#include "talus/io/atomic_file.hpp"
#include "talus/io/bytes.hpp"
#include "talus/io/scene_sketch.hpp"
#include "talus/particles.hpp"
#include "talus/simulation.hpp"
#include "talus/step/state.hpp"
#include "talus/version.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// \file
/// Checkpoints: the state of a simulation in a file, from which it goes on with the same bits. A
/// header of text lines, little-endian numbers, and a fingerprint of all bytes at the end.

namespace talus {

namespace detail {

inline constexpr std::string_view checkpoint_kind = "talus-checkpoint ";
inline constexpr std::string_view checkpoint_format = "talus-checkpoint 6";
/// Of a list of the pieces that ranks have written, see distributed/checkpoint.hpp.
inline constexpr std::string_view pieces_kind = "talus-pieces ";

/// "0.1" of "0.1.2": patches read the files of each other.
inline std::string_view minor_version(std::string_view version) {
  return version.substr(0, version.find_last_of('.'));
}

/// What must be the same for a state to be meaningful: name and value of each. Friction law,
/// transfer and solver are left out: a run may go on with others.
template <class Sim>
std::vector<std::pair<std::string, std::string>> checkpoint_configuration(const Sim& sim) {
  const auto& params = sim.params();
  std::vector<std::pair<std::string, std::string>> lines;
  const auto add = [&](const std::string& name, const auto&... values) {
    ByteWriter value;
    (value.number(values), ...);
    lines.emplace_back(name, value.bytes().substr(1));
  };
  constexpr int dim = static_cast<int>(decltype(params.gravity)::RowsAtCompileTime);
  constexpr const char* axes[] = {"x", "y", "z"};
  add("dimension", dim);
  for (int a = 0; a < dim; ++a) {
    const std::string axis = axes[a];
    const std::size_t s = static_cast<std::size_t>(a);
    add("grid.origin." + axis, params.grid.origin[a]);
    add("grid.size." + axis, params.grid.size[a]);
    add("grid.cells." + axis, params.grid.cells[a]);
    for (const auto& [side, face] :
         {std::pair("lower.", params.faces.lower[s]), std::pair("upper.", params.faces.upper[s])}) {
      add("faces." + (side + axis) + ".kind", static_cast<int>(face.kind));
      add("faces." + (side + axis) + ".friction",
          face.kind == FaceKind::frictional ? face.friction : 0.0);
    }
  }
  const std::string name = "material.density";
  ByteWriter densities;
  for (int m = 0; m < sim.materials(); ++m)
    densities.number(sim.density(m));
  lines.emplace_back(name, densities.bytes().substr(1));
  add("time_step", params.time_step);
  add("cfl", params.cfl);
  add("min_relative_mass", params.min_relative_mass);
  add("packing.slack", params.packing.slack);
  add("packing.dilatancy", params.packing.dilatancy);
  add("packing.cohesion_slack", params.packing.cohesion_slack);
  add("packing.even", params.packing.even ? 1 : 0);
  add("packing.shifting", params.packing.shifting);
  add("packing.surfaces", params.packing.surfaces ? 1 : 0);
  add("obstacles", params.obstacles.size());
  add("bodies", params.bodies.size());
  for (std::size_t b = 0; b < params.bodies.size(); ++b) {
    const std::string body = "bodies." + std::to_string(b);
    add(body + ".mass", params.bodies[b].mass);
    add(body + ".friction", params.bodies[b].friction);
    add(body + ".rotates", params.bodies[b].rotates ? 1 : 0);
    for (int r = 0; r < params.bodies[b].inertia.rows(); ++r)
      for (int c = 0; c <= r; ++c)
        add(body + ".inertia." + std::to_string(r) + std::to_string(c),
            params.bodies[b].inertia(r, c));
    add(body + ".corner_radius", params.bodies[b].corner_radius);
    add(body + ".corners", params.bodies[b].corners.size());
    for (std::size_t c = 0; c < params.bodies[b].corners.size(); ++c)
      for (int a = 0; a < dim; ++a)
        add(body + ".corner." + std::to_string(c) + "." + axes[a], params.bodies[b].corners[c][a]);
  }
  return lines;
}

/// What the files of all checkpoints begin with after the line of their format: version,
/// configuration, and the numbers of the state that belong to no particle or node.
/// mixed: do the particles have mixed derivatives?
template <class Sim>
void put_configuration(ByteWriter& out, const Sim& sim, bool mixed) {
  const auto& state = sim.state();
  out.text(std::string("version ") + TALUS_VERSION + "\n");
  out.line("bytes of a particle's numbers", sizeof(typename Sim::ParticleData::Scalar));
  for (const auto& [name, value] : checkpoint_configuration(sim))
    out.text(name + " " + value + "\n");
  out.line("state", state.time, state.steps, state.time_step);
  out.line("mixed derivatives", mixed ? 1 : 0);
  for (std::size_t o = 0; o < sim.params().obstacles.size(); ++o) {
    const auto sketch =
        sketch_obstacle(*sim.params().obstacles[o], sim.grid(), state.time, sim.params().time_step);
    out.line("obstacle." + std::to_string(o), sketch.held, sketch.friction.sum, sketch.normal.sum,
             sketch.velocity.sum, sketch.open_fraction.sum);
  }
  for (std::size_t b = 0; b < sim.params().bodies.size(); ++b)
    out.line("bodies." + std::to_string(b) + ".shape",
             sketch_shape(sim.params().bodies[b].shape, sim.grid().size().norm()).sum);
  out.line("next_id", state.particles.next_id);
}

/// Reads it, and refuses what is of another configuration than `sim`. Returns whether particles
/// have mixed derivatives.
template <class Sim>
bool take_configuration(
    ByteReader& in, const Sim& sim,
    SimulationState<Sim::dimension, typename Sim::ParticleData::Scalar>& state) {
  const auto compare = [&](const std::string& name, const std::string& ours) {
    const std::string_view theirs = in.line(name + " ");
    if (theirs != ours)
      in.fail("its " + name + " is " + std::string(theirs) + ", this simulation's is " + ours);
  };
  if (const std::string_view theirs = in.line("version ");
      minor_version(theirs) != minor_version(TALUS_VERSION))
    in.fail("its version is " + std::string(theirs) + ", this one's is " TALUS_VERSION);
  compare("bytes of a particle's numbers",
          std::to_string(sizeof(typename Sim::ParticleData::Scalar)));
  for (const auto& [name, value] : checkpoint_configuration(sim))
    compare(name, value);
  int mixed = 0;
  in.line("state", state.time, state.steps, state.time_step);
  in.line("mixed derivatives", mixed);
  for (std::size_t o = 0; o < sim.params().obstacles.size(); ++o) {
    const std::string name = "obstacle." + std::to_string(o);
    std::size_t held = 0;
    double friction = 0, normal = 0, velocity = 0, open_fraction = 0;
    in.line(name, held, friction, normal, velocity, open_fraction);
    const auto ours =
        sketch_obstacle(*sim.params().obstacles[o], sim.grid(), state.time, sim.params().time_step);
    const char* differs = held != ours.held                         ? "shape or motion"
                          : !ours.friction.same(friction)           ? "friction"
                          : !ours.normal.same(normal)               ? "normals"
                          : !ours.velocity.same(velocity)           ? "velocities"
                          : !ours.open_fraction.same(open_fraction) ? "open fraction"
                                                                    : nullptr;
    if (differs)
      in.fail("its " + name + " is another than this simulation's: the " + differs + " differ");
  }
  for (std::size_t b = 0; b < sim.params().bodies.size(); ++b) {
    const std::string name = "bodies." + std::to_string(b) + ".shape";
    double shape = 0;
    in.line(name, shape);
    if (!sketch_shape(sim.params().bodies[b].shape, sim.grid().size().norm()).same(shape))
      in.fail("its " + name + " is another than this simulation's");
  }
  in.line("next_id", state.particles.next_id);
  return mixed == 1;
}

inline void check_notes(std::string_view notes) {
  if (notes.size() > (std::size_t{1} << 20U))
    throw_invalid("the length of a checkpoint's notes", notes.size(), "at most 2^20 bytes");
}

/// Goes to the line after that of the format, if the bytes are whole and of this format, and
/// returns their fingerprint. kind: what the format begins with in all versions.
inline std::uint64_t take_format(ByteReader& in, std::string_view kind, std::string_view format) {
  if (!in.starts_with(kind))
    in.fail("it is no checkpoint");
  if (!in.starts_with(format))
    in.fail("it has the format of another version of talus");
  const std::uint64_t fingerprint = in.check_fingerprint();
  in.line(format);
  return fingerprint;
}

/// A file that is written bit by bit, for the state may be most of the memory, with the fingerprint
/// of all bytes at the end. A template, so that programs which save nothing do not compile it.
template <class Writer = ByteWriter>
class SealedFile {
 public:
  explicit SealedFile(const std::filesystem::path& path) : file_(path) {}

  Writer out;

  /// To be called now and then.
  void flush_some() {
    if (out.bytes().size() > (std::size_t{1} << 20U))
      flush();
  }
  /// Returns the fingerprint.
  std::uint64_t commit() {
    flush();
    const std::uint64_t value = fingerprint_.value();
    out.raw(value);
    file_.write(out.bytes());
    file_.commit(AtomicFile::Durable::yes);
    return value;
  }

 private:
  void flush() {
    fingerprint_.add(out.bytes());
    file_.write(out.bytes());
    out = {};
  }

  AtomicFile file_;
  Fingerprint fingerprint_;
};

/// materials: how many there are; with one, particles have no index of theirs.
template <int Dim, class Real>
void put_particles(SealedFile<>& file, const Particles<Dim, Real>& particles, int materials) {
  ByteWriter& out = file.out;
  for (std::size_t p = 0; p < particles.size(); ++p) {
    out.raw(std::uint64_t{particles.id[p]});
    out.raw(particles.volume[p]);
    out.raw(particles.position[p]);
    out.raw(particles.velocity[p]);
    out.raw(particles.affine[p]);
    if (!particles.mixed.empty())
      out.raw(particles.mixed[p]);
    if (materials > 1)
      out.raw(particles.material.empty() ? 0 : particles.material[p]);
    file.flush_some();
  }
}

/// Adds `count` particles to those that are there; next_id stays.
template <int Dim, class Real>
void take_particles(ByteReader& in, std::size_t count, bool mixed, int materials,
                    Particles<Dim, Real>& particles) {
  in.need(count,
          sizeof(std::uint64_t) + sizeof(double) * Dim + sizeof(Real) * (1 + Dim + Dim * Dim));
  const std::size_t next_id = particles.next_id;
  std::size_t p = particles.size();
  particles.resize(p + count);
  if (mixed)
    particles.resize_mixed(p + count);
  if (materials > 1)
    particles.resize_material(p + count);
  for (; p < particles.size(); ++p) {
    std::uint64_t id = 0;
    in.raw(id);
    particles.id[p] = id;
    in.raw(particles.volume[p]);
    in.raw(particles.position[p]);
    in.raw(particles.velocity[p]);
    in.raw(particles.affine[p]);
    if (mixed)
      in.raw(particles.mixed[p]);
    if (materials > 1)
      in.raw(particles.material[p]);
  }
  particles.next_id = next_id;
}

template <int Dim>
void put_bodies(ByteWriter& out, const Array<RigidState<Dim>>& bodies) {
  for (const RigidState<Dim>& body : bodies) {
    out.raw(body.position);
    out.raw(body.rotation);
    out.raw(body.velocity);
    out.raw(body.angular_velocity);
  }
}

template <int Dim>
void take_bodies(ByteReader& in, std::size_t count, Array<RigidState<Dim>>& bodies) {
  bodies.resize(count);
  for (RigidState<Dim>& body : bodies) {
    in.raw(body.position);
    in.raw(body.rotation);
    in.raw(body.velocity);
    in.raw(body.angular_velocity);
  }
}

} // namespace detail

/// Saves the state of `sim`. `notes`: whatever the program wants to find again, at most 2^20 bytes.
/// The file gets its name when it is complete and on the disk: an earlier one is good until then.
/// Throws std::runtime_error if it cannot be written, std::invalid_argument for longer notes, or if
/// `sim` is one rank's part: see distributed::write_checkpoint.
template <class Sim>
void write_checkpoint(const std::filesystem::path& path, const Sim& sim,
                      std::string_view notes = {}) {
  constexpr int dim = Sim::dimension;
  if (!sim.grid().whole())
    throw_invalid("a checkpoint", "of one rank's part of a simulation",
                  "a whole one, or distributed::write_checkpoint of all ranks");
  detail::check_notes(notes);
  const auto& state = sim.state();
  detail::SealedFile<> file(path);
  detail::ByteWriter& out = file.out;
  out.text(std::string(detail::checkpoint_format) + "\n");
  detail::put_configuration(out, sim, !state.particles.mixed.empty());
  out.line("counts", state.particles.size(), state.stress_impulse.size(), state.contacts.size(),
           state.body_contacts.size(), notes.size());
  out.text(notes);
  out.raw(state.gravity);
  detail::put_particles(file, state.particles, sim.materials());
  for (const auto& stress : state.stress_impulse) {
    out.raw(stress);
    file.flush_some();
  }
  for (const Contact<dim>& contact : state.contacts) {
    out.raw(contact.node);
    out.raw(contact.boundary_id);
    out.raw(contact.impulse);
  }
  detail::put_bodies(out, state.bodies);
  for (const BodyContact<dim>& contact : state.body_contacts) {
    out.raw(contact.node);
    out.raw(contact.boundary_id);
    out.raw(contact.body);
    out.raw(contact.point);
    out.raw(contact.impulse);
  }
  file.commit();
}

/// Puts the state that `path` holds into `sim` and returns the notes. `sim` is one that was made
/// with the same parameters (threads, friction law, transfer and solver may differ); its particles
/// are replaced. After that it goes on like the run that wrote the file, to the last bit. Obstacles
/// and shapes are compared by what they do at random places and times, the later ones up to 57 000
/// time steps after the file's.
/// Throws std::runtime_error, and leaves `sim` as it was, if the file cannot be read, is damaged,
/// or belongs to another minor version or configuration; the message names the difference.
template <class Sim>
std::string read_checkpoint(const std::filesystem::path& path, Sim& sim) {
  constexpr int dim = Sim::dimension;
  detail::ByteReader in(path);
  if (in.starts_with(detail::pieces_kind))
    in.fail("it lists the pieces of a run on several ranks, which go on with it (--ranks 1 or more "
            "for an example program)");
  detail::take_format(in, detail::checkpoint_kind, detail::checkpoint_format);

  SimulationState<dim, typename Sim::ParticleData::Scalar> state;
  std::size_t particles = 0, nodes = 0, contacts = 0, body_contacts = 0, length = 0;
  const bool mixed = detail::take_configuration(in, sim, state);
  in.line("counts", particles, nodes, contacts, body_contacts, length);
  std::string notes(in.take(length));
  in.raw(state.gravity);
  detail::take_particles(in, particles, mixed, sim.materials(), state.particles);
  in.need(nodes, sizeof(double) * symmetric_size<dim>);
  state.stress_impulse.resize(nodes);
  for (auto& stress : state.stress_impulse)
    in.raw(stress);
  in.need(contacts, 2 * sizeof(int));
  state.contacts.resize(contacts);
  for (Contact<dim>& contact : state.contacts) {
    in.raw(contact.node);
    in.raw(contact.boundary_id);
    in.raw(contact.impulse);
  }
  detail::take_bodies(in, sim.bodies().size(), state.bodies);
  in.need(body_contacts, 4 * sizeof(int));
  state.body_contacts.resize(body_contacts);
  for (BodyContact<dim>& contact : state.body_contacts) {
    in.raw(contact.node);
    in.raw(contact.boundary_id);
    in.raw(contact.body);
    in.raw(contact.point);
    in.raw(contact.impulse);
  }
  if (!in.at_end())
    in.fail("there is more in it than expected");
  try {
    sim.restore(std::move(state));
  } catch (const std::invalid_argument& error) {
    in.fail(error.what());
  }
  return notes;
}

} // namespace talus
