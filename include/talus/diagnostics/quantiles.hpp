// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace talus {

/// The value below which a share q of `values` lies: linear between the sorted values, of which the
/// first is at q = 0 and the last at q = 1. NaN without values. Throws std::invalid_argument unless
/// q is in [0, 1].
inline double quantile(std::vector<double> values, double q) {
  if (!(q >= 0 && q <= 1))
    throw_invalid("quantile: q", q, "a number in [0, 1]");
  if (values.empty())
    return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double place = q * static_cast<double>(values.size() - 1);
  const std::size_t below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double share = place - static_cast<double>(below);
  return share > 0 ? values[below] + share * (values[above] - values[below]) : values[below];
}

/// Inertial numbers of the nodes that flow.
struct InertialQuantiles {
  double low = 0, median = 0, high = 0; ///< 30 %, 50 % and 70 %; NaN without nodes
  std::size_t nodes = 0;                ///< that count
};

/// Over the nodes with least <= I < ∞; without pressure I is infinite. In the convention of the
/// law's InertialNumber. flow: anything with grid() and inertial_number(node). Rousseau et al. 2023
/// take least = 5e-4.
template <class Flow>
InertialQuantiles inertial_quantiles(const Flow& flow, double least = 5e-4) {
  const auto& grid = flow.grid();
  std::vector<double> values;
  for (int n = 0; n < grid.node_count(); ++n) {
    const auto node = grid.node_index(n);
    if (!grid.own().holds(node))
      continue;
    const double inertial = flow.inertial_number(node);
    if (inertial >= least && std::isfinite(inertial))
      values.push_back(inertial);
  }
  InertialQuantiles result;
  result.nodes = values.size();
  result.low = quantile(values, 0.3);
  result.median = quantile(values, 0.5);
  result.high = quantile(std::move(values), 0.7);
  return result;
}

} // namespace talus
