// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

/// \file
/// The scalar equation behind SecularSolver, written once for a number and for a pack of numbers,
/// each lane a problem of its own.

namespace talus {

/// How a type of numbers compares: for plain numbers one answer, for packs one a lane (see
/// secular_batch.hpp).
template <class Real>
struct Lanes {
  using Scalar = Real;
  using Mask = bool;
  static Real select(Mask condition, Real yes, Real no) { return condition ? yes : no; }
  static bool all(Mask mask) { return mask; }
};

/// What can be worked out from W and μ alone, in units of tr W / N: the arrow matrix
/// [W_NN cᵀ; c diag(e)] that W becomes in the eigenvectors Q of W_TT. Real: a number or a pack.
template <class Law, int N, class Real>
struct SecularForm {
  static constexpr int tangents = N - 1;
  using Tangent = std::array<Real, static_cast<std::size_t>(tangents)>;
  std::array<Tangent, static_cast<std::size_t>(tangents)> basis{}; ///< Q, by columns
  Tangent eigenvalues{};                                           ///< e
  Tangent coupling{};                                              ///< c = Qᵀ W_TN
  Tangent compliance{};                                            ///< 1/e
  Tangent coupling_at_pole{};                                      ///< c/(e + α*)
  Real normal{};                                                   ///< W_NN
  Real schur{};                                                    ///< D(0)
  Real pole{};                                                     ///< α* (associated law)
  Real friction{};                                                 ///< μ
  Real scale{};                                                    ///< tr W / N; 0: no W at all
};

/// The outcome of solve_secular.
template <class Real>
struct SecularOutcome {
  typename Lanes<Real>::Mask open{}, stick{};
  int iterations = 0; ///< of the slowest lane
  Real residual{};    ///< of all equations, relative to |b| and |W| |λ|
};

/// Solves (γ, λ) in Law with γ = W λ + b; see SecularSolver for the equations. lambda is the start
/// on entry and the solution on return.
template <class Law, int N, class Real>
class SecularEquation {
 public:
  using L = Lanes<Real>;
  using Mask = typename L::Mask;
  using Scalar = typename L::Scalar;
  using Form = SecularForm<Law, N, Real>;
  using Tangent = typename Form::Tangent;
  using Vector = std::array<Real, static_cast<std::size_t>(N)>;
  static constexpr bool associated = std::is_same_v<Law, AssociatedLaw>;
  static constexpr std::size_t m = N - 1;
  static constexpr Scalar epsilon = std::numeric_limits<Scalar>::epsilon();
  /// A residual (of the order of ε if all is well) above this is a miss.
  static constexpr Scalar miss = 4096 * epsilon;

