// SPDX-License-Identifier: MIT
// All local solver policies: against the secular solver, against the natural residual, on problems
// of all kinds; batches; and a policy of a user's own.

#include "talus/cone/comparison/contact.hpp"
#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/comparison/hybrid.hpp"
#include "talus/cone/comparison/projection.hpp"
#include "talus/cone/comparison/quartic.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/cone/secular.hpp"
#include "talus/cone/secular_batch.hpp"

#include "../support/cone_problems.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

namespace test_local_policies {

using namespace talus;
using namespace cone_problems;

namespace {

// A user's own policy, as docs/local_solvers.md shows it.
// [own-policy]
/// Ignores what couples the components: exact if W is diagonal with W_TT isotropic, and says so.
struct DiagonalSolver {
  struct Params {};
  template <class Law, int N, class Scalar = double>
  using Prepared = talus::ScaledCone<Law, N, Scalar>;

  DiagonalSolver() = default;
  explicit DiagonalSolver(const Params&) {}

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const talus::Mat<N, Scalar>& w, Scalar friction) const {
    return {w, friction};
  }

  template <class Law, int N, class Scalar>
  talus::LocalReport solve(const talus::ScaledCone<Law, N, Scalar>& cone,
                           const talus::Vec<N, Scalar>& b,
                           talus::Vec<N, Scalar>& lambda) const noexcept {
    lambda.setZero();
    if (!(cone.scale > 0) || b[0] >= 0)
      return {};
    lambda = -b.cwiseQuotient(cone.w.diagonal());
    const Scalar tangent = lambda.template tail<N - 1>().norm();
    if (tangent > cone.friction * lambda[0])
      lambda.template tail<N - 1>() *= cone.friction * lambda[0] / tangent;
    const talus::LocalReport report = talus::judge<Law, N, Scalar>(cone, b, lambda, 1e-10, 1);
    lambda /= cone.scale;
    return report;
  }
};
// [own-policy]

static_assert(LocalSolver<DiagonalSolver, CoulombLaw, 6> &&
              LocalSolver<DiagonalSolver, AssociatedLaw, 2>);
static_assert(LocalSolver<ContactSolver, CoulombLaw, 2> &&
              LocalSolver<ProjectionSolver, AssociatedLaw, 6> &&
              LocalSolver<QuarticSolver, CoulombLaw, 3> &&
              LocalSolver<QuarticSolver, AssociatedLaw, 3> &&
              LocalSolver<HybridSolver<>, CoulombLaw, 3> &&
              LocalSolver<HybridSolver<ContactSolver, SecularSolver>, AssociatedLaw, 6>);

template <class Law, int N>
void secular_misses_none() {
  for (int k = 0; k < kinds; ++k) {
    const Tally t = tally<SecularSolver, Law, N>(SecularSolver{}, Kind(k), 20000, 1e-10, 11);
    INFO("N ", N, ", ", std::string(kind_name[k]), ": worst ", t.worst, ", unreported ", t.silent);
    CHECK(t.missed == 0);
  }
}

/// Policies may miss, but must say so: what they call solved is.
template <class Solver, class Law, int N>
Tally never_silent(const Solver& solver, double max_condition, double bound) {
  Tally all;
  for (int k = 0; k < kinds; ++k) {
    const Tally t = tally<Solver, Law, N>(solver, Kind(k), 1000, bound, 5, max_condition);
    INFO("N ", N, ", ", std::string(kind_name[k]), ": worst ", t.worst);
    CHECK(t.silent == 0);
    all.problems += t.problems;
    all.missed += t.missed;
  }
  return all;
}

/// |λ − λ_secular| / |λ_secular| over random definite problems of a small condition and μ.
template <class Solver, class Law, int N>
void agrees_with_secular(const Solver& solver, double condition) {
  Numbers numbers;
  double worst = 0;
  int misses = 0;
  for (int k = 0; k < 1000; ++k) {
    const Mat<N> w = numbers.matrix<N>(condition);
    const Vec<N> b = numbers.vector<N>();
    const double mu = numbers.uniform(0.05, 0.45);
    Vec<N> lambda = Vec<N>::Zero(), secular = Vec<N>::Zero();
    const LocalStatus status = solve_local(solver, Law{}, w, b, mu, lambda).status;
    CHECK(solve_local(SecularSolver{}, Law{}, w, b, mu, secular).status !=
          LocalStatus::not_converged);
    if (status == LocalStatus::not_converged)
      ++misses;
    else
      worst = std::max(worst, (lambda - secular).norm() / (b.norm() + secular.norm()));
  }
  INFO("misses ", misses, ", worst ", worst);
  CHECK(worst < 1e-7);
  CHECK(misses <= 20);
}

template <class Solver, int N>
void trivial_problems() {
  const Solver solver{};
  const Mat<N> w = Mat<N>::Identity();
  Vec<N> lambda = Vec<N>::Ones();
  CHECK(solve_local(solver, CoulombLaw{}, w, Vec<N>(Vec<N>::Zero()), 0.5, lambda).status ==
        LocalStatus::open);
  CHECK(lambda.norm() == 0);
  lambda.setOnes();
  CHECK(solve_local(solver, AssociatedLaw{}, Mat<N>(Mat<N>::Zero()), Vec<N>(Vec<N>::Ones()), 0.5,
                    lambda)
            .status == LocalStatus::open);
  CHECK(lambda.norm() == 0);
  // a weight on the ground: open above, stick when pressed, slide when pushed, no friction
  const auto solve = [&](double normal, double tangent, double mu) {
    Vec<N> b = Vec<N>::Zero();
    b[0] = normal;
    b[1] = tangent;
    lambda.setZero();
    const LocalStatus status =
        solve_local(solver, CoulombLaw{}, Mat<N>(4 * w), b, mu, lambda).status;
    return status;
  };
  CHECK(solve(1, 0.3, 0.5) == LocalStatus::open);
  CHECK(solve(-1, 0.3, 0.5) == LocalStatus::stick);
  CHECK(lambda[0] == doctest::Approx(0.25));
  CHECK(lambda[1] == doctest::Approx(-0.075));
  CHECK(solve(-1, 0.9, 0.5) == LocalStatus::slide);
  CHECK(lambda[0] == doctest::Approx(0.25));
  CHECK(lambda[1] == doctest::Approx(-0.125));
  CHECK(solve(-1, 0.9, 0) != LocalStatus::not_converged);
  CHECK(lambda[0] == doctest::Approx(0.25));
  CHECK(std::abs(lambda[1]) < 1e-12);
}

template <class Law, int N, int Width>
void batch_equals_one_by_one() {
  Numbers numbers;
  double worst = 0;
  int statuses_differ = 0;
  for (int k = 0; k < 300; ++k) {
    SecularBatch<Law, N, Width> batch;
    typename SecularBatch<Law, N, Width>::Vector b, lambda;
    std::array<Vec<N>, Width> one;
    std::array<LocalReport, Width> report;
    std::array<double, Width> size; // |λ| + |b|/w
    for (int lane = 0; lane < Width; ++lane) {
      const auto l = static_cast<std::size_t>(lane);
      // regimes and kinds mixed, now and then a lane without W
      Kind kind = Kind(numbers.below(kinds));
      if (kind == Kind::singular || kind == Kind::hard_case) // λ is not unique there
        kind = Kind::random;
      Problem<N> p = draw<N>(numbers, kind, 1e3, 3);
      if (numbers.below(20) == 0)
        p.w.setZero();
      batch.set(lane, p.w, p.mu);
      one[l] = Vec<N>::Zero();
      for (int i = 0; i < N; ++i) {
        b[static_cast<std::size_t>(i)][l] = p.b[i];
        lambda[static_cast<std::size_t>(i)][l] = 0;
      }
      report[l] = solve_local(SecularSolver{}, Law{}, p.w, p.b, p.mu, one[l]);
      size[l] = one[l].norm() + (p.w.trace() > 0 ? p.b.norm() * N / p.w.trace() : 1);
    }
    const auto reports = batch.solve(b, lambda);
    for (std::size_t l = 0; l < Width; ++l) {
      statuses_differ += reports[l].status != report[l].status;
      double difference = 0;
      for (int i = 0; i < N; ++i)
        difference =
            std::max(difference, std::abs(lambda[static_cast<std::size_t>(i)][l] - one[l][i]));
      worst = std::max(worst, difference / size[l]);
    }
  }
  INFO("N ", N, ", ", Width, " lanes: worst ", worst);
  CHECK(statuses_differ == 0);
  CHECK(worst < 1e-9); // rounding, times the condition
}

} // namespace

