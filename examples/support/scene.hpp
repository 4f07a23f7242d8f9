// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"
#include "run.hpp"
#include "run_picture.hpp"
#include "scene_options.hpp"

#include "talus/core/types.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

/// \file
/// Frame of the programs that show one scene each.

namespace support {

/// A program that shows one scene. It says what is in the box and what is measured:
///
///     int main(int argc, char** argv) {
///       double depth = 0.1; // m
///       support::Scene scene("bed", "A bed of sand rests.");
///       scene.run.end_time = 2;
///       scene.option("--depth", depth, "depth_m", "Of the bed, m");
///       return scene.main<2, 3>(argc, argv, [&]<int dim>() {
///         auto params = scene.box<dim>({0.5, 0.1, 0.2});
///         talus::Particles<dim> sand;
///         talus::fill_bed(sand, talus::Grid<dim>(params.grid), depth, scene.seeding);
///         support::SceneSimulation<dim> sim(params, sand);
///         auto run = scene.start(sim);
///         if (run.finished()) // earlier, with --resume
///           return 0;
///         while (run.advance()) {
///         }
///         return run.finish({{"speed_m_s", talus::largest_speed(sim)}},
///                           support::picture("Bed", "it rests"));
///       });
///     }
class Scene : public SceneOptions {
 public:
  /// about: one sentence, for --help.
  Scene(std::string name, const std::string& about) : name_(std::move(name)), app_(about) {}

  /// An option of this program alone. What `value` holds is the default; key: its name in
  /// summary.json; about: with the unit. The value must outlive the scene.
  void option(const std::string& flag, double& value, const std::string& key,
              const std::string& about) {
    app_.add_option(flag, value, about)->capture_default_str();
    own_.emplace_back(key, [&value] { return nlohmann::json(value); });
  }
  /// The same for a text, the name of a file, say.
  void option(const std::string& flag, std::string& value, const std::string& key,
              const std::string& about) {
    app_.add_option(flag, value, about);
    own_.emplace_back(key, [&value] { return nlohmann::json(value); });
  }

  /// Options of all scenes that would do nothing in this one, without the dashes: it does not have
  /// them.
  void without(const std::vector<std::string>& names) { without_ = names; }

  /// The program: reads the command line and calls body<dimension>() → exit status. Dims: the
  /// dimensions that it can be run in, 2, 3 or both; of one alone, body may be no template.
  template <int... Dims, class Body>
  int main(int argc, char** argv, const Body& body) {
    constexpr std::array dimensions{Dims...};
    constexpr bool choice = dimensions.size() > 1;
    dimension = dimensions[0];
    if constexpr (choice) {
      app_.add_option("--dim", dimension, "Dimension")
          ->check(CLI::IsMember({Dims...}))
          ->capture_default_str();
    }
    add_scene_options(app_, *this, "out/" + name_);
    for (const std::string& name : without_)
      app_.remove_option(app_.get_option("--" + name));
    return run_program(app_, argc, argv, [&] {
      if constexpr (choice)
        return dimension == 2 ? body.template operator()<2>() : body.template operator()<3>();
      else
        return body();
    });
  }

  /// What makes the run what it is and no option says: the contents of a file, say (content_of). To
  /// be called before start().
  void input(const std::string& key, const nlohmann::json& value) {
    own_.emplace_back(key, [value] { return value; });
  }

  /// Does the command line give this option?
  bool given(const std::string& flag) const { return app_.get_option(flag)->count() > 0; }

  /// As box_params.
  template <int Dim, class Sim = SceneSimulation<Dim>>
  typename Sim::Params box(const talus::Vec<3>& size) const {
    return box_params<Dim, Sim>(*this, size);
  }

  /// The run, ready to advance; sections.csv is along the middle of the box.
  template <class Sim>
  Run<Sim> start(Sim& sim) const {
    nlohmann::json inputs = scene_inputs(*this, sim);
    for (std::string name : without_) {
      std::replace(name.begin(), name.end(), '-', '_');
      inputs.erase(name);
    }
    for (const auto& [key, value] : own_)
      inputs[key] = value();
    return Run<Sim>(sim, name_, run, inputs);
  }

 private:
  std::string name_;
  CLI::App app_;
  std::vector<std::string> without_;
  std::vector<std::pair<std::string, std::function<nlohmann::json()>>> own_;
};

/// An angle in degrees.
inline double degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

} // namespace support