  static SecularOutcome<Real> solve(const Form& form, const Vector& b, Vector& lambda,
                                    int max_iterations) noexcept {
    using std::max, std::abs;
    SecularOutcome<Real> outcome;
    Real size = abs(b[0]);
    for (std::size_t k = 0; k < m; ++k)
      size = max(size, abs(b[k + 1]));
    const Mask empty = !(size > Real(0)) || !(form.scale > Real(0));
    const Real b_unit = L::select(empty, Real(1), size);
    const Real unit = L::select(empty, Real(0), b_unit / form.scale);

    SecularEquation eq(form);
    const Real inverse = Real(1) / b_unit;
    Vector b_scaled;
    for (std::size_t k = 0; k < m + 1; ++k)
      b_scaled[k] = b[k] * inverse;
    // b of the order of the smallest numbers: 1/b overflows
    if (!L::all(inverse < Real(std::numeric_limits<Scalar>::max())))
      for (std::size_t k = 0; k < m + 1; ++k)
        b_scaled[k] = b[k] / b_unit;
    eq.b_n = b_scaled[0];
    for (std::size_t k = 0; k < m; ++k) {
      eq.a[k] = form.basis[k][0] * b_scaled[1];
      for (std::size_t i = 1; i < m; ++i)
        eq.a[k] += form.basis[k][i] * b_scaled[i + 1];
    }

    // λ = 0? Up to rounding, since a root α beyond 1/ε has no digits.
    const Real a_norm = norm(eq.a);
    outcome.open =
        empty || (associated ? eq.mu * a_norm <= eq.b_n + Real(16 * epsilon) * abs(eq.b_n)
                             : eq.b_n >= Real(-epsilon));
    const Mask frictionless = eq.mu <= Real(epsilon * epsilon);
    if (L::all(outcome.open)) {
      for (Real& x : lambda)
        x = Real(0);
      return outcome;
    }

    // λ = −W⁻¹ b? That is α = 0.
    Tangent tangent;
    Real normal = eq.stick(tangent);
    const Mask sticks =
        normal > Real(0) && dot(tangent, tangent) <= eq.mu * eq.mu * (normal * normal);
    outcome.stick = sticks && !outcome.open && !frictionless;
    Mask left = !(outcome.open || outcome.stick || frictionless); // lanes without a solution yet
    if (!L::all(!outcome.stick))
      outcome.residual = eq.refine_stick(normal, tangent);
    if (!L::all(!left)) {
      Real low(0), high(std::numeric_limits<Scalar>::infinity()), side(1);
      if constexpr (associated) {
        // Below the pole of λ_N = n/D or above it?
        const Mask below = dot(form.coupling_at_pole, eq.a) > eq.b_n;
        high = L::select(below, form.pole, high);
        low = L::select(below, low, form.pole);
        side = L::select(below, side, Real(-1));
      }
      const Real start = eq.start(lambda, inverse * form.scale);
      const Real alpha = L::select(inside(start, low, high), start, between(low, high));
      // A second, stricter search for the few where the first stopped too far from the root.
      for (const Scalar closeness : {Scalar(2e-3), Scalar(1e-8)}) {
        Real root =
            eq.find_root(alpha, low, high, side, left, Real(closeness), max_iterations, outcome);
        Tangent edge_tangent;
        Real edge_normal = eq.edge(root, edge_tangent);
        const Real residual = eq.refine_edge(root, edge_normal, edge_tangent, !left);
        normal = L::select(left, edge_normal, normal);
        for (std::size_t k = 0; k < m; ++k)
          tangent[k] = L::select(left, edge_tangent[k], tangent[k]);
        outcome.residual = L::select(left, residual, outcome.residual);
        left = left && !(residual <= Real(miss));
        if (L::all(!left))
          break;
      }
    }

    const Mask slip = frictionless && !outcome.open;
    normal = L::select(slip, max(Real(0), -eq.b_n / eq.w_n), normal);
    outcome.residual = L::select(outcome.open || slip, Real(0), outcome.residual);
    lambda[0] = L::select(outcome.open, Real(0), normal * unit);
    const Mask zero = outcome.open || slip;
    for (std::size_t k = 0; k < m; ++k) {
      Real sum = form.basis[0][k] * tangent[0];
      for (std::size_t i = 1; i < m; ++i)
        sum += form.basis[i][k] * tangent[i];
      lambda[k + 1] = L::select(zero, Real(0), sum * unit);
    }
    const Mask finite = abs(lambda[0]) < Real(std::numeric_limits<Scalar>::max());
    outcome.residual =
        L::select(finite, outcome.residual, Real(std::numeric_limits<Scalar>::infinity()));
    return outcome;
  }

 private:
  explicit SecularEquation(const Form& form)
      : form_(form), w_n(form.normal), mu(form.friction),
        kappa(associated ? form.friction * form.friction : Real(0)) {}

  const Real& coupling(std::size_t k) const { return form_.coupling[k]; }
  const Real& eigenvalue(std::size_t k) const { return form_.eigenvalues[k]; }

  static Real dot(const Tangent& x, const Tangent& y) {
    Real sum = x[0] * y[0];
    for (std::size_t k = 1; k < m; ++k)
      sum += x[k] * y[k];
    return sum;
  }
  static Real norm(const Tangent& x) {
    using std::sqrt;
    return sqrt(dot(x, x));
  }
  /// Halley's method on μ λ_N / |λ_T| = 1 from alpha, inside the bracket, in the lanes of `wanted`.
  Real find_root(Real alpha, Real low, Real high, const Real& side, const Mask& wanted,
                 const Real& closeness, int max_iterations, SecularOutcome<Real>& outcome) {
    using std::abs, std::min;
    Mask done = !wanted;
    for (int k = 1; k <= max_iterations && !L::all(done); ++k) {
      ++outcome.iterations;
      evaluate(alpha, side);
      const Real f = ratio - Real(1);
      const Mask above = (f > Real(0)) == (side > Real(0)); // the root is below α
      high = L::select(above, alpha, high);
      low = L::select(above, low, alpha);
      Real next = halley(alpha, f);
      const Mask close = (abs(next - alpha) <= closeness * alpha &&
                          abs(f) <= min(Real(1e-2), closeness * Real(8))) ||
                         abs(f) <= Real(8 * epsilon);
      // the bracket halves (in powers of ten) at least every fourth time
      const Mask good = inside(next, low, high) && (close || Mask(k % 4 != 0));
      const Mask tight =
          high - low <= closeness * Real(1e-3) * low || high < Real(epsilon * epsilon);
      next = L::select(good, next, L::select(close, alpha, between(low, high)));
      alpha = L::select(done, alpha, next);
      done = done || close || tight;
    }
    return alpha;
  }

