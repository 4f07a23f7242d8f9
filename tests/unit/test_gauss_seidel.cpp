// SPDX-License-Identifier: MIT
// Gauss-Seidel on small problems, checked with dense algebra that shares nothing with the solver.

#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/projection_step.hpp"
#include "talus/cone/secular.hpp"
#include "talus/dual/operator.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include "../support/pile.hpp"

#include <Eigen/Dense>
#include <doctest/doctest.h>

#include <cmath>

namespace test_gauss_seidel {

using namespace talus;
using support::small_pile;

namespace {

/// Checks u = u_free + M⁻¹ Bᵀ λ and the law of every cone and contact with dense W and plain loops.
template <int Dim>
void check_solution(const DualProblem<Dim>& solved, double tolerance) {
  constexpr int n = symmetric_size<Dim>;
  const Stencil<Dim> stencil(solved.grid);
  const std::size_t cones = solved.cones();
  const Eigen::Index size = static_cast<Eigen::Index>(cones) * n;

  // u_free: take all impulses out again
  DualProblem<Dim> free = solved;
  remove_impulses(free, stencil);
  // dense W by columns, b with the contacts' impulses in it
  Eigen::MatrixXd w(size, size);
  Eigen::VectorXd b(size), lambda(size);
  DualProblem<Dim> zero = free;
  for (auto& u : zero.velocity)
    u.setZero();
  DualProblem<Dim> with_contacts = free;
  for (const auto& contact : solved.contacts) {
    const std::size_t j = static_cast<std::size_t>(contact.node);
    with_contacts.velocity[j].template head<Dim>() +=
        free.inverse_mass[j].template head<Dim>().cwiseProduct(contact.impulse);
  }
  for (std::size_t i = 0; i < cones; ++i) {
    const Eigen::Index row = static_cast<Eigen::Index>(i) * n;
    b.segment<n>(row) = integrated_strain_rate(with_contacts, stencil, i);
    b[row] += solved.free_volume_rate[i];
    lambda.segment<n>(row) = solved.stress_impulse[i];
    for (int c = 0; c < n; ++c) {
      DualProblem<Dim> unit = zero;
      scatter_stress(unit, stencil, i, Vec<n>(Vec<n>::Unit(c)));
      for (std::size_t k = 0; k < cones; ++k)
        w.block<n, 1>(static_cast<Eigen::Index>(k) * n, row + c) =
            integrated_strain_rate(unit, stencil, k);
    }
    CHECK((w.block<n, n>(row, row) - diagonal_block(solved, stencil, i)).norm() <
          1e-12 * w.block<n, n>(row, row).norm());
  }
  CHECK((w - w.transpose()).norm() < 1e-12 * w.norm());
  CHECK(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(w).eigenvalues().minCoeff() >
        -1e-12 * w.norm());

  const Eigen::VectorXd gamma = w * lambda + b;
  CHECK(lambda.norm() > 0);
  double error2 = 0;
  for (std::size_t i = 0; i < cones; ++i) {
    const Eigen::Index row = static_cast<Eigen::Index>(i) * n;
    const Vec<n> g = gamma.segment<n>(row), l = lambda.segment<n>(row);
    const double rho = n / w.block<n, n>(row, row).trace();
    error2 += natural_residual<n, double>(CoulombLaw{}, g, l, solved.opening[i], rho).squaredNorm();
    // the velocities that the solver kept are the right ones
    Vec<n> kept = integrated_strain_rate(solved, stencil, i);
    kept[0] += solved.free_volume_rate[i];
    CHECK((kept - g).norm() * rho < 1e-9 * (l.norm() + lambda.norm()));
  }
  CHECK(std::sqrt(error2) < 20 * tolerance * lambda.norm());

  for (const auto& contact : solved.contacts) {
    const Vec<Dim> v = solved.velocity[static_cast<std::size_t>(contact.node)].template head<Dim>();
    const double r_n = contact.impulse.dot(contact.normal), v_n = v.dot(contact.normal);
    const Vec<Dim> r_t = contact.impulse - r_n * contact.normal;
    CHECK(r_n >= 0);
    CHECK(r_t.norm() <= contact.friction * r_n * (1 + 1e-12) + 1e-300);
    CHECK(v_n > -1e-6);
  }
}

template <int Dim, class Local, class Law>
void solve_and_check(double tolerance, double mu) {
  auto sim = small_pile<Dim, GaussSeidel<Local, Law>>(tolerance, mu);
  const StepReport report = sim.step();
  INFO(Dim, "-D, sweeps ", report.solve.iterations, ", residual ", report.solve.residual.l2);
  CHECK(report.solve.status == SolveStatus::converged);
  CHECK(report.solve.residual.l2 <= tolerance);
  // the largest of n numbers is between their root mean square and √n times that
  const double count = static_cast<double>(report.cones + report.contacts);
  CHECK(report.solve.residual.max >= report.solve.residual.l2 * (1 - 1e-12));
  CHECK(report.solve.residual.max <= report.solve.residual.l2 * std::sqrt(count) * (1 + 1e-12));
  check_solution(sim.problem(), tolerance);
}

} // namespace

TEST_CASE("Gauss-Seidel solves small dense problems") {
  solve_and_check<2, SecularSolver, AssociatedLaw>(1e-9, 0.44);
  solve_and_check<2, SecularSolver, CoulombLaw>(1e-9, 0.44);
  solve_and_check<2, FischerBurmeisterNewton, CoulombLaw>(1e-9, 0.44);
  solve_and_check<3, SecularSolver, AssociatedLaw>(1e-6, 0.44);
  solve_and_check<2, SecularSolver, AssociatedLaw>(1e-8, 0);
  solve_and_check<2, ProjectionStep, AssociatedLaw>(1e-9, 0.44);
  solve_and_check<3, ProjectionStep, AssociatedLaw>(1e-6, 0.44);
  solve_and_check<2, ProjectionStep, AssociatedLaw>(1e-8, 0);
}

TEST_CASE("Gauss-Seidel: a warm start at the solution needs no sweep") {
  using S = GaussSeidel<SecularSolver>;
  auto sim = small_pile<2, S>(1e-7, 0.44);
  static_cast<void>(sim.step().completed());
  DualProblem<2> problem = sim.problem();
  S::Workspace<2> workspace;
  S::Params params;
  params.tolerance = 1e-7;
  const SolveReport report = S(params).solve(problem, workspace, Execution());
  CHECK(report.iterations == 0);
  CHECK(report.status == SolveStatus::converged);
}

TEST_CASE("Gauss-Seidel: the velocities it leaves are those of its stresses and impulses") {
  using S = GaussSeidel<>;
  auto sim = small_pile<3, S>(1e-6, 0.44);
  static_cast<void>(sim.step().completed());
  DualProblem<3> before, after;
  CHECK(sim.step([&](const DualProblem<3>& problem) { before = problem; }).solve.iterations > 20);
  after = sim.problem();
  const Stencil<3> stencil(before.grid);
  remove_impulses(before, stencil);
  remove_impulses(after, stencil);
  double difference = 0, size = 0;
  for (std::size_t j = 0; j < after.velocity.size(); ++j) {
    difference = std::max(difference, (after.velocity[j] - before.velocity[j]).norm());
    size = std::max(size, before.velocity[j].norm());
  }
  CHECK(size > 0);
  CHECK(difference < 1e-11 * size);
}

TEST_CASE("Gauss-Seidel says when it stops early") {
  using S = GaussSeidel<SecularSolver>;
  auto sim = small_pile<2, S>(1e-9, 0.44);
  DualProblem<2> problem;
  {
    static_cast<void>(sim.step().completed());
    problem = sim.problem();
  }
  remove_impulses(problem, Stencil<2>(problem.grid));
  S::Workspace<2> workspace;
  S::Params params;
  params.tolerance = 1e-12;
  params.max_sweeps = 3;
  const SolveReport report = S(params).solve(problem, workspace, Execution());
  CHECK(report.status == SolveStatus::not_converged);
  CHECK(report.iterations == 3);
  CHECK(report.residual.l2 > 1e-12);
  CHECK(to_string(report.status) == "not converged");
  CHECK_THROWS_AS(S({.max_sweeps = 0}), std::invalid_argument);
}

} // namespace test_gauss_seidel
