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
  Real pole{};                                                     ///< α* (associated law)
  Real inverse_normal{};                                           ///< 1/W_NN
  Real inverse_schur{};                                            ///< 1/D(0)
  Real inverse_slope{};                                            ///< 1/(1 + μ²)
  Real friction{};                                                 ///< μ
  Real scale{};                                                    ///< tr W / N; 0: no W at all
};

/// How the search for a solution ended.
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
      const Real start = eq.start(lambda, inverse * form.scale, a_norm);
      const Real alpha = L::select(inside(start, low, high), start, between(low, high));
      // Stricter searches for the few where the first stopped too far from the root.
      outcome.residual =
          L::select(left, Real(std::numeric_limits<Scalar>::infinity()), outcome.residual);
      for (const Scalar closeness : {Scalar(2e-3), Scalar(1e-8), Scalar(1e-13)}) {
        Real root = eq.find_root(alpha, low, high, side, left, closeness, max_iterations, outcome);
        Tangent edge_tangent;
        Real edge_normal = eq.edge(root, edge_tangent);
        const Real residual = eq.refine_edge(root, edge_normal, edge_tangent, !left);
        const Mask better = left && residual < outcome.residual;
        normal = L::select(better, edge_normal, normal);
        for (std::size_t k = 0; k < m; ++k)
          tangent[k] = L::select(better, edge_tangent[k], tangent[k]);
        outcome.residual = L::select(better, residual, outcome.residual);
        left = left && !(residual <= Real(miss));
        if (L::all(!left))
          break;
      }
    }

    const Mask slip = frictionless && !outcome.open;
    normal = L::select(slip, max(Real(0), -eq.b_n * form.inverse_normal), normal);
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
  [[gnu::always_inline]] Real find_root(Real alpha, Real low, Real high, const Real& side,
                                        const Mask& wanted, Scalar closeness_wanted,
                                        int max_iterations, SecularOutcome<Real>& outcome) {
    const Real closeness(closeness_wanted);
    const bool quick = closeness_wanted > Scalar(1e-4); // the first search
    using std::abs, std::min;
    Mask done = !wanted;
    for (int k = 1; k <= max_iterations && !L::all(done); ++k) {
      ++outcome.iterations;
      evaluate(alpha, side, quick);
      const Mask above = (excess > Real(0)) == (side > Real(0)); // the root is below α
      high = L::select(above, alpha, high);
      low = L::select(above, low, alpha);
      Real next = halley(alpha);
      const Mask close = (abs(next - alpha) <= closeness * alpha &&
                          abs(excess) <= min(Real(1e-2), closeness * Real(8)) * edge_length) ||
                         abs(excess) <= Real(8 * epsilon) * edge_length;
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
  [[gnu::always_inline]] Real stick(Tangent& tangent) const {
    Real n = -b_n;
    for (std::size_t k = 0; k < m; ++k)
      n += coupling(k) * form_.compliance[k] * a[k];
    const Real normal = n * form_.inverse_schur;
    for (std::size_t k = 0; k < m; ++k)
      tangent[k] = -form_.compliance[k] * (a[k] + coupling(k) * normal);
    return normal;
  }

  /// λ for a given α: returns λ_N.
  [[gnu::always_inline]] Real edge(const Real& alpha, Tangent& tangent) {
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

  /// At α: D, and ρ − 1 and two derivatives of ρ = μ |n| / |D λ_T|, times powers of |D λ_T| so that
  /// there is no division by it: excess, slope, curvature.
  [[gnu::always_inline]] void evaluate(const Real& alpha, const Real& side, bool quick) {
    using std::sqrt;
    Real n0(0), n1(0), n2(0), t00(0), t01(0), t11(0), t02(0);
    const auto add = [&](const Real& t0, const Real& t1, const Real& t2) {
      t00 += t0 * t0;
      t01 += t0 * t1;
      t11 += t1 * t1;
      t02 += t0 * t2;
    };
    bool polynomial = false;
    if constexpr (m == 2)
      polynomial = quick && L::all(alpha < Real(100)); // where α is large its powers cancel
    if (polynomial) {
      // All times (e_0 + α)(e_1 + α): no division, and (c_0 a_0 + …) c_0 − … is gone.
      const std::size_t last = m - 1; // 1
      const Real x0 = eigenvalue(0) + alpha, x1 = eigenvalue(last) + alpha, x = x0 * x1;
      const Real w = w_n - kappa * alpha, c0 = coupling(0), c1 = coupling(last);
      const Real a0 = a[0], a1 = a[last], ca0 = c0 * a0, ca1 = c1 * a1;
      determinant = w * x - c0 * c0 * x1 - c1 * c1 * x0;
      n0 = ca0 * x1 + ca1 * x0 - b_n * x;
      n1 = ca0 + ca1 - b_n * (x0 + x1);
      n2 = Real(-2) * b_n;
      const Real twist = a0 * c1 - a1 * c0;
      const Real y0 = a0 * w - c0 * b_n, y1 = a1 * w - c1 * b_n;
      const Real z0 = kappa * a0, z1 = kappa * a1;
      add(y0 * x1 - c1 * twist, y0 - z0 * x1, Real(-2) * z0);
      add(y1 * x0 + c0 * twist, y1 - z1 * x0, Real(-2) * z1);
    } else {
      Real d0 = w_n - kappa * alpha, d1 = -kappa, d2(0);
      n0 = -b_n;
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
      for (std::size_t k = 0; k < m; ++k) {
        const Real r = reciprocal[k], c = coupling(k), ak = a[k];
        const Real t0 = (d0 * ak + n0 * c) * r;
        const Real t1 = (d1 * ak + n1 * c - t0) * r;
        add(t0, t1, (d2 * ak + n2 * c - t1 - t1) * r);
      }
    }
    const Real factor = side * mu, m0 = factor * n0, m1 = factor * n1, m2 = factor * n2;
    edge_square = t00;
    edge_length = sqrt(t00);
    excess = m0 - edge_length;
    slope = m1 * t00 - m0 * t01;
    curvature = (m2 * t00 - (m1 + m1) * t01 - m0 * (t11 + t02)) * t00 + Real(3) * m0 * (t01 * t01);
  }

  /// Halley's step, written with what `evaluate` leaves so that it needs one division; in 1/α above
  /// the pole, where the ratio becomes constant for large α.
  [[gnu::always_inline]] Real halley(const Real& alpha) const {
    const Real half = Real(0.5) * excess, down = slope * slope - half * curvature;
    const Real change = excess * edge_square;
    Real top = alpha * down - change * slope, bottom = down;
    if constexpr (associated) {
      // u = 1/α: f_u = −α² f′, f_uu = α⁴ f″ + 2 α³ f′
      const Real x = alpha * slope, xx = alpha * alpha * curvature + (x + x) * edge_square;
      const Real down_u = x * x - half * xx;
      const Mask below = determinant > Real(0);
      top = L::select(below, top, alpha * down_u);
      bottom = L::select(below, bottom, down_u + change * x);
    }
    return top / bottom;
  }

  /// α from the start: what makes λ_T best fit (e + α) λ_T = −(a + c λ_N). Without a start, that
  /// of the projection of −b on the cone.
  [[gnu::always_inline]] Real start(const Vector& lambda, const Real& inverse_unit,
                                    const Real& a_norm) const {
    using std::max;
    Real length2 = lambda[1] * lambda[1];
    for (std::size_t k = 1; k < m; ++k)
      length2 += lambda[k + 1] * lambda[k + 1];
    const Mask cold = !(length2 > Real(0));
    Real alpha(0);
    if (!L::all(!cold)) {
      // −b scaled by the normal stiffness, on the edge: λ_T along −a
      const Real normal =
          max(Real(0), (mu * a_norm - b_n * form_.inverse_normal) * form_.inverse_slope);
      Real weighted(0);
      for (std::size_t k = 0; k < m; ++k)
        weighted += eigenvalue(k) * (a[k] * a[k]);
      const Real square = a_norm * a_norm, inverse = Real(1) / square;
      const Real stretch = a_norm / (mu * normal);
      alpha = ((square + normal * dot(form_.coupling, a)) * stretch - weighted) * inverse;
    }
    if (!L::all(cold)) {
      Real top(0), bottom(0);
      const Real normal = lambda[0] * inverse_unit;
      for (std::size_t k = 0; k < m; ++k) {
        Real t = form_.basis[k][0] * lambda[1];
        for (std::size_t i = 1; i < m; ++i)
          t += form_.basis[k][i] * lambda[i + 1];
        t *= inverse_unit;
        top -= t * (a[k] + coupling(k) * normal + eigenvalue(k) * t);
        bottom += t * t;
      }
      alpha = L::select(cold, alpha, top / bottom);
    }
    return alpha;
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
  [[gnu::always_inline]] Real refine_edge(Real& alpha, Real& normal, Tangent& tangent,
                                          const Mask& skip) {
    using std::abs, std::max, std::min, std::sqrt;
    Real best(std::numeric_limits<Scalar>::infinity()), best_normal = normal;
    Tangent best_tangent = tangent;
    for (int k = 0;; ++k) {
      Tangent row;
      const Real length = norm(tangent);
      Real balance = w_n * normal + b_n - kappa * alpha * normal;
      Real worst(0), sliding(0);
      for (std::size_t i = 0; i < m; ++i) {
        row[i] = (eigenvalue(i) + alpha) * tangent[i] + a[i] + coupling(i) * normal;
        balance += coupling(i) * tangent[i];
        worst = max(worst, abs(row[i]));
        sliding = max(sliding, abs(tangent[i])); // not the length, whose square may vanish
      }
      const Real edge = length - mu * normal;
      // γ̃_N = μ |γ̃_T| = μ α |λ_T| rests on the edge's equation, too; inside the cone there is to be
      // no motion; and α < 0 is friction that drives.
      const Real motion = abs(alpha) * sliding;
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
      const Real target = mu * normal;
      Real f1 = -balance, f2 = -edge * length;
      if (!L::all(abs(edge) <= Real(1e-3) * length)) // 1/|λ_T| = 1/(μ λ_N), nearly linear in α
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
      Tangent step;
      Real next2(0);
      for (std::size_t i = 0; i < m; ++i) {
        step[i] = -(row[i] + coupling(i) * d_normal + tangent[i] * d_alpha) * reciprocal[i];
        next2 += (tangent[i] + step[i]) * (tangent[i] + step[i]);
      }
      // Where λ_T is small the full step may overshoot the edge, a quadratic along the step: q2 τ²
      // + 2 q1 τ + q0 = 0.
      const Real next_edge = sqrt(next2) - mu * (normal + d_normal);
      const Mask overshoots =
          abs(next_edge) > Real(0.25) * abs(edge) && abs(edge) > Real(16 * epsilon) * length;
      Real fraction(1);
      if (!L::all(!overshoots)) {
        const Real d_target = mu * d_normal;
        const Real q2 = dot(step, step) - d_target * d_target;
        const Real q1 = dot(step, tangent) - target * d_target;
        const Real q0 = edge * (length + target);
        const Real root = sqrt(max(Real(0), q1 * q1 - q2 * q0));
        const Real shorter = -q0 / (q1 + L::select(q1 < Real(0), -root, root));
        fraction = L::select(overshoots && abs(shorter) < Real(2), shorter, fraction);
      }
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
      const Real d_normal = (f1 - balance) * form_.inverse_schur;
      normal += d_normal;
      for (std::size_t i = 0; i < m; ++i)
        tangent[i] -= (row[i] + coupling(i) * d_normal) * form_.compliance[i];
    }
    return residual;
  }

  const Form& form_;
  Tangent a{}, reciprocal{};
  Real b_n{}, w_n, mu, kappa;
  Real determinant{}, numerator{};
  Real edge_length{}, edge_square{}, excess{}, slope{}, curvature{};
};

} // namespace talus
