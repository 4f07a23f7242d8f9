// SPDX-License-Identifier: MIT
// Triangle meshes: files in both forms, and sampled distances against those of the same solid.

#include "talus/boundary/mesh_distance.hpp"
#include "talus/boundary/node_in_solid.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/io/stl.hpp"
#include "talus/scene/fill.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

namespace test_mesh {

using namespace talus;
using support::contains;
using support::content;
using support::Folder;
using support::message_of;

static_assert(SignedDistance<shapes::SampledMesh, 3>);

namespace {

/// A ball of radius r about the origin: n rings, with the poles.
TriangleMesh ball_mesh(double r, int n) {
  const auto at = [&](int i, int j) {
    const double polar = std::numbers::pi * i / n, round = std::numbers::pi * j / n;
    return Vec<3>(r * std::sin(polar) * std::cos(round), r * std::sin(polar) * std::sin(round),
                  r * std::cos(polar));
  };
  TriangleMesh mesh;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2 * n; ++j) {
      const int next = (j + 1) % (2 * n); // the seam's points must be the same to the bit
      if (i > 0)
        mesh.push_back({at(i, j), at(i + 1, j), at(i, next)});
      if (i + 1 < n)
        mesh.push_back({at(i, next), at(i + 1, j), at(i + 1, next)});
    }
  return mesh;
}

TriangleMesh box_mesh(const Vec<3>& lower, const Vec<3>& upper) {
  TriangleMesh mesh;
  const auto corner = [&](int bits) {
    return Vec<3>(bits & 1 ? upper[0] : lower[0], bits & 2 ? upper[1] : lower[1],
                  bits & 4 ? upper[2] : lower[2]);
  };
  constexpr int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                               {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    mesh.push_back({corner(q[0]), corner(q[1]), corner(q[2])});
    mesh.push_back({corner(q[0]), corner(q[2]), corner(q[3])});
  }
  return mesh;
}

std::string ascii(const TriangleMesh& mesh) {
  std::ostringstream text;
  text.precision(17);
  text << "solid thing\n";
  for (const auto& t : mesh) {
    text << " facet normal 0 0 0\n  outer loop\n";
    for (const auto& x : t)
      text << "   vertex " << x.transpose() << "\n";
    text << "  endloop\n endfacet\n";
  }
  text << "endsolid thing\n";
  return text.str();
}

std::string binary(const TriangleMesh& mesh) {
  std::string bytes = "solid, but binary";
  bytes.resize(80);
  const auto put = [&](auto value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  };
  put(static_cast<std::uint32_t>(mesh.size()));
  for (const auto& t : mesh) {
    for (int k = 0; k < 3; ++k)
      put(0.0F);
    for (const auto& x : t)
      for (int a = 0; a < 3; ++a)
        put(static_cast<float>(x[a]));
    put(std::uint16_t{0});
  }
  return bytes;
}

} // namespace

