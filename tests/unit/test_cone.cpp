// SPDX-License-Identifier: MIT
// The cone law and its local solvers, on random and degenerate problems.

#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/cone/secular.hpp"

#include "../support/cone_problems.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

namespace test_cone {

using namespace talus;
using cone_problems::Numbers;

namespace {

/// See cone_problems::error.
template <class Law, int N>
double error(const Mat<N>& w, const Vec<N>& b, double mu, const Vec<N>& lambda) {
  return cone_problems::error<Law, N>({w, b, mu}, lambda);
}

template <class Solver, class Law, int N>
void solve_many(double condition, double mu_max, double bound, int count, double mu_min = 0) {
  Numbers numbers;
  const Solver solver;
  int misses = 0, statuses[4] = {};
  double worst = 0;
  for (int k = 0; k < count; ++k) {
    const Mat<N> w = numbers.matrix<N>(condition);
    const Vec<N> b = numbers.vector<N>();
    const double mu = numbers.uniform(mu_min, mu_max);
    Vec<N> lambda = k % 2 == 0 ? Vec<N>(Vec<N>::Zero()) : numbers.vector<N>();
    const LocalReport report = solve_local(solver, Law{}, w, b, mu, lambda);
    ++statuses[static_cast<int>(report.status)];
    const double e = error<Law, N>(w, b, mu, lambda);
    // what a solver says of itself must be true
    if (report.status == LocalStatus::not_converged)
      ++misses;
    else if (!(e < bound))
      ++misses;
    worst = std::max(worst, e);
  }
  INFO("N ", N, ", condition ", condition, ", mu below ", mu_max, ", worst error ", worst,
       ", open ", statuses[0], ", stick ", statuses[1], ", slide ", statuses[2], ", not converged ",
       statuses[3]);
  CHECK(misses == 0);
}

template <class Law>
void secular_all_sizes(double condition, double mu_max, double bound) {
  solve_many<SecularSolver, Law, 2>(condition, mu_max, bound, 3000);
  solve_many<SecularSolver, Law, 3>(condition, mu_max, bound, 3000);
  solve_many<SecularSolver, Law, 6>(condition, mu_max, bound, 3000);
}

} // namespace

TEST_CASE("projection on the cone: nearest point, Moreau's decomposition") {
  Numbers numbers;
  for (int k = 0; k < 2000; ++k) {
    const Vec<6> x = numbers.vector<6>();
    const double mu = k % 10 == 0 ? 0 : numbers.uniform(0, 3);
    const Vec<6> p = project_on_cone<6, double>(x, mu);
    CHECK(p.tail<5>().norm() <= mu * p[0] * (1 + 1e-14) + 1e-15);
    CHECK((project_on_cone<6, double>(p, mu) - p).norm() < 1e-14);
    const Vec<6> rest = p - x; // in the dual cone K_{1/μ}, orthogonal to p
    CHECK(mu * rest.tail<5>().norm() <= rest[0] + 1e-13);
    CHECK(std::abs(rest.dot(p)) < 1e-13);
  }
}

TEST_CASE("Fischer-Burmeister function is zero where, and only where, the law holds") {
  Numbers numbers;
  for (int k = 0; k < 2000; ++k) {
    // complementary pairs on the edges, and pairs with one inside and the other zero
    const Vec<5> t = numbers.vector<5>().normalized();
    const double a = numbers.uniform(0.1, 2), b = numbers.uniform(0.1, 2);
    Vec<6> x, y;
    x << a, a * t;
    y << b, -b * t;
    CHECK(fischer_burmeister<6, double>(x, y).norm() < 1e-14 * (a + b));
    x[0] *= 1 + numbers.uniform(0, 1);
    CHECK(fischer_burmeister<6, double>(x, Vec<6>(Vec<6>::Zero())).norm() < 1e-14 * x.norm());
    CHECK(fischer_burmeister<6, double>(x, y).norm() > 1e-6); // x·y > 0
    y[0] *= 0.9;                                              // y left the cone
    CHECK(fischer_burmeister<6, double>(Vec<6>(Vec<6>::Zero()), y).norm() > 1e-3);
  }
  const Vec<3> zero = Vec<3>::Zero();
  CHECK(fischer_burmeister<3, double>(zero, zero).norm() == 0);
  // no overflow or underflow; homogeneous
  const Vec<3> x(1, 0.3, -0.2), y(0.5, 0.4, 0.1);
  const Vec<3> f = fischer_burmeister<3, double>(x, y);
  for (const double scale : {1e-200, 1e-100, 1e100, 1e200})
    CHECK((fischer_burmeister<3, double>(Vec<3>(scale * x), Vec<3>(scale * y)) / scale - f).norm() <
          1e-14);
}

TEST_CASE("law residuals: Coulomb's regimes, and mu = 0") {
  using V = Vec<3>;
  const auto coulomb = [](const V& gamma, const V& lambda, double mu) {
    return law_residual<3, double>(CoulombLaw{}, gamma, lambda, mu).norm();
  };
  CHECK(coulomb(V(1, 0.2, 0.3), V(0, 0, 0), 0.5) < 1e-15);        // open
  CHECK(coulomb(V(0, 0, 0), V(1, 0.2, 0.3), 0.5) < 1e-15);        // stick
  CHECK(coulomb(V(0, 0.6, 0.8), V(1, -0.3, -0.4), 0.5) < 1e-15);  // slide
  CHECK(coulomb(V(0, 0.6, 0.8), V(1, 0.3, 0.4), 0.5) > 0.1);      // friction that drives
  CHECK(coulomb(V(0.1, 0.6, 0.8), V(1, -0.3, -0.4), 0.5) > 0.01); // dilates while pressed
  CHECK(coulomb(V(0, 0, 0), V(1, 0.6, 0.3), 0.5) > 0.01);         // outside the cone
  CHECK(coulomb(V(0, 0.6, 0.8), V(1, 0, 0), 0) < 1e-15);          // frictionless
  CHECK(coulomb(V(-1, 0, 0), V(1e-20, 0, 0), 0) == doctest::Approx(2));
  CHECK(coulomb(V(1e-20, 0, 0), V(-1, 0, 0), 0) == doctest::Approx(2));
  CHECK(coulomb(V(1, 0, 0), V(1e-20, 0, 0), 0) / 1e-20 == doctest::Approx(1));
  CHECK(coulomb(V(0.1, 0.6, 0.8), V(1, 0, 0), 0) > 0.01);
  CHECK(coulomb(V(0, 0.6, 0.8), V(1, 0.1, 0), 0) > 0.01);
  CHECK(coulomb(V(0, 0.6, 0.8), V(-1, 0, 0), 0) > 0.01);
}

TEST_CASE("residuals are honest: a stress that is wrong by x shows about x") {
  Numbers numbers;
  for (int k = 0; k < 1000; ++k) {
    const Mat<6> w = numbers.matrix<6>(10);
    const Vec<6> b = numbers.vector<6>();
    Vec<6> lambda = Vec<6>::Zero();
    solve_local(SecularSolver{}, CoulombLaw{}, w, b, 0.4, lambda);
    if (lambda.norm() == 0)
      continue;
    const double scale = w.trace() / 6;
    for (const double x : {1e-6, 1e-3}) {
      Vec<6> wrong = lambda + x * lambda.norm() * numbers.vector<6>().normalized();
      const double r =
          law_residual<6, double>(CoulombLaw{}, (w * wrong + b) / scale, wrong, 0.4).norm() /
          lambda.norm();
      CHECK(r < 10 * x);
      CHECK(r > 1e-3 * x);
    }
  }
}

TEST_CASE("secular solver: both laws, all sizes, conditions up to 1e6") {
  for (const double mu_max : {1e-3, 1.0, 10.0})
    for (const double condition : {1.0, 1e2, 1e4}) {
      secular_all_sizes<CoulombLaw>(condition, mu_max, 1e-10);
      secular_all_sizes<AssociatedLaw>(condition, mu_max, 1e-10);
    }
  secular_all_sizes<CoulombLaw>(1e6, 0.8, 1e-9);
  secular_all_sizes<AssociatedLaw>(1e6, 0.8, 1e-9);
}

TEST_CASE("Fischer-Burmeister Newton: both laws where it is to be trusted") {
  // not for tiny mu: f_MFB weighs the normal complementarity by mu
  solve_many<FischerBurmeisterNewton, CoulombLaw, 6>(2, 0.5, 1e-10, 2000, 0.05);
  solve_many<FischerBurmeisterNewton, CoulombLaw, 3>(2, 0.5, 1e-10, 2000, 0.05);
  solve_many<FischerBurmeisterNewton, CoulombLaw, 2>(2, 0.5, 1e-10, 2000, 0.05);
  solve_many<FischerBurmeisterNewton, AssociatedLaw, 6>(100, 2, 1e-10, 2000, 0.05);
  solve_many<FischerBurmeisterNewton, AssociatedLaw, 3>(100, 2, 1e-10, 2000, 0.05);
}

TEST_CASE("Fischer-Burmeister Newton says so when it misses") {
  Numbers numbers;
  const FischerBurmeisterNewton solver({.tolerance = 1e-12, .max_iterations = 1});
  int missed = 0;
  for (int k = 0; k < 500; ++k) {
    const Mat<6> w = numbers.matrix<6>(100);
    const Vec<6> b = numbers.vector<6>();
    Vec<6> lambda = Vec<6>::Zero();
    const LocalReport report = solve_local(solver, CoulombLaw{}, w, b, 0.5, lambda);
    const bool solved = error<CoulombLaw, 6>(w, b, 0.5, lambda) < 1e-9;
    CHECK((report.status != LocalStatus::not_converged) == solved);
    missed += !solved;
  }
  CHECK(missed > 100); // one iteration is not enough for sliding
}

TEST_CASE("both local solvers agree where the solution is unique") {
  Numbers numbers;
  for (int k = 0; k < 2000; ++k) {
    const Mat<6> w = numbers.matrix<6>(10);
    const Vec<6> b = numbers.vector<6>();
    const double mu = numbers.uniform(0, 2);
    Vec<6> secular = Vec<6>::Zero(), newton = Vec<6>::Zero();
    solve_local(SecularSolver{}, AssociatedLaw{}, w, b, mu, secular);
    const LocalReport report =
        solve_local(FischerBurmeisterNewton{}, AssociatedLaw{}, w, b, mu, newton);
    CHECK(report.status != LocalStatus::not_converged);
    CHECK((secular - newton).norm() < 1e-8 * (1 + secular.norm()));
  }
}

TEST_CASE("secular solver: degenerate problems") {
  Numbers numbers;
  const SecularSolver solver;
  const auto check = [&](const auto law, const Mat<6>& w, const Vec<6>& b, double mu,
                         double bound) {
    Vec<6> lambda = Vec<6>::Zero();
    const LocalReport report = solve_local(solver, law, w, b, mu, lambda);
    CHECK(report.status != LocalStatus::not_converged);
    CHECK(lambda.allFinite());
    const double e = error<std::decay_t<decltype(law)>, 6>(w, b, mu, lambda);
    CHECK(e < bound);
  };
  for (int k = 0; k < 500; ++k) {
    const Mat<6> w = numbers.matrix<6>(100);
    Vec<6> b = numbers.vector<6>();
    check(CoulombLaw{}, w, b, 0, 1e-10);
    check(AssociatedLaw{}, w, b, 0, 1e-10);
    check(CoulombLaw{}, w, Vec<6>::Zero(), 0.4, 1e-10);
    check(AssociatedLaw{}, w, Vec<6>::Zero(), 0.4, 1e-10);
    check(CoulombLaw{}, w, b, 1e4, 1e-8); // several solutions: any is right
    b[0] = 0;
    check(CoulombLaw{}, w, b, 0.4, 1e-10);
    check(AssociatedLaw{}, w, b, 0.4, 1e-10);
    b[0] = -b.tail<5>().norm() / 0.4; // −b on the cone's edge
    check(AssociatedLaw{}, w, b, 0.4, 1e-10);
    check(CoulombLaw{}, Mat<6>::Identity(), b, 0.4, 1e-10);
    check(AssociatedLaw{}, Mat<6>::Identity(), b, 0.4, 1e-10);
    b.tail<5>().setZero(); // no tangent at all
    check(CoulombLaw{}, w, b, 0.4, 1e-10);
    check(AssociatedLaw{}, w, b, 0.4, 1e-10);
  }
  // W of every rank, b in its range as in an assembled problem
  for (int rank = 1; rank < 6; ++rank)
    for (int k = 0; k < 200; ++k) {
      Mat<6> w = Mat<6>::Zero();
      Vec<6> b = Vec<6>::Zero();
      for (int r = 0; r < rank; ++r) {
        const Vec<6> v = numbers.vector<6>();
        w += v * v.transpose();
        b += numbers.normal() * v;
      }
      check(CoulombLaw{}, w, b, 0.4, 1e-6);
      check(AssociatedLaw{}, w, b, 0.4, 1e-6);
    }
  Vec<6> lambda = Vec<6>::Ones();
  CHECK(
      solve_local(solver, CoulombLaw{}, Mat<6>(Mat<6>::Zero()), Vec<6>(Vec<6>::Ones()), 0.4, lambda)
          .status == LocalStatus::open);
}

TEST_CASE("secular solver: any unit gives the same answer") {
  Numbers numbers;
  for (int k = 0; k < 200; ++k) {
    const Mat<6> w = numbers.matrix<6>(100);
    const Vec<6> b = numbers.vector<6>();
    Vec<6> reference = Vec<6>::Zero();
    solve_local(SecularSolver{}, AssociatedLaw{}, w, b, 0.4, reference);
    for (const double a : {1e-150, 1e-30, 1e30, 1e150})
      for (const double c : {1e-150, 1.0, 1e150}) {
        Vec<6> lambda = Vec<6>::Zero();
        solve_local(SecularSolver{}, AssociatedLaw{}, Mat<6>(a * w), Vec<6>(c * b), 0.4, lambda);
        if (c / a > 1e-300 && c / a < 1e300)
          CHECK((lambda / (c / a) - reference).norm() < 1e-9 * (1 + reference.norm()));
      }
  }
}

TEST_CASE("secular solver in single precision") {
  Numbers numbers;
  for (int k = 0; k < 1000; ++k) {
    const Mat<6, float> w = numbers.matrix<6>(10).cast<float>();
    const Vec<6, float> b = numbers.vector<6>().cast<float>();
    Vec<6, float> lambda = Vec<6, float>::Zero();
    const SecularSolver solver;
    CHECK(solver.solve(solver.prepare(CoulombLaw{}, w, 0.4F), b, lambda).status !=
          LocalStatus::not_converged);
    CHECK(error<CoulombLaw, 6>(w.cast<double>(), b.cast<double>(), 0.4F, lambda.cast<double>()) <
          1e-4);
  }
}

TEST_CASE("Fischer-Burmeister Newton converges quadratically") {
  Numbers numbers;
  int quadratic = 0, sequences = 0;
  for (int k = 0; k < 200; ++k) {
    const Mat<6> w = numbers.matrix<6>(3);
    const Vec<6> b = numbers.vector<6>();
    Vec<6> solution = Vec<6>::Zero();
    if (solve_local(SecularSolver{}, AssociatedLaw{}, w, b, 0.4, solution).status !=
        LocalStatus::slide)
      continue;
    // distances to the solution after 1, 2, ... iterations from a nearby start
    std::vector<double> distance;
    for (int n = 1; n <= 6; ++n) {
      Vec<6> lambda = 1.1 * solution;
      const FischerBurmeisterNewton solver({.tolerance = 1e-15, .max_iterations = n});
      solver.solve(solver.prepare(AssociatedLaw{}, w, 0.4), b, lambda);
      distance.push_back((lambda - solution).norm() / solution.norm());
    }
    ++sequences;
    for (std::size_t n = 1; n < distance.size(); ++n)
      if (distance[n] < 1e-5 && distance[n] > 1e-13) { // the last step before rounding
        quadratic += std::log(distance[n]) < 1.6 * std::log(distance[n - 1]);
        break;
      } else if (distance[n] <= 1e-13) {
        ++quadratic;
        break;
      }
  }
  INFO(quadratic, " of ", sequences);
  CHECK(sequences > 50);
  CHECK(quadratic > 0.9 * sequences);
}

} // namespace test_cone