  static Mask inside(const Real& x, const Real& low, const Real& high) {
    return x > low && x < high;
  }

  /// −W⁻¹ b: returns λ_N.
  Real stick(Tangent& tangent) const {
    Real n = -b_n;
    for (std::size_t k = 0; k < m; ++k)
      n += coupling(k) * form_.compliance[k] * a[k];
    const Real normal = n / form_.schur;
    for (std::size_t k = 0; k < m; ++k)
      tangent[k] = -form_.compliance[k] * (a[k] + coupling(k) * normal);
    return normal;
  }

  /// λ for a given α: returns λ_N.
  Real edge(const Real& alpha, Tangent& tangent) {
    Real d = w_n - kappa * alpha, n = -b_n;
    for (std::size_t k = 0; k < m; ++k) {
      const Real r = Real(1) / (eigenvalue(k) + alpha), cr = coupling(k) * r;
      reciprocal[k] = r;
      d -= coupling(k) * cr;
      n += cr * a[k];
    }
    determinant = d;
    numerator = n;
    const Real normal = normal_on_edge();
    for (std::size_t k = 0; k < m; ++k)
      tangent[k] = -reciprocal[k] * (a[k] + coupling(k) * normal);
    return normal;
  }

  /// D, n, ρ = μ |n| / |D λ_T| and two derivatives of ρ at α.
  void evaluate(const Real& alpha, const Real& side) {
    using std::sqrt;
    Real d0 = w_n - kappa * alpha, d1 = -kappa, d2(0), n0 = -b_n, n1(0), n2(0);
    for (std::size_t k = 0; k < m; ++k) {
      const Real r = Real(1) / (eigenvalue(k) + alpha);
      reciprocal[k] = r;
      const Real cr = coupling(k) * r, ar = a[k] * r;
      d0 -= coupling(k) * cr;
      d1 += cr * cr;
      d2 -= cr * cr * r;
      n0 += coupling(k) * ar;
      n1 -= cr * ar;
      n2 += cr * ar * r;
    }
    d2 += d2;
    n2 += n2;
    determinant = d0;
    numerator = n0;
    Real t00(0), t01(0), t11(0), t02(0);
    for (std::size_t k = 0; k < m; ++k) {
      const Real r = reciprocal[k], c = coupling(k), ak = a[k];
      const Real t0 = (d0 * ak + n0 * c) * r;
      const Real t1 = (d1 * ak + n1 * c - t0) * r;
      const Real t2 = (d2 * ak + n2 * c - t1 - t1) * r;
      t00 += t0 * t0;
      t01 += t0 * t1;
      t11 += t1 * t1;
      t02 += t0 * t2;
    }
    const Real inverse2 = Real(1) / t00, inverse = sqrt(inverse2);
    const Real p1 = t01 * inverse2; // |t|'/|t|
    const Real p2 = (t11 + t02) * inverse2 - p1 * p1;
    const Real factor = side * mu * inverse;
    ratio = factor * n0;
    slope = factor * n1 - ratio * p1;
    curvature = factor * n2 - (slope + slope) * p1 - ratio * p2;
  }

  /// Halley's step; in 1/α above the pole, where the ratio becomes constant for large α.
  Real halley(const Real& alpha, const Real& f) const {
    const Real half = Real(0.5) * f, down = slope * slope - half * curvature;
    Real top = alpha * down - f * slope, bottom = down;
    if constexpr (associated) {
      // u = 1/α: f_u = −α² f′, f_uu = α⁴ f″ + 2 α³ f′
      const Real x = alpha * slope, xx = alpha * alpha * curvature + x + x;
      const Real down_u = x * x - half * xx;
      const Mask below = determinant > Real(0);
      top = L::select(below, top, alpha * down_u);
      bottom = L::select(below, bottom, down_u + f * x);
    }
    return top / bottom;
  }

