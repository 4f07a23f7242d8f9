// SPDX-License-Identifier: MIT
// Terrain: maps and their files, the ground as an obstacle, release areas, maps of what lies there.

#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/io/stl.hpp"
#include "talus/scene/fill.hpp"
#include "talus/terrain/ascii_grid.hpp"
#include "talus/terrain/deposit_maps.hpp"
#include "talus/terrain/polygon.hpp"
#include "talus/terrain/raster.hpp"
#include "talus/terrain/terrain.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <fstream>
#include <limits>
#include <locale>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace test_terrain {

using namespace talus;
using support::about;
using support::contains;
using support::content;
using support::Folder;
using support::message_of;

static_assert(Region<Release, 3>);

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// z = 1 + 0.5 x − 0.25 y at the middle of the cells of a map whose corner is at (x, y).
Raster plane(int columns, int rows, double x, double y, double cell, const Vec<2>& origin) {
  Raster map{columns, rows, x, y, cell, std::vector<double>(std::size_t(columns * rows))};
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      map.at(i, j) =
          1 + 0.5 * (x - origin[0] + (i + 0.5) * cell) - 0.25 * (y - origin[1] + (j + 0.5) * cell);
  return map;
}

void write(const support::fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

} // namespace

TEST_CASE("ESRI ASCII grids: what is read") {
  const Folder folder;
  const auto file = folder / "a.asc";
  const std::string values = "1 2 3\n-4.5 -9999 6e1\n";
  const std::pair<const char*, std::string> same[] = {
      {"plain",
       "ncols 3\nnrows 2\nxllcorner 500000.5\nyllcorner 5e6\ncellsize 5\nNODATA_value -9999\n" +
           values},
      {"capitals, another order, no NODATA_value",
       "NROWS 2\nNCOLS 3\nCELLSIZE 5.0\nYLLCORNER 5000000\nXLLCORNER 500000.5\n" + values},
      {"the middle of the cell",
       "ncols 3\nnrows 2\nxllcenter 500003.0\nyllcenter 5000002.5\ncellsize 5\n" + values},
      {"blanks, CR LF, a byte order mark, rows that are no lines",
       "\xef\xbb\xbfncols\t 3\r\nnrows 2\r\nxllcorner 500000.5\r\nyllcorner 5000000\r\n"
       "cellsize 5\r\nnodata_value -32768\r\n 1 2\r\n3 -4.5 -32768\r\n60 \r\n\r\n"},
  };
  for (const auto& dialect : same) {
    CAPTURE(dialect.first);
    write(file, dialect.second);
    const Raster map = read_ascii_grid(file);
    CHECK(map.columns == 3);
    CHECK(map.rows == 2);
    CHECK(map.x == 500000.5);
    CHECK(map.y == 5e6);
    CHECK(map.cell == 5);
    REQUIRE(map.values.size() == 6);
    CHECK(map.at(0, 1) == 1); // the file begins in the north-west
    CHECK(map.at(2, 1) == 3);
    CHECK(map.at(0, 0) == -4.5);
    CHECK(std::isnan(map.at(1, 0)));
    CHECK(map.at(2, 0) == 60);
    CHECK(range_of(map) == std::pair(-4.5, 60.0));
  }
}

TEST_CASE("ESRI ASCII grids: no data, where a program rounded it to a float") {
  const Folder folder;
  const auto file = folder / "a.asc";
  const std::string head = "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 5\nNODATA_value ";
  const auto voids = [&](const std::string& no_data, const std::string& values) {
    write(file, head + no_data + '\n' + values + '\n');
    const Raster map = read_ascii_grid(file);
    return std::pair(std::isnan(map.at(0, 0)), std::isnan(map.at(1, 0)));
  };
  CHECK(voids("-3.4028234663852886e+38", "-3.4028235e+38 -3.4e38") == std::pair(true, false));
  CHECK(voids("-3.40282347e+38", "5 -3.4028234663852886e+38") == std::pair(false, true));
  CHECK(voids("-9999", "-9999.0001 -9998.99") == std::pair(true, false));
  CHECK(voids("0", "1e-300 -0") == std::pair(false, true));
  CHECK(voids("1.7e308", "-1.7e308 1.7e308") == std::pair(false, true));

  Raster map{2, 1, 0, 0, 5, {1, none}};
  for (const double wrong : {none, HUGE_VAL, -HUGE_VAL})
    CHECK(contains(message_of<std::invalid_argument>([&] { write_ascii_grid(file, map, wrong); }),
                   "no_data is " + text_of(wrong) + "; allowed: a finite number"));
  map.at(0, 0) = -9999.0001; // it would be read as none
  CHECK(contains(message_of<std::invalid_argument>([&] { write_ascii_grid(file, map); }),
                 "is -9999.0001; allowed: finite numbers other than that for no data, -9999"));
}

