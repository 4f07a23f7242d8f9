// SPDX-License-Identifier: MIT
#pragma once

#include "results.hpp"

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

/// \file
/// Pictures of the studies: described here, drawn by plot_study.py.

namespace support {

using Values = std::vector<double>;

/// One set of axes with curves.
class Panel {
 public:
  struct Axes {
    std::string title{}, x{}, y{}; ///< labels with units
    bool log = false;              ///< both axes logarithmic
    bool log_y = false;            ///< the upright one alone
  };
  explicit Panel(const Axes& axes)
      : json_{{"title", axes.title}, {"x", axes.x},         {"y", axes.y},
              {"log", axes.log},     {"log_y", axes.log_y}, {"curves", nlohmann::json::array()}} {}

  /// kind: line, dashed, points, or reference (black). label: curves of one name, up to a colon,
  /// share a colour; empty or with the colon at its end it is not in the legend. y_error: half
  /// lengths of error bars, or none.
  Panel& add(const std::string& kind, const std::string& label, const Values& x, const Values& y,
             const Values& y_error = {}) {
    json_["curves"].push_back(
        {{"kind", kind}, {"label", label}, {"x", x}, {"y", y}, {"y_error", y_error}});
    return *this;
  }
  /// What is between two curves.
  Panel& band(const std::string& label, const Values& x, const Values& low, const Values& high) {
    json_["curves"].push_back(
        {{"kind", "band"}, {"label", label}, {"x", x}, {"y", low}, {"high", high}});
    return *this;
  }
  /// A published value: a point with error bars in both directions.
  Panel& published(const std::string& label, double x, double x_error, double y, double y_error) {
    json_["curves"].push_back({{"kind", "published"},
                               {"label", label},
                               {"x", {x}},
                               {"y", {y}},
                               {"x_error", {x_error}},
                               {"y_error", {y_error}}});
    return *this;
  }
  const nlohmann::json& json() const { return json_; }

 private:
  nlohmann::json json_;
};

/// Writes OUT/picture.json, which plot_study.py draws as OUT/NAME.png.
inline void write_panels(const fs::path& out, const std::string& name, const std::string& title,
                         const std::vector<Panel>& panels) {
  nlohmann::json picture = {{"name", name}, {"title", title}, {"panels", nlohmann::json::array()}};
  for (const Panel& panel : panels)
    picture["panels"].push_back(panel.json());
  write_json(out / "picture.json", picture);
}

} // namespace support