TEST_CASE("secular solver misses none of 1e6 random and adversarial problems, Coulomb's law") {
  secular_misses_none<CoulombLaw, 2>();
  secular_misses_none<CoulombLaw, 3>();
  secular_misses_none<CoulombLaw, 6>();
}

TEST_CASE("secular solver misses none of 1e6 random and adversarial problems, associated law") {
  secular_misses_none<AssociatedLaw, 2>();
  secular_misses_none<AssociatedLaw, 3>();
  secular_misses_none<AssociatedLaw, 6>();
}

TEST_CASE("no policy is silent about a miss") {
  never_silent<QuarticSolver, CoulombLaw, 3>(QuarticSolver{}, 1e12, 1e-9);
  never_silent<QuarticSolver, AssociatedLaw, 3>(QuarticSolver{}, 1e12, 1e-9);
  never_silent<ProjectionSolver, CoulombLaw, 6>(ProjectionSolver({.max_iterations = 50}), 1e3,
                                                1e-9);
  never_silent<ProjectionSolver, AssociatedLaw, 3>(ProjectionSolver({.max_iterations = 50}), 1e3,
                                                   1e-9);
  const Tally contact = never_silent<ContactSolver, CoulombLaw, 6>(ContactSolver{}, 1e3, 1e-9);
  CHECK(contact.missed > contact.problems / 4); // it is only for isotropic W
}

