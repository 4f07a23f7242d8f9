// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"
#include "talus/diagnostics/energy_budget.hpp"
#include "talus/io/csv.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

/// \file
/// The tables of --budget: where energy and momentum of a run go.

namespace support {

/// In 2-D the axis that points up is called z, as in 3-D.
template <int Dim>
constexpr const char* axis_name(int axis) {
  constexpr const char* names[] = {"x", "y", "z"};
  return names[axis == Dim - 1 ? 2 : axis];
}

/// The record of an energy budget, as checkpoints and summaries hold it.
inline nlohmann::json to_json(const talus::EnergyRecord& record) {
  nlohmann::json json = {{"any", record.any}, {"largest_closure", record.largest_closure}};
  const auto put = [](nlohmann::json& of) {
    return [&of](const char* name, double value) { of[name] = value; };
  };
  talus::EnergyLevels::for_each(record.start, put(json["start"]));
  talus::EnergyLevels::for_each(record.now, put(json["now"]));
  talus::EnergyTerms::for_each(record.total, put(json["total"]));
  for (const talus::BoundaryWork& work : record.total.boundaries)
    json["boundaries"].push_back({work.friction, work.motion, work.impact});
  return json;
}
inline talus::EnergyRecord energy_record(const nlohmann::json& json) {
  talus::EnergyRecord record;
  const auto get = [](const nlohmann::json& of) {
    return [&of](const char* name, double& value) { value = of.at(name); };
  };
  record.any = json.at("any");
  record.largest_closure = json.at("largest_closure");
  talus::EnergyLevels::for_each(record.start, get(json.at("start")));
  talus::EnergyLevels::for_each(record.now, get(json.at("now")));
  talus::EnergyTerms::for_each(record.total, get(json.at("total")));
  if (json.contains("boundaries"))
    for (const nlohmann::json& work : json.at("boundaries"))
      record.total.boundaries.push_back({work.at(0), work.at(1), work.at(2)});
  return record;
}

/// Writes energy.csv and forces.csv of a simulation whose observer is an EnergyBudget.
template <class Sim>
class BudgetTables {
 public:
  static constexpr int dimension = Sim::dimension;
  using Budget = talus::EnergyBudget<dimension, typename Sim::ParticleData::Scalar>;

  /// Null if the simulation has no such observer.
  static std::shared_ptr<Budget> budget_of(const Sim& sim) {
    return std::dynamic_pointer_cast<Budget>(sim.params().observer);
  }

  static std::vector<std::string> energy_columns(const Sim& sim) {
    std::vector<std::string> names{"time_s"};
    const auto add = [&](const char* name, double) { names.push_back(name + std::string("_J")); };
    const talus::EnergyLevels levels;
    const talus::EnergyTerms terms;
    talus::EnergyLevels::for_each(levels, add);
    for (const std::string& name : boundaries(sim, true))
      names.push_back(name + "_J");
    talus::EnergyTerms::for_each(terms, add);
    return names;
  }
  static std::vector<std::string> force_columns(const Sim& sim) {
    std::vector<std::string> names{"time_s"};
    const auto add = [&](const std::string& name, const std::string& unit) {
      for (int a = 0; a < dimension; ++a)
        names.push_back(name + "_" + axis_name<dimension>(a) + unit);
    };
    add("momentum", "_Ns");
    add("weight", "_N");
    for (const std::string& name : boundaries(sim, false))
      add(name, "_N");
    add("exchanged", "_N");
    add("closure", "_N");
    return names;
  }

  /// One row of each after a step that was completed. times: s, before and after it.
  static void write(const Sim& sim, const Budget& budget, double before, double after,
                    talus::CsvWriter& energy, talus::CsvWriter& forces) {
    const talus::EnergyRecord& record = budget.record();
    if (sim.steps() == 1)
      energy.row(energy_row(sim, before, record.start, talus::EnergyTerms()));
    energy.row(energy_row(sim, after, record.now, record.total));
    std::vector<double> row{after};
    const auto add = [&](const talus::Vec<dimension>& v, double factor) {
      for (int a = 0; a < dimension; ++a)
        row.push_back(factor * v[a]);
    };
    const auto& momentum = budget.momentum();
    const double rate = 1 / sim.time_step();
    add(momentum.after, 1);
    add(momentum.weight, rate);
    for (int face = 0; face < 2 * dimension; ++face)
      add(sim.face_wrench(face / 2, face % 2 == 1).force, -1);
    for (std::size_t o = 0; o < sim.params().obstacles.size(); ++o)
      add(sim.obstacle_wrench(o).force, -1);
    add(momentum.exchanged, rate);
    add(momentum.closure(), rate);
    forces.row(row);
  }

  /// For summary.json: energies at the start and at the end, and what came and went between.
  static nlohmann::json summary(const Sim& sim, const talus::EnergyRecord& record) {
    nlohmann::json json = to_json(record);
    json.erase("any");
    json.erase("boundaries");
    const std::vector<std::string> names = boundaries(sim, true);
    for (std::size_t b = 0; b < record.total.boundaries.size(); ++b) {
      const talus::BoundaryWork& work = record.total.boundaries[b];
      json["boundaries"][names[b]] = {
          {"friction", work.friction}, {"motion", work.motion}, {"impact", work.impact}};
    }
    return json;
  }

 private:
  static std::vector<std::string> boundaries(const Sim& sim, bool bodies) {
    std::vector<std::string> names;
    for (int face = 0; face < 2 * dimension; ++face)
      names.push_back(std::string("face_") + axis_name<dimension>(face / 2) +
                      (face % 2 == 1 ? "_upper" : "_lower"));
    for (std::size_t o = 0; o < sim.params().obstacles.size(); ++o)
      names.push_back("obstacle_" + std::to_string(o));
    for (std::size_t b = 0; bodies && b < sim.params().bodies.size(); ++b)
      names.push_back("body_" + std::to_string(b));
    return names;
  }

  static std::vector<double> energy_row(const Sim& sim, double time,
                                        const talus::EnergyLevels& levels,
                                        const talus::EnergyTerms& terms) {
    std::vector<double> row{time};
    const auto add = [&](const char*, double value) { row.push_back(value); };
    talus::EnergyLevels::for_each(levels, add);
    for (std::size_t b = 0; b < boundaries(sim, true).size(); ++b)
      row.push_back(b < terms.boundaries.size() ? terms.boundaries[b].sum() : 0);
    talus::EnergyTerms::for_each(terms, add);
    return row;
  }
};

} // namespace support
