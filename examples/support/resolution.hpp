// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

/// \file
/// Grid, time step and particles of the collapses, by name.

namespace support {

struct Resolution {
  const char* name;
  double along, across, up; ///< edges of a cell, m
  double time_step;         ///< s
  int per_axis;             ///< particles along an edge of a cell
};

/// coarse: a quick look. medium: cells half as high, near the reference's deposits for a tenth of
/// its work (docs/how-to/resolution.md). reference: the paper's.
inline constexpr std::array<Resolution, 3> resolutions = {{
    {"coarse", 0.02, 0.02, 0.01, 1.66e-3, 3},
    {"medium", 0.02, 0.02, 0.005, 1.66e-3, 3},
    {"reference", 0.01, 0.01, 0.005, 8.3e-4, 6},
}};

inline std::vector<std::string> resolution_names() {
  std::vector<std::string> names;
  for (const Resolution& resolution : resolutions)
    names.emplace_back(resolution.name);
  return names;
}

/// name: one of resolution_names(); throws std::out_of_range for others.
inline const Resolution& resolution_of(const std::string& name) {
  std::size_t i = 0;
  while (i < resolutions.size() && resolutions[i].name != name)
    ++i;
  return resolutions.at(i);
}

} // namespace support
