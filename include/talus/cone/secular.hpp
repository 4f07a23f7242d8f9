// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/core/types.hpp"

#include <Eigen/Eigenvalues>

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
///   D λ_N = n,  λ_k = −r_k (a_k + c_k λ_N),
///   D(α) = W_NN − κ α − Σ c_k² r_k,  n(α) = Σ c_k a_k r_k − b_N,
/// and α is the root of |λ_T| = μ λ_N. For Coulomb's law D > 0 for all α; the root exists as soon
/// as λ is neither 0 nor −W⁻¹b. For the associated law D has one root α*, and the solution with λ_N
/// > 0 lies below it if n(α*) > 0 and above it otherwise. Found by Newton's method on the ratio μ
/// |n| / |D λ_T| = 1, which is smooth across α*, inside a bracket.
///
/// W may be singular: where the Schur complement W_NN − Σ c_k²/e_k is below 8 sqrt(ε) of its terms,
/// where rounding would drown it, W_NN is raised to make it so; ε: the rounding unit. So answers
/// are exact to rounding for W of a condition up to some 1e7, and those of a matrix within 1.2e-7
/// of W (in double precision) beyond.
///
/// Cost: an eigendecomposition of size N − 1 to prepare; two products with Q and a few iterations
/// of about 10 N operations to solve.
class SecularSolver {
 public:
  struct Params {
    int max_iterations = 100; ///< bisection alone would need less
  };

  /// The law's share of W: the arrow matrix [W_NN cᵀ; c diag(e)] and its basis, in units of
  /// `scale`.
  template <class Law, int N, class Scalar = double>
  struct Prepared {
    Mat<N - 1, Scalar> basis;       ///< Q
    Vec<N - 1, Scalar> eigenvalues; ///< e
    Vec<N - 1, Scalar> coupling;    ///< c
    Scalar normal = 1;              ///< W_NN
    Scalar pole = 0;                ///< α* (associated law)
    Scalar friction = 0;            ///< μ
    Scalar scale = 0;               ///< tr W / N
  };

  SecularSolver() = default;
  explicit SecularSolver(const Params& params) : params_(params) {}

  template <class Law, int N, class Scalar>
  Prepared<Law, N, Scalar> prepare(Law, const Mat<N, Scalar>& w, Scalar friction) const {
    constexpr Scalar slack = 16 * std::numeric_limits<Scalar>::epsilon();
    Prepared<Law, N, Scalar> p;
    p.friction = friction;
    p.scale = w.trace() / N;
    if (!(p.scale > 0)) {
      p.basis.setIdentity();
      p.eigenvalues.setOnes();
      p.coupling.setZero();
      return p;
    }
    const Eigen::SelfAdjointEigenSolver<Mat<N - 1, Scalar>> eigen(
        w.template bottomRightCorner<N - 1, N - 1>() / p.scale);
    p.basis = eigen.eigenvectors();
    p.coupling = p.basis.transpose() * w.template bottomLeftCorner<N - 1, 1>() / p.scale;
    const Scalar largest = eigen.eigenvalues().maxCoeff();
    p.eigenvalues = eigen.eigenvalues().cwiseMax(slack * largest);
    // D(0), the Schur complement, must stand clear of the rounding of its own terms.
    p.normal = w(0, 0) / p.scale;
    if (largest > 0)
      p.normal = std::max(p.normal, (1 + least<Scalar>()) *
                                        p.coupling.cwiseAbs2().cwiseQuotient(p.eigenvalues).sum());
    if constexpr (std::is_same_v<Law, AssociatedLaw>)
      p.pole = find_pole(p);
    return p;
  }