TEST_CASE("STL files, ASCII and binary") {
  const Folder folder;
  const auto file = folder / "a.stl";
  const auto write = [&](const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
  };
  const TriangleMesh mesh = box_mesh({0, 0, -1}, {1, 2, 3});
  for (const std::string& bytes : {ascii(mesh), binary(mesh)}) {
    write(bytes);
    const TriangleMesh read = read_stl(file, 1e-3);
    REQUIRE(read.size() == mesh.size());
    for (std::size_t t = 0; t < mesh.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        CHECK((read[t][k] - 1e-3 * mesh[t][k]).norm() < 1e-15);
  }
  const auto message = [&](const std::string& bytes) {
    write(bytes);
    return message_of<std::runtime_error>([&] { static_cast<void>(read_stl(file)); });
  };
  CHECK(contains(message(""), "a.stl: it is neither"));
  CHECK(contains(message("solid empty\nendsolid\n"), "no triangle"));
  CHECK(contains(message("solid a\nvertex 1 2"), "line 2: a corner's coordinate is \"\""));
  CHECK(contains(message("solid a\nvertex 1 2 3"), "a facet has 1 corners"));
  const std::string good = binary(mesh);
  CHECK(contains(message(good.substr(0, good.size() - 1)),
                 "of 12 triangles that it announces it can hold 11"));
  CHECK(contains(message("x" + good.substr(1, good.size() - 2)), "neither"));
  CHECK(contains(message_of<std::invalid_argument>([&] { static_cast<void>(read_stl(file, 0)); }),
                 "scale is 0"));
  CHECK(contains(
      message_of<std::runtime_error>([&] { static_cast<void>(read_stl(folder / "none")); }),
      "No such file"));
}

TEST_CASE("STL: a number is a whole word") {
  const Folder folder;
  const auto file = folder / "a.stl";
  for (const char* bad : {"0,5", "1.5D+03", "2mm", "1.5f", "1e", "0x10", "1_000", "1'000", "nan",
                          "-inf", "1e999", "1.#INF", "--1", "+-1", "1..5", "endloop"}) {
    CAPTURE(bad);
    std::ofstream(file)
        << "solid tetra\nfacet normal 0 0 0\n outer loop\r\n  vertex 0 0 0\n  vertex " << bad
        << " 0 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid\n";
    const std::string said =
        message_of<std::runtime_error>([&] { static_cast<void>(read_stl(file)); });
    CHECK(contains(said, "line 5: a corner's coordinate is \"" + std::string(bad) + "\""));
  }
  for (const char* good : {"2", "+2", "2.", "2.0", "+2e0", "2E+00", "0.2e1", "20e-1", "2.000000"}) {
    CAPTURE(good);
    std::ofstream(file) << "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex " << good
                        << " 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    CHECK(read_stl(file)[0][1][0] == 2);
  }
}

TEST_CASE("STL: dialects") {
  const Folder folder;
  const auto file = folder / "a.stl";
  const auto write = [&](const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
  };
  const TriangleMesh mesh = box_mesh({0, 0, -1}, {1, 2, 3});
  const std::string plain = ascii(mesh), raw = binary(mesh);
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
    return text;
  };
  std::string capitals = plain;
  for (char& c : capitals)
    c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  std::string unfinished = raw, never_counted = raw;
  for (std::size_t k = 80; k < 84; ++k) {
    unfinished[k] = '\xff';
    never_counted[k] = '\0';
  }
  const std::pair<const char*, std::string> taken[] = {
      {"capitals", capitals},
      {"byte order mark", "\xef\xbb\xbf" + plain},
      {"blank lines first", "\r\n \t\n" + plain},
      {"lines end with CR LF", replaced(plain, "\n", "\r\n")},
      {"lines end with CR", replaced(plain, "\n", "\r")},
      {"all in one line", replaced(plain, "\n", " ")},
      {"all in one line, normals", replaced(replaced(plain, "0 0 0\n", "0 0 1 "), "\n", "\t")},
      {"no name", replaced(plain, " thing", "")},
      {"a name of keywords", replaced(plain, "thing", "a facet vertex 1 2 normal outer loop")},
      {"a name that is not ASCII", replaced(plain, "thing",
                                            "Gr\xc3\xb6\xc3\x9f"
                                            "e")},
      {"end in two words", replaced(plain, "end", "end ")},
      {"normals that are no numbers", replaced(plain, "0 0 0\n", "nan -nan(ind) 1,0\n")},
      {"no normals", replaced(plain, "normal 0 0 0", "")},
      {"colours", replaced(plain, "  outer", "color 0.5 0.5 1\n  outer")},
      {"no solid, no endsolid", plain.substr(12, plain.find("endsolid") - 12)},
      {"zeros behind", plain + std::string(100, '\0')},
      {"Ctrl-Z behind", plain + "\x1a"},
      {"binary that begins with solid", raw},
      {"binary, zeros behind", raw + std::string(77, '\0')},
      {"binary, a line end behind", raw + "\r\n"},
      {"binary, number never filled in", never_counted},
      {"binary, number -1", unfinished},
  };
  for (const auto& dialect : taken) { // no binding: CAPTURE takes it into a lambda
    CAPTURE(dialect.first);
    write(dialect.second);
    TriangleMesh read;
    REQUIRE_NOTHROW(read = read_stl(file));
    CHECK(read == mesh);
  }
  write(plain + replaced(plain, "thing", "another"));
  CHECK(read_stl(file).size() == 2 * mesh.size());

  const std::pair<std::string, const char*> refused[] = {
      {replaced(plain, "  endloop", "   vertex 0 0 9\n  endloop"),
       "line 8: a facet has 4 corners"}, // a quad
      {plain.substr(0, plain.find("endloop", plain.size() / 2)), "truncated"},
      {plain.substr(0, plain.find("endfacet", plain.size() / 2) - 60), "truncated"},
      {raw + std::string(50, 'x'), "more in it than the 12 triangles"},
      {"\xff\xfes\0o\0l\0i\0d\0", "neither"}, // UTF-16
      {std::string(84, '\0'), "neither"},
      {replaced(raw, std::string("\0\0\x80\x3f", 4), std::string("\0\0\x80\x7f", 4)), // 1 → ∞
       "triangle 1: a coordinate is not finite"},
  };
  for (const auto& wrong : refused) {
    const std::string words = wrong.second;
    CAPTURE(words);
    write(wrong.first);
    const std::string said =
        message_of<std::runtime_error>([&] { static_cast<void>(read_stl(file)); });
    CAPTURE(said);
    CHECK(contains(said, words));
  }
}

