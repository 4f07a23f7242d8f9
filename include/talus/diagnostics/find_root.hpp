// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"

#include <algorithm>
#include <cmath>

namespace talus {

/// Where a function is zero, and how well that is known.
struct Root {
  double x = 0;        ///< estimate
  double low = 0;      ///< the zero is between
  double high = 0;     ///< these two
  int evaluations = 0; ///< calls of the function
  bool found = false;  ///< false if the function has the same sign at both ends, x is the better
                       ///< of them then, or is not a number at x
};

/// A zero of f between `low` and `high`, at whose ends f has different signs: regula falsi with the
/// Illinois rule (Dowell & Jarratt 1971), which keeps it between two values. For costly functions
/// such as whole simulations: it needs few calls, and no derivative. Ends when the bracket is not
/// wider than x_tolerance or |f| <= f_tolerance. Throws std::invalid_argument for an empty bracket
/// or without tolerances.
template <class Function>
Root find_root(const Function& f, double low, double high, double x_tolerance, double f_tolerance,
               int max_evaluations = 50) {
  if (!(low < high))
    throw_invalid("find_root: low", low, "less than high");
  require_non_negative("find_root: x_tolerance", x_tolerance);
  require_non_negative("find_root: f_tolerance", f_tolerance);
  double f_low = f(low), f_high = f(high);
  Root root;
  root.evaluations = 2;
  root.low = low;
  root.high = high;
  const auto settle = [&](double x) {
    root.x = x;
    return root;
  };
  if (std::isnan(f_low) || std::isnan(f_high))
    return settle(std::isnan(f_low) ? low : high);
  root.found = f_low == 0 || f_high == 0 || std::signbit(f_low) != std::signbit(f_high);
  if (!root.found || std::min(std::abs(f_low), std::abs(f_high)) <= f_tolerance)
    return settle(std::abs(f_low) <= std::abs(f_high) ? low : high);
  int last_side = 0;
  double x = low;
  while (root.evaluations < max_evaluations) {
    x = root.low - f_low * (root.high - root.low) / (f_high - f_low);
    const double fx = f(x);
    ++root.evaluations;
    root.found = !std::isnan(fx);
    if (!root.found || std::abs(fx) <= f_tolerance)
      return settle(x);
    // An end that stays for a second time counts half: else it might stay for ever.
    if (std::signbit(fx) == std::signbit(f_low)) {
      root.low = x;
      f_low = fx;
      if (last_side == -1)
        f_high /= 2;
      last_side = -1;
    } else {
      root.high = x;
      f_high = fx;
      if (last_side == 1)
        f_low /= 2;
      last_side = 1;
    }
    if (root.high - root.low <= x_tolerance)
      return settle(x);
  }
  return settle(x);
}

} // namespace talus
