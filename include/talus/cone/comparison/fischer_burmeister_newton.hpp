// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace talus {

/// Generalised Newton's method on the Fischer–Burmeister function, with a line search on |f|²/2:
/// \f[ f_{MFB}(W λ + b, λ) = 0, \f]
/// the local solver of Rousseau et al. 2023 (after Daviet, Bertails-Descoubes & Boissieux 2011),
/// for any size of cone and both laws. Quadratic convergence near a regular solution. Starts from
/// the given λ, and again from P_K(−b) and from zero if that stalls; returns the best iterate and
/// says whether it met the tolerance. f_MFB weighs the normal complementarity by μ, so for small μ
/// that is met to tolerance/μ only. Use it to compare with the paper; SecularSolver is faster and
/// does not miss.
class FischerBurmeisterNewton {
 public:
  struct Params {
    double tolerance = 1e-12; ///< for |f|, relative to the scale of b (and of λ)
    int max_iterations = 60;  ///< per start
  };

  /// Vectors of N numbers and N equations with their right-hand sides, filled with zeros so that
  /// all loads and stores are of whole registers: a load of what was stored in parts waits for it.
  template <int N>
  static constexpr int width = (N + 4) / 4 * 4;
  template <int N, class Scalar>
  using Padded = Vec<width<N>, Scalar>;
  template <int N, class Scalar>
  using Rows = RectMat<width<N>, N, Scalar>; ///< one equation a column, entry N its right side

  /// W and μ in units of `scale`.
  template <class Law, int N, class Scalar = double>
  struct Prepared {
    Rows<N, Scalar> w = Rows<N, Scalar>::Zero(); ///< W / scale
    Scalar scale = 0;                            ///< tr W / N
    Scalar friction = 0;                         ///< μ
  };