TEST_CASE("a sampled mesh has the distances of the solid") {
  const double spacing = 0.05;
  const shapes::SampledMesh ball(ball_mesh(0.5, 24), spacing);
  const shapes::SampledMesh box(box_mesh({-0.4, -0.3, -0.5}, {0.4, 0.3, 0.5}), spacing);
  const shapes::Ball<3> exact_ball({0, 0, 0}, 0.5);
  const shapes::Box<3> exact_box({-0.4, -0.3, -0.5}, {0.4, 0.3, 0.5});
  Random random(5);
  for (int n = 0; n < 3000; ++n) {
    Vec<3> x;
    for (int a = 0; a < 3; ++a)
      x[a] = 3 * random.uniform() - 1.5;
    const double from_ball = ball.distance(x), from_box = box.distance(x);
    if (std::abs(exact_ball.distance(x)) < spacing) // the mesh's own error: 0.5 (1 − cos 7.5°/2)
      CHECK(std::abs(from_ball - exact_ball.distance(x)) < 0.006);
    if (std::abs(exact_box.distance(x)) < spacing)
      CHECK(std::abs(from_box - exact_box.distance(x)) < 0.5 * spacing); // at edges
    if (exact_ball.distance(x) > 0)
      CHECK(from_ball < exact_ball.distance(x) + 0.006); // never more than the distance
    CHECK((from_box < 0) == (exact_box.distance(x) < 0));
  }
  CHECK(box.distance({0.42, 0.1, 0.1}) == doctest::Approx(0.02)); // exact next to faces
  CHECK((surface_normal<3>(ball, Vec<3>(0.3, 0.4, 0), 1e-3) - Vec<3>(0.6, 0.8, 0)).norm() < 0.05);
}

TEST_CASE("a mesh of 2e4 triangles on 1e5 nodes: what is far away takes no time") {
  // 2e9 pairs: a minute without a tree
  const double r = 0.5, spacing = 0.025;
  const TriangleMesh mesh = ball_mesh(r, 71);
  REQUIRE(mesh.size() > 19800);
  const shapes::SampledMesh ball(mesh, spacing);
  const double flat = r * (1 - std::cos(std::numbers::pi / 142) * std::cos(std::numbers::pi / 142));
  Random random(7);
  for (int n = 0; n < 5000; ++n) {
    Vec<3> x;
    for (int a = 0; a < 3; ++a)
      x[a] = 1.1 * random.uniform() - 0.55;
    const double exact = x.norm() - r;
    // the mesh is within the ball; a trilinear field of |x| is above it by at most 3/8 h²/|x|
    CHECK(ball.distance(x) > exact - 1e-12);
    CHECK(ball.distance(x) < exact + flat + std::min(spacing, spacing * spacing / (4 * x.norm())));
  }
}