  template <class Law, int N, class Scalar>
  LocalReport solve(const Prepared<Law, N, Scalar>& p, const Vec<N, Scalar>& b,
                    Vec<N, Scalar>& lambda) const noexcept {
    constexpr bool associated = std::is_same_v<Law, AssociatedLaw>;
    const Scalar size = b.cwiseAbs().maxCoeff(), mu = p.friction;
    if (!(size > 0) || !(p.scale > 0)) {
      lambda.setZero();
      return {LocalStatus::open, 0, 0};
    }
    const Scalar b_n = b[0] / size;
    const Vec<N - 1, Scalar> a = p.basis.transpose() * (b.template tail<N - 1>() / size);
    if (associated ? mu * a.norm() <= b_n : b_n >= 0) {
      lambda.setZero();
      return {LocalStatus::open, 0, 0};
    }
    const Scalar unit = size / p.scale;
    if (!(mu > 0)) {
      lambda.setZero();
      lambda[0] = -b_n / p.normal * unit;
      return {LocalStatus::slide, 0, 0};
    }

    Edge<N, Scalar> edge(p, a, b_n, associated ? mu * mu : Scalar(0));
    edge.evaluate(0);
    if (edge.determinant > 0 && edge.tangent.norm() <= mu * edge.numerator) {
      const Vec<N - 1, Scalar> stick = edge.tangent / edge.determinant;
      write(p, stick, edge.numerator / edge.determinant, unit, lambda);
      return {LocalStatus::stick, 0, 0};
    }
    // Where is the root, and from where do we look for it? From the α of the start if it has one.
    Scalar low = 0, high = std::numeric_limits<Scalar>::infinity(), sign = 1;
    Scalar alpha = start<Scalar, N>(p, a, lambda / unit);
    if constexpr (associated) {
      edge.evaluate(p.pole);
      if (edge.numerator > 0) {
        high = p.pole;
      } else {
        low = p.pole;
        sign = -1;
      }
    }
    if (!(alpha > low && alpha < high))
      alpha = high < std::numeric_limits<Scalar>::infinity() ? high * Scalar(0.75)
                                                             : low * 2 + Scalar(0.1);

    using std::abs;
    constexpr Scalar tolerance = 32 * std::numeric_limits<Scalar>::epsilon();
    int iterations = 0;
    bool converged = false;
    while (!converged && iterations < params_.max_iterations) {
      ++iterations;
      edge.evaluate(alpha);
      const Scalar tangent = edge.tangent.norm(), normal = mu * sign * edge.numerator;
      converged = abs(normal - tangent) <= tolerance * tangent;
      if (converged)
        break;
      // Inside the cone (ratio > 1) the root is on the side away from the pole.
      const bool inside = normal > tangent;
      (inside == (sign > 0) ? high : low) = alpha;
      const Scalar tangent_slope = edge.tangent.dot(edge.tangent_slope) / tangent;
      const Scalar slope = mu * sign * edge.numerator_slope - normal * tangent_slope / tangent;
      Scalar next = alpha - (normal - tangent) / slope;
      if (!(next > low && next < high))
        next = high < std::numeric_limits<Scalar>::infinity() ? between(low, high) : 4 * alpha;
      converged = abs(next - alpha) <= tolerance / 8 * alpha || high - low <= tolerance / 8 * low;
      alpha = next;
    }
    edge.evaluate(alpha);
    const Scalar lambda_n = edge.normal_on_edge();
    const Vec<N - 1, Scalar> lambda_t = edge.tangent_for(lambda_n);
    write(p, lambda_t, lambda_n, unit, lambda);
    const Scalar off_edge = abs(lambda_t.norm() - mu * lambda_n) / (mu * lambda_n);
    const Scalar residual = std::max(off_edge, edge.imbalance(lambda_n));
    // What is left where rounding drowns the equation; a miss is a matter of ones, not of
    // this.
    const bool solved = lambda_n >= 0 && residual <= 8 * least<Scalar>();
    return {solved ? LocalStatus::slide : LocalStatus::not_converged, iterations,
            static_cast<double>(residual)};
  }

 private:
  /// The smallest Schur complement that is told from rounding, relative to its terms.
  template <class Scalar>
  static Scalar least() {
    return 8 * std::sqrt(std::numeric_limits<Scalar>::epsilon());
  }

  /// The quantities of the class comment at one α, both sides of D λ = ... multiplied out.
  template <int N, class Scalar>
  struct Edge {
    using Tangent = Eigen::Array<Scalar, N - 1, 1>;
    const Tangent e, c, a;
    const Scalar w_n, b_n, kappa, mu;
    Tangent r;
    Scalar determinant = 0, numerator = 0, numerator_slope = 0; ///< D, n, dn/dα
    Vec<N - 1, Scalar> tangent, tangent_slope;                  ///< D λ_T and its derivative

    template <class Prepared>
    Edge(const Prepared& p, const Vec<N - 1, Scalar>& a_, Scalar b_n_, Scalar kappa_)
        : e(p.eigenvalues.array()), c(p.coupling.array()), a(a_.array()), w_n(p.normal), b_n(b_n_),
          kappa(kappa_), mu(p.friction) {}

