// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cmath>

/// \file
/// Symmetric tensors as vectors (τ_N, τ_T) in the basis that is orthonormal for <τ,υ> = τ:υ/2, the
/// isotropic direction first. The Drucker–Prager law becomes Coulomb's law in R^s in this basis
/// (Daviet & Bertails-Descoubes 2016; spec of the model §2).

namespace talus {

/// The vector of a symmetric tensor. τ: d × d, only its symmetric part is used.
/// \f[ d = 2: \left( \tfrac{τ_{xx} + τ_{yy}}{2}, \tfrac{τ_{xx} − τ_{yy}}{2}, τ_{xy} \right); \quad
///     d = 3: \left( \tfrac{\mathrm{tr}\, τ}{\sqrt 6}, \tfrac{τ_{xx} − τ_{yy}}{2},
///     \tfrac{2 τ_{zz} − τ_{xx} − τ_{yy}}{2 \sqrt 3}, τ_{xy}, τ_{xz}, τ_{yz} \right). \f]
template <int Dim, class Scalar>
Vec<symmetric_size<Dim>, Scalar> symmetric_to_vector(const Mat<Dim, Scalar>& t) {
  static_assert(Dim == 2 || Dim == 3, "talus: the dimension is 2 or 3");
  using std::sqrt;
  const Scalar half(0.5);
  Vec<symmetric_size<Dim>, Scalar> v;
  if constexpr (Dim == 2) {
    v << half * (t(0, 0) + t(1, 1)), half * (t(0, 0) - t(1, 1)), half * (t(0, 1) + t(1, 0));
  } else {
    const Scalar in_plane = t(0, 0) + t(1, 1);
    v << (in_plane + t(2, 2)) / sqrt(Scalar(6)), half * (t(0, 0) - t(1, 1)),
        (2 * t(2, 2) - in_plane) / (2 * sqrt(Scalar(3))), half * (t(0, 1) + t(1, 0)),
        half * (t(0, 2) + t(2, 0)), half * (t(1, 2) + t(2, 1));
  }
  return v;
}

/// The symmetric tensor of a vector: the inverse of symmetric_to_vector.
template <int Dim, class Scalar>
Mat<Dim, Scalar> vector_to_symmetric(const Vec<symmetric_size<Dim>, Scalar>& v) {
  static_assert(Dim == 2 || Dim == 3, "talus: the dimension is 2 or 3");
  using std::sqrt;
  Mat<Dim, Scalar> t;
  if constexpr (Dim == 2) {
    t << v(0) + v(1), v(2), v(2), v(0) - v(1);
  } else {
    const Scalar isotropic = sqrt(Scalar(2) / Scalar(3)) * v(0);
    const Scalar axial = v(2) / sqrt(Scalar(3));
    t << isotropic + v(1) - axial, v(3), v(4), v(3), isotropic - v(1) - axial, v(5), v(4), v(5),
        isotropic + 2 * axial;
  }
  return t;
}

/// μ̃ = sqrt(2/d) μ: the opening of the cone |τ_T| ≤ μ̃ τ_N that stands for ‖Dev τ‖ ≤ μ Tr τ/d.
template <int Dim>
double cone_friction(double friction) {
  return std::sqrt(2.0 / Dim) * friction;
}

/// Tr τ / d of a tensor given by its normal component: sqrt(2/d) τ_N. For λ = −σ, the pressure.
template <int Dim>
double mean_from_normal(double normal) {
  return std::sqrt(2.0 / Dim) * normal;
}

/// The normal component of a·I: a sqrt(d/2).
template <int Dim>
double normal_from_mean(double mean) {
  return mean * std::sqrt(Dim / 2.0);
}

} // namespace talus