TEST_CASE("ESRI ASCII grids: what is refused, in words") {
  const Folder folder;
  const auto file = folder / "a.asc";
  const std::string head = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 5\n";
  const std::pair<std::string, const char*> refused[] = {
      {"", "its header has no ncols"},
      {"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\n1 2 3 4 5 6", "its header has no cellsize"},
      {"ncols 3\nnrows 2\nxllcorner 0\ncellsize 5\n1", "no yllcorner or yllcenter"},
      {"ncols 3\nnrows 0\n", "line 2: nrows is \"0\"; allowed: an integer >= 1"},
      {"ncols 3.0\n", "line 1: ncols is \"3.0\"; allowed: an integer >= 1"},
      {"ncols 3\nncols 3\n", "line 2: a key is \"ncols\"; allowed: each key once"},
      {"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ndx 5\ndy 4\n",
       "line 5: a key is \"dx\"; allowed: ncols, nrows"},
      {"ncols 3\nnrows 2\nxllcorner 0,5\n", "line 3: xllcorner is \"0,5\"; allowed: a finite"},
      {"ncols 3\nnrows 2\ncellsize 0\n", "line 3: cellsize is \"0\"; allowed: a number > 0"},
      {head + "1 2 3\n4 5\n",
       "the number of values is 5; allowed: ncols * nrows = 6; line 7 has 2"},
      {head + "1 2 3\n4 5 6 7\n", "the number of values is 7"},
      {head + "1 2 3\n4 five 6\n", "line 7: a value is \"five\"; allowed: a finite number"},
      {head + "1 2 3\n4 5 1,5\n", "line 7: a value is \"1,5\""},
      {head + "1 2 nan\n4 5 6\n", "line 6: a value is \"nan\""},
      {head + "1 2 3\n4 -0.5 6\n", "line 7: a value is \"-0.5\"; allowed: a number >= 0, or"},
      {"ncols 2000000000\nnrows 2000000000\nxllcorner 0\nyllcorner 0\ncellsize 5\n1 2\n",
       "the number of values is 2; allowed: ncols * nrows = 4000000000000000000"},
      {"xllcenter 2\n" + head + "1 2 3\n4 5 6\n",
       "its header has xllcorner and xllcenter; allowed: one of the two"},
      {"yllcenter 2\n" + head + "1 2 3\n4 5 6\n", "yllcorner and yllcenter; allowed: one of"},
  };
  for (const auto& wrong : refused) {
    const std::string words = wrong.second;
    CAPTURE(words);
    write(file, wrong.first);
    const std::string said =
        message_of<std::runtime_error>([&] { static_cast<void>(read_ascii_grid(file, 0)); });
    CAPTURE(said);
    CHECK(contains(said, words));
    CHECK(contains(said, "cannot read " + file.string()));
  }
  CHECK(contains(message_of<std::runtime_error>(
                     [&] { static_cast<void>(read_ascii_grid(folder / "none.asc")); }),
                 "none.asc: No such file"));
}

