// SPDX-License-Identifier: MIT
// Dual problems in files: what is read is what was written, and damage is found.

#include "talus/io/matrix_market.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/solver/gauss_seidel.hpp"

#include "../support/files.hpp"
#include "../support/pile.hpp"

#include <Eigen/Dense>
#include <doctest/doctest.h>

#include <sstream>

namespace test_problem_file {

using namespace talus;
using support::contains, support::content, support::Folder, support::message_of;
namespace fs = std::filesystem;

namespace {

/// The second step's problem, with its warm start.
template <int Dim>
DualProblem<Dim> recorded() {
  auto sim = support::small_pile<Dim, GaussSeidel<>>(1e-5, 0.44);
  CHECK(sim.step().completed());
  DualProblem<Dim> problem;
  CHECK(sim.step([&](const DualProblem<Dim>& p) { problem = p; }).completed());
  return problem;
}

template <int Dim>
void round_trip() {
  const Folder folder;
  const DualProblem<Dim> written = recorded<Dim>();
  write_problem(folder / "a.talus", written);
  CHECK(problem_dimension(folder / "a.talus") == Dim);
  const DualProblem<Dim> read = read_problem<Dim>(folder / "a.talus");
  CHECK(read.node == written.node);
  CHECK(read.velocity == written.velocity);
  CHECK(read.inverse_mass == written.inverse_mass);
  CHECK(read.gradient_weights == written.gradient_weights);
  CHECK(read.stress_impulse == written.stress_impulse);
  CHECK(read.velocity_scale == written.velocity_scale);
  CHECK(read.contacts.size() == written.contacts.size());
  CHECK(written.contacts.size() > 0);
  write_problem(folder / "b.talus", read);
  CHECK(content(folder / "a.talus") == content(folder / "b.talus"));

  // solved from the file as in the simulation, to the last bit
  DualProblem<Dim> one = written, two = read;
  typename GaussSeidel<>::Workspace<Dim> workspace;
  const SolveReport first = GaussSeidel<>().solve(one, workspace, Execution());
  const SolveReport second = GaussSeidel<>().solve(two, workspace, Execution());
  CHECK(first.iterations == second.iterations);
  CHECK(one.velocity == two.velocity);

  // cold: no stress, no impulse, and the same solution
  DualProblem<Dim> cold = read;
  remove_impulses(cold, Stencil<Dim>(cold.grid));
  for (const auto& stress : cold.stress_impulse)
    CHECK(stress.isZero(0));
  const SolveReport third = GaussSeidel<>().solve(cold, workspace, Execution());
  CHECK(third.status == SolveStatus::converged);
  double difference = 0, size = 0;
  for (std::size_t j = 0; j < cold.velocity.size(); ++j) {
    difference += (cold.velocity[j] - one.velocity[j]).squaredNorm();
    size += one.velocity[j].squaredNorm();
  }
  CHECK(std::sqrt(difference) < 1e-2 * std::sqrt(size));
}

/// Reads what write_matrix_market wrote.
Eigen::MatrixXd matrix_market(const fs::path& path) {
  std::istringstream file(content(path));
  std::string line;
  std::getline(file, line);
  Eigen::Index rows = 0, columns = 0, entries = 0;
  file >> rows >> columns;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(rows, columns);
  if (contains(line, "array")) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i)
      file >> matrix.data()[i];
    return matrix;
  }
  file >> entries;
  for (Eigen::Index e = 0; e < entries; ++e) {
    Eigen::Index row = 0, column = 0;
    double value = 0;
    file >> row >> column >> value;
    matrix(row - 1, column - 1) = value;
  }
  CHECK(file.good());
  return matrix;
}

/// The same on a slope in a periodic box of so many cells along it.
DualProblem<2> endless(int cells) {
  using Sim = Simulation<2, ConstantFriction, PolyPic, GaussSeidel<>>;
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.1 * cells, 0.4}, .cells = {cells, 4}};
  params.material.density = 1500;
  params.gravity = {5, -9};
  params.time_step = 1e-3;
  params.rheology.mu = 0.44;
  params.faces = Faces<2>::all({FaceKind::periodic});
  params.faces.lower[1] = {FaceKind::frictional, 0.3};
  params.faces.upper[1] = {FaceKind::open};
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.1 * cells, 0.2}, {.per_axis = 2, .jitter = 1});
  Sim sim(params, sand);
  DualProblem<2> problem;
  for (int n = 0; n < 2; ++n)
    CHECK(sim.step([&](const DualProblem<2>& p) { problem = p; }).completed());
  return problem;
}

