// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/cone/local_solver.hpp"
#include "talus/scene/fill.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

/// \file
/// Random and adversarial cone problems for tests and benchmarks, and a check of their solutions
/// that shares nothing with the solvers.

namespace cone_problems {

using talus::Mat, talus::Vec;

class Numbers {
 public:
  explicit Numbers(std::uint64_t seed = 11) : random_(seed) {}

  double uniform(double low, double high) { return low + (high - low) * random_.uniform(); }
  /// Every power of ten between is as likely.
  double decades(double low, double high) {
    return std::pow(10, uniform(std::log10(low), std::log10(high)));
  }
  double normal() {
    return std::sqrt(-2 * std::log(1 - random_.uniform())) *
           std::cos(2 * std::numbers::pi * random_.uniform());
  }
  int below(int count) { return static_cast<int>(count * random_.uniform()); }
  template <int N>
  Vec<N> vector() {
    Vec<N> v;
    for (int i = 0; i < N; ++i)
      v[i] = normal();
    return v;
  }
  template <int N>
  Mat<N> rotation() {
    Mat<N> q;
    for (int i = 0; i < N * N; ++i)
      q.data()[i] = normal();
    // Gram and Schmidt's way, each column twice: to rounding; a decomposition of Eigen's takes half
    // a minute to compile
    for (int i = 0; i < 2 * N; ++i) {
      auto column = q.col(i / 2);
      for (int j = 0; j < i / 2; ++j)
        column -= q.col(j).dot(column) * q.col(j);
      column /= column.norm();
    }
    return q;
  }
  /// Symmetric, eigenvalues from 1 down to 1/condition.
  template <int N>
  Mat<N> matrix(double condition) {
    Vec<N> d;
    for (int i = 0; i < N; ++i)
      d[i] = std::pow(condition, -uniform(0, 1));
    d[0] = 1;
    d[N - 1] = 1 / condition;
    return from_eigenvalues<N>(d);
  }
  template <int N>
  Mat<N> from_eigenvalues(const Vec<N>& d) {
    const Mat<N> q = rotation<N>();
    const Mat<N> w = q * d.asDiagonal() * q.transpose();
    return 0.5 * (w + w.transpose());
  }

