// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/compiler.hpp"

#include <Eigen/Core>

/// \file
/// The vocabulary that every header shares: fixed-size vectors and matrices, and index types.

namespace talus {

/// A Rows × Cols matrix, stored by columns. The order is part of the type: inner loops read the
/// numbers as they lie, and EIGEN_DEFAULT_TO_ROW_MAJOR must not change that.
template <int Rows, int Cols, class Scalar = double>
using RectMat = Eigen::Matrix<Scalar, Rows, Cols, Eigen::ColMajor>;

/// A column of Dim numbers.
template <int Dim, class Scalar = double>
using Vec = RectMat<Dim, 1, Scalar>;

/// A Dim × Dim matrix.
template <int Dim, class Scalar = double>
using Mat = RectMat<Dim, Dim, Scalar>;

/// Integer coordinates of a cell or of a node: Index<3>{76, 3, 15}.
template <int Dim>
struct Index {
  int values[static_cast<unsigned>(Dim)]{};

  constexpr int& operator[](int axis) { return values[axis]; }
  constexpr int operator[](int axis) const { return values[axis]; }
  friend constexpr bool operator==(const Index&, const Index&) = default;
};

/// Number of independent components of a symmetric Dim × Dim tensor, d(d+1)/2; also the size of
/// the bulk's cone.
template <int Dim>
inline constexpr int symmetric_size = Dim*(Dim + 1) / 2;

/// base^exponent for small non-negative integers, at compile time.
constexpr int ipow(int base, int exponent) {
  return exponent == 0 ? 1 : base * ipow(base, exponent - 1);
}

/// The direction that points up, away from the bed: y in 2-D, z in 3-D. x points downslope.
template <int Dim>
inline constexpr int up_axis = Dim - 1;

} // namespace talus