    void evaluate(Scalar alpha) {
      r = (e + alpha).inverse();
      const Tangent cr = c * r;
      determinant = w_n - kappa * alpha - (c * cr).sum();
      numerator = (a * cr).sum() - b_n;
      const Scalar determinant_slope = cr.square().sum() - kappa;
      numerator_slope = -(cr * a * r).sum();
      const Tangent t = -(determinant * a + numerator * c) * r;
      tangent = t.matrix();
      tangent_slope = (-(determinant_slope * a + numerator_slope * c + t) * r).matrix();
    }

    Vec<N - 1, Scalar> tangent_for(Scalar lambda_n) const {
      return (-(a + c * lambda_n) * r).matrix();
    }

    /// How far D λ_N = n is from holding, relative to its terms.
    Scalar imbalance(Scalar lambda_n) const {
      using std::abs;
      return abs(determinant * lambda_n - numerator) /
             ((a * c * r).abs().sum() + abs(b_n) + w_n * lambda_n);
    }

    /// λ_N at the root: n/D, unless both nearly vanish (α ≈ α*); then from |λ_T| = μ λ_N itself, a
    /// quadratic equation that stays well-behaved.
    Scalar normal_on_edge() const {
      using std::abs, std::max, std::sqrt;
      const Scalar quotient = numerator / determinant;
      const Tangent r2 = r.square();
      const Scalar q2 = (r2 * c * c).sum() - mu * mu;
      if (kappa == 0 || q2 >= 0 ||
          abs(numerator) > Scalar(0.1) * ((a * c * r).abs().sum() + abs(b_n)))
        return quotient;
      const Scalar q1 = (r2 * c * a).sum(), q0 = (r2 * a * a).sum();
      const Scalar root = sqrt(max(Scalar(0), q1 * q1 - q2 * q0));
      const Scalar q = -(q1 + (q1 < 0 ? -root : root));
      const Scalar first = q / q2, second = q0 / q;
      // The cone is met once where λ_N > 0 if q2 < 0 (the direction of α* points into the cone).
      return max(first, second);
    }
  };

  /// A point between the ends of a bracket that may span many powers of ten, or reach down to 0.
  template <class Scalar>
  static Scalar between(Scalar low, Scalar high) {
    if (!(low > 0))
      return high / 256;
    return high > 4 * low ? std::sqrt(low) * std::sqrt(high) : (low + high) / 2;
  }

  /// α of a start λ (in the solver's units): what makes λ_T best fit (e + α) λ_T = −(a + c λ_N).
  template <class Scalar, int N, class Prepared>
  static Scalar start(const Prepared& p, const Vec<N - 1, Scalar>& a,
                      const Vec<N, Scalar>& lambda) {
    const Vec<N - 1, Scalar> t = p.basis.transpose() * lambda.template tail<N - 1>();
    const Scalar tt = t.squaredNorm();
    return tt > 0 ? -(t.dot(a + p.coupling * lambda[0] + p.eigenvalues.cwiseProduct(t))) / tt
                  : Scalar(-1);
  }

  /// The root of D, which is concave and decreasing there: Newton's method from above never
  /// overshoots.
  template <int N, class Scalar>
  static Scalar find_pole(const Prepared<AssociatedLaw, N, Scalar>& p) {
    const Scalar kappa = p.friction * p.friction;
    if (!(kappa > 0))
      return 0;
    Scalar alpha = p.normal / kappa;
    for (int k = 0; k < 100; ++k) {
      const Vec<N - 1, Scalar> cr =
          p.coupling.cwiseQuotient((p.eigenvalues.array() + alpha).matrix());
      const Scalar d = p.normal - kappa * alpha - cr.dot(p.coupling);
      const Scalar next = alpha - d / (cr.squaredNorm() - kappa);
      if (!(next < alpha * (1 - 4 * std::numeric_limits<Scalar>::epsilon())) || !(next > 0))
        break;
      alpha = next;
    }
    return alpha;
  }

  template <class Prepared, int M, int N, class Scalar>
  static void write(const Prepared& p, const Vec<M, Scalar>& tangent, Scalar normal, Scalar unit,
                    Vec<N, Scalar>& lambda) {
    lambda[0] = normal * unit;
    lambda.template tail<M>() = p.basis * tangent * unit;
  }

  Params params_{};
};

} // namespace talus
