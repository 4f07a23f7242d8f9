// SPDX-License-Identifier: MIT
// The interior-point solver: its cone algebra, the sparse form of a problem, and residuals that
// sweeps do not reach.

#include "talus/boundary/body.hpp"
#include "talus/boundary/shape_obstacle.hpp"
#include "talus/boundary/shapes.hpp"
#include "talus/cone/secular.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/dual/nested_dissection.hpp"
#include "talus/io/problem_file.hpp"
#include "talus/solver/interior_point.hpp"
#include "talus/solver/sweeps_then_interior_point.hpp"

#include "../physics/scenes.hpp"
#include "../support/files.hpp"
#include "../support/pile.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <iterator>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

namespace test_interior_point {

using namespace talus;

static_assert(Solver<InteriorPoint, 2> && Solver<InteriorPoint, 3>);
static_assert(Solver<SweepsThenInteriorPoint, 2> && Solver<SweepsThenInteriorPoint, 3>);

namespace {

/// The problem of a later step of a small moving pile, with its warm start.
template <int Dim>
DualProblem<Dim> pile(double mu, int steps = 3) {
  auto sim = support::small_pile<Dim, GaussSeidel<>>(1e-4, mu);
  DualProblem<Dim> problem;
  for (int k = 0; k < steps; ++k)
    CHECK(sim.step([&](const DualProblem<Dim>& p) { problem = p; }).completed());
  return problem;
}

/// A ball that has fallen into sand, with another one upon it.
DualProblem<2> with_balls() {
  auto params = scenes::box<2>({0.2, 0, 0.16}, {10, 1, 8}, 0, 0.44);
  auto ball = ball_body<2>({0.1, 0.09}, 0.03, 3000, 0.3);
  ball.start.velocity[1] = -1;
  params.bodies.push_back(ball);
  auto upper = ball_body<2>({0.105, 0.141}, 0.02, 2000, 0.2);
  upper.start.velocity[1] = -1.5;
  params.bodies.push_back(upper);
  scenes::Sim<2> sim(params, scenes::block<2>(params.grid, 0, 0.2, 0, 0.06, 0.5));
  DualProblem<2> problem;
  for (int k = 0; k < 5; ++k)
    CHECK(sim.step([&](const DualProblem<2>& p) { problem = p; }).completed());
  int with_sand = 0, with_each_other = 0;
  for (const auto& contact : problem.body_contacts) {
    with_sand += contact.node >= 0;
    with_each_other += contact.other >= 0 && contact.impulse.norm() > 0;
  }
  CHECK(with_sand > 0);
  CHECK(with_each_other > 0);
  return problem;
}

template <int Dim, class SolverT>
SolveReport solve(DualProblem<Dim>& problem, double tolerance, int threads = 1) {
  typename SolverT::Params params;
  params.tolerance = tolerance;
  if constexpr (requires { params.max_sweeps; })
    params.max_sweeps = 200000;
  typename SolverT::template Workspace<Dim> workspace;
  return SolverT(params).solve(problem, workspace, Execution(threads));
}

template <int Dim>
double difference(const DualProblem<Dim>& a, const DualProblem<Dim>& b) {
  double of = 0, size = 0;
  for (std::size_t j = 0; j < a.velocity.size(); ++j) {
    of += (a.velocity[j] - b.velocity[j]).squaredNorm();
    size += b.velocity[j].squaredNorm();
  }
  return std::sqrt(of / size);
}

/// The rows of the sparse form say what the operators say.
template <int Dim>
void same_algebra(const DualProblem<Dim>& problem) {
  constexpr int s = symmetric_size<Dim>;
  const SparseForm<Dim> form(problem);
  const SparseProblem& sparse = form.sparse;
  Eigen::VectorXd force = Eigen::VectorXd::Zero(sparse.unknowns);
  sparse.add_forces(sparse.lambda.data(), force.data());
  Eigen::SparseLU<Eigen::SparseMatrix<double>, Eigen::AMDOrdering<int>> mass(sparse.mass);
  const Eigen::VectorXd v = mass.solve(force);
  Eigen::VectorXd gamma = Eigen::Map<const Eigen::VectorXd>(sparse.start.data(), sparse.rows());
  sparse.add_rates(v.data(), gamma.data());
  const Stencil<Dim> stencil(problem.grid);
  double error = 0;
  std::size_t number = 0;
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    const double trace = diagonal_block(problem, stencil, i).trace();
    if (!(trace > 0))
      continue;
    Vec<s> expected = integrated_strain_rate(problem, stencil, i);
    expected[0] += problem.free_volume_rate[i];
    const auto& cone = sparse.cones[number++];
    CHECK(cone.size == s);
    error = std::max(error, (gamma.segment<s>(cone.row) - expected).norm());
    CHECK(std::abs(2 * cone.scale * s - trace) < 1e-12 * trace); // W of 2 λ is half of W
  }
  for (std::size_t c = 0; c < problem.body_contacts.size(); ++c) {
    const auto& contact = problem.body_contacts[c];
    const auto& cone = sparse.cones[number + problem.contacts.size() + c];
    const Vec<Dim> w = relative_velocity(problem, contact) - contact.wall_velocity;
    error = std::max(error, std::abs(gamma[cone.row] - w.dot(contact.normal)));
    CHECK(std::abs(gamma.segment<Dim>(cone.row).norm() - w.norm()) < 1e-12);
  }
  CHECK(error < 1e-12 * gamma.norm());
  DualProblem<Dim> back = problem;
  remove_impulses(back, stencil);
  form.put(sparse.lambda.data(), back, Execution());
  CHECK(difference(back, problem) < 1e-12);
}

template <int Dim>
void reaches(double mu) {
  CAPTURE(mu);
  DualProblem<Dim> problem = pile<Dim>(mu), threaded = problem;
  const SolveReport report = solve<Dim, InteriorPoint>(problem, 1e-8);
  CHECK(report.status == SolveStatus::converged);
  CHECK(report.residual.l2 <= 1e-8);
  CHECK(report.iterations < 60);
  CHECK(solve<Dim, InteriorPoint>(threaded, 1e-8, 3).iterations == report.iterations);
  CHECK(threaded.velocity == problem.velocity);
}

} // namespace

