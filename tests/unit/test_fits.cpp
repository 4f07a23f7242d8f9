// SPDX-License-Identifier: MIT
// Fits, quantiles and root finding against exact values.

#include "talus/core/grid.hpp"
#include "talus/diagnostics/find_root.hpp"
#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/quantiles.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace test_fits {

using namespace talus;

TEST_CASE("a line through exact points, and the textbook's errors of scattered ones") {
  const LineFit exact = fit_line({1, 2, 4}, {5, 7, 11});
  CHECK(exact.slope == doctest::Approx(2));
  CHECK(exact.intercept == doctest::Approx(3));
  CHECK(exact.slope_error < 1e-12);
  CHECK(exact(10) == doctest::Approx(23));

  // By hand: mean x 2, Sxx 10, Sxy 6, residuals 0.2 -0.4 0.0 0.4 -0.2 have squares 0.4, s² = 0.4/3.
  const LineFit scattered = fit_line({0, 1, 2, 3, 4}, {1.2, 1.2, 2.2, 3.2, 3.2});
  CHECK(scattered.slope == doctest::Approx(0.6));
  CHECK(scattered.intercept == doctest::Approx(1.0));
  CHECK(scattered.slope_error == doctest::Approx(std::sqrt(0.4 / 3 / 10)));
  CHECK(scattered.intercept_error == doctest::Approx(std::sqrt(0.4 / 3 * (0.2 + 0.4))));
  CHECK(std::isnan(fit_line({0, 1}, {0, 1}).slope_error));
}

TEST_CASE("a line through the points between two heights") {
  const std::vector<double> x = {0, 1, 2, 3, 4}, y = {9, 8, 6, 4, 0};
  const LineFit line = fit_line_between(x, y, 4, 8);
  CHECK(line.points == 3);
  CHECK(line.slope == doctest::Approx(-2));
  CHECK(line(0) == doctest::Approx(10));
  const LineFit none = fit_line_between(x, y, 7, 8);
  CHECK(none.points == 1);
  CHECK(std::isnan(none.slope));
  CHECK(std::isnan(none(1)));
  CHECK_THROWS_AS(fit_line_between(x, {1, 2}, 0, 9), std::invalid_argument);
}

TEST_CASE("a power law, in any units") {
  std::vector<double> x, y;
  for (const double a : {1.0, 3.0, 7.0, 20.0}) {
    x.push_back(a);
    y.push_back(3.4 * std::pow(a, 0.65));
  }
  const PowerLawFit fit = fit_power_law(x, y);
  CHECK(fit.exponent == doctest::Approx(0.65));
  CHECK(fit.coefficient == doctest::Approx(3.4));
  CHECK(fit.exponent_error < 1e-12);
  CHECK(fit(7) == doctest::Approx(y[2]));
  // A common factor changes the coefficient alone; its relative error is the line's.
  for (double& value : y)
    value *= value > 20 ? 1001 : 999;
  const PowerLawFit scaled = fit_power_law(x, y);
  CHECK(scaled.exponent == doctest::Approx(0.65).epsilon(0.01));
  CHECK(scaled.exponent_error > 0);
  CHECK(scaled.coefficient == doctest::Approx(3400).epsilon(0.01));
}

TEST_CASE("fits refuse what has no line") {
  CHECK_THROWS_AS(fit_line({1}, {1}), std::invalid_argument);
  CHECK_THROWS_AS(fit_line({1, 2}, {1}), std::invalid_argument);
  CHECK_THROWS_AS(fit_line({2, 2}, {1, 3}), std::invalid_argument);
  CHECK_THROWS_AS(fit_line({1, 2}, {1, std::nan("")}), std::invalid_argument);
  CHECK_THROWS_AS(fit_power_law({1, 2}, {1, 0}), std::invalid_argument);
}