  /// α from the start: what makes λ_T best fit (e + α) λ_T = −(a + c λ_N). Without a start, that
  /// of the projection of −b on the cone.
  Real start(const Vector& lambda, const Real& inverse_unit) const {
    using std::max;
    Tangent t;
    for (std::size_t k = 0; k < m; ++k) {
      t[k] = form_.basis[k][0] * lambda[1];
      for (std::size_t i = 1; i < m; ++i)
        t[k] += form_.basis[k][i] * lambda[i + 1];
      t[k] *= inverse_unit;
    }
    Real normal = lambda[0] * inverse_unit;
    const Mask cold = !(dot(t, t) > Real(0));
    const Real a_norm = norm(a);
    // −b scaled by the normal stiffness, on the edge
    const Real on_edge = max(Real(0), (mu * a_norm - b_n / w_n) / (Real(1) + mu * mu));
    normal = L::select(cold, on_edge, normal);
    const Real shrink = -mu * on_edge / a_norm;
    for (std::size_t k = 0; k < m; ++k)
      t[k] = L::select(cold, shrink * a[k], t[k]);
    Real top(0);
    for (std::size_t k = 0; k < m; ++k)
      top -= t[k] * (a[k] + coupling(k) * normal + eigenvalue(k) * t[k]);
    return top / dot(t, t);
  }

  /// A point between the ends of a bracket that may span many powers of ten, or reach down to 0.
  static Real between(const Real& low, const Real& high) {
    using std::sqrt;
    const Real floor = L::select(low > Real(0), low, high * Real(1.0 / 4096));
    const Real middle =
        L::select(high > Real(4) * floor, sqrt(floor) * sqrt(high), Real(0.5) * (floor + high));
    const Real open_end = L::select(low > Real(0), Real(8) * low, Real(1));
    return L::select(high < Real(std::numeric_limits<Scalar>::infinity()), middle, open_end);
  }

  /// λ_N at the root: n/D, unless both nearly vanish (α ≈ α*); then from |λ_T| = μ λ_N itself, a
  /// quadratic equation that stays well-behaved.
  Real normal_on_edge() const {
    using std::abs, std::max, std::sqrt;
    const Real quotient = numerator / determinant;
    if constexpr (!associated) {
      return quotient;
    } else {
      Real q2 = -mu * mu, q1(0), q0(0), terms = abs(b_n);
      for (std::size_t k = 0; k < m; ++k) {
        const Real cr = coupling(k) * reciprocal[k], ar = a[k] * reciprocal[k];
        q2 += cr * cr;
        q1 += cr * ar;
        q0 += ar * ar;
        terms += abs(coupling(k) * ar);
      }
      const Mask regular = (abs(numerator) > Real(1e-3) * terms || q2 >= Real(0)) &&
                           abs(determinant) > Real(4 * epsilon) * w_n;
      if (L::all(regular))
        return quotient;
      const Real root = sqrt(max(Real(0), q1 * q1 - q2 * q0));
      const Real q = -(q1 + L::select(q1 < Real(0), -root, root));
      // The cone is met once where λ_N > 0 if q2 < 0 (the direction of α* points into the cone).
      return L::select(regular, quotient, max(q / q2, q0 / q));
    }
  }