TEST_CASE("ESRI ASCII grids: written and read again they are the same, whatever the locale") {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const Folder folder;
  const auto file = folder / "a.asc";
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new Comma));
  Raster map{7, 5, 632000.1, 5094000.7, 1.0 / 3, {}};
  Random random(3);
  for (int k = 0; k < 35; ++k)
    map.values.push_back(k == 11 ? none : 2000 * random.uniform() - 300);
  write_ascii_grid(file, map);
  const Raster read = read_ascii_grid(file);
  std::locale::global(before);
  CHECK(read.columns == 7);
  CHECK(read.rows == 5);
  CHECK(read.x == map.x);
  CHECK(read.y == map.y);
  CHECK(read.cell == map.cell);
  for (std::size_t k = 0; k < 35; ++k)
    CHECK((k == 11 ? std::isnan(read.values[k]) : read.values[k] == map.values[k]));
  CHECK(content(file).starts_with("ncols 7\nnrows 5\nxllcorner 632000.1\nyllcorner 5094000.7\n"
                                  "cellsize 0.3333333333333333\nNODATA_value -9999\n"));
  map.values[3] = -9999;
  CHECK(contains(message_of<std::invalid_argument>([&] { write_ascii_grid(file, map); }),
                 "a.asc is -9999; allowed: finite numbers other than"));
  map.values.pop_back();
  CHECK(contains(message_of<std::invalid_argument>([&] { write_ascii_grid(file, map); }),
                 "the number of values is 34; allowed: 35"));
  map.values[3] = 1;
  map.values.push_back(0);
  CHECK(contains(
      message_of<std::runtime_error>([&] { write_ascii_grid(folder / "no" / "a.asc", map); }),
      "cannot write"));
}

TEST_CASE("a field of a map: exact for a plane, in UTM too, also half a cell beyond the middles") {
  for (const Vec<2>& origin : {Vec<2>(0, 0), Vec<2>(632000.25, 5094000.5)}) {
    const BilinearMap height(plane(8, 6, origin[0] - 1, origin[1] + 2, 0.5, origin), origin);
    Random random(1);
    for (int n = 0; n < 500; ++n) {
      const double x = -1 + 4 * random.uniform(), y = 2 + 3 * random.uniform();
      CHECK(std::abs(height(x, y) - (1 + 0.5 * x - 0.25 * y)) < 1e-14);
    }
  }
  Raster twisted{2, 2, 0, 0, 1, {0, 0, 0, 1}}; // z = u v
  CHECK(BilinearMap(twisted, {0, 0})(0.75, 1.25) == about(0.25 * 0.75));
  twisted.at(1, 1) = none;
  CHECK(std::isnan(BilinearMap(twisted, {0, 0})(0.75, 1.25)));
  CHECK(BilinearMap(twisted, {0, 0})(0.75, 0.5) == 0); // it does not need that one
  twisted = {1, 2, 0, 0, 1, {0, 0}};
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   BilinearMap(twisted, {0, 0});
                 }),
                 "columns or rows is 1; allowed: an integer >= 2"));
}

TEST_CASE("a map's origin is a point") {
  const Raster map = plane(4, 3, 0, 0, 1, {0, 0});
  for (const double wrong : {none, HUGE_VAL}) {
    CHECK(contains(message_of<std::invalid_argument>([&] {
                     BilinearMap(map, {wrong, 0});
                   }),
                   "map: origin.x is " + text_of(wrong) + "; allowed: a finite number"));
    CHECK(contains(message_of<std::invalid_argument>([&] {
                     CellMap(map, {0, wrong});
                   }),
                   "map: origin.y is " + text_of(wrong) + "; allowed: a finite number"));
  }
}

TEST_CASE("friction by cell") {
  const Vec<2> origin(500000, 5000000);
  const CellMap friction({2, 2, 500010, 5000020, 10, {0.1, 0.2, 0.3, none}}, origin);
  CHECK(friction(10, 20) == 0.1);
  CHECK(friction(19.999, 29.999) == 0.1);
  CHECK(friction(20.001, 29.999) == 0.2);
  CHECK(friction(19.999, 30.001) == 0.3);
  CHECK(friction(-1e9, -1e9) == 0.1); // the nearest one
  CHECK(friction(1e9, 25) == 0.2);
  CHECK(std::isnan(friction(25, 35)));

  const auto flat = [](const Vec<3>&) { return 0.0; };
  const Terrain<3> ground({.height = flat, .friction_at = friction});
  const Vec<3> cell(1, 1, 1);
  CHECK(ground.contact({12, 22, 0}, cell, 0)->friction == 0.1);
  CHECK(ground.contact({22, 22, 0}, cell, 0)->friction == 0.2);
  CHECK_FALSE(ground.contact({25, 35, 1}, cell, 0)); // asked only where it holds
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   static_cast<void>(ground.contact({25, 35, 0}, cell, 0));
                 }),
                 "terrain: the friction at x = (25, 35, 0) m is nan"));
  CHECK(contains(message_of<std::invalid_argument>([&] { Terrain<3>({.height = flat}); }),
                 "terrain.friction is nan, not given"));
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   Terrain<3>({.height = flat, .friction = 0.3, .friction_at = friction});
                 }),
                 "terrain.friction is 0.3; allowed: no number"));
  CHECK(contains(message_of<std::invalid_argument>([&] { Terrain<3>({.friction = 0.3}); }),
                 "terrain.height is empty"));
}