template <int Dim>
void plain_algebra(const DualProblem<Dim>& problem) {
  constexpr int s = symmetric_size<Dim>;
  const Folder folder;
  write_matrix_market(folder.path, problem);
  const Eigen::MatrixXd h = matrix_market(folder / "H.mtx"), e = matrix_market(folder / "E.mtx");
  const Eigen::VectorXd mass = matrix_market(folder / "M.mtx"), f = matrix_market(folder / "f.mtx"),
                        k = matrix_market(folder / "k.mtx"), mu = matrix_market(folder / "mu.mtx"),
                        lambda = matrix_market(folder / "lambda.mtx");
  CHECK(mu.size() == static_cast<Eigen::Index>(problem.cones() + problem.contacts.size()));
  const Eigen::VectorXd inverse = mass.cwiseInverse();
  const Eigen::MatrixXd w = h * inverse.asDiagonal() * e.transpose();
  const Eigen::VectorXd gamma = h * (f + inverse.cwiseProduct(e.transpose() * lambda)) + k;
  Eigen::Index unknowns = 0; // a copy is none
  for (int j = 0; j < problem.grid.node_count(); ++j)
    if (problem.grid.owner(j) == j)
      unknowns += (problem.inverse_mass[j].array() > 0).count();
  CHECK(mass.size() == unknowns);
  const Stencil<Dim> stencil(problem.grid);
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    const Eigen::Index row = static_cast<Eigen::Index>(i) * s;
    CHECK((w.block<s, s>(row, row) - diagonal_block(problem, stencil, i)).norm() <
          1e-12 * w.block<s, s>(row, row).norm());
    Vec<s> expected = integrated_strain_rate(problem, stencil, i);
    expected[0] += problem.free_volume_rate[i];
    CHECK((gamma.segment<s>(row) - expected).norm() < 1e-10 * (k.norm() + gamma.norm()));
  }
  Eigen::Index row = static_cast<Eigen::Index>(problem.cones()) * s;
  for (const Contact<Dim>& contact : problem.contacts) {
    const Vec<Dim> w_c =
        problem.velocity[static_cast<std::size_t>(contact.node)].template head<Dim>() -
        contact.wall_velocity;
    CHECK(gamma[row] == doctest::Approx(w_c.dot(contact.normal)).epsilon(1e-9));
    CHECK(gamma.segment<Dim>(row).norm() == doctest::Approx(w_c.norm()).epsilon(1e-9));
    row += Dim;
  }
}

} // namespace

TEST_CASE("problem files read back bit for bit and solve to the same bits") {
  round_trip<2>();
  round_trip<3>();
}

TEST_CASE("Matrix Market export is the same algebra") {
  plain_algebra(recorded<2>());
  plain_algebra(recorded<3>());
  for (const int cells : {1, 2, 3})
    plain_algebra(endless(cells));
}

TEST_CASE("problem files that are not right are refused by name") {
  const Folder folder;
  const fs::path good = folder / "good.talus", bad = folder / "bad.talus";
  write_problem(good, recorded<2>());
  const std::string bytes = content(good);
  const auto refused = [&](const std::string& text) {
    std::ofstream(bad, std::ios::binary) << text;
    return message_of<std::runtime_error>([&] { static_cast<void>(read_problem<2>(bad).cones()); });
  };
  CHECK(contains(refused(""), "bad.talus"));
  CHECK(contains(refused("hello\n"), "talus-problem"));
  CHECK(contains(refused(bytes.substr(0, bytes.size() / 2)), "checksum"));
  CHECK(contains(refused(bytes + "x"), "checksum"));
  for (std::size_t at = 30; at < bytes.size(); at += bytes.size() / 50) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    CHECK(contains(refused(damaged), "cannot read"));
  }
  // right checksum, wrong content
  const auto resealed = [&](std::string text) {
    text.resize(text.size() - sizeof(std::uint64_t));
    detail::ByteWriter out;
    out.text(text);
    out.seal();
    return refused(out.bytes());
  };
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = bytes;
    text.replace(text.find(from), from.size(), to);
    return resealed(text);
  };
  CHECK(contains(replaced("talus-problem 1", "talus-problem 4"), "version is 4"));
  CHECK(contains(replaced("cells 3 3", "cells 3 0"), "grid.cells.y is 0"));
  CHECK(contains(replaced("cells 3 3", "cells 3 x"), "cells"));
  CHECK(contains(replaced("cells 3 3", "cells 1 1"), "not on the grid"));
  CHECK(contains(replaced("cones ", "cones 9"), "truncated"));
  CHECK(contains(
      message_of<std::runtime_error>([&] { static_cast<void>(read_problem<3>(good).cones()); }),
      "its dimension is 2; expected: 3"));
  CHECK(contains(message_of<std::runtime_error>(
                     [&] { static_cast<void>(problem_dimension(folder / "none.talus")); }),
                 "none.talus"));
  CHECK(contains(
      message_of<std::runtime_error>([&] { static_cast<void>(problem_dimension(folder.path)); }),
      "folder"));
  CHECK(contains(message_of<std::runtime_error>(
                     [&] { write_problem(folder / "no" / "x.talus", recorded<2>()); }),
                 "cannot write"));
}

} // namespace test_problem_file
