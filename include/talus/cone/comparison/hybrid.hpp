// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/comparison/fischer_burmeister_newton.hpp"
#include "talus/cone/comparison/quartic.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/types.hpp"

namespace talus {

/// First, and Second where First says that it missed: the paper's choice in 2-D is the closed form
/// with Newton's method behind it. Offers the laws and sizes that both offer. Cost: First's, and
/// Second's times First's share of misses. Use it to compare with the paper.
template <class First = QuarticSolver, class Second = FischerBurmeisterNewton>
class HybridSolver {
 public:
  struct Params {
    typename First::Params first{};
    typename Second::Params second{};
  };

  template <class Law, int N, class Scalar = double>
  struct Prepared {
    typename First::template Prepared<Law, N, Scalar> first;
    typename Second::template Prepared<Law, N, Scalar> second;
  };

  HybridSolver() = default;
  explicit HybridSolver(const Params& params) : first_(params.first), second_(params.second) {}

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law law, const Mat<N, Scalar>& w, Scalar friction) const {
    return {first_.prepare(law, w, friction), second_.prepare(law, w, friction)};
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const Prepared<Law, N, Scalar>& prepared, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    Vec<N, Scalar> first = lambda;
    const LocalReport closed = first_.solve(prepared.first, b, first);
    if (closed.status != LocalStatus::not_converged) {
      lambda = first;
      return closed;
    }
    return second_.solve(prepared.second, b, lambda);
  }

 private:
  First first_{};
  Second second_{};
};

} // namespace talus
