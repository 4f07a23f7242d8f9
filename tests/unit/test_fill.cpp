// SPDX-License-Identifier: MIT
// Regions and the particles that fill them.

#include "talus/boundary/shapes.hpp"
#include "talus/core/grid.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/particles.hpp"
#include "talus/scene/fill.hpp"
#include "talus/scene/region.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

namespace test_fill {

using namespace talus;
using support::about;

namespace {

using Pattern = Seeding::Pattern;
constexpr Pattern patterns[] = {Pattern::jittered, Pattern::random, Pattern::blue_noise};

using shapes::Ball, shapes::Box;

/// A box of 1 m with cells of 0.1 m (0.05 m upwards).
template <int Dim>
Grid<Dim> grid() {
  GridParams<Dim> params;
  for (int a = 0; a < Dim; ++a) {
    params.size[a] = 1;
    params.cells[a] = a == up_axis<Dim> ? 20 : 10;
  }
  return Grid<Dim>(params);
}

template <int Dim>
double total_volume(const Particles<Dim>& particles) {
  double total = 0;
  for (const double volume : particles.volume)
    total += volume;
  return total;
}

template <int Dim, class R>
Particles<Dim> filled(const R& region, const Seeding& seeding) {
  Particles<Dim> particles;
  const std::size_t added = fill(particles, grid<Dim>(), region, seeding);
  CHECK(added == particles.size());
  for (std::size_t p = 0; p < particles.size(); ++p) {
    CHECK(contains(region, particles.position[p]));
    CHECK(particles.volume[p] > 0);
  }
  return particles;
}

/// Smallest distance of two particles, in units of `spacing` along each axis.
template <int Dim>
double closest_pair(const Particles<Dim>& particles, const Vec<Dim>& spacing) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < particles.size(); ++p)
    for (std::size_t q = 0; q < p; ++q)
      least = std::min(
          least, (particles.position[p] - particles.position[q]).cwiseQuotient(spacing).norm());
  return least;
}

} // namespace

TEST_CASE("a bed is a box on the floor of the grid, as wide as it is") {
  const Grid<3> grid({.origin = {-1, 0, 2}, .size = {1, 0.5, 1}, .cells = {4, 2, 4}});
  Particles<3> bed, box;
  CHECK(fill_bed(bed, grid, 0.3, {.per_axis = 2}) == 8 * 4 * 2);
  fill_box<3>(box, grid, {-1, 0, 2}, {0, 0.5, 2.3}, {.per_axis = 2});
  CHECK(bed.position == box.position);
  CHECK(bed.volume == box.volume);
  CHECK_THROWS_AS(fill_bed(bed, grid, 0, {}), std::invalid_argument);
  CHECK_THROWS_AS(fill_bed(bed, grid, 1.1, {}), std::invalid_argument);
}

TEST_CASE("a box on the lattice is filled exactly, with equal particles") {
  const Box<2> box{{0.2, 0.1}, {0.7, 0.4}};
  for (const Pattern pattern : patterns) {
    const auto particles = filled<2>(box, {.per_axis = 2, .pattern = pattern});
    CHECK(particles.size() == 10 * 12);
    CHECK(total_volume(particles) == about(0.15, 1e-12));
    for (const double volume : particles.volume)
      CHECK(volume == about(0.15 / 120));
  }
  const auto regular = filled<2>(box, {.per_axis = 2, .jitter = 0});
  CHECK((regular.position[0] - Vec<2>(0.225, 0.1125)).norm() < 1e-12);
  CHECK((regular.position[119] - Vec<2>(0.675, 0.3875)).norm() < 1e-12);
}