TEST_CASE("policies agree with the secular solver where the solution is unique") {
  agrees_with_secular<QuarticSolver, CoulombLaw, 3>(QuarticSolver{}, 10);
  agrees_with_secular<QuarticSolver, AssociatedLaw, 3>(QuarticSolver{}, 10);
  agrees_with_secular<HybridSolver<>, CoulombLaw, 3>(HybridSolver<>{}, 10);
  agrees_with_secular<HybridSolver<>, AssociatedLaw, 3>(HybridSolver<>{}, 10);
  agrees_with_secular<ProjectionSolver, CoulombLaw, 6>(ProjectionSolver{}, 10);
  agrees_with_secular<ProjectionSolver, AssociatedLaw, 6>(ProjectionSolver{}, 10);
  agrees_with_secular<ContactSolver, CoulombLaw, 6>(ContactSolver{}, 1);
  agrees_with_secular<ContactSolver, AssociatedLaw, 2>(ContactSolver{}, 1);
  agrees_with_secular<FischerBurmeisterNewton, AssociatedLaw, 6>(FischerBurmeisterNewton{}, 10);
}

TEST_CASE("hybrid solver: Newton's method catches what the closed form misses") {
  Numbers numbers;
  int caught = 0;
  for (int k = 0; k < 3000; ++k) {
    const Mat<3> w = numbers.matrix<3>(1); // isotropic: double roots
    const Vec<3> b = numbers.vector<3>();
    const double mu = numbers.uniform(0.05, 1);
    Vec<3> quartic = Vec<3>::Zero(), hybrid = Vec<3>::Zero();
    const bool missed = solve_local(QuarticSolver{}, CoulombLaw{}, w, b, mu, quartic).status ==
                        LocalStatus::not_converged;
    const LocalReport report = solve_local(HybridSolver<>{}, CoulombLaw{}, w, b, mu, hybrid);
    CHECK(report.status != LocalStatus::not_converged);
    CHECK(error<CoulombLaw, 3>({w, b, mu}, hybrid) < 1e-9);
    caught += missed;
  }
  CHECK(caught > 10);
}

TEST_CASE("policies on problems with known answers") {
  trivial_problems<SecularSolver, 2>();
  trivial_problems<SecularSolver, 6>();
  trivial_problems<ContactSolver, 2>();
  trivial_problems<ContactSolver, 3>();
  trivial_problems<ProjectionSolver, 3>();
  trivial_problems<ProjectionSolver, 6>();
  trivial_problems<FischerBurmeisterNewton, 3>();
  trivial_problems<HybridSolver<>, 3>();
}

TEST_CASE("batches give what one by one gives") {
  batch_equals_one_by_one<CoulombLaw, 6, 4>();
  batch_equals_one_by_one<AssociatedLaw, 6, 4>();
  batch_equals_one_by_one<AssociatedLaw, 6, 8>();
  batch_equals_one_by_one<CoulombLaw, 3, 8>();
  batch_equals_one_by_one<AssociatedLaw, 3, 4>();
  batch_equals_one_by_one<CoulombLaw, 2, 4>();
}

TEST_CASE("secular solver in single precision keeps the accuracy that it can have") {
  Numbers numbers;
  int missed = 0;
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    const Problem<6> p = draw<6>(numbers, Kind(k % kinds), 1e4, 10);
    if (p.mu > 10)
      continue;
    // what single precision can hold
    const Mat<6, float> w = p.w.cast<float>();
    const Vec<6, float> b = p.b.cast<float>();
    Vec<6, float> lambda = Vec<6, float>::Zero();
    const SecularSolver solver;
    const float mu = static_cast<float>(p.mu);
    missed += solver.solve(solver.prepare(AssociatedLaw{}, w, mu), b, lambda).status ==
              LocalStatus::not_converged;
    worst = std::max(worst, error<AssociatedLaw, 6>({w.cast<double>(), b.cast<double>(), mu},
                                                    lambda.cast<double>()));
  }
  INFO("missed ", missed, ", worst ", worst);
  CHECK(missed == 0);
  CHECK(worst < 1e-4);
}

TEST_CASE("a policy of a user's own works wherever the library's do") {
  trivial_problems<DiagonalSolver, 3>();
  agrees_with_secular<DiagonalSolver, CoulombLaw, 6>(DiagonalSolver{}, 1);
}

TEST_CASE("local solvers refuse parameters out of range") {
  CHECK_THROWS_AS(SecularSolver({.max_iterations = 0}), std::invalid_argument);
  CHECK_THROWS_AS(ProjectionSolver({.tolerance = -1}), std::invalid_argument);
  CHECK_THROWS_AS(ProjectionSolver({.tolerance = 1e-10, .max_iterations = 0}),
                  std::invalid_argument);
  CHECK_THROWS_AS(FischerBurmeisterNewton({.tolerance = 0}), std::invalid_argument);
}

} // namespace test_local_policies
