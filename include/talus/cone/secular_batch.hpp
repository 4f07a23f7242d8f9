// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/local_solver.hpp"
#include "talus/cone/secular.hpp"
#include "talus/cone/secular_equation.hpp"
#include "talus/core/types.hpp"

#include <experimental/simd>

#include <array>
#include <cstddef>

namespace talus {

/// Width numbers that are worked on at once.
template <int Width, class Scalar = double>
using Pack = std::experimental::simd<
    Scalar, std::experimental::simd_abi::deduce_t<Scalar, static_cast<std::size_t>(Width)>>;

template <class Number, class Abi>
struct Lanes<std::experimental::simd<Number, Abi>> {
  using Real = std::experimental::simd<Number, Abi>;
  using Scalar = Number;
  using Mask = typename Real::mask_type;
  static Real select(const Mask& condition, const Real& yes, Real no) {
    std::experimental::where(condition, no) = yes;
    return no;
  }
  static bool all(const Mask& mask) { return std::experimental::all_of(mask); }
};

/// Width independent cone problems of one size and law, solved together in SIMD lanes by the
/// equations of SecularSolver: the same answers as one by one, to rounding. The time is that of
/// the slowest lane, so it pays (see docs/performance.md) if the lanes are problems of a kind. Fill
/// all lanes; a lane that was not set holds no W and is open.
template <class Law, int N, int Width, class Scalar = double>
class SecularBatch {
 public:
  static constexpr int width = Width;
  using Real = Pack<Width, Scalar>;
  using Equation = SecularEquation<Law, N, Real>;
  using Vector = typename Equation::Vector; ///< N packs: b or λ of all lanes

  explicit SecularBatch(const SecularSolver& solver = SecularSolver{}) : solver_(solver) {}

  /// Puts W (N × N, symmetric positive semi-definite) and μ ≥ 0 of one problem into a lane.
  void set(int lane, const Mat<N, Scalar>& w, Scalar friction) {
    const SecularForm<Law, N, Scalar> one = solver_.prepare(Law{}, w, friction);
    const auto l = static_cast<std::size_t>(lane);
    for (std::size_t k = 0; k < N - 1; ++k) {
      for (std::size_t i = 0; i < N - 1; ++i)
        form_.basis[k][i][l] = one.basis[k][i];
      form_.eigenvalues[k][l] = one.eigenvalues[k];
      form_.coupling[k][l] = one.coupling[k];
      form_.compliance[k][l] = one.compliance[k];
      form_.coupling_at_pole[k][l] = one.coupling_at_pole[k];
    }
    form_.normal[l] = one.normal;
    form_.inverse_normal[l] = one.inverse_normal;
    form_.inverse_schur[l] = one.inverse_schur;
    form_.inverse_slope[l] = one.inverse_slope;
    form_.pole[l] = one.pole;
    form_.friction[l] = one.friction;
    form_.scale[l] = one.scale;
  }

  /// Solves all lanes; lambda is the start on entry and the solution on return.
  std::array<LocalReport, static_cast<std::size_t>(Width)> solve(const Vector& b,
                                                                 Vector& lambda) const noexcept {
    const auto outcome = Equation::solve(form_, b, lambda, solver_.params().max_iterations);
    std::array<LocalReport, static_cast<std::size_t>(Width)> reports;
    for (std::size_t l = 0; l < reports.size(); ++l)
      reports[l] = SecularSolver::report<Law, N>(outcome.open[l], outcome.stick[l],
                                                 outcome.iterations, outcome.residual[l]);
    return reports;
  }

 private:
  SecularSolver solver_;
  SecularForm<Law, N, Real> form_{};
};

} // namespace talus