TEST_CASE("volumes of a disc, a ball and a box off the lattice") {
  const double radius = 0.331, disc_area = std::numbers::pi * radius * radius;
  const Vec<2> centre(0.513, 0.497);
  const Ball<2> disc(centre, radius);
  const double ball_volume = 4 * std::numbers::pi / 3 * std::pow(radius, 3);
  const Ball<3> ball({0.513, 0.497, 0.52}, radius);
  const auto box = [](double top) { return Box<3>({0.113, 0.207, 0.319}, {0.587, 0.711, top}); };
  const double base = 0.474 * 0.504;
  for (const Pattern pattern : patterns) {
    CHECK(total_volume(filled<2>(disc, {.per_axis = 3, .pattern = pattern})) ==
          about(disc_area, 1e-3));
    CHECK(total_volume(filled<3>(ball, {.per_axis = 2, .pattern = pattern})) ==
          about(ball_volume, 1e-3));
    CHECK(total_volume(filled<3>(box(0.807), {.per_axis = 2, .pattern = pattern})) ==
          about(base * 0.488, 1e-3));
    // the 0.12 of the last shares that are left above 0.8 hold no particle
    CHECK(total_volume(filled<3>(box(0.803), {.per_axis = 2, .pattern = pattern})) ==
          about(base * 0.481, 1e-3));
  }
  // without a distance
  const auto inside = [&](const Vec<2>& x) { return (x - centre).norm() < radius; };
  CHECK(total_volume(filled<2>(inside, {.per_axis = 3})) == about(disc_area, 5e-3));
}

TEST_CASE("what leaves the grid is cut off, hollow regions stay hollow") {
  const auto hollow = [](const Vec<2>& x) {
    const double r = x.norm();
    return r > 0.6 && r < 0.8;
  };
  for (const Pattern pattern : patterns) {
    const auto particles = filled<2>(hollow, {.per_axis = 4, .pattern = pattern, .jitter = 1});
    CHECK(total_volume(particles) == about(std::numbers::pi / 4 * (0.64 - 0.36), 5e-3));
    for (const Vec<2>& x : particles.position)
      CHECK(x.minCoeff() >= 0);
  }
}

TEST_CASE("the same seed gives the same particles, another one others") {
  const Ball<2> disc{{0.5, 0.5}, 0.3};
  for (const Pattern pattern : patterns) {
    const auto sum = [&](std::uint64_t seed) {
      return state_checksum(filled<2>(disc, {.per_axis = 2, .pattern = pattern, .seed = seed}));
    };
    CHECK(sum(1) == sum(1));
    CHECK(sum(1) != sum(2));
  }
}

TEST_CASE("blue noise keeps particles apart, random positions do not") {
  const Vec<2> spacing(0.05, 0.025);
  const Ball<2> disc{{0.5, 0.5}, 0.35};
  const auto distance = [&](Pattern pattern) {
    return closest_pair(filled<2>(disc, {.per_axis = 2, .pattern = pattern}), spacing);
  };
  CHECK(distance(Pattern::blue_noise) > 0.6);
  CHECK(distance(Pattern::random) < 0.1);
  Particles<3> box;
  fill_box<3>(box, grid<3>(), {0.1, 0.1, 0.1}, {0.4, 0.4, 0.4},
              {.per_axis = 2, .pattern = Pattern::blue_noise});
  CHECK(box.size() == 6 * 6 * 12);
  CHECK(total_volume(box) == about(0.027, 1e-12));
  CHECK(closest_pair(box, Vec<3>(0.05, 0.05, 0.025)) > 0.6);
  for (const Vec<3>& x : box.position)
    CHECK(((x.array() >= 0.1).all() && (x.array() <= 0.4).all()));
}

TEST_CASE("regions that hold nothing are refused") {
  Particles<2> particles;
  const auto refused = [&](const auto& region, const Seeding& seeding) {
    CHECK_THROWS_AS(fill(particles, grid<2>(), region, seeding), std::invalid_argument);
  };
  refused([](const Vec<2>&) { return false; }, {});
  refused(Ball<2>{{3, 3}, 1}, {});                  // outside of the grid
  refused(Box<2>{{0.2, 0.299}, {0.7, 0.3005}}, {}); // too thin for 1/12 of a cell
  refused(Ball<2>{{0.5, 0.5}, 0.3}, {.per_axis = 0});
  refused(Ball<2>{{0.5, 0.5}, 0.3}, {.jitter = 1.5});
  CHECK(particles.empty());
}

TEST_CASE("a box is told how thick it must be") {
  Particles<2> particles;
  const Grid<2> long_box({.origin = {0, 0}, .size = {1e9, 1}, .cells = {100, 10}});
  const auto message = [&](double width) {
    return support::message_of<std::invalid_argument>([&] {
      fill_box<2>(particles, long_box, {0, 0}, {width, 0.5}, {});
    });
  };
  CHECK(message(0.15) ==
        "fill_box: upper - lower is 0.15; allowed: more than 1 m, 1e-9 of the grid's size");
  CHECK(support::contains(message(std::numeric_limits<double>::quiet_NaN()), "lower is nan"));
  CHECK(particles.empty());
  CHECK(fill_box<2>(particles, long_box, {0, 0}, {1.5, 0.5}, {}) == 15);
}