TEST_CASE("a plane as a terrain is the plane as a shape, in 2-D and 3-D") {
  const Vec<2> origin(632000.25, 5094000.5);
  const BilinearMap height(plane(30, 30, origin[0], origin[1], 0.1, origin), origin);
  const Terrain<3> terrain({.height = height, .friction = 0.3});
  const ShapeObstacle<3> shape(
      {.shape = shapes::HalfSpace<3>({0, 0, 1}, {-0.5, 0.25, 1}), .friction = 0.3});
  const Vec<3> cell(0.2, 0.1, 0.15);
  Random random(2);
  int held = 0, partly = 0;
  for (int n = 0; n < 4000; ++n) {
    const double x = 3 * random.uniform(), y = 3 * random.uniform();
    const Vec<3> place(x, y, 1 + 0.5 * x - 0.25 * y + 0.6 * (random.uniform() - 0.5));
    const auto here = terrain.contact(place, cell, 0), there = shape.contact(place, cell, 0);
    REQUIRE(here.has_value() == there.has_value());
    const double open = terrain.open_fraction(place, cell, 0);
    CHECK(std::abs(open - shape.open_fraction(place, cell, 0)) < 1e-11);
    partly += open > 0 && open < 1;
    if (!here)
      continue;
    ++held;
    CHECK((here->normal - there->normal).norm() < 1e-9);
    CHECK(here->velocity.norm() == 0);
    CHECK(here->friction == 0.3);
  }
  CHECK(held > 2000);
  CHECK(partly > 1000);

  // Along y = 1 + x/2 on the map, a profile: z = 1 + 0.5 x − 0.25 (1 + x/2) over s = x √1.25.
  const double stretch = std::sqrt(1.25);
  const Terrain<2> profile(
      {.height = [&](const Vec<2>& s) { return height(s[0] / stretch, 1 + s[0] / stretch / 2); },
       .friction = 0.4});
  const double slope = 0.375 / stretch;
  const auto contact = profile.contact({1, 0.75 + slope}, {0.1, 0.1}, 0);
  REQUIRE(contact.has_value());
  CHECK((contact->normal - Vec<2>(-slope, 1).normalized()).norm() < 1e-9);
  CHECK(profile.open_fraction({1, 0.75 + slope}, {0.1, 0.1}, 0) == about(0.5, 1e-9));
}

TEST_CASE("a curved terrain: distance and normal to the order of the cell") {
  // a ball's cap of radius r
  const double r = 50;
  const Terrain<3> terrain(
      {.height = [&](const Vec<3>& x) { return std::sqrt(r * r - x[0] * x[0] - x[1] * x[1]); },
       .friction = 0});
  const Vec<3> cell(1, 1, 1), out = Vec<3>(0.3, -0.4, 1.2).normalized();
  for (const double d : {-0.4, 0.0, 0.4}) {
    const auto contact = terrain.contact((r + d) * out, cell, 0);
    REQUIRE(contact.has_value());
    CHECK((contact->normal - out).norm() < 0.01);
    const NodeInSolid<3> exact =
        node_in_solid<3>(shapes::Ball<3>({0, 0, 0}, r), (r + d) * out, cell);
    CHECK(std::abs(terrain.open_fraction((r + d) * out, cell, 0) - exact.open_fraction) < 0.01);
  }
}