  FischerBurmeisterNewton() = default;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit FischerBurmeisterNewton(const Params& params) : params_(params) {
    require_positive("solver.local.tolerance", params_.tolerance);
    if (params_.max_iterations < 1)
      throw_invalid("solver.local.max_iterations", params_.max_iterations, "an integer >= 1");
  }

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    Prepared<Law, N, Scalar> p;
    p.scale = w.trace() / N;
    p.friction = friction;
    if (p.scale > 0)
      p.w.template topRows<N>() = w / p.scale;
    return p;
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const Prepared<Law, N, Scalar>& p, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    const Scalar size = b.cwiseAbs().maxCoeff();
    if (!(size > 0) || !(p.scale > 0)) {
      lambda.setZero();
      return {LocalStatus::open, 0, 0};
    }
    const Scalar unit = size / p.scale;
    Padded<N, Scalar> b_scaled = Padded<N, Scalar>::Zero(), start = b_scaled;
    b_scaled.template head<N>() = b / size;
    start.template head<N>() = lambda / unit;
    Iterate<Law, N, Scalar> best(p, b_scaled, start);
    int iterations = newton(p, b_scaled, best);
    for (int attempt = 0; attempt < 2 && !met(best); ++attempt) {
      start.setZero();
      if (attempt == 0)
        start.template head<N>() = project_on_cone<N, Scalar>(-b / size, p.friction);
      Iterate<Law, N, Scalar> other(p, b_scaled, start);
      iterations += newton(p, b_scaled, other);
      if (other.merit < best.merit)
        best = other;
    }
    lambda = best.lambda.template head<N>() * unit;
    return {met(best) ? classify(best, p.friction) : LocalStatus::not_converged, iterations,
            static_cast<double>(std::sqrt(best.merit) / best.size())};
  }

 private:
  /// λ, and f = f_MFB(W λ + b, λ) there.
  template <class Law, int N, class Scalar>
  struct Iterate {
    Padded<N, Scalar> lambda, gamma, f;
    Scalar merit; ///< |f|²

    Iterate(const Prepared<Law, N, Scalar>& p, const Padded<N, Scalar>& b,
            const Padded<N, Scalar>& start)
        : lambda(start), gamma(b) {
      for (int j = 0; j < N; ++j)
        gamma += lambda[j] * p.w.col(j);
      f = residual<Law, N, Scalar>(gamma, lambda, p.friction);
      merit = f.squaredNorm();
    }
    Scalar size() const { return 1 + lambda.norm(); }
  };

  /// The identity: e_k, in whole registers, is its column k.
  template <class Vector>
  static Eigen::Map<const Vector> unit(int k) {
    constexpr std::size_t size = static_cast<std::size_t>(Vector::RowsAtCompileTime);
    using Scalar = typename Vector::Scalar;
    static constexpr auto identity = [] {
      std::array<Scalar, size * size> entries{};
      for (std::size_t i = 0; i < size; ++i)
        entries[i * size + i] = 1;
      return entries;
    }();
    return Eigen::Map<const Vector>(identity.data() + static_cast<std::size_t>(k) * size);
  }

  /// ĝ = (γ̃_N, μ γ̃_T) and λ̂ = (μ λ_N, λ_T).
  template <class Law, int N, class Scalar>
  static void hats(const Padded<N, Scalar>& gamma, const Padded<N, Scalar>& lambda, Scalar mu,
                   Padded<N, Scalar>& x, Padded<N, Scalar>& y) {
    const Padded<N, Scalar> gamma_t = tangential(gamma);
    Scalar normal = gamma[0];
    if constexpr (std::is_same_v<Law, CoulombLaw>)
      normal += mu * gamma_t.norm();
    x = mu * gamma_t + normal * unit<Padded<N, Scalar>>(0);
    y = tangential(lambda) + (mu * lambda[0]) * unit<Padded<N, Scalar>>(0);
  }

  /// law_residual() for numbers near one.
  template <class Law, int N, class Scalar>
  static Padded<N, Scalar> residual(const Padded<N, Scalar>& gamma, const Padded<N, Scalar>& lambda,
                                    Scalar mu) {
    if (!(mu > Scalar(1e-30))) {
      Padded<N, Scalar> f = Padded<N, Scalar>::Zero();
      f.template head<N>() =
          law_residual<N, Scalar>(Law{}, gamma.template head<N>(), lambda.template head<N>(), mu);
      return f;
    }
    Padded<N, Scalar> x, y;
    hats<Law, N, Scalar>(gamma, lambda, mu, x, y);
    return fischer_burmeister_unscaled<width<N>, Scalar>(x, y); // zeros stay zeros
  }

  template <class State>
  bool met(const State& state) const {
    return std::sqrt(state.merit) <= params_.tolerance * state.size();
  }

  template <class Law, int N, class Scalar>
  static LocalStatus classify(const Iterate<Law, N, Scalar>& state, Scalar friction) {
    const Scalar tangent = tangential(state.lambda).norm();
    if (state.lambda.norm() <= std::sqrt(state.merit))
      return LocalStatus::open;
    return tangent < friction * state.lambda[0] * (1 - Scalar(1e-6)) ? LocalStatus::stick
                                                                     : LocalStatus::slide;
  }

  /// Runs from `state` until it meets the tolerance or stalls; returns the number of iterations.
  template <class Law, int N, class Scalar>
  int newton(const Prepared<Law, N, Scalar>& p, const Padded<N, Scalar>& b,
             Iterate<Law, N, Scalar>& state) const noexcept {
    int iterations = 0;
    while (iterations < params_.max_iterations && !met(state) && std::isfinite(state.merit)) {
      ++iterations;
      // J = L_s⁻¹ A, so J d = −f is A d = −L_s f, and the slope of |f|²/2 along d is −|f|².
      Padded<N, Scalar> s, step = Padded<N, Scalar>::Zero();
      const Rows<N, Scalar> a = equations(p, state, s);
      if (eliminate<N, Scalar>(a, step) && search(p, b, state, step, -state.merit))
        continue;
      // singular, or nearly: down the gradient Jᵀ f = Aᵀ L_s⁻¹ f
      const Padded<N, Scalar> quotient = jordan_quotient(state.f, s);
      step.setZero();
      for (int i = 0; i < N; ++i)
        step.template head<N>() -= quotient[i] * a.col(i).template head<N>();
      if (!search(p, b, state, step, -step.squaredNorm()))
        break;
    }
    return iterations;
  }

  /// Halves the step until |f|² falls enough. False, and `state` as it was, if it does not fall.
  template <class Law, int N, class Scalar>
  static bool search(const Prepared<Law, N, Scalar>& p, const Padded<N, Scalar>& b,
                     Iterate<Law, N, Scalar>& state, const Padded<N, Scalar>& step,
                     Scalar slope) noexcept {
    if (!step.allFinite() || !(slope < 0))
      return false;
    for (Scalar length = 1; length > Scalar(1e-10); length /= 2) {
      const Iterate<Law, N, Scalar> next(p, b, state.lambda + length * step);
      if (next.merit < state.merit && next.merit <= state.merit + Scalar(2e-4) * length * slope) {
        state = next;
        return true;
      }
    }
    return false;
  }

  /// x∘y = (x·y, x_N y_T + y_N x_T).
  template <class Vector>
  static Vector jordan_product(const Vector& x, const Vector& y) {
    return x[0] * tangential(y) + y[0] * tangential(x) + x.dot(y) * unit<Vector>(0);
  }

  /// The y with s∘y = x, for s inside the cone.
  template <class Vector>
  static Vector jordan_quotient(const Vector& x, const Vector& s) {
    const Vector s_t = tangential(s);
    const auto tangent = s_t.norm(), det = (s[0] - tangent) * (s[0] + tangent);
    const auto normal = (s[0] * x[0] - s_t.dot(x)) / det;
    return (tangential(x) - normal * s_t) / s[0] + normal * unit<Vector>(0);
  }

  /// x = A⁻¹ r by Gauss–Jordan elimination. Rows are swapped only where the pivot is a tenth of the
  /// largest or less, so that the search for that one is seldom waited for. False if a pivot
  /// vanishes.
  template <int N, class Scalar>
  static bool eliminate(Rows<N, Scalar> a, Padded<N, Scalar>& x) noexcept {
    for (int k = 0; k < N; ++k) {
      int largest = k;
      for (int i = k + 1; i < N; ++i)
        if (std::abs(a(k, i)) > std::abs(a(k, largest)))
          largest = i;
      if (std::abs(a(k, k)) <= Scalar(0.1) * std::abs(a(k, largest)))
        a.col(k).swap(a.col(largest));
      if (!(std::abs(a(k, k)) > 0))
        return false;
      const Padded<N, Scalar> pivot = a.col(k) * (1 / a(k, k));
      for (int i = 0; i < N; ++i)
        a.col(i) = i == k ? pivot : Padded<N, Scalar>(a.col(i) - a(k, i) * pivot);
    }
    for (int i = 0; i < N; ++i)
      x[i] = a(N, i);
    return true;
  }

  /// The rows of A d = −L_s f and s, where A = L_s J and J is an element of the generalised
  /// Jacobian of λ ↦ f = x + y − s with x = ĝ, y = λ̂, s∘s = x∘x + y∘y: from L_s ds = L_x dx + L_y
  /// dy, A = L_{s−x} dx + L_{s−y} dy.
  template <class Law, int N, class Scalar>
  static Rows<N, Scalar> equations(const Prepared<Law, N, Scalar>& p,
                                   const Iterate<Law, N, Scalar>& state, Padded<N, Scalar>& s) {
    using Vector = Padded<N, Scalar>;
    const Scalar mu = p.friction;
    Rows<N, Scalar> a;
    if (!(mu > 0)) { // f = (x_N + y_N − hypot(x_N, y_N), λ_T): no product, s = e_N
      s = unit<Vector>(0);
      const Scalar size = std::hypot(state.gamma[0], state.lambda[0]);
      const Scalar dx = 1 - (size > 0 ? state.gamma[0] / size : std::sqrt(Scalar(0.5)));
      const Scalar dy = 1 - (size > 0 ? state.lambda[0] / size : std::sqrt(Scalar(0.5)));
      for (int i = 0; i < N; ++i)
        a.col(i) = (i == 0 ? Vector(dx * p.w.col(0) + dy * unit<Vector>(0)) : unit<Vector>(i)) -
                   state.f[i] * unit<Vector>(N);
      return a;
    }
    Vector x, y;
    hats<Law, N, Scalar>(state.gamma, state.lambda, mu, x, y);
    s = x + y - state.f;
    // On the edge L_s is singular; a point at a rounding-sized distance inside gives a valid
    // element.
    const Scalar larger = std::max(x.norm(), y.norm());
    const Scalar least =
        tangential(s).norm() + std::numeric_limits<Scalar>::epsilon() * (larger > 0 ? larger : 1);
    s = tangential(s) + std::max(s[0], least) * unit<Vector>(0);
    const Vector u = s - x, v = s - y, right = jordan_product(s, state.f);
    Vector first = p.w.col(0); // dĝ_N/dλ; W is symmetric: its columns are its rows
    if constexpr (std::is_same_v<Law, CoulombLaw>) {
      const Vector gamma_t = tangential(state.gamma);
      const Scalar tangent = gamma_t.norm();
      if (tangent > 0) // where γ_T = 0, 0 is in the subdifferential of its norm
        for (int i = 1; i < N; ++i)
          first += (mu / tangent * gamma_t[i]) * p.w.col(i);
    }
    // dλ̂/dλ = diag(μ, 1, …)
    Vector top =
        u[0] * first + tangential(v) + (mu * v[0]) * unit<Vector>(0) - right[0] * unit<Vector>(N);
    for (int i = 1; i < N; ++i) {
      top += (mu * u[i]) * p.w.col(i);
      a.col(i) = (u[0] * mu) * p.w.col(i) + u[i] * first + v[0] * unit<Vector>(i) +
                 (mu * v[i]) * unit<Vector>(0) - right[i] * unit<Vector>(N);
    }
    a.col(0) = top;
    return a;
  }

  Params params_{};
};

} // namespace talus
