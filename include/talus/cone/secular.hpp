// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/cone/secular_equation.hpp"
#include "talus/core/error.hpp"
#include "talus/core/symmetric_eigen.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace talus {

/// Exact solver for cones of any size: the edge of the cone is found as the root of one scalar
/// equation.
///
/// There γ_T = −α λ_T with α > 0 and γ_N = κ α λ_N, with κ = 0 for Coulomb's law (γ_N = 0) and κ =
/// μ² for the associated one (γ̃ on the edge of the dual cone). With W_TT = Q diag(e) Qᵀ, worked out
/// once, c = Qᵀ w (w = W_TN), a = Qᵀ b_T and r_k = 1/(e_k + α),
/// \f[ D λ_N = n, \quad λ_k = −r_k (a_k + c_k λ_N), \quad
///     D(α) = W_{NN} − κ α − \sum_k c_k^2 r_k, \quad n(α) = \sum_k c_k a_k r_k − b_N, \f]
/// and α is the root of the secular equation
/// \f[ ρ(α) = \frac{μ |n|}{|D λ_T|} = 1. \f]
/// For Coulomb's law D > 0 for all α; the root exists as soon as λ is neither 0 nor −W⁻¹b. For the
/// associated law D has one root α*, and the solution with λ_N > 0 lies below it if n(α*) > 0 and
/// above it otherwise; ρ is smooth across α*. Halley's method inside a bracket finds α; a step or
/// two of Newton's method on all equations at once (λ_T, λ_N, α) give back the digits that the
/// elimination lost.
///
/// W may be singular: where its smallest eigenvalue is not told from rounding, W is raised by a few
/// ε tr W / N (ε: the rounding unit). The answer satisfies the law to some 10 ε, relative to
/// |b| + |W| |λ|, whatever the condition; the report says by how much.
///
/// Cost: an eigendecomposition of size N − 1 to prepare; three products with Q and three to six
/// evaluations of about 30 N operations to solve. Use it unless there is a reason not to.
class SecularSolver {
 public:
  struct Params {
    int max_iterations = 100; ///< bisection alone would need less
  };

  template <class Law, int N, class Scalar = double>
  using Prepared = SecularForm<Law, N, Scalar>;

  SecularSolver() = default;
  /// Throws std::invalid_argument if max_iterations < 1.
  explicit SecularSolver(const Params& params) : params_(params) {
    if (params_.max_iterations < 1)
      throw_invalid("solver.local.max_iterations", params_.max_iterations, "an integer >= 1");
  }
  const Params& params() const { return params_; }

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    constexpr Scalar least = 16 * std::numeric_limits<Scalar>::epsilon();
    constexpr std::size_t m = N - 1;
    Prepared<Law, N, Scalar> p;
    p.friction = friction;
    p.scale = w.trace() / N;
    p.normal = p.inverse_normal = p.inverse_schur = 1;
    p.inverse_slope = 1 / (1 + friction * friction);
    p.eigenvalues.fill(1);
    p.compliance.fill(1);
    if (!(p.scale > 0))
      return p;
    Mat<N - 1, Scalar> tangential;
    for (int c = 0; c < N - 1; ++c)
      for (int r = 0; r < N - 1; ++r)
        tangential(r, c) = w(r + 1, c + 1) / p.scale;
    const SymmetricEigen<N - 1, Scalar> eigen(tangential);
    p.normal = w(0, 0) / p.scale;
    Scalar schur = p.normal, smallest = p.normal;
    for (std::size_t k = 0; k < m; ++k) {
      const int i = static_cast<int>(k);
      p.eigenvalues[k] = eigen.values[i];
      p.coupling[k] = 0;
      for (std::size_t j = 0; j < m; ++j) {
        const int row = static_cast<int>(j);
        p.basis[k][j] = eigen.vectors(row, i);
        p.coupling[k] += p.basis[k][j] * (w(row + 1, 0) / p.scale);
      }
      smallest = std::min(smallest, p.eigenvalues[k]);
      schur -= p.coupling[k] * p.coupling[k] / p.eigenvalues[k];
    }
    // The Schur complement is at least the smallest eigenvalue, unless rounding made W indefinite.
    if (!(smallest > least) || !(schur > least)) {
      p.normal = std::max(p.normal, Scalar(0)) + least;
      for (Scalar& e : p.eigenvalues)
        e = std::max(e, Scalar(0)) + least;
    }
    if constexpr (std::is_same_v<Law, AssociatedLaw>)
      p.pole = find_pole(p);
    schur = p.normal;
    for (std::size_t k = 0; k < m; ++k) {
      p.compliance[k] = 1 / p.eigenvalues[k];
      p.coupling_at_pole[k] = p.coupling[k] / (p.eigenvalues[k] + p.pole);
      schur -= p.coupling[k] * p.coupling[k] * p.compliance[k];
    }
    p.inverse_normal = 1 / p.normal;
    p.inverse_schur = 1 / schur;
    return p;
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const Prepared<Law, N, Scalar>& p, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    using Equation = SecularEquation<Law, N, Scalar>;
    typename Equation::Vector b_array, lambda_array;
    for (int k = 0; k < N; ++k) {
      b_array[static_cast<std::size_t>(k)] = b[k];
      lambda_array[static_cast<std::size_t>(k)] = lambda[k];
    }
    const auto outcome = Equation::solve(p, b_array, lambda_array, params_.max_iterations);
    for (int k = 0; k < N; ++k)
      lambda[k] = lambda_array[static_cast<std::size_t>(k)];
    return report<Law, N>(outcome.open, outcome.stick, outcome.iterations, outcome.residual);
  }

  /// The report of one lane.
  template <class Law, int N, class Scalar>
  static LocalReport report(bool open, bool stick, int iterations, Scalar residual) {
    LocalStatus status = LocalStatus::slide;
    if (!(residual <= SecularEquation<Law, N, Scalar>::miss))
      status = LocalStatus::not_converged;
    else if (open)
      status = LocalStatus::open;
    else if (stick)
      status = LocalStatus::stick;
    return {status, iterations, static_cast<double>(residual)};
  }

 private:
  /// The root of D, which is concave and decreasing there: Newton's method from above never
  /// overshoots.
  template <int N, class Scalar>
  static Scalar find_pole(const Prepared<AssociatedLaw, N, Scalar>& p) {
    const Scalar kappa = p.friction * p.friction;
    if (!(kappa > 0))
      return 0;
    Scalar alpha = p.normal / kappa;
    for (int k = 0; k < 100; ++k) {
      Scalar d = p.normal - kappa * alpha, slope = -kappa;
      for (std::size_t i = 0; i < N - 1; ++i) {
        const Scalar cr = p.coupling[i] / (p.eigenvalues[i] + alpha);
        d -= cr * p.coupling[i];
        slope += cr * cr;
      }
      const Scalar next = alpha - d / slope;
      if (!(next < alpha * (1 - 4 * std::numeric_limits<Scalar>::epsilon())) || !(next > 0))
        break;
      alpha = next;
    }
    return alpha;
  }

  Params params_{};
};

} // namespace talus