TEST_CASE("a hole in the map is an error where it is needed") {
  Raster map = plane(10, 10, 0, 0, 1, {0, 0});
  map.at(7, 7) = none;
  const Terrain<3> ground({.height = BilinearMap(map, {0, 0}), .friction = 0.3});
  const Vec<3> cell(1, 1, 1);
  CHECK(ground.contact({3, 3, 1}, cell, 0).has_value());
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   static_cast<void>(ground.contact({7, 7, 1}, cell, 0));
                 }),
                 "terrain: the height at x = (7, 7, 1) m is nan; allowed: a finite number: the map "
                 "has no data there"));
}

TEST_CASE("polygons: inside by the even-odd rule, exact distances") {
  Polygon area;
  area.add_ring({{0, 0}, {4, 0}, {4, 3}, {0, 3}, {0, 0}}); // closed twice
  area.add_ring({{1, 1}, {1, 2}, {2, 2}, {2, 1}});         // a hole
  CHECK(area.contains(0.5, 0.5));
  CHECK_FALSE(area.contains(1.5, 1.5));
  CHECK_FALSE(area.contains(-1, 1)); // the ray passes two corners' heights
  CHECK_FALSE(area.contains(5, 0));
  CHECK(area.distance(3, 1.5) == -1);
  CHECK(area.distance(1.5, 1.75) == 0.25);
  CHECK(area.distance(7, 7) == 5);
  CHECK(area.bounds() == std::array<Polygon::Point, 2>{{{0, 0}, {4, 3}}});
  const Polygon away = area.moved(500000, 5000000);
  CHECK(away.distance(500003, 5000001.5) == -1);
  CHECK(away.moved(-500000, -5000000).distance(1.5, 1.75) == 0.25);

  Polygon star; // crosses itself: its middle is outside
  star.add_ring({{0, 3}, {1.8, -2.4}, {-2.9, 0.9}, {2.9, 0.9}, {-1.8, -2.4}});
  CHECK(star.contains(0, 2));
  CHECK_FALSE(star.contains(0, 0));
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   star.add_ring({{0, 0}, {1, 1}});
                 }),
                 "corners of a ring is 2; allowed: at least 3"));
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   star.add_ring({{0, 0}, {1, 1}, {none, 0}});
                 }),
                 "a corner's coordinate is nan"));
}

TEST_CASE("polygon files") {
  const Folder folder;
  const auto file = folder / "a.csv";
  const std::pair<const char*, const char*> same[] = {
      {"plain", "500000,5000000\n500004,5000000\n500004,5000003\n500000,5000003\n"},
      {"names, blanks, a comment, closed, no last line end",
       "x , y\n# the upper edge\n500000 5000000\n 500004\t, 5000000\n500004  5000003\n"
       "5e5 , +5000003.0\n500000,5000000"},
      {"CR LF, a byte order mark, blank lines",
       "\xef\xbb\xbf\r\n500000,5000000\r\n500004,5000000\r\n500004,5000003\r\n500000,5000003\r\n"
       "\r\n\r\n"},
  };
  for (const auto& dialect : same) {
    CAPTURE(dialect.first);
    write(file, dialect.second);
    const Polygon area = read_polygon(file);
    CHECK(area.bounds() == std::array<Polygon::Point, 2>{{{500000, 5000000}, {500004, 5000003}}});
    CHECK(area.distance(500003, 5000001.5) == -1);
  }
  write(file, "0,0\n4,0\n4,3\n0,3\n\n1 1\n1 2\n2 2\n2 1\n");
  CHECK_FALSE(read_polygon(file).contains(1.5, 1.5)); // two rings

  const std::pair<const char*, const char*> refused[] = {
      {"", "it holds no corner"},
      {"x,y\n", "it holds no corner"},
      {"0,0\n1,1\n", "line 2: polygon: the number of corners of a ring is 2; allowed: at least 3"},
      {"0,0\n1,0\n1,1\n\n5,5\n\n0,0\n", "line 6: polygon: the number of corners of a ring is 1"},
      {"0,0\n1;0\n1,1\n", "line 2: a corner is \"1;0\"; allowed: two finite numbers"},
      {"0,0\n1,0,7\n1,1\n", "line 2: a corner is \"1,0,7\""},
      {"0,0\n1,0\n1,nan\n", "line 3: a corner is \"1,nan\""},
      {"0,0\n1\n1,1\n", "line 2: a corner is \"1\""},
      {"0,0\n,1\n1,1\n", "line 2: a corner is \",1\""},
      {"0,0\nx,y\n1,1\n", "line 2: a corner is \"x,y\""},
      {"x,y\nx,y\n1,1\n", "line 2: a corner is \"x,y\""},
  };
  for (const auto& wrong : refused) {
    const std::string words = wrong.second;
    CAPTURE(words);
    write(file, wrong.first);
    const std::string said =
        message_of<std::runtime_error>([&] { static_cast<void>(read_polygon(file)); });
    CAPTURE(said);
    CHECK(contains(said, words));
    CHECK(contains(said, "cannot read " + file.string()));
  }
}

