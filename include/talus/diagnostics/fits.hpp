// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace talus {

/// A straight line y = intercept + slope x by least squares. The errors are standard errors,
/// estimated from the scatter about the line; NaN for two points, which leave none.
struct LineFit {
  double slope = 0, slope_error = 0;         ///< unit of y over unit of x
  double intercept = 0, intercept_error = 0; ///< unit of y
  std::size_t points = 0;

  double operator()(double x) const { return intercept + slope * x; }
};

/// x, y: #points values each, of any unit. Throws std::invalid_argument unless both have the same
/// number of finite values, at least two, and two of x differ.
inline LineFit fit_line(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  if (n < 2 || y.size() != n)
    throw_invalid("fit_line: the number of points", n < 2 ? n : y.size(),
                  n < 2 ? "at least 2" : "that of x, " + std::to_string(n));
  double mean_x = 0, mean_y = 0;
  for (std::size_t i = 0; i < n; ++i) {
    require_finite("fit_line: x", x[i]);
    require_finite("fit_line: y", y[i]);
    mean_x += x[i] / static_cast<double>(n);
    mean_y += y[i] / static_cast<double>(n);
  }
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < n; ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  if (!(xx > 0))
    throw_invalid("fit_line: all x", x[0], "at least two different values");
  LineFit fit;
  fit.points = n;
  fit.slope = xy / xx;
  fit.intercept = mean_y - fit.slope * mean_x;
  double squares = 0;
  for (std::size_t i = 0; i < n; ++i)
    squares += (y[i] - fit(x[i])) * (y[i] - fit(x[i]));
  const double variance = squares / (static_cast<double>(n) - 2); // 0/0 for two points
  fit.slope_error = std::sqrt(variance / xx);
  fit.intercept_error = std::sqrt(variance * (1 / static_cast<double>(n) + mean_x * mean_x / xx));
  return fit;
}

/// The line through those of the points whose y is between `low` and `high`: the slope of a heap
/// between two heights, say, or a rate. Its values are NaN, and `points` says why, if there are
/// less than two of them. Throws std::invalid_argument as fit_line does.
inline LineFit fit_line_between(const std::vector<double>& x, const std::vector<double>& y,
                                double low, double high) {
  if (y.size() != x.size())
    throw_invalid("fit_line: the number of points", y.size(),
                  "that of x, " + std::to_string(x.size()));
  std::vector<double> x_inside, y_inside;
  for (std::size_t i = 0; i < x.size(); ++i)
    if (y[i] >= low && y[i] <= high) {
      x_inside.push_back(x[i]);
      y_inside.push_back(y[i]);
    }
  if (x_inside.size() >= 2)
    return fit_line(x_inside, y_inside);
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  return {none, none, none, none, x_inside.size()};
}

/// y = coefficient x^exponent, fitted as a line through the logarithms: all points count by their
/// relative error. Standard errors as in LineFit.
struct PowerLawFit {
  double exponent = 0, exponent_error = 0;
  double coefficient = 0, coefficient_error = 0; ///< of y at x = 1
  std::size_t points = 0;

  double operator()(double x) const { return coefficient * std::pow(x, exponent); }
};

/// x, y: #points values each, > 0. Throws std::invalid_argument as fit_line does, or if a value is
/// not positive.
inline PowerLawFit fit_power_law(const std::vector<double>& x, const std::vector<double>& y) {
  const auto logarithms = [](const char* name, const std::vector<double>& values) {
    std::vector<double> logs;
    for (const double value : values) {
      require_positive(name, value);
      logs.push_back(std::log(value));
    }
    return logs;
  };
  const LineFit line =
      fit_line(logarithms("fit_power_law: x", x), logarithms("fit_power_law: y", y));
  PowerLawFit fit;
  fit.exponent = line.slope;
  fit.exponent_error = line.slope_error;
  fit.coefficient = std::exp(line.intercept);
  fit.coefficient_error = fit.coefficient * line.intercept_error;
  fit.points = line.points;
  return fit;
}

} // namespace talus
