// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <concepts>

namespace talus {

enum class LocalStatus : unsigned char {
  open,          ///< λ = 0
  stick,         ///< λ inside the cone, no (shifted) motion
  slide,         ///< λ on the edge of the cone
  not_converged, ///< the solver missed its tolerance; λ is its best iterate
};

/// What a local solver says about one solve.
struct LocalReport {
  LocalStatus status = LocalStatus::open;
  int iterations = 0;
  double residual = 0; ///< of the solver's own stopping test, dimensionless; 0 for closed forms
};

/// What LocalSolver and LocalStep have in common: Params, Prepared and prepare.
template <class S, class Law, int N>
concept PreparesCone = std::constructible_from<S, const typename S::Params&> &&
    std::default_initializable<typename S::template Prepared<Law, N>> &&
    requires(const S s, const Mat<N> w) {
  { s.prepare(Law{}, w, 0.5) } -> std::same_as<typename S::template Prepared<Law, N>>;
};

/// A solver of one cone: find λ with γ = W λ + b and (γ, λ) in Law. A model S has
///   - `S::Params`, an aggregate that S is constructible from;
///   - `S::Prepared<Law, N>`, default constructible: all that can be worked out from W and μ alone,
///     which do not change within a time step;
///   - `s.prepare(Law{}, W, mu)` → Prepared (W: N × N, symmetric positive semi-definite; mu ≥ 0);
///   - `s.solve(prepared, b, lambda)` → LocalReport, noexcept: λ is a start on entry, the solution
///   on
///     return.
/// Models: SecularSolver (exact, any size), FischerBurmeisterNewton (the paper's),
/// QuarticSolver and HybridSolver (size 3), ContactSolver (isotropic W), ProjectionSolver. Which
/// when, and how to write one: docs/local_solvers.md.
template <class S, class Law, int N>
concept LocalSolver = PreparesCone<S, Law, N> &&
    requires(const S s, const typename S::template Prepared<Law, N> prepared, const Vec<N> b,
             Vec<N>& lambda) {
  { s.solve(prepared, b, lambda) }
  noexcept->std::same_as<LocalReport>;
};

/// What may take a local solver's place in a sweep: one step towards the solution instead of all of
/// the way. A model S has Params, Prepared and prepare as a LocalSolver has, and
///   - `s.step(prepared, gamma, lambda)`, noexcept: improves λ, given γ = W λ + b at the λ on
///   entry;
///     leaves λ as it is if and only if that is the solution.
/// Models: ProjectionStep, LaggingSlipStep.
template <class S, class Law, int N>
concept LocalStep = PreparesCone<S, Law, N> &&
    requires(const S s, const typename S::template Prepared<Law, N> prepared, const Vec<N> gamma,
             Vec<N>& lambda) {
  { s.step(prepared, gamma, lambda) }
  noexcept;
};

/// Prepares and solves in one go.
template <class S, class Law, int N>
LocalReport solve_local(const S& solver, Law law, const Mat<N>& w, const Vec<N>& b, double friction,
                        Vec<N>& lambda) {
  return solver.solve(solver.prepare(law, w, friction), b, lambda);
}

} // namespace talus