TEST_CASE("a release on a slope: volume and place, in UTM") {
  const Vec<2> origin(632000.25, 5094000.5);
  const BilinearMap height(plane(40, 40, origin[0], origin[1], 0.1, origin), origin);
  Polygon area;
  area.add_ring({{1 + origin[0], 1 + origin[1]},
                 {3 + origin[0], 1 + origin[1]},
                 {3 + origin[0], 2 + origin[1]},
                 {1 + origin[0], 2 + origin[1]}});
  const Release release({.area = area.moved(-origin[0], -origin[1]),
                         .bottom = height,
                         .top = [&](const Vec<3>& x) { return height(x) + 0.8; },
                         .cell = 0.1});
  const double steep = std::sqrt(1 + 0.25 + 0.0625);
  const double middle = 1 + 0.5 * 2 - 0.25 * 1.5; // ground at (2, 1.5)
  CHECK(release.distance({2, 1.5, middle}) == doctest::Approx(0).epsilon(1e-12));
  CHECK(release.distance({2, 1.5, middle + 0.3}) == about(-0.3 / steep, 1e-9));
  CHECK(release.distance({2, 1.5, middle + 0.9}) == about(0.1 / steep, 1e-9));
  CHECK(release.distance({2, 2.07, middle + 0.3}) == about(0.07, 1e-9));
  CHECK(release.distance({2, 1.95, middle + 0.3}) == about(-0.05, 1e-9));
  const auto nothing = [](const Vec<3>&) { return none; };
  const Release no_data(
      {.area = area.moved(-origin[0], -origin[1]), .bottom = nothing, .top = nothing, .cell = 0.1});
  CHECK(no_data.distance({1000, 1.5, 0}) == 997); // no height asked
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   static_cast<void>(no_data.distance({2, 1.5, 0}));
                 }),
                 "the height at x = (2, 1.5, 0) m is nan"));

  const Grid<3> grid({.origin = {0, 0, 0}, .size = {4, 4, 4}, .cells = {10, 10, 10}});
  Particles<3> sand;
  fill(sand, grid, release, {.per_axis = 3});
  double volume = 0;
  for (std::size_t p = 0; p < sand.size(); ++p) {
    volume += sand.volume[p];
    const Vec<3>& x = sand.position[p];
    CHECK(x[0] > 1);
    CHECK(x[0] < 3);
    CHECK(x[2] > height(x));
    CHECK(x[2] < height(x) + 0.8);
  }
  CHECK(volume == about(2 * 1 * 0.8, 1e-3));

  Raster cells{8, 8, origin[0], origin[1], 0.5, std::vector<double>(64)};
  const Raster depth = depth_map(sand, cells, origin);
  CHECK(depth.x == origin[0]); // back in the map's coordinates
  double sum = 0;
  for (int j = 0; j < 8; ++j)
    for (int i = 0; i < 8; ++i) {
      sum += depth.at(i, j) * 0.25;
      const bool there = j >= 2 && j < 4 && i >= 2 && i < 6;
      CHECK(std::abs(depth.at(i, j) - (there ? 0.8 : 0)) < 0.25); // particles are 0.13 m apart
    }
  CHECK(sum == about(volume));
  for (Vec<3>& v : sand.velocity)
    v = {0, 0, 1};
  sand.velocity[0] = {0, 3, 4}; // at the corner
  const Raster speed = speed_map(sand, cells, origin);
  CHECK(speed.at(2, 2) == 5);
  CHECK(speed.at(5, 2) == 1);
  CHECK(speed.at(6, 2) == 0);
  cells.x += 2; // particles beside the map do not count
  const Raster part = depth_map(sand, cells, origin);
  CHECK(std::accumulate(part.values.begin(), part.values.end(), 0.0) * 0.25 == about(0.8, 0.01));

  CHECK(contains(message_of<std::invalid_argument>(
                     [&] { Release({.area = area, .bottom = height, .cell = 1}); }),
                 "release.top is empty"));
  CHECK(contains(message_of<std::invalid_argument>(
                     [&] { Release({.area = area, .bottom = height, .top = height}); }),
                 "release.cell is 0"));
}