TEST_CASE("quantiles are linear between the sorted values") {
  CHECK(quantile({3, 1, 2, 4, 5}, 0.5) == 3);
  CHECK(quantile({4, 1, 3, 2}, 0.5) == doctest::Approx(2.5));
  CHECK(quantile({4, 1, 3, 2}, 0.3) == doctest::Approx(1.9));
  CHECK(quantile({4, 1, 3, 2}, 0) == 1);
  CHECK(quantile({4, 1, 3, 2}, 1) == 4);
  CHECK(quantile({7}, 0.3) == 7);
  CHECK(std::isnan(quantile({}, 0.5)));
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK(quantile({1, infinity, infinity}, 1) == infinity);
  CHECK_THROWS_AS(quantile({1}, 1.1), std::invalid_argument);
}

TEST_CASE("inertial numbers: of the flowing nodes with a pressure") {
  struct Flow {
    Grid<2> grid_{{.origin = {0, 0}, .size = {1, 1}, .cells = {2, 2}}};
    const Grid<2>& grid() const { return grid_; }
    double inertial_number(const Index<2>& node) const {
      if (node[0] == 0)
        return 1e-4; // at rest
      if (node[1] == 2)
        return std::numeric_limits<double>::infinity(); // no pressure
      return node[0] < 0 || node[0] > 2 || node[1] < 0 || node[1] > 2
                 ? 0
                 : 1e-2 * (2 * node[0] + node[1]);
    }
  };
  const InertialQuantiles quantiles = inertial_quantiles(Flow{});
  CHECK(quantiles.nodes == 4); // 0.02, 0.03, 0.04, 0.05
  CHECK(quantiles.median == doctest::Approx(0.035));
  CHECK(quantiles.low == doctest::Approx(0.029));
  CHECK(quantiles.high == doctest::Approx(0.041));

  struct Ring { // periodic along x: nodes and their copies are one place
    Grid<2> grid_{{.origin = {0, 0}, .size = {1, 1}, .cells = {3, 2}}, {true, false}};
    const Grid<2>& grid() const { return grid_; }
    double inertial_number(const Index<2>& /*node*/) const { return 0.01; }
  };
  CHECK(inertial_quantiles(Ring{}).nodes == 9);
}

TEST_CASE("roots: few calls, a bracket, and an answer where there is none") {
  int calls = 0;
  const Root root = find_root(
      [&](double x) {
        ++calls;
        return std::exp(x) - 2;
      },
      0, 3, 1e-12, 1e-10);
  CHECK(root.found);
  CHECK(std::abs(root.x - std::log(2.0)) < 1e-9);
  CHECK(root.low <= std::log(2.0));
  CHECK(root.high >= std::log(2.0));
  CHECK(calls == root.evaluations);
  CHECK(calls <= 14);

  // A step, as a coarse grid makes of a height: the bracket closes round it.
  const Root step = find_root([](double x) { return x < 0.3 ? -1.0 : 1.0; }, 0, 1, 1e-3, 0);
  CHECK(step.found);
  CHECK(step.high - step.low <= 1e-3);
  CHECK(std::abs(step.x - 0.3) <= 1e-3);

  const Root none = find_root([](double x) { return 1 + x * x; }, -1, 2, 1e-3, 0);
  CHECK_FALSE(none.found);
  CHECK(none.x == -1);
  CHECK(find_root([](double x) { return x - 1; }, 1, 2, 1e-3, 0).x == 1);

  // where it is not a number
  const Root at_end = find_root([](double x) { return x - 1 + std::sqrt(2 - x); }, 0, 3, 1e-3, 0);
  CHECK_FALSE(at_end.found);
  CHECK(at_end.x == 3);
  const Root inside = find_root(
      [](double x) { return std::abs(x - 1.5) < 1 ? std::nan("") : x - 1; }, 0, 3, 1e-3, 0);
  CHECK_FALSE(inside.found);
  CHECK(inside.x == 1);
  CHECK(inside.evaluations == 3);
  CHECK_THROWS_AS(find_root([](double x) { return x; }, 1, 1, 1e-3, 0), std::invalid_argument);
}

} // namespace test_fits