TEST_CASE("Jordan algebra: products, quotients, the scaling, the way to the edge") {
  const double x[] = {2, 0.3, -0.4, 1.2}, z[] = {1, -0.2, 0.6, 0.1};
  double xz[4], back[4], wz[4], inverse[4], twice[4];
  jordan::product(x, z, 4, xz);
  jordan::divide(xz, x, 4, back);
  const jordan::Scaling scaling(x, z, 4);
  scaling.apply(z, 4, false, wz);
  scaling.apply(x, 4, true, inverse);
  scaling.squared(z, 4, twice);
  for (int k = 0; k < 4; ++k) {
    CHECK(std::abs(back[k] - z[k]) < 1e-14);
    CHECK(std::abs(wz[k] - inverse[k]) < 1e-14); // W z = W⁻¹ x
    CHECK(std::abs(twice[k] - x[k]) < 1e-14);    // W² z = x
  }
  const double out[] = {-1, 1, 0.5, -2}, in[] = {3, 1, 0, 0};
  const double t = jordan::step_to_boundary(x, out, 4);
  double edge[4];
  for (int k = 0; k < 4; ++k)
    edge[k] = x[k] + t * out[k];
  CHECK(edge[0] > 0);
  CHECK(std::abs(jordan::determinant(edge, 4)) < 1e-14);
  CHECK(std::isinf(jordan::step_to_boundary(x, in, 4)));
}

TEST_CASE("the sparse form of a problem is the same algebra") {
  same_algebra<2>(pile<2>(0.44));
  same_algebra<3>(pile<3>(0.44));
  same_algebra<2>(with_balls());
}

TEST_CASE("interior points reach 1e-8, with much friction too, for any number of threads") {
  for (const double mu : {0.0, 0.1, 0.44, 2.0})
    reaches<2>(mu);
  reaches<3>(0.44);
}

TEST_CASE("interior points and sweeps agree") {
  DualProblem<2> problem = pile<2>(0.2), by_sweeps = problem;
  CHECK(solve<2, InteriorPoint>(problem, 1e-8).status == SolveStatus::converged);
  CHECK(solve<2, GaussSeidel<SecularSolver>>(by_sweeps, 1e-8).status == SolveStatus::converged);
  CHECK(difference(problem, by_sweeps) < 1e-6);
}