TEST_CASE("a funnel holds nothing above its opening, however fine its lattice is") {
  // square, walls 0.2 thick and inclined by 45°; outlet 0.6 wide at z = 0.3, opening 2 wide at z =
  // 1
  const auto ring = [](double r, double z) {
    return std::array<Vec<3>, 4>{Vec<3>(-r, -r, z), Vec<3>(r, -r, z), Vec<3>(r, r, z),
                                 Vec<3>(-r, r, z)};
  };
  const std::array<std::array<Vec<3>, 4>, 4> rings{ring(0.3, 0.3), ring(0.6, 0.3), ring(1.3, 1),
                                                   ring(1, 1)};
  TriangleMesh mesh;
  for (std::size_t r = 0; r < 4; ++r)
    for (std::size_t k = 0; k < 4; ++k) {
      const auto &from = rings[r], &to = rings[(r + 1) % 4];
      const std::size_t n = (k + 1) % 4;
      mesh.push_back({from[k], from[n], to[n]});
      mesh.push_back({from[k], to[n], to[k]});
    }
  const double h = 0.1;
  for (const double spacing : {h, h / 2, h / 4}) {
    CAPTURE(spacing);
    const shapes::SampledMesh funnel(mesh, spacing);
    const Vec<3> cell = Vec<3>::Constant(h);
    for (int i = -4; i <= 4; ++i)
      for (int j = -4; j <= 4; ++j)
        for (int k = 11; k <= 22; ++k)
          CHECK_FALSE(
              node_in_solid<3>(funnel, Vec<3>(h * i + 0.01, h * j + 0.01, h * k), cell).contact);
    for (double x = 0.5; x < 1.15; x += 0.1) // in the midst of a wall
      CHECK(node_in_solid<3>(funnel, {x, 0.01, x - 0.15}, cell).contact);
    // beyond the lattice distances go on as they were
    double steepest = 0;
    for (double z = 1; z < 2; z += 0.001)
      steepest = std::max(
          steepest, std::abs(funnel.distance({0.1, 0, z + 0.001}) - funnel.distance({0.1, 0, z})));
    CHECK(steepest < 0.0011 + 0.02 * spacing);
  }
}

TEST_CASE("meshes that enclose nothing are refused") {
  TriangleMesh open = box_mesh({0, 0, 0}, {1, 1, 1});
  open.pop_back();
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh(open, 0.1); }),
                 "the mesh is open near there"));
  TriangleMesh sheet; // z = 0, in many triangles
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) {
      sheet.push_back({Vec<3>(i, j, 0), Vec<3>(i + 1, j, 0), Vec<3>(i, j + 1, 0)});
      sheet.push_back({Vec<3>(i + 1, j + 1, 0), Vec<3>(i, j + 1, 0), Vec<3>(i + 1, j, 0)});
    }
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh(sheet, 0.5); }),
                 "the mesh is open near there"));
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh({}, 0.1); }),
                 "the number of triangles is 0"));
  const TriangleMesh closed = box_mesh({0, 0, 0}, {1, 1, 1});
  CHECK(contains(
      message_of<std::invalid_argument>([&] { shapes::SampledMesh(closed, 4e-3); }), // 257³ nodes
      "a larger spacing"));
  TriangleMesh both_ways = closed; // a sheet with two sides, a shell and its inverse
  for (const auto& [a, b, c] : closed)
    both_ways.push_back({b, a, c});
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh(both_ways, 0.1); }),
                 "what its triangles enclose is nothing"));
  const shapes::SampledMesh plate(box_mesh({0, 0, 0}, {1, 1, 0.01}), 0.1); // no node in it
  CHECK(plate.distance({0.5, 0.5, 0.3}) == doctest::Approx(0.29));
  TriangleMesh inward = closed;
  for (auto& t : inward)
    std::swap(t[0], t[1]);
  CHECK(shapes::SampledMesh(inward, 0.1).distance({0.5, 0.5, 0.5}) < -0.4);
}

TEST_CASE("meshes in the coordinates of maps") {
  const Vec<3> place(632000.5, 5094000.5, 800);
  const auto moved = [&](TriangleMesh mesh) {
    for (auto& t : mesh)
      for (auto& x : t)
        x += place;
    return mesh;
  };
  const TriangleMesh ball = ball_mesh(10, 48); // 9024 triangles: half a minute if each is asked
  const shapes::SampledMesh here(ball, 1), there(moved(ball), 1);
  Random random(9);
  for (int n = 0; n < 500; ++n) {
    Vec<3> x;
    for (int a = 0; a < 3; ++a)
      x[a] = 24 * random.uniform() - 12;
    REQUIRE(there.distance(place + x) == support::about(here.distance(x), 1e-6));
  }
  TriangleMesh open = box_mesh({0, 0, 0}, {10, 10, 10});
  open.pop_back();
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh(moved(open), 1); }),
                 "mesh: spacing is 1; allowed: above 38.8"));
}