  /// Newton's method on all equations at once, in increments: what the elimination lost to
  /// cancellation comes back. Returns the residual.
  Real refine_edge(Real& alpha, Real& normal, Tangent& tangent, const Mask& skip) {
    using std::abs, std::max, std::min, std::sqrt;
    Real best(std::numeric_limits<Scalar>::infinity()), best_normal = normal;
    Tangent best_tangent = tangent;
    for (int k = 0;; ++k) {
      Tangent row;
      const Real length = norm(tangent);
      Real balance = w_n * normal + b_n - kappa * alpha * normal;
      Real worst(0);
      for (std::size_t i = 0; i < m; ++i) {
        row[i] = (eigenvalue(i) + alpha) * tangent[i] + a[i] + coupling(i) * normal;
        balance += coupling(i) * tangent[i];
        worst = max(worst, abs(row[i]));
      }
      const Real edge = length - mu * normal;
      // γ̃_N = μ |γ̃_T| = μ α |λ_T| rests on the edge's equation, too; inside the cone there is to be
      // no motion; and α < 0 is friction that drives.
      const Real motion = abs(alpha) * length;
      Real wrong = abs(edge) * (associated ? Real(1) + mu * abs(alpha) : Real(1));
      wrong = L::select(edge < Real(0), min(wrong, motion), wrong);
      wrong = L::select(alpha < Real(0), max(wrong, motion), wrong);
      const Real terms = Real(1) + abs(normal) + length;
      const Real residual = L::select(terms < Real(std::numeric_limits<Scalar>::max()),
                                      max(max(worst, abs(balance)), wrong) / terms,
                                      Real(std::numeric_limits<Scalar>::infinity()));
      const Mask better = residual < best;
      best = L::select(better, residual, best);
      best_normal = L::select(better, normal, best_normal);
      for (std::size_t i = 0; i < m; ++i)
        best_tangent[i] = L::select(better, tangent[i], best_tangent[i]);
      if (k == 8 ||
          L::all(skip || best <= Real(16 * epsilon) || (!better && best <= Real(256 * epsilon))))
        break;
      Real j11 = w_n - kappa * alpha, j12 = -kappa * normal, j21(0), j22(0);
      // What is rounding must not be corrected: where W is singular that moves λ far.
      const Real noise = Real(4 * epsilon) * terms;
      balance = L::select(abs(balance) <= noise, Real(0), balance);
      for (Real& r : row)
        r = L::select(abs(r) <= noise, Real(0), r);
      // 1/|λ_T| = 1/(μ λ_N), nearly linear in α
      const Real target = mu * normal;
      Real f1 = -balance, f2 = -edge * length;
      f2 *= L::select(target > Real(0), length / target, Real(1));
      for (std::size_t i = 0; i < m; ++i) {
        if (k > 0)
          reciprocal[i] = Real(1) / (eigenvalue(i) + alpha);
        const Real r = reciprocal[i], cr = coupling(i) * r, tr = tangent[i] * r;
        j11 -= coupling(i) * cr;
        j12 -= coupling(i) * tr;
        j21 -= tangent[i] * cr;
        j22 -= tangent[i] * tr;
        f1 += cr * row[i];
        f2 += tr * row[i];
      }
      j21 -= mu * length;
      const Real inverse = Real(1) / (j11 * j22 - j12 * j21);
      const Real d_normal = (f1 * j22 - j12 * f2) * inverse;
      const Real d_alpha = (j11 * f2 - f1 * j21) * inverse;
      // The edge along the step is a quadratic: q2 τ² + 2 q1 τ + q0 = 0.
      Tangent step;
      Real q2 = -mu * d_normal * (mu * d_normal), q1 = -target * (mu * d_normal), next2(0);
      for (std::size_t i = 0; i < m; ++i) {
        step[i] = -(row[i] + coupling(i) * d_normal + tangent[i] * d_alpha) * reciprocal[i];
        q2 += step[i] * step[i];
        q1 += step[i] * tangent[i];
        next2 += (tangent[i] + step[i]) * (tangent[i] + step[i]);
      }
      const Real q0 = edge * (length + target);
      const Real root = sqrt(max(Real(0), q1 * q1 - q2 * q0));
      const Real shorter = -q0 / (q1 + L::select(q1 < Real(0), -root, root));
      const Real next_edge = sqrt(next2) - mu * (normal + d_normal);
      // Where λ_T is small the full step may overshoot the edge.
      const Mask overshoots =
          abs(next_edge) > Real(0.25) * abs(edge) && abs(edge) > Real(16 * epsilon) * length;
      const Real fraction = L::select(overshoots && abs(shorter) < Real(2), shorter, Real(1));
      for (std::size_t i = 0; i < m; ++i)
        tangent[i] += fraction * step[i];
      normal += fraction * d_normal;
      alpha += fraction * d_alpha;
    }
    normal = best_normal;
    tangent = best_tangent;
    return best;
  }

  /// One step of iterative refinement of W λ = −b. Returns the residual.
  Real refine_stick(Real& normal, Tangent& tangent) const {
    using std::abs, std::max;
    Real residual(0);
    for (int k = 0; k < 2; ++k) {
      Tangent row;
      Real balance = w_n * normal + b_n, f1(0), worst(0);
      for (std::size_t i = 0; i < m; ++i) {
        row[i] = eigenvalue(i) * tangent[i] + a[i] + coupling(i) * normal;
        balance += coupling(i) * tangent[i];
        f1 += coupling(i) * form_.compliance[i] * row[i];
        worst = max(worst, abs(row[i]));
      }
      residual = max(worst, abs(balance)) / (Real(1) + abs(normal) + norm(tangent));
      if (k == 1 || L::all(residual <= Real(4 * epsilon)))
        break;
      const Real d_normal = (f1 - balance) / form_.schur;
      normal += d_normal;
      for (std::size_t i = 0; i < m; ++i)
        tangent[i] -= (row[i] + coupling(i) * d_normal) * form_.compliance[i];
    }
    return residual;
  }

  const Form& form_;
  Tangent a{}, reciprocal{};
  Real b_n{}, w_n, mu, kappa;
  Real determinant{}, numerator{}, ratio{}, slope{}, curvature{};
};

} // namespace talus