TEST_CASE("interior points take over where sweeps do not arrive, and not before") {
  DualProblem<2> hard = pile<2>(2), easy = hard;
  SweepsThenInteriorPoint::Workspace<2> workspace;
  const auto run = [&](double tolerance, DualProblem<2>& problem, std::size_t max_cones = 100) {
    return SweepsThenInteriorPoint({.tolerance = tolerance,
                                    .max_sweeps = 30,
                                    .lagging_starts = 0,
                                    .max_cones = max_cones})
        .solve(problem, workspace, Execution());
  };
  CHECK(GaussSeidel<>({.tolerance = 1e-8, .max_sweeps = 30})
            .solve(easy, workspace.sweeps, Execution())
            .status == SolveStatus::not_converged);
  DualProblem<2> large = hard;
  const SolveReport by_sweeps = run(1e-8, large, large.cones() - 1);
  CHECK(by_sweeps.status == SolveStatus::not_converged);
  CHECK(by_sweeps.iterations == 30);
  const SolveReport by_both = run(1e-8, hard);
  CHECK(by_both.status == SolveStatus::converged);
  CHECK(by_both.iterations > 30);
  CHECK(run(1e-2, easy).iterations < 30);
}

TEST_CASE("the slip lags: all of it at first, then a share of what changed") {
  const Mat<3> w = Vec<3>(1, 2, 3).asDiagonal();
  const double mu = 0.5, share = 0.25;
  const LaggingSlipStep lagging({.share = share});
  const ProjectionStep plain;
  const auto prepared = lagging.prepare(CoulombLaw{}, w, mu);
  Vec<3> lambda(2, 0.3, -0.4), expected = lambda;
  const Vec<3> first(-1, 0.3, 0.4), second(0.2, -3, 4); // |γ_T| is 0.5, then 5
  lagging.step(prepared, first, lambda);
  plain.step(plain.prepare(CoulombLaw{}, w, mu), first, expected);
  CHECK((lambda - expected).norm() < 1e-15);
  lagging.step(prepared, second, lambda);
  const Vec<3> shifted = second + mu * (0.5 + share * (5 - 0.5)) * Vec<3>::Unit(0);
  plain.step(plain.prepare(AssociatedLaw{}, w, mu), shifted, expected);
  CHECK((lambda - expected).norm() < 1e-15);
  CHECK(lambda.norm() > 0);
}

TEST_CASE("a lagging slip arrives where sweeps go in circles, else the best of all is left") {
  const auto params = [] {
    auto of = scenes::box<2>({0.4, 0, 0.2}, {16, 1, 8}, 0, 0.9);
    of.time_step = 3e-3;
    of.solver = {};
    return of;
  }();
  scenes::Sim<2> sim(params, scenes::block<2>(params.grid, 0, 0.12, 0, 0.16, 0.5));
  using Hybrid = SweepsThenInteriorPoint;
  Hybrid::Workspace<2> workspace;
  const auto run = [&](DualProblem<2> problem, const Hybrid::Params& with, int threads = 1) {
    const SolveReport report = Hybrid(with).solve(problem, workspace, Execution(threads));
    return std::pair(report, problem.velocity);
  };
  int missed = 0, missed_with_more = 0, missed_lagging = 0;
  for (int k = 0; k < 60; ++k) {
    DualProblem<2> problem;
    if (sim.step([&](const DualProblem<2>& p) { problem = p; }).solve.iterations <= 500)
      continue;
    const auto sweeps =
        run(problem, {.max_sweeps = 500, .lagging_starts = 0, .max_cones = 0}).first;
    const auto more = run(problem, {.max_sweeps = 1000, .lagging_starts = 0, .max_cones = 0}).first;
    const auto [lagging, velocity] = run(problem, {.max_sweeps = 500, .max_cones = 0});
    missed += sweeps.status != SolveStatus::converged;
    missed_with_more += more.status != SolveStatus::converged;
    missed_lagging += lagging.status != SolveStatus::converged;
    CHECK(lagging.iterations > 500);
    CHECK(lagging.iterations <= 1000);
    CHECK(run(problem, {.max_sweeps = 500, .max_cones = 0}, 3).second == velocity);
    DualProblem<2> copy = problem;
    const SolveReport alone = GaussSeidel<>({.tolerance = 1e-14, .max_sweeps = 500})
                                  .solve(copy, workspace.sweeps, Execution());
    const SolveReport best = Hybrid({.tolerance = 1e-14, .max_sweeps = 500, .max_cones = 0})
                                 .solve(problem, workspace, Execution());
    CHECK(best.status == SolveStatus::not_converged);
    CHECK(best.residual.l2 <= alone.residual.l2);
    const SolveReport left =
        GaussSeidel<>({.tolerance = 1}).solve(problem, workspace.sweeps, Execution());
    CHECK(left.iterations == 0);
    CHECK(left.residual.l2 == best.residual.l2);
  }
  CHECK(missed > 0);
  CHECK(missed_lagging < missed_with_more);
  CHECK_THROWS_AS(Hybrid({.lagging_starts = -1}), std::invalid_argument);
  CHECK_THROWS_AS(LaggingSlipStep({.share = 0}), std::invalid_argument);
}

