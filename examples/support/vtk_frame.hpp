// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"
#include "talus/diagnostics/particle_fields.hpp"
#include "talus/diagnostics/strain_rate.hpp"
#include "talus/io/vtk.hpp"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

/// \file
/// What a program shows of a simulation in ParaView.

namespace support {

/// Writes the files of a simulation on one process, as talus::distributed::ParallelVtk those of one
/// on several.
template <class Sim>
class WholeVtk {
 public:
  static constexpr int dimension = Sim::dimension;
  using Node = talus::Index<dimension>;

  explicit WholeVtk(const Sim& sim) : sim_(sim) {
    for (int a = 0; a < dimension; ++a)
      nodes_[a] = sim.grid().cells(a) + 1;
  }
  template <class Function>
  talus::VtkField node_field(std::string name, const Function& value) const {
    return talus::vtk_node_field<dimension>(std::move(name), nodes_, value);
  }
  template <class Function>
  talus::VtkField particle_field(std::string name, const Function& value) const {
    return talus::vtk_field(std::move(name), talus::at_particles(sim_, value));
  }
  void write_particles(const std::filesystem::path& path,
                       const std::vector<talus::VtkField>& fields) const {
    talus::write_vtk_particles<dimension>(path, sim_.particles().position, fields);
  }
  void write_cells(const std::filesystem::path& path,
                   const std::vector<talus::VtkField>& fields) const {
    talus::write_vtk_cells<dimension>(path, sim_.grid().origin(), sim_.grid().spacing(), nodes_,
                                      fields,
                                      [&](const Node& n) { return sim_.volume_fraction(n) > 0; });
  }

 private:
  const Sim& sim_;
  Node nodes_{};
};

/// Writes the particles and the cells with material; vtk: WholeVtk or ParallelVtk of sim. The
/// fields of the grid are those of the last step, the positions those after it.
template <class Vtk, class Sim>
void write_vtk_frame(const Vtk& vtk, const Sim& sim,
                     const talus::StrainRate<Sim::dimension>& strain_rate,
                     const std::filesystem::path& particles, const std::filesystem::path& grid) {
  using Node = talus::Index<Sim::dimension>;
  const auto stress = [&](const Node& n) { return sim.stress(n); };
  const auto pressure = [&](const Node& n) { return sim.pressure(n); };
  const auto inertial_number = [&](const Node& n) { return sim.inertial_number(n); };
  std::vector<talus::VtkField> of_particles{talus::vtk_field("id", sim.particles().id),
                                            talus::vtk_field("velocity", sim.particles().velocity),
                                            talus::vtk_field("volume", sim.particles().volume),
                                            vtk.particle_field("stress", stress),
                                            vtk.particle_field("pressure", pressure),
                                            vtk.particle_field("inertial_number", inertial_number)};
  if (sim.materials() > 1)
    of_particles.push_back(talus::vtk_field("material", sim.particles().material));
  vtk.write_particles(particles, of_particles);
  std::vector<talus::VtkField> of_nodes{
      vtk.node_field("volume_fraction", [&](const Node& n) { return sim.volume_fraction(n); }),
      vtk.node_field("velocity", [&](const Node& n) { return sim.velocity(n); }),
      vtk.node_field("stress", stress),
      vtk.node_field("pressure", pressure),
      vtk.node_field("strain_rate", [&](const Node& n) { return strain_rate(n); }),
      vtk.node_field("inertial_number", inertial_number)};
  for (int m = 1; m < sim.materials(); ++m)
    of_nodes.push_back(vtk.node_field("material_" + std::to_string(m) + "_fraction",
                                      [&](const Node& n) { return sim.material_fraction(n, m); }));
  vtk.write_cells(grid, of_nodes);
}

} // namespace support
