// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/error.hpp"
#include "talus/core/types.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace talus {

/// Generalised Newton's method on f_MFB(W λ + b, λ) = 0 with a line search on |f|²/2, the local
/// solver of Rousseau et al. 2023 (after Daviet, Bertails-Descoubes & Boissieux 2011), for any size
/// of cone and both laws. Quadratic convergence near a regular solution. Starts from the given λ,
/// and again from P_K(−b) and from zero if that stalls; returns the best iterate and says
/// whether it met the tolerance. f_MFB weighs the normal complementarity by μ, so for small μ that
/// is met to tolerance/μ only. Use it to compare with the paper; SecularSolver is faster and does
/// not miss.
class FischerBurmeisterNewton {
 public:
  struct Params {
    double tolerance = 1e-12; ///< for |f|, relative to the scale of b (and of λ)
    int max_iterations = 60;  ///< per start
  };

  /// W and μ in units of `scale`.
  template <class Law, int N, class Scalar = double>
  struct Prepared {
    Mat<N, Scalar> w = Mat<N, Scalar>::Identity(); ///< W / scale
    Scalar scale = 0;                              ///< tr W / N
    Scalar friction = 0;                           ///< μ
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
      p.w = w / p.scale;
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
    const Vec<N, Scalar> b_scaled = b / size;
    Iterate<Law, N, Scalar> best(p, b_scaled, lambda / unit);
    int iterations = newton(p, b_scaled, best);
    for (int attempt = 0; attempt < 2 && !met(best); ++attempt) {
      Vec<N, Scalar> start = Vec<N, Scalar>::Zero();
      if (attempt == 0)
        start = project_on_cone<N, Scalar>(-b_scaled, p.friction);
      Iterate<Law, N, Scalar> other(p, b_scaled, start);
      iterations += newton(p, b_scaled, other);
      if (other.merit < best.merit)
        best = other;
    }
    lambda = best.lambda * unit;
    return {met(best) ? classify(best, p.friction) : LocalStatus::not_converged, iterations,
            static_cast<double>(std::sqrt(best.merit) / best.size())};
  }

 private:
  template <class Law, int N, class Scalar>
  struct Iterate {
    Vec<N, Scalar> lambda, gamma, f;
    Scalar merit; ///< |f|²

    Iterate(const Prepared<Law, N, Scalar>& p, const Vec<N, Scalar>& b, const Vec<N, Scalar>& start)
        : lambda(start), gamma(p.w * start + b), f(law_residual(Law{}, gamma, lambda, p.friction)),
          merit(f.squaredNorm()) {}
    Scalar size() const { return 1 + lambda.norm(); }
  };

  template <class State>
  bool met(const State& state) const {
    return std::sqrt(state.merit) <= params_.tolerance * state.size();
  }

  template <class Law, int N, class Scalar>
  static LocalStatus classify(const Iterate<Law, N, Scalar>& state, Scalar friction) {
    const Scalar tangent = state.lambda.template tail<N - 1>().norm();
    if (state.lambda.norm() <= std::sqrt(state.merit))
      return LocalStatus::open;
    return tangent < friction * state.lambda[0] * (1 - Scalar(1e-6)) ? LocalStatus::stick
                                                                     : LocalStatus::slide;
  }

  /// Runs from `state` until it meets the tolerance or stalls; returns the number of iterations.
  template <class Law, int N, class Scalar>
  int newton(const Prepared<Law, N, Scalar>& p, const Vec<N, Scalar>& b,
             Iterate<Law, N, Scalar>& state) const noexcept {
    int iterations = 0;
    while (iterations < params_.max_iterations && !met(state) && std::isfinite(state.merit)) {
      ++iterations;
      const Mat<N, Scalar> jacobian = derivative<Law>(p, state);
      Vec<N, Scalar> step = jacobian.partialPivLu().solve(-state.f);
      const Vec<N, Scalar> gradient = jacobian.transpose() * state.f;
      if (!step.allFinite() || !(gradient.dot(step) < 0))
        step = -gradient;
      const Scalar slope = gradient.dot(step);
      if (!(slope < 0))
        break;
      Scalar length = 1;
      Iterate<Law, N, Scalar> next(p, b, state.lambda + step);
      while (!(next.merit <= state.merit + Scalar(2e-4) * length * slope) &&
             length > Scalar(1e-10)) {
        length /= 2;
        next = Iterate<Law, N, Scalar>(p, b, state.lambda + length * step);
      }
      if (!(next.merit < state.merit))
        break;
      state = next;
    }
    return iterations;
  }

