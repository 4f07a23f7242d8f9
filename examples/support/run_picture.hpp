// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include <cstdio>
#include <string>
#include <vector>

/// \file
/// What summary.json tells plot_run.py to draw.

namespace support {

/// The snapshots, with a title and a fact above them.
inline nlohmann::json picture(const std::string& title, const std::string& fact) {
  return {{"title", title}, {"facts", {fact}}};
}

/// The same, and one curve y(x) below them.
inline nlohmann::json picture(const std::string& title, const std::string& fact,
                              const std::string& x_label, const std::vector<double>& x,
                              const std::string& y_label, const std::vector<double>& y) {
  const nlohmann::json curve = {{"kind", "line"}, {"label", "talus"}, {"x", x}, {"y", y}};
  nlohmann::json all = picture(title, fact);
  all["panels"] = {{{"x", x_label}, {"y", y_label}, {"curves", {curve}}}};
  return all;
}

/// printf into a text.
template <class... Values>
std::string text(const char* format, const Values&... values) {
  char line[256];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

} // namespace support
