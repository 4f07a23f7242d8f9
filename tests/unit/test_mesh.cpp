// SPDX-License-Identifier: MIT
// Triangle meshes: files in both forms, and sampled distances against those of the same solid.

#include "talus/boundary/mesh_distance.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/boundary/signed_distance.hpp"
#include "talus/io/stl.hpp"
#include "talus/scene/fill.hpp"

#include "../support/files.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>

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
  CHECK(contains(message("solid a vertex 1 2"), "a coordinate \"\""));
  CHECK(contains(message("solid a vertex 1 2 x"), "a coordinate \"x\""));
  CHECK(contains(message("solid a vertex 1 2 nan"), "not complete"));
  CHECK(contains(message("solid a vertex 1 2 nan vertex 0 0 0 vertex 0 0 1"), "not finite"));
  const std::string good = binary(mesh);
  CHECK(contains(message(good.substr(0, good.size() - 1)), "no triangle")); // begins like ASCII
  CHECK(contains(message("x" + good.substr(1, good.size() - 2)), "neither"));
  CHECK(contains(
      message_of<std::runtime_error>([&] { static_cast<void>(read_stl(folder / "none")); }),
      "No such file"));
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

TEST_CASE("meshes that enclose nothing are refused") {
  TriangleMesh open = box_mesh({0, 0, 0}, {1, 1, 1});
  open.pop_back();
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh(open, 0.1); }),
                 "a closed surface"));
  CHECK(contains(message_of<std::invalid_argument>([&] { shapes::SampledMesh({}, 0.1); }),
                 "the number of triangles is 0"));
  const TriangleMesh closed = box_mesh({0, 0, 0}, {1, 1, 1});
  CHECK(contains(
      message_of<std::invalid_argument>([&] { shapes::SampledMesh(closed, 4e-3); }), // 257³ nodes
      "a larger spacing"));
  TriangleMesh inward = closed;
  for (auto& t : inward)
    std::swap(t[0], t[1]);
  CHECK(shapes::SampledMesh(inward, 0.1).distance({0.5, 0.5, 0.5}) < -0.4);
}