  /// An element of the generalised Jacobian of λ ↦ f(ĝ, λ̂).
  template <class Law, int N, class Scalar>
  static Mat<N, Scalar> derivative(const Prepared<Law, N, Scalar>& p,
                                   const Iterate<Law, N, Scalar>& state) {
    const Scalar mu = p.friction;
    if (!(mu > 0)) {
      Mat<N, Scalar> j = Mat<N, Scalar>::Identity();
      const Scalar size = std::hypot(state.gamma[0], state.lambda[0]);
      const Scalar dx = 1 - (size > 0 ? state.gamma[0] / size : std::sqrt(Scalar(0.5)));
      const Scalar dy = 1 - (size > 0 ? state.lambda[0] / size : std::sqrt(Scalar(0.5)));
      j.row(0) = dx * p.w.row(0);
      j(0, 0) += dy;
      return j;
    }
    Vec<N, Scalar> x = state.gamma, y = state.lambda; // ĝ and λ̂
    Mat<N, Scalar> dx = p.w;                          // dĝ/dλ
    dx.template bottomRows<N - 1>() *= mu;
    x.template tail<N - 1>() *= mu;
    y[0] *= mu;
    if constexpr (std::is_same_v<Law, CoulombLaw>) {
      const Scalar tangent = state.gamma.template tail<N - 1>().norm();
      x[0] += mu * tangent;
      // where γ_T = 0, 0 is in the subdifferential of its norm
      if (tangent > 0)
        dx.row(0) += (mu / tangent) * (state.gamma.template tail<N - 1>().transpose() *
                                       p.w.template bottomRows<N - 1>());
    }
    // f = x + y − s with s∘s = z = x∘x + y∘y, so L_s ds = L_x dx + L_y dy.
    const Scalar larger = std::max(x.norm(), y.norm());
    const Scalar zero_norm = x.squaredNorm() + y.squaredNorm();
    const Vec<N - 1, Scalar> z_t =
        2 * (x[0] * x.template tail<N - 1>() + y[0] * y.template tail<N - 1>());
    const Scalar difference = std::max(Scalar(0), zero_norm - z_t.norm());
    // On the edge L_s is singular; a point at a rounding-sized distance inside gives a valid
    // element.
    const Scalar low = std::max(std::sqrt(difference),
                                std::numeric_limits<Scalar>::epsilon() * (larger > 0 ? larger : 1));
    const Scalar high = std::max(low, std::sqrt(zero_norm + z_t.norm()));
    const Scalar s0 = (low + high) / 2;
    const Vec<N - 1, Scalar> direction = z_t.norm() > 0
                                             ? Vec<N - 1, Scalar>(z_t / z_t.norm())
                                             : Vec<N - 1, Scalar>(Vec<N - 1, Scalar>::Zero());
    const Vec<N - 1, Scalar> s_t = (high - low) / 2 * direction;
    // L_s⁻¹ applied to the arrow matrices of x and y
    const Scalar det = low * high;
    Mat<N, Scalar> inverse;
    inverse(0, 0) = s0 / det;
    inverse.template topRightCorner<1, N - 1>() = -s_t.transpose() / det;
    inverse.template bottomLeftCorner<N - 1, 1>() = -s_t / det;
    inverse.template bottomRightCorner<N - 1, N - 1>() =
        (Mat<N - 1, Scalar>::Identity() + s_t * s_t.transpose() / det) / s0;
    const Mat<N, Scalar> px = Mat<N, Scalar>::Identity() - inverse * arrow(x);
    Mat<N, Scalar> py = Mat<N, Scalar>::Identity() - inverse * arrow(y);
    py.col(0) *= mu; // dλ̂/dλ
    return px * dx + py;
  }

  /// L_x: y ↦ x∘y.
  template <int N, class Scalar>
  static Mat<N, Scalar> arrow(const Vec<N, Scalar>& x) {
    Mat<N, Scalar> l = x[0] * Mat<N, Scalar>::Identity();
    l.template topRightCorner<1, N - 1>() = x.template tail<N - 1>().transpose();
    l.template bottomLeftCorner<N - 1, 1>() = x.template tail<N - 1>();
    return l;
  }

  Params params_{};
};

} // namespace talus