TEST_CASE_TEMPLATE("dissected nodes: all of them, and factors that fill less", N,
                   std::integral_constant<int, 2>, std::integral_constant<int, 3>) {
  constexpr int dim = N::value;
  GridParams<dim> params;
  for (int a = 0; a < dim; ++a)
    params.cells[a] = dim == 2 ? 60 : 14;
  params.size.setOnes();
  const Grid<dim> grid(params);
  Array<int> natural;
  for (int j = 0; j < grid.node_count(); ++j)
    natural.push_back(j);
  Array<int> nodes = natural, other_way = natural;
  std::reverse(other_way.begin(), other_way.end());
  dissect(grid, nodes.data(), nodes.data() + nodes.size());
  dissect(grid, other_way.data(), other_way.data() + other_way.size());
  CHECK(nodes == other_way);
  const auto fill = [&](const Array<int>& order) { // of the Cholesky factor, by its elimination
    std::vector<std::set<int>> later(order.size());
    std::ptrdiff_t entries = 0;
    const auto near = [&](int i, int j) {
      const auto a = grid.node_index(i), b = grid.node_index(j);
      for (int k = 0; k < dim; ++k)
        if (std::abs(a[k] - b[k]) > 2)
          return false;
      return true;
    };
    const int n = static_cast<int>(order.size());
    for (int i = 0; i < n; ++i)
      for (int j = i + 1; j < n; ++j)
        if (near(order[static_cast<std::size_t>(i)], order[static_cast<std::size_t>(j)]))
          later[static_cast<std::size_t>(i)].insert(j);
    for (const auto& of : later) {
      entries += std::ssize(of);
      if (!of.empty()) // the rest of the column goes to its parent
        later[static_cast<std::size_t>(*of.begin())].insert(std::next(of.begin()), of.end());
    }
    return entries;
  };
  CHECK(1.5 * static_cast<double>(fill(nodes)) < static_cast<double>(fill(natural)));
  std::sort(nodes.begin(), nodes.end());
  CHECK(nodes == natural);
}

TEST_CASE("by arc length alone, from the start of the path") {
  DualProblem<2> problem = pile<2>(0.9);
  InteriorPoint::Params params;
  params.newton_iterations = 1;
  InteriorPoint::Workspace<2> workspace;
  const SolveReport report = InteriorPoint(params).solve(problem, workspace, Execution());
  CHECK(report.status == SolveStatus::converged);
}

TEST_CASE("problems with free bodies: in files bit for bit, and solved") {
  const support::Folder folder;
  DualProblem<2> problem = with_balls();
  write_problem(folder / "a.talus", problem);
  DualProblem<2> read = read_problem<2>(folder / "a.talus");
  write_problem(folder / "b.talus", read);
  CHECK(support::content(folder / "a.talus") == support::content(folder / "b.talus"));
  CHECK(solve<2, InteriorPoint>(read, 1e-8).status == SolveStatus::converged);
  CHECK(solve<2, GaussSeidel<>>(problem, 1e-6).status == SolveStatus::converged);
  CHECK(difference(read, problem) < 1e-4);
  for (int b = 0; b < 2; ++b)
    CHECK(std::abs(read.bodies[b].velocity[1] - problem.bodies[b].velocity[1]) < 1e-4);
}

