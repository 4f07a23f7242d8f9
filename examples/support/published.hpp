// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include <optional>
#include <string>

namespace support {

struct Published {
  double value, half_width;
};

/// What the paper gives for a quantity ("runout", …) of a case, from source "sim" or "exp"; unit:
/// the end of its name in the case's file, "_m". None if it gives nothing.
inline std::optional<Published> published_value(const nlohmann::json& all,
                                                const std::string& quantity,
                                                const std::string& source,
                                                const std::string& unit) {
  const std::string of = quantity + "_" + source;
  std::string half_width = of + "_pm" + unit; // or one for both sources
  if (!all.contains(half_width))
    half_width = quantity + "_pm" + unit;
  if (!all.contains(of + unit) || !all.contains(half_width))
    return {};
  return Published{all.at(of + unit), all.at(half_width)};
}

} // namespace support
