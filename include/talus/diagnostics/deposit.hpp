// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

/// \file
/// Where the volume of a deposit lies: a measure of the run-out that hangs on no height of a front.

namespace talus {

/// The x up to which a share of a volume lies, m: of the particles with x_p > beyond and last
/// coordinate > above, sorted by x, half of each on either side of it,
/// \f[ x: \sum_{x_p < x} V_p = \mathrm{share} \sum_p V_p, \f]
/// linear between particles; the first or last one's place beyond them. share: in [0, 1]; beyond,
/// above: m. Not a number without such particles. Throws std::invalid_argument for another share.
template <int Dim, class Real>
double volume_quantile(const Particles<Dim, Real>& particles, double share,
                       double beyond = -std::numeric_limits<double>::infinity(),
                       double above = -std::numeric_limits<double>::infinity()) {
  if (!(share >= 0 && share <= 1))
    throw_invalid("volume_quantile: share", share, "a number in [0, 1]");
  std::vector<std::pair<double, double>> parts; // x, volume
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const Vec<Dim>& x = particles.position[p];
    if (x[0] > beyond && x[up_axis<Dim>] > above)
      parts.emplace_back(x[0], static_cast<double>(particles.volume[p]));
  }
  if (parts.empty())
    return std::numeric_limits<double>::quiet_NaN();
  std::ranges::sort(parts); // by volume, too: the order of the particles does not count
  double total = 0;
  for (const auto& part : parts)
    total += part.second;
  double last_x = parts.front().first, last_sum = 0, sum = 0;
  for (const auto& [x, volume] : parts) {
    const double middle = sum + volume / 2;
    if (middle >= share * total)
      return middle > last_sum
                 ? last_x + (x - last_x) * (share * total - last_sum) / (middle - last_sum)
                 : x;
    last_x = x;
    last_sum = middle;
    sum += volume;
  }
  return last_x;
}

} // namespace talus