TEST_CASE("interior points: a body that does not turn, and a push without gravity") {
  using Sim = Simulation<2, ConstantFriction, PolyPic, InteriorPoint>;
  Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.8, 0.8}, .cells = {8, 8}};
  params.material.density = 1000;
  params.gravity = {0, -9.81};
  params.time_step = 1e-3;
  params.rheology.mu = 0.5;
  params.faces = Faces<2>::all({FaceKind::no_slip});
  Particles<2> sand;
  fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, {0.8, 0.5}, {});
  auto block = block_body<2>({0.4, 0.63}, {0.3, 0.22}, 2000, 0.3);
  for (const bool turns : {true, false}) {
    block.rotates = turns;
    params.bodies = {block};
    Sim sim(params, sand);
    for (int k = 0; k < 3; ++k)
      CHECK(sim.step().solve.status == SolveStatus::converged);
    CHECK((sim.bodies()[0].angular_velocity.norm() > 0) == turns);
  }

  params.bodies.clear();
  params.gravity.setZero();
  params.faces = Faces<2>::all({FaceKind::open});
  RigidState<2> up;
  up.velocity = {0, 0.1};
  params.obstacles = {
      make_obstacle<ShapeObstacle<2>>({.shape = shapes::HalfSpace<2>({0, 0.15}, {0, 1}),
                                       .friction = 0.4,
                                       .motion = steady_motion<2>(up)})};
  Particles<2> block_of_sand;
  fill_box<2>(block_of_sand, Grid<2>(params.grid), {0.2, 0.15}, {0.6, 0.5}, {});
  Sim sim(params, block_of_sand);
  CHECK(sim.step().solve.status == SolveStatus::converged);
  CHECK(sim.velocity({4, 3})[1] == doctest::Approx(0.1).epsilon(0.01));
}

TEST_CASE("a simulation with interior points, and wrong parameters") {
  const auto bed = [] {
    auto params = scenes::box<2>({0.2, 0, 0.1}, {10, 1, 5}, 15, 0.44);
    Simulation<2, ConstantFriction, PolyPic, InteriorPoint>::Params with;
    with.grid = params.grid;
    with.material = params.material;
    with.gravity = params.gravity;
    with.time_step = params.time_step;
    with.rheology = params.rheology;
    with.faces = params.faces;
    return with;
  }();
  Simulation<2, ConstantFriction, PolyPic, InteriorPoint> sim(
      bed, scenes::block<2>(bed.grid, 0, 0.2, 0, 0.06));
  for (int k = 0; k < 5; ++k) {
    const StepReport report = sim.step();
    CHECK(report.solve.status == SolveStatus::converged);
    CHECK(report.solve.residual.l2 <= 1e-8);
  }
  CHECK(support::contains(
      support::message_of<std::invalid_argument>([] { InteriorPoint({.tolerance = 0}); }),
      "solver.tolerance is 0"));
  CHECK_THROWS_AS(InteriorPoint({.newton_iterations = 0}), std::invalid_argument);
  CHECK_THROWS_AS(InteriorPoint({.max_iterations = 0}), std::invalid_argument);
}

TEST_CASE("sand that sticks between walls of friction stays at rest, whatever its self-stress") {
  for (const int wide : {1, 4}) {
    Simulation<2, ConstantFriction, PolyPic, InteriorPoint>::Params params;
    params.grid.cells = {wide, wide == 1 ? 8 : 4};
    params.grid.size = {0.1 * params.grid.cells[0], 0.1 * params.grid.cells[1]};
    params.gravity = {wide == 1 ? 1.0 : 0.0, -9.81};
    params.time_step = 1e-3;
    params.material.density = 1500;
    params.rheology.mu = 3;
    params.faces = Faces<2>::all({FaceKind::frictional, 0.3});
    params.faces.upper[1] = {FaceKind::open};
    const Vec<2> upper(params.grid.size[0], params.grid.size[1] / 2);
    Particles<2> sand;
    fill_box<2>(sand, Grid<2>(params.grid), {0, 0}, upper, {.per_axis = 4, .jitter = 0});
    Simulation<2, ConstantFriction, PolyPic, InteriorPoint> sim(params, sand);
    for (int n = 0; n < 100; ++n) {
      CHECK(sim.step().solve.status == SolveStatus::converged);
      CHECK(largest_speed(sim) < 1e-5);
    }
  }
}

} // namespace test_interior_point
