// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cmath>
#include <limits>

namespace talus {

/// Eigenvalues and vectors of a small symmetric matrix, A = Q diag(e) Qᵀ, in no order, by cyclic
/// Jacobi rotations (Golub & Van Loan, Matrix Computations, 8.5). To rounding, relative to each
/// eigenvalue where A is positive definite and its diagonal says how large they are. Plain loops:
/// Eigen's own comes with products of large matrices, which cost every program 10 s to compile and,
/// with AVX-512, g++ 12 warns of them (GCC bug 105593).
template <int N, class Scalar = double>
struct SymmetricEigen {
  Vec<N, Scalar> values;  ///< e
  Mat<N, Scalar> vectors; ///< Q, one a column

  /// a: N × N; its lower triangle is used. A NaN in it makes everything NaN.
  explicit SymmetricEigen(const Mat<N, Scalar>& a) {
    Mat<N, Scalar> m = a;
    for (int r = 0; r < N; ++r)
      for (int c = 0; c < N; ++c)
        vectors(r, c) = Scalar(r == c ? 1 : 0);
    constexpr int most_sweeps = 40; // five or six are enough; NaN never ends
    bool rotated = true;
    for (int sweep = 0; sweep < most_sweeps && rotated; ++sweep) {
      rotated = false;
      for (int p = 0; p < N - 1; ++p)
        for (int q = p + 1; q < N; ++q)
          rotated = rotate(m, p, q) || rotated;
    }
    for (int k = 0; k < N; ++k)
      values[k] = m(k, k);
  }

 private:
  /// Turns the plane of p < q so that entry (q, p) vanishes. False if it is nothing but rounding.
  bool rotate(Mat<N, Scalar>& m, int p, int q) {
    using std::abs, std::sqrt;
    constexpr Scalar epsilon = std::numeric_limits<Scalar>::epsilon() / 2;
    const Scalar off = m(q, p);
    if (off == 0 || abs(off) <= epsilon * sqrt(abs(m(p, p))) * sqrt(abs(m(q, q))))
      return false;
    const Scalar slope = (m(q, q) - m(p, p)) / (2 * off);                           // cot 2φ
    const Scalar t = (slope < 0 ? -1 : 1) / (abs(slope) + sqrt(1 + slope * slope)); // tan φ
    const Scalar c = 1 / sqrt(1 + t * t), s = t * c;
    m(p, p) -= t * off;
    m(q, q) += t * off;
    m(q, p) = 0;
    const auto turn = [&](Scalar& x, Scalar& y) {
      const Scalar old = x;
      x = c * old - s * y;
      y = s * old + c * y;
    };
    for (int k = 0; k < N; ++k) {
      if (k < p)
        turn(m(p, k), m(q, k));
      else if (k > p && k < q)
        turn(m(k, p), m(q, k));
      else if (k > q)
        turn(m(k, p), m(k, q));
      turn(vectors(k, p), vectors(k, q));
    }
    return true;
  }
};

} // namespace talus