TEST_CASE_TEMPLATE("particles on the edges of a map belong to its outermost cells", Real, double,
                   float) {
  const Vec<2> origin(632000.1, 5094000.7);
  const Raster cells{30, 20, origin[0], origin[1], 0.1, std::vector<double>(600)}; // 3 m by 2 m
  Particles<3, Real> sand;
  const auto add = [&](double x, double y) { sand.add({x, y, 0}, {0, 0, 1}, 0.01); };
  for (const double off : {0.0, 1e-9, -1e-9}) { // rounding
    add(off, 1.05);
    add(3 + off, 1.05);
    add(1.05, off);
    add(1.05, 2 + off);
    add(3 + off, 2 + off);
  }
  const Raster depth = depth_map(sand, cells, origin);
  CHECK(std::accumulate(depth.values.begin(), depth.values.end(), 0.0) * 0.01 == about(0.15, 1e-6));
  for (const auto& [column, row] : {std::pair(0, 10), {29, 10}, {10, 0}, {10, 19}, {29, 19}})
    CHECK(depth.at(column, row) == about(3, 1e-6));
  CHECK(speed_map(sand, cells, origin).at(29, 19) == 1);
  sand = {};
  for (const double beside : {-0.01, 3.01})
    add(beside, 1.05);
  for (const double beside : {-0.01, 2.01})
    add(1.05, beside);
  CHECK(range_of(depth_map(sand, cells, origin)).second == 0);
}

TEST_CASE("an open sheet of triangles as a map of heights") {
  TriangleMesh sheet; // z = 1 + 0.5 x − 0.25 y over [2, 6] × [−1, 2]
  const auto at = [](int i, int j) {
    const double x = 2 + i, y = -1 + j;
    return Vec<3>(x, y, 1 + 0.5 * x - 0.25 * y);
  };
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 3; ++j) {
      sheet.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      sheet.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)}); // turned the other way, too
    }
  Raster map = height_map(sheet, 0.25);
  CHECK(map.columns == 16);
  CHECK(map.rows == 12);
  CHECK(map.x == 2);
  CHECK(map.y == -1);
  for (int j = 0; j < map.rows; ++j)
    for (int i = 0; i < map.columns; ++i)
      CHECK(map.at(i, j) == about(1 + 0.5 * (2 + (i + 0.5) / 4) - 0.25 * (-1 + (j + 0.5) / 4)));

  // a roof above a corner, before what is below
  sheet.insert(sheet.begin(), {Vec<3>(2, -1, 9), Vec<3>(4, -1, 9), Vec<3>(2, 1, 9)});
  sheet.push_back({Vec<3>(3, 0, 0), Vec<3>(3, 1, 0), Vec<3>(3, 1, 20)}); // upright
  map = height_map(sheet, 0.25);
  CHECK(map.at(0, 0) == 9);
  CHECK(map.at(7, 7) == about(1 + 0.5 * 3.875 - 0.25 * 0.875));
  sheet.resize(1);
  map = height_map(sheet, 0.5);
  CHECK(map.at(0, 0) == 9);
  CHECK(std::isnan(map.at(3, 3))); // no triangle there

  CHECK(contains(message_of<std::invalid_argument>([&] { static_cast<void>(height_map({}, 1)); }),
                 "the number of triangles is 0"));
  CHECK(contains(
      message_of<std::invalid_argument>([&] { static_cast<void>(height_map(sheet, 1e-5)); }),
      "the number of cells is 4e+10; allowed: below 1e8"));
  CHECK(
      contains(message_of<std::invalid_argument>([&] { static_cast<void>(height_map(sheet, 0)); }),
               "height_map: cell is 0"));
}

} // namespace test_terrain
