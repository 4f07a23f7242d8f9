// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace talus {

/// An upper bound of the largest eigenvalue of a symmetric positive semi-definite W (N × N), a few
/// percent above it as a rule: the lesser of ‖W⁴‖_F^{1/4} and Gershgorin's bound.
template <int N, class Scalar>
Scalar largest_eigenvalue_bound(const Mat<N, Scalar>& w) {
  using std::sqrt;
  const Scalar scale = w.trace();
  if (!(scale > 0))
    return 0;
  const Mat<N, Scalar> unit = w / scale, square = unit * unit, fourth = square * square;
  const Scalar by_power = sqrt(sqrt(fourth.norm()));
  Scalar by_rows(0);
  for (int c = 0; c < N; ++c) {
    Scalar row(0);
    for (int r = 0; r < N; ++r)
      row += std::abs(unit(r, c));
    by_rows = std::max(by_rows, row);
  }
  return scale * std::min(by_power, by_rows);
}

/// One projected step towards the solution of a cone, a model of LocalStep:
/// \f[ λ ← P_{K_μ}(λ − \tilde γ / L), \quad L ≥ ‖W‖. \f]
/// For the associated law it never raises the energy ½ λᵀWλ + bᵀλ, so that sweeps of it converge;
/// and a sweep costs a third of one with exact local solutions while as many are needed, since the
/// others' change soon makes the exact solution obsolete. (Prox-linear block coordinate descent:
/// Tseng & Yun 2009; Xu & Yin 2013.) For Coulomb's law γ̃ = γ + μ |γ_T| e_N, as of the start.
///
/// Cost: two square roots and a division a step; the bound L once a step of time, 0.1 µs.
class ProjectionStep {
 public:
  struct Params {};

  template <class, int N, class Scalar = double>
  struct Prepared {
    Scalar step{}; ///< 1/L; 0: no W at all, and λ stays
    Scalar friction{};
  };

  ProjectionStep() = default;
  explicit ProjectionStep(const Params&) {}

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    const Scalar largest = largest_eigenvalue_bound<N, Scalar>(w);
    return {largest > 0 ? 1 / largest : 0, friction};
  }

  /// gamma: W λ + b (N) of the λ on entry.
  template <class Law, int N, class Scalar>
  void step(const Prepared<Law, N, Scalar>& cone, const Vec<N, Scalar>& gamma,
            Vec<N, Scalar>& lambda) const noexcept {
    using std::max, std::sqrt;
    // Numbers one by one: in registers all the way, while vectors would go through memory.
    const Scalar mu = cone.friction;
    Scalar slip2(0), tangent2(0);
    Vec<N, Scalar> x;
    for (int k = 0; k < N; ++k)
      x[k] = lambda[k] - cone.step * gamma[k];
    for (int k = 1; k < N; ++k) {
      slip2 += gamma[k] * gamma[k];
      tangent2 += x[k] * x[k];
    }
    if constexpr (std::is_same_v<Law, CoulombLaw>)
      x[0] -= cone.step * mu * sqrt(slip2);
    // Without branches, which would be guessed wrong: the nearest point of the cone's surface, or
    // its apex, or x itself where that is inside.
    const Scalar tangent = sqrt(tangent2);
    const Scalar on_edge = max(Scalar(0), (x[0] + mu * tangent) / (1 + mu * mu));
    const bool inside = tangent <= mu * x[0];
    const Scalar shrunk = tangent > 0 ? mu * on_edge / tangent : Scalar(0);
    const Scalar factor = inside ? Scalar(1) : shrunk;
    lambda[0] = inside ? x[0] : on_edge;
    for (int k = 1; k < N; ++k)
      lambda[k] = factor * x[k];
  }
};

} // namespace talus
