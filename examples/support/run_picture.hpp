// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include <cstdio>
#include <string>
#include <vector>

/// \file
/// What summary.json tells plot_run.py to draw.

namespace support {

/// A title, a fact below it, and one curve y(x) beside the snapshots.
inline nlohmann::json picture(const std::string& title, const std::string& fact,
                              const std::string& x_label, const std::vector<double>& x,
                              const std::string& y_label, const std::vector<double>& y) {
  const nlohmann::json curve = {{"kind", "line"}, {"label", "talus"}, {"x", x}, {"y", y}};
  const nlohmann::json panel = {{"x", x_label}, {"y", y_label}, {"curves", {curve}}};
  return {{"title", title}, {"facts", {fact}}, {"panels", {panel}}};
}

/// printf into a text.
template <class... Values>
std::string text(const char* format, const Values&... values) {
  char line[256];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

} // namespace support
