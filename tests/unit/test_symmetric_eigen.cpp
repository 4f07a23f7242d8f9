// SPDX-License-Identifier: MIT
// Eigenvalues of small symmetric matrices against their definition.

#include "talus/core/symmetric_eigen.hpp"

#include "talus/core/types.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace test_symmetric_eigen {

using namespace talus;

namespace {

template <int N, class Scalar>
void check(const Mat<N, Scalar>& a, Scalar tolerance) {
  const SymmetricEigen<N, Scalar> eigen(a);
  const Mat<N, Scalar> q = eigen.vectors;
  const Scalar size = a.norm();
  CHECK((q * q.transpose() - Mat<N, Scalar>::Identity()).norm() <= tolerance);
  CHECK((q * eigen.values.asDiagonal() * q.transpose() - a).norm() <= tolerance * size);
}

template <int N, class Scalar>
void check_many(Scalar tolerance) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 300; ++n) {
    Mat<N, Scalar> b;
    for (int r = 0; r < N; ++r)
      for (int c = 0; c < N; ++c)
        b(r, c) = static_cast<Scalar>(normal(random) * std::pow(10.0, n % 7 * (c % 3 - 1)));
    if (n % 5 == 0)
      b.col(0).setZero(); // singular
    check<N, Scalar>(b * b.transpose(), tolerance);
    check<N, Scalar>(b + b.transpose(), tolerance); // not definite
    check<N, Scalar>(Mat<N, Scalar>(b.diagonal().asDiagonal()), tolerance);
  }
  check<N, Scalar>(Mat<N, Scalar>::Zero(), tolerance);
  check<N, Scalar>(Mat<N, Scalar>::Ones(), tolerance);
}

} // namespace

TEST_CASE("eigenvalues and vectors of symmetric matrices") {
  check_many<1, double>(1e-14);
  check_many<2, double>(1e-14);
  check_many<5, double>(1e-14);
  check_many<5, float>(5e-6F);
}

TEST_CASE("small eigenvalues of a graded matrix are right to their own digits") {
  Mat<3> a; // D C D, C well conditioned, D = diag(1, 1e-5, 1e-10)
  a << 1, 0.5e-5, 0.25e-10, 0.5e-5, 1e-10, 0.5e-15, 0.25e-10, 0.5e-15, 1e-20;
  Vec<3> e = SymmetricEigen<3>(a).values;
  std::sort(e.data(), e.data() + 3);
  CHECK(std::abs(e[0] / 7.5e-21 - 1) < 1e-9); // det C / det C_2, but for relative 1e-10
  CHECK(std::abs(e[1] / 7.5e-11 - 1) < 1e-9);
}

TEST_CASE("a NaN is not lost among eigenvalues") {
  Mat<5> a = Mat<5>::Identity();
  a(3, 1) = a(1, 3) = std::numeric_limits<double>::quiet_NaN();
  const SymmetricEigen<5> eigen(a);
  CHECK_FALSE(eigen.values.allFinite());
  CHECK_FALSE(eigen.vectors.allFinite());
}

} // namespace test_symmetric_eigen