TEST_CASE("corners that are apart by rounding: at any spacing, scale and place") {
  for (const double scale : {1.0, 1e-3, 25.4e-3, 1e-6})
    for (const double away : {0.0, 0.25, 40.0, -1000.0})
      for (const double spacing : {0.05, 0.07, 0.1, 0.25}) {
        CAPTURE(scale);
        CAPTURE(away);
        CAPTURE(spacing);
        const Vec<3> lower = Vec<3>::Constant(away);
        TriangleMesh mesh = box_mesh(lower, lower + Vec<3>(1, 1, 1));
        Random random(1);
        for (auto& t : mesh)
          for (auto& x : t)
            for (int a = 0; a < 3; ++a) { // the nearest float, or one of its neighbours
              const float to = random.uniform() < 0.5 ? -1e9F : 1e9F;
              const float place = static_cast<float>(x[a]);
              x[a] = scale * static_cast<double>(
                                 random.uniform() < 0.5 ? place : std::nextafter(place, to));
            }
        const shapes::SampledMesh solid(mesh, scale * spacing);
        const shapes::Box<3> exact(scale * lower, scale * (lower + Vec<3>(1, 1, 1)));
        for (int n = 0; n < 200; ++n) {
          Vec<3> x;
          for (int a = 0; a < 3; ++a)
            x[a] = scale * (away + 2 * random.uniform() - 0.5);
          const double off = std::abs(solid.distance(x) - exact.distance(x));
          REQUIRE(off < (exact.distance(x) < 0.3 * scale ? 0.5 * scale * spacing : scale));
          if (std::abs(exact.distance(x)) > 0.3 * scale * spacing)
            REQUIRE((solid.distance(x) < 0) == (exact.distance(x) < 0));
        }
      }
}

TEST_CASE("several shells: apart, touching, overlapping, within each other") {
  const auto joined = [](TriangleMesh a, const TriangleMesh& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
  };
  const TriangleMesh cube = box_mesh({0, 0, 0}, {1, 1, 1});
  for (const double gap : {0.4, 0.0, -0.35}) { // between the two
    CAPTURE(gap);
    const Vec<3> lower(1 + gap, 0, 0), upper(2 + gap, 1, 1);
    const shapes::SampledMesh solid(joined(cube, box_mesh(lower, upper)), 0.1);
    const shapes::Box<3> a({0, 0, 0}, {1, 1, 1}), b(lower, upper);
    const shapes::Box<3> all({0, 0, 0}, upper);
    Random random(3);
    for (int n = 0; n < 2000; ++n) {
      const Vec<3> x(3.6 * random.uniform() - 0.5, 2 * random.uniform() - 0.5,
                     2 * random.uniform() - 0.5);
      const double exact = gap > 0 ? std::min(a.distance(x), b.distance(x)) : all.distance(x);
      if (std::abs(exact) > 0.03)
        REQUIRE((solid.distance(x) < 0) == (exact < 0));
      if (std::abs(exact) < 0.1 || gap == 0) // faces that touch count no more
        REQUIRE(std::abs(solid.distance(x) - exact) < (exact < 0.3 ? 0.05 : 1));
    }
  }
  { // a fence: what is long lies within the posts in its middle and at its corners
    TriangleMesh fence = box_mesh({0, -0.05, 0.45}, {3, 0.05, 0.55});
    std::vector<shapes::Box<3>> parts{{{0, -0.05, 0.45}, {3, 0.05, 0.55}}};
    for (int k = 0; k < 4; ++k) {
      const Vec<3> lower(k - 0.2, -0.2, 0), upper(k + 0.2, 0.2, 1);
      fence = joined(fence, box_mesh(lower, upper));
      parts.emplace_back(lower, upper);
    }
    const shapes::SampledMesh solid(fence, 0.04);
    Random random(4);
    for (int n = 0; n < 2000; ++n) {
      const Vec<3> x(0.3 + 0.4 * random.uniform(), 0.3 * random.uniform() - 0.15,
                     0.35 + 0.3 * random.uniform());
      double exact = std::numeric_limits<double>::infinity();
      for (const auto& part : parts)
        exact = std::min(exact, part.distance(x));
      REQUIRE(std::abs(solid.distance(x) - exact) < 0.02);
      if (std::abs(exact) > 0.01)
        REQUIRE((solid.distance(x) < 0) == (exact < 0));
    }
  }
  TriangleMesh inner = box_mesh({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75});
  CHECK(shapes::SampledMesh(joined(cube, inner), 0.05).distance({0.5, 0.5, 0.5}) ==
        support::about(-0.5, 0.05));
  for (auto& t : inner)
    std::swap(t[0], t[1]);
  CHECK(shapes::SampledMesh(joined(cube, inner), 0.05).distance({0.5, 0.5, 0.5}) ==
        support::about(0.25, 0.1));
}

} // namespace test_mesh
