// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cmath>

/// \file
/// Sums and products of small vectors and matrices as plain loops. Every kind of expression of
/// Eigen is a class of its own and costs the compiler about 2 MB and 20 ms, in every program; so
/// what is not in an inner loop is written with these. Sums go from the first entry to the last.

namespace talus {

/// a + b.
template <int N>
Vec<N> plus(const Vec<N>& a, const Vec<N>& b) {
  Vec<N> c;
  for (int k = 0; k < N; ++k)
    c[k] = a[k] + b[k];
  return c;
}

/// a − b.
template <int N>
Vec<N> minus(const Vec<N>& a, const Vec<N>& b) {
  Vec<N> c;
  for (int k = 0; k < N; ++k)
    c[k] = a[k] - b[k];
  return c;
}

/// s a.
template <int N>
Vec<N> scaled(double s, const Vec<N>& a) {
  Vec<N> c;
  for (int k = 0; k < N; ++k)
    c[k] = s * a[k];
  return c;
}

/// a + s b.
template <int N>
Vec<N> plus_scaled(const Vec<N>& a, double s, const Vec<N>& b) {
  Vec<N> c;
  for (int k = 0; k < N; ++k)
    c[k] = a[k] + s * b[k];
  return c;
}

/// a · b.
template <int N>
double dot(const Vec<N>& a, const Vec<N>& b) {
  double sum = a[0] * b[0];
  for (int k = 1; k < N; ++k)
    sum += a[k] * b[k];
  return sum;
}

/// |a|.
template <int N>
double norm(const Vec<N>& a) {
  return std::sqrt(dot<N>(a, a));
}

/// M a.
template <int N>
Vec<N> product(const Mat<N>& m, const Vec<N>& a) {
  Vec<N> b;
  for (int r = 0; r < N; ++r) {
    b[r] = m(r, 0) * a[0];
    for (int k = 1; k < N; ++k)
      b[r] += m(r, k) * a[k];
  }
  return b;
}

/// Mᵀ a.
template <int N>
Vec<N> transposed_product(const Mat<N>& m, const Vec<N>& a) {
  Vec<N> b;
  for (int r = 0; r < N; ++r) {
    b[r] = m(0, r) * a[0];
    for (int k = 1; k < N; ++k)
      b[r] += m(k, r) * a[k];
  }
  return b;
}

/// A B.
template <int N>
Mat<N> matrix_product(const Mat<N>& a, const Mat<N>& b) {
  Mat<N> c;
  for (int r = 0; r < N; ++r)
    for (int s = 0; s < N; ++s) {
      c(r, s) = a(r, 0) * b(0, s);
      for (int k = 1; k < N; ++k)
        c(r, s) += a(r, k) * b(k, s);
    }
  return c;
}

/// A Bᵀ.
template <int N>
Mat<N> matrix_product_transposed(const Mat<N>& a, const Mat<N>& b) {
  Mat<N> c;
  for (int r = 0; r < N; ++r)
    for (int s = 0; s < N; ++s) {
      c(r, s) = a(r, 0) * b(s, 0);
      for (int k = 1; k < N; ++k)
        c(r, s) += a(r, k) * b(s, k);
    }
  return c;
}

/// x of A x = b, A symmetric and positive definite: elimination without a change of order.
template <int N>
Vec<N> solve_positive(Mat<N> a, Vec<N> b) {
  for (int k = 0; k < N; ++k)
    for (int r = k + 1; r < N; ++r) {
      const double factor = a(r, k) / a(k, k);
      for (int c = k + 1; c < N; ++c)
        a(r, c) -= factor * a(k, c);
      b[r] -= factor * b[k];
    }
  for (int k = N - 1; k >= 0; --k) {
    for (int c = k + 1; c < N; ++c)
      b[k] -= a(k, c) * b[c];
    b[k] /= a(k, k);
  }
  return b;
}

/// ‖R Rᵀ − I‖, Frobenius: 0 if and only if R is orthogonal.
template <int N>
double orthogonality_error(const Mat<N>& r) {
  const Mat<N> p = matrix_product_transposed<N>(r, r);
  double sum = 0;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) {
      const double off = p(i, j) - (i == j ? 1 : 0);
      sum += off * off;
    }
  return std::sqrt(sum);
}

} // namespace talus