TEST_CASE("what holds particles already is not filled again") {
  Particles<2> particles;
  const Seeding seeding{.per_axis = 2};
  const auto refused = [&](const auto& fill_again) {
    const std::size_t before = particles.size();
    const std::string message = support::message_of<std::invalid_argument>(fill_again);
    CHECK(particles.size() == before);
    return message;
  };
  fill_box<2>(particles, grid<2>(), {0.1, 0.1}, {0.4, 0.4}, seeding);
  CHECK(support::contains(refused([&] {
                            fill_box<2>(particles, grid<2>(), {0.1, 0.1}, {0.4, 0.4}, seeding);
                          }),
                          "fill_box: the number of particles that are there already is 72"));
  CHECK(support::contains(refused([&] {
                            fill(particles, grid<2>(), Ball<2>{{0.4, 0.4}, 0.2}, seeding);
                          }),
                          "fill: the number of particles that are there already"));
  for (const Pattern pattern : patterns) { // side by side is fine
    Particles<2> sides;
    const Seeding with{.per_axis = 3, .pattern = pattern, .jitter = 1};
    fill_box<2>(sides, grid<2>(), {0, 0}, {0.3, 0.3}, with);
    fill_box<2>(sides, grid<2>(), {0.3, 0}, {0.6, 0.3}, with);
    fill_box<2>(sides, grid<2>(), {0, 0.3}, {0.6, 0.4}, with);
    fill(sides, grid<2>(), Ball<2>{{0.7, 0.7}, 0.2}, with);
    fill(
        sides, grid<2>(), [](const Vec<2>& x) { return x[0] < 0.4 && x[1] > 0.4; }, with);
    CHECK(sides.size() > 200);
  }
}

TEST_CASE("a region that gives no distance, or throws, is told and leaves no particles") {
  struct Holed {
    double distance(const Vec<2>& x) const {
      return x[0] > 0.5 ? std::numeric_limits<double>::quiet_NaN() : x[0] - 0.8;
    }
  };
  struct Throwing {
    double distance(const Vec<2>& x) const {
      if (x[0] > 0.5)
        throw std::runtime_error("no distance");
      return x[0] - 0.8;
    }
  };
  const Ball<2> ball{{0.7, 0.5}, 0.2};
  for (const Pattern pattern : patterns) {
    Particles<2> particles;
    const Seeding seeding{.per_axis = 2, .pattern = pattern};
    const auto refused = [&](const auto& region) {
      return support::message_of<std::invalid_argument>(
          [&] { fill(particles, grid<2>(), region, seeding); });
    };
    CHECK(support::contains(refused(Holed{}), "a shape's distance at x = (0.5"));
    CHECK(support::contains(refused(shapes::Union(ball, Holed{})), "a shape's distance"));
    CHECK(support::contains(refused(shapes::Union(Holed{}, ball)), "a shape's distance"));
    CHECK(support::contains(refused(shapes::Intersection(ball, Holed{})), "a shape's distance"));
    CHECK(support::contains(refused(shapes::Intersection(Holed{}, ball)), "a shape's distance"));
    CHECK(support::contains(refused(shapes::difference(ball, Holed{})), "a shape's distance"));
    CHECK_THROWS_AS(fill(particles, grid<2>(), Throwing{}, seeding), std::runtime_error);
    CHECK(particles.empty());
  }
}

TEST_CASE("a region of sample points without volume is refused, not sought for ever") {
  // the samples of a share at per_axis = 1 lie at 1/8, 3/8, ... of a cell
  const auto dust = [](const Vec<2>& x) {
    const double place = 80 * x[0];
    return std::abs(place - std::round(place)) < 1e-9 && std::abs(x[1] - 0.50625) < 1e-9;
  };
  Particles<2> particles;
  CHECK(support::contains(support::message_of<std::invalid_argument>([&] {
                            fill(particles, grid<2>(), dust,
                                 {.per_axis = 1, .pattern = Pattern::random});
                          }),
                          "all outside of the region"));
  CHECK(particles.empty());
}

} // namespace test_fill
