// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/diagnostics/particle_fields.hpp"
#include "talus/distributed/together.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/io/atomic_file.hpp"
#include "talus/io/vtk.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace talus::distributed {

/// VTK files of a simulation on several ranks: each rank writes its particles or cells to a piece
/// (.vtu), and rank 0 an index of the pieces (.pvtu), which is what ParaView opens and a VtkSeries
/// lists. Nothing is gathered.
///
///     const distributed::ParallelVtk vtk(sim);
///     vtk.write_particles("particles.pvtu", {vtk_field("id", sim.particles().id)});
///     vtk.write_cells("grid.pvtu", {vtk.node_field("velocity", [&](const Index<3>& node) {
///                       return sim.velocity(node);
///                     })});
///
/// All functions are collective; all ranks give the same paths, names and order of fields. What
/// cannot be written is a std::runtime_error on all ranks.
template <class Sim>
class ParallelVtk {
 public:
  static constexpr int dimension = Sim::dimension;

  /// sim must live as long as this, and make no step meanwhile. Throws std::invalid_argument if it
  /// has no ranks.
  explicit ParallelVtk(const Sim& sim) : sim_(sim), order_(sim.grid()) {
    if (!sim.params().ranks)
      throw_invalid("params.ranks", "null", "the ranks that share the simulation");
    const Grid<dimension>& grid = sim.grid();
    first_ = grid.own().begin;
    for (int a = 0; a < dimension; ++a) // cells begin at own nodes and end one node later
      count_[a] = std::max(1, std::min(grid.own().end[a], grid.cells(a)) - first_[a] + 1);
  }

  /// A nodal field for write_cells. value(index) is called for the nodes that this rank owns, and
  /// gives a number, Vec or Mat.
  template <class Function>
  VtkField node_field(std::string name, const Function& value) const {
    const auto values = at_nodes(value);
    return vtk_node_field<dimension>(std::move(name), count_, [&](const Index<dimension>& local) {
      return values[number(global(local))];
    });
  }
  /// A nodal field at the particles, for write_particles: see talus::at_particles.
  template <class Function>
  VtkField particle_field(std::string name, const Function& value) const {
    const auto values = at_nodes(value);
    return vtk_field(std::move(name), talus::at_particles(sim_, [&](const Index<dimension>& node) {
                       return values[number(node)];
                     }));
  }

  /// fields: one value for each particle of this rank.
  void write_particles(const std::filesystem::path& path,
                       const std::vector<VtkField>& fields) const {
    write(path, fields, [&](const std::filesystem::path& piece) {
      write_vtk_particles<dimension>(piece, sim_.particles().position, fields);
    });
  }
  /// The cells with material at a node, each in one piece; fields: made by node_field.
  void write_cells(const std::filesystem::path& path, const std::vector<VtkField>& fields) const {
    const auto fractions =
        at_nodes([&](const Index<dimension>& node) { return sim_.volume_fraction(node); });
    write(path, fields, [&](const std::filesystem::path& piece) {
      write_vtk_cells<dimension>(
          piece, sim_.grid().origin(), sim_.grid().spacing(), count_, fields,
          [&](const Index<dimension>& local) { return fractions[number(global(local))] > 0; },
          first_);
    });
  }

 private:
  const Communicator& all() const { return sim_.params().ranks->communicator(); }
  Index<dimension> global(Index<dimension> local) const {
    for (int a = 0; a < dimension; ++a)
      local[a] += first_[a];
    return local;
  }
  int number(const Index<dimension>& node) const {
    return sim_.grid().node(sim_.grid().owner(node));
  }

  /// The values at all nodes of the window; others' come from their owners.
  template <class Function>
  auto at_nodes(const Function& value) const {
    using Value = std::decay_t<decltype(value(Index<dimension>()))>;
    Array<Value> values;
    const auto nodes = static_cast<std::size_t>(sim_.grid().node_count());
    if constexpr (std::is_arithmetic_v<Value>)
      values.assign(nodes, Value(0));
    else
      values.assign(nodes, Value::Zero());
    for (const int node : order_.nodes())
      values[node] = value(sim_.grid().node_index(node));
    sim_.params().ranks->halo().share_nodes(values.data(), sizeof(Value));
    return values;
  }

  template <class WritePiece>
  void write(const std::filesystem::path& path, const std::vector<VtkField>& fields,
             const WritePiece& write_piece) const {
    const auto piece = [&](int rank) {
      std::filesystem::path name = path;
      return name.replace_filename(path.stem().string() + "_" + std::to_string(rank) + ".vtu");
    };
    together(all(), [&] { write_piece(piece(all().rank())); });
    together(all(), [&] {
      if (all().rank() != 0)
        return;
      const auto array = [](const std::string& name, int components) {
        return "<PDataArray type=\"Float64\" Name=\"" + talus::detail::xml_escaped(name) +
               "\" NumberOfComponents=\"" + std::to_string(components) + "\"/>\n";
      };
      std::string xml = "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" "
                        "version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
                        "<PUnstructuredGrid GhostLevel=\"0\">\n<PPointData>\n";
      for (const VtkField& field : fields)
        xml += array(field.name, field.components);
      xml += "</PPointData>\n<PPoints>\n" + array("position", 3) + "</PPoints>\n";
      for (int rank = 0; rank < all().size(); ++rank)
        xml += "<Piece Source=\"" + talus::detail::xml_escaped(piece(rank).filename().string()) +
               "\"/>\n";
      AtomicFile file(path);
      file.write(xml + "</PUnstructuredGrid>\n</VTKFile>\n");
      file.commit();
    });
  }

  const Sim& sim_;
  BlockOrder<dimension> order_;
  Index<dimension> first_{}, count_{}; ///< the nodes of this rank's cells
};

} // namespace talus::distributed