 private:
  talus::Random random_;
};

template <int N>
struct Problem {
  Mat<N> w = Mat<N>::Identity();
  Vec<N> b = Vec<N>::Zero();
  double mu = 0;
};

/// The larger of two measures of how far λ is from solving the problem: the natural residual and
/// f_MFB, relative to |λ| + |b|/w with w = tr W / N. Units of W and b do not matter.
template <class Law, int N>
double error(const Problem<N>& problem, const Vec<N>& lambda) {
  const double w_unit = problem.w.trace() / N, b_unit = problem.b.cwiseAbs().maxCoeff();
  if (!(w_unit > 0) || !(b_unit > 0))
    return lambda.norm();
  // λ in units of b_unit / w_unit, which alone may overflow
  const Vec<N> b = problem.b / b_unit, x = lambda / b_unit * w_unit;
  const Vec<N> gamma = problem.w / w_unit * x + b;
  const double natural =
      talus::natural_residual<N, double>(Law{}, gamma, x, problem.mu, 1.0).norm();
  const double fb = talus::law_residual<N, double>(Law{}, gamma, x, problem.mu).norm();
  const double worst = std::max(natural, fb) / (x.norm() + b.norm());
  return std::isfinite(worst) ? worst : INFINITY;
}

enum class Kind {
  random,       ///< nothing special
  nearly_open,  ///< b at the border between open and slide
  nearly_stick, ///< −W⁻¹b at the edge of the cone, inside or outside
  along_edge,   ///< b along the edge of the cone or of its dual, or opposite to it
  singular,     ///< W of a lower rank, b in its range or not
  hard_case,    ///< b_T orthogonal to the weakest directions of W_TT, or nearly
  multiple,     ///< W with equal eigenvalues
  axes,         ///< b along one axis, W diagonal or not
  tiny_parts,   ///< b_N or b_T smaller than the other by up to 200 powers of ten
};
inline constexpr int kinds = 9;
inline constexpr std::string_view kind_name[] = {"random",         "nearly open", "nearly stick",
                                                 "along the edge", "singular",    "hard case",
                                                 "multiple",       "axes",        "tiny parts"};

/// A problem of one kind, condition of W up to max_condition, μ from 0 to 10³ (most below 1), and
/// units of W and b from 10^−unit_decades to 10^unit_decades.
template <int N>
Problem<N> draw(Numbers& numbers, Kind kind, double max_condition = 1e12,
                double unit_decades = 150) {
  constexpr int m = N - 1;
  Problem<N> p;
  const int friction = numbers.below(10);
  p.mu = friction == 0   ? 0
         : friction == 1 ? numbers.decades(1e-12, 1)
         : friction == 2 ? numbers.decades(1, 1e3)
         : friction == 3 ? numbers.uniform(1, 10)
                         : numbers.uniform(0, 1);
  p.w = numbers.matrix<N>(numbers.decades(1, max_condition));
  p.b = numbers.vector<N>();
  const double nudge = (numbers.below(2) == 0 ? 1 : -1) * numbers.decades(1e-17, 1e-2);
  switch (kind) {
  case Kind::random:
    break;
  case Kind::nearly_open:
    p.b[0] = numbers.below(2) == 0 ? nudge : p.mu * p.b.template tail<m>().norm() * (1 + nudge);
    break;
  case Kind::nearly_stick: {
    Vec<N> lambda;
    lambda << 1, p.mu * (1 + nudge) * numbers.vector<m>().normalized();
    p.b = -p.w * lambda;
    break;
  }
  case Kind::along_edge: {
    const double slope = numbers.below(2) == 0 || !(p.mu > 0) ? p.mu : 1 / p.mu;
    p.b[0] = (numbers.below(2) == 0 ? 1 : -1);
    p.b.template tail<m>() = numbers.vector<m>().normalized() * slope * (1 + nudge);
    break;
  }
  case Kind::singular: {
    p.w.setZero();
    const int rank = 1 + numbers.below(N - 1);
    Vec<N> in_range = Vec<N>::Zero();
    for (int r = 0; r < rank; ++r) {
      const Vec<N> v = numbers.vector<N>();
      p.w += v * v.transpose();
      in_range += numbers.normal() * v;
    }
    if (numbers.below(4) > 0)
      p.b = in_range;
    break;
  }
  case Kind::hard_case: {
    Vec<N> d = Vec<N>::Ones();
    d[m] = numbers.below(2) == 0 ? 0 : numbers.decades(1 / max_condition, 1);
    const Mat<m> q = numbers.rotation<m>();
    const Mat<m> tangent = q * d.template tail<m>().asDiagonal() * q.transpose();
    p.w.setZero();
    p.w(0, 0) = numbers.decades(1e-2, 1e2);
    p.w.template bottomRightCorner<m, m>() = 0.5 * (tangent + tangent.transpose());
    Vec<m> b = p.b.template tail<m>();
    b -= (1 + (numbers.below(2) == 0 ? nudge : 0)) * q.col(m - 1).dot(b) * q.col(m - 1);
    p.b.template tail<m>() = b;
    p.b[0] = -std::abs(p.b[0]);
    break;
  }
  case Kind::multiple: {
    Vec<N> d = Vec<N>::Ones();
    const double low = numbers.decades(1 / max_condition, 1);
    for (int i = 1 + numbers.below(N - 1); i < N; ++i)
      d[i] = low;
    p.w = numbers.from_eigenvalues<N>(d);
    break;
  }
  case Kind::axes: {
    const int axis = numbers.below(N);
    const double size = p.b[axis];
    p.b.setZero();
    p.b[axis] = size;
    if (numbers.below(2) == 0)
      p.b[0] = -std::abs(size);
    if (numbers.below(2) == 0)
      p.w = Mat<N>(p.w.diagonal().asDiagonal());
    break;
  }
  case Kind::tiny_parts:
    if (numbers.below(2) == 0)
      p.b[0] *= numbers.decades(1e-200, 1);
    else
      p.b.template tail<m>() *= numbers.decades(1e-200, 1);
    break;
  }
  const double w_decades = numbers.uniform(-unit_decades, unit_decades);
  // λ itself, up to 10¹⁵ b/w, must not overflow
  const double b_decades =
      std::clamp(numbers.uniform(-unit_decades, unit_decades), w_decades - 285, w_decades + 285);
  p.w *= std::pow(10, w_decades);
  p.b *= std::pow(10, b_decades);
  return p;
}

/// What became of many problems.
struct Tally {
  long problems = 0;
  long missed = 0; ///< error above the bound, or reported as a miss
  long silent = 0; ///< of those, not reported
  double worst = 0;

  void add(double found, bool reported, double bound) {
    ++problems;
    const bool wrong = !(found <= bound);
    missed += wrong || reported;
    silent += wrong && !reported;
    worst = found > worst ? found : worst;
  }
};

/// Solves `count` problems of one kind, every second one from a random start.
template <class Solver, class Law, int N>
Tally tally(const Solver& solver, Kind kind, long count, double bound, std::uint64_t seed,
            double max_condition = 1e12) {
  Numbers numbers(seed);
  Tally result;
  for (long k = 0; k < count; ++k) {
    const Problem<N> p = draw<N>(numbers, kind, max_condition);
    Vec<N> lambda = Vec<N>::Zero();
    if (k % 2 == 1)
      lambda = 1e3 * numbers.vector<N>();
    const talus::LocalReport report = talus::solve_local(solver, Law{}, p.w, p.b, p.mu, lambda);
    result.add(error<Law, N>(p, lambda), report.status == talus::LocalStatus::not_converged, bound);
  }
  return result;
}

} // namespace cone_problems
