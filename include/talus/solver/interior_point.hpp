// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/jordan.hpp"
#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"
#include "talus/dual/residual.hpp"
#include "talus/dual/sparse_problem.hpp"
#include "talus/dual/whole_problem.hpp"
#include "talus/solver/solver.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseLU>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <utility>

namespace talus {

namespace detail {

/// Newton's method on the central path of a SparseProblem: with the cones scaled to K_1,
/// x = (μ λ_N, λ_T) and z = (γ_N + μ |γ_T|, μ γ_T), which is de Saxcé's γ̃,
/// \f[ M v = H^T λ, \quad x ∘ z = τ e, \quad τ → 0, \f]
/// each step in Nesterov–Todd's scaling, by the LU factors of M + Hᵀ Q H.
class CentralPath {
 public:
  enum class Coupling {
    full,  ///< |γ_T| is part of the linearisation
    lagged ///< it is kept during a step; the matrix is symmetric and positive definite
  };
  using Vector = Eigen::VectorXd;
  struct Point {
    Vector v, x, z;
  };

  explicit CentralPath(const SparseProblem& problem)
      : problem_(problem), matrix_(problem.pattern()), scaling_(problem.cones.size()) {
    factors_.isSymmetric(true);
    factors_.setPivotThreshold(0.01);
    factors_.analyzePattern(matrix_);
    const Eigen::Index rows = problem.rows();
    slip_ = Vector::Zero(rows);
    identity_ = Vector::Zero(rows);
    for (const auto& cone : problem.cones)
      identity_[cone.row] = 1;
  }

  /// A start inside the cones: λ and γ̃ as they are, pushed in as far as the mean energy E/n of a
  /// cone asks for. energy: E, J. on_path: x ∘ z = E/n e instead.
  Point start(double energy, bool on_path) const {
    const double each = energy / static_cast<double>(problem_.cones.size());
    Point point;
    point.x = Eigen::Map<const Vector>(problem_.lambda.data(), problem_.rows());
    point.v = Vector::Zero(problem_.unknowns);
    problem_.add_forces(point.x.data(), point.v.data());
    for (int c = 0; c < problem_.unknowns; ++c) // bodies: as if their inertia were diagonal
      point.v[c] /= problem_.mass.coeff(c, c);
    point.z = rates(point.v);
    for (const auto& cone : problem_.cones) {
      double *x = point.x.data() + cone.row, *z = point.z.data() + cone.row;
      const double mu = friction(cone);
      x[0] *= mu;
      push_in(x, cone.size, std::sqrt(each / cone.scale));
      z[0] += mu * jordan::tangent_norm(z, cone.size);
      for (int k = 1; k < cone.size; ++k)
        z[k] *= mu;
      push_in(z, cone.size, std::sqrt(each * cone.scale));
      if (on_path) { // τ x⁻¹
        const double factor = each / jordan::inner_determinant(x, cone.size);
        for (int k = 0; k < cone.size; ++k)
          z[k] = (k == 0 ? factor : -factor) * x[k];
      }
    }
    return point;
  }

  Vector lambda(const Point& point) const {
    Vector result = point.x;
    for (const auto& cone : problem_.cones)
      result[cone.row] /= friction(cone);
    return result;
  }
  /// Mean of x·z.
  double energy(const Point& point) const {
    return point.x.dot(point.z) / static_cast<double>(problem_.cones.size());
  }

  /// What is left of the equations at a point: momentum, and z of its definition.
  struct Residuals {
    Vector momentum, rates;
  };
  Residuals residuals(const Point& point) const {
    Residuals left{problem_.mass * point.v, rates(point.v)};
    Vector forces = Vector::Zero(problem_.unknowns);
    const Vector l = lambda(point);
    problem_.add_forces(l.data(), forces.data());
    left.momentum -= forces;
    for (const auto& cone : problem_.cones) {
      double* z = left.rates.data() + cone.row;
      const double mu = friction(cone);
      z[0] += mu * jordan::tangent_norm(z, cone.size);
      for (int k = 1; k < cone.size; ++k)
        z[k] *= mu;
    }
    left.rates -= point.z;
    return left;
  }

  /// Prepares for direction() at a point. false: the matrix is singular.
  bool factorise(const Point& point, Coupling coupling) {
    const Vector gamma = rates(point.v);
    for (std::size_t i = 0; i < scaling_.size(); ++i) {
      const auto& cone = problem_.cones[i];
      scaling_[i] =
          jordan::Scaling(point.x.data() + cone.row, point.z.data() + cone.row, cone.size);
      const double* g = gamma.data() + cone.row;
      const double slip = coupling == Coupling::full ? jordan::tangent_norm(g, cone.size) : 0;
      for (int k = 1; k < cone.size; ++k)
        slip_[cone.row + k] = slip > 0 ? g[k] / slip : 0;
    }
    problem_.assemble(
        [&](std::size_t i, double* q) {
          const auto& cone = problem_.cones[i];
          const double* w = scaling_[i].w;
          const double mu = friction(cone), eta = scaling_[i].eta;
          for (int r = 0; r < cone.size; ++r) {
            double* of_row = q + std::ptrdiff_t{r} * cone.size;
            for (int c = 0; c < cone.size; ++c)
              of_row[c] = eta *
                          (2 * w[r] * w[c] - (r != c   ? 0
                                              : r == 0 ? 1
                                                       : -1)) *
                          (c == 0 ? 1 : mu) / (r == 0 ? mu : 1);
            for (int c = 1; c < cone.size; ++c)
              of_row[c] += mu * of_row[0] * slip_[cone.row + c];
          }
        },
        matrix_);
    factors_.factorize(matrix_);
    scaled_ = applied(point.z, false);
    return factors_.info() == Eigen::Success;
  }
  /// The sign of the matrix' determinant: negative beyond a fold of the path.
  double sign() { return factors_.signDeterminant(); }

  /// The step that takes `left` away to first order, with x ∘ z → the product in the scaled frame,
  /// v ∘ v + products (of_products: v ∘ v included).
  Point direction(const Residuals& left, const Vector& products) {
    const Vector change = applied(divided(products, scaled_), false);
    Point step;
    Vector force = change - squared(left.rates);
    unscale(force);
    step.v = -left.momentum;
    problem_.add_forces(force.data(), step.v.data());
    step.v = factors_.solve(step.v).eval();
    step.z = Vector::Zero(problem_.rows());
    problem_.add_rates(step.v.data(), step.z.data());
    for (const auto& cone : problem_.cones) {
      double* z = step.z.data() + cone.row;
      const double mu = friction(cone);
      z[0] += mu * jordan::dot(slip_.data() + cone.row + 1, z + 1, cone.size - 1);
      for (int k = 1; k < cone.size; ++k)
        z[k] *= mu;
    }
    step.z += left.rates;
    step.x = change - squared(step.z);
    return step;
  }

  /// v ∘ v, v = W z = W⁻¹ x.
  Vector square() const { return product(scaled_, scaled_); }
  const Vector& identity() const { return identity_; }
  /// (W⁻¹ dx) ∘ (W dz).
  Vector second_order(const Point& step) const {
    return product(applied(step.x, true), applied(step.z, false));
  }
  /// W⁻¹ dx and W dz, one under the other.
  Vector in_frame(const Point& step) const {
    Vector both(2 * problem_.rows());
    both << applied(step.x, true), applied(step.z, false);
    return both;
  }
  /// The largest norm of a cone's part of in_frame().
  double largest(const Vector& both) const {
    double largest = 0;
    for (const auto& cone : problem_.cones) {
      const double* x = both.data() + cone.row;
      const double* z = x + problem_.rows();
      largest = std::max(largest, jordan::dot(x, x, cone.size) + jordan::dot(z, z, cone.size));
    }
    return std::sqrt(largest);
  }
  /// The longest t ≤ most with point + t step inside the cones.
  double longest(const Point& point, const Point& step, double most) const {
    for (const auto& cone : problem_.cones)
      for (const auto& [of, d] : {std::pair(&point.x, &step.x), std::pair(&point.z, &step.z)})
        most = std::min(
            most, jordan::step_to_boundary(of->data() + cone.row, d->data() + cone.row, cone.size));
    return most;
  }
  std::size_t cones() const { return problem_.cones.size(); }

 private:
  using Cone = SparseProblem::Cone;

  /// μ; any number will do for a cone without friction, which has one row.
  static double friction(const Cone& cone) {
    return cone.size == 1 ? 1 : std::max(cone.friction, 1e-9);
  }

  static void push_in(double* x, int n, double least) {
    x[0] += std::max(0.0, least - (x[0] - jordan::tangent_norm(x, n)));
  }
  Vector rates(const Vector& v) const {
    Vector result = Eigen::Map<const Vector>(problem_.start.data(), problem_.rows());
    problem_.add_rates(v.data(), result.data());
    return result;
  }
  void unscale(Vector& x) const {
    for (const auto& cone : problem_.cones)
      x[cone.row] /= friction(cone);
  }
  /// visit(i, cone) for all cones.
  template <class Visit>
  void each(const Visit& visit) const {
    for (std::size_t i = 0; i < problem_.cones.size(); ++i)
      visit(i, problem_.cones[i]);
  }
  Vector applied(const Vector& v, bool inverse) const {
    Vector result(v.size());
    each([&](std::size_t i, const Cone& cone) {
      scaling_[i].apply(v.data() + cone.row, cone.size, inverse, result.data() + cone.row);
    });
    return result;
  }
  Vector squared(const Vector& v) const {
    Vector result(v.size());
    each([&](std::size_t i, const Cone& cone) {
      scaling_[i].squared(v.data() + cone.row, cone.size, result.data() + cone.row);
    });
    return result;
  }
  Vector product(const Vector& a, const Vector& b) const {
    Vector result(a.size());
    each([&](std::size_t, const Cone& cone) {
      jordan::product(a.data() + cone.row, b.data() + cone.row, cone.size,
                      result.data() + cone.row);
    });
    return result;
  }
  Vector divided(const Vector& a, const Vector& b) const {
    Vector result(a.size());
    each([&](std::size_t, const Cone& cone) {
      jordan::divide(a.data() + cone.row, b.data() + cone.row, cone.size, result.data() + cone.row);
    });
    return result;
  }

  const SparseProblem& problem_;
  Eigen::SparseMatrix<double> matrix_;
  Eigen::SparseLU<Eigen::SparseMatrix<double>, Eigen::NaturalOrdering<int>> factors_;
  Array<jordan::Scaling> scaling_; ///< #cones
  Vector slip_;                    ///< γ_T/|γ_T|, #rows; 0 if lagged
  Vector scaled_;                  ///< v
  Vector identity_;
};

} // namespace detail

/// Interior-point method for the whole problem, to residuals that sweeps do not reach: Newton steps
/// along the central path (detail::CentralPath) with Mehrotra's corrector, on the non-associated
/// law itself. Each iteration factorises a sparse matrix of all velocities, on one thread, so it is
/// for problems of some thousand cones, in 2-D above all.
///
/// The path of Coulomb's law has folds where much friction jams the medium; Newton's method stalls
/// beyond them, where the determinant is negative. There the next steps are made with |γ_T| lagged,
/// whose matrix is that of a convex problem; and if that has not helped in `newton_iterations`, the
/// path is followed from its start by arc length, τ growing where the determinant is negative,
/// which takes it round folds.
///
/// After Mehrotra 1992; Nesterov & Todd 1997; Acary, Armand, Nguyen & Shpakovych 2024 (interior
/// points for contact with friction); Smale 1976 (the sign of the determinant).
class InteriorPoint {
 public:
  struct Params {
    double tolerance = 1e-8;    ///< for the l2 residual of dual/residual.hpp
    int newton_iterations = 80; ///< before the path is followed by arc length
    int max_iterations = 400;   ///< in all
  };
  template <int Dim>
  struct Workspace {
    ResidualMeter<Dim> meter;
    Array<double> inverse_scale; ///< #cones
  };

  InteriorPoint() = default;

  /// Throws std::invalid_argument if a parameter is out of range.
  explicit InteriorPoint(const Params& params) : params_(params) {
    require_positive("solver.tolerance", params_.tolerance);
    if (params_.newton_iterations < 1)
      throw_invalid("solver.newton_iterations", params_.newton_iterations, "an integer >= 1");
    if (params_.max_iterations < 1)
      throw_invalid("solver.max_iterations", params_.max_iterations, "an integer >= 1");
  }

  const Params& params() const { return params_; }

  /// Leaves the best point of all iterations. Several ranks each solve the whole problem, to the
  /// same bits.
  template <int Dim>
  SolveReport solve(DualProblem<Dim>& problem, Workspace<Dim>& workspace,
                    const Execution& execution) const {
    if (const Communicator* const ranks = execution.communicator(); ranks && ranks->size() > 1) {
      DualProblem<Dim> whole = gathered(problem, *ranks);
      const SolveReport report = solve(whole, workspace, Execution(execution.threads()));
      give_part(whole, problem);
      return report;
    }
    const auto start = std::chrono::steady_clock::now();
    const Stencil<Dim> stencil(problem.grid);
    workspace.inverse_scale.resize(problem.cones());
    for (std::size_t i = 0; i < problem.cones(); ++i) {
      const double trace = diagonal_block(problem, stencil, i).trace();
      workspace.inverse_scale[i] = trace > 0 ? symmetric_size<Dim> / trace : 0;
    }
    const auto measure = [&] {
      return workspace.meter(problem, stencil, workspace.inverse_scale, execution);
    };
    SolveReport report;
    report.residual = measure();
    if (workspace.meter.stress() > wedged) {
      remove_impulses(problem, stencil);
      report.residual = measure();
    }
    if (report.residual.finite() && !(report.residual.l2 <= params_.tolerance)) {
      const SparseForm<Dim> form(problem);
      Search search(form.sparse, energy(problem, form.sparse), params_);
      Eigen::VectorXd best =
          Eigen::Map<const Eigen::VectorXd>(form.sparse.lambda.data(), form.sparse.rows());
      while (report.iterations < params_.max_iterations && search.advance()) {
        ++report.iterations;
        const Eigen::VectorXd lambda = search.lambda();
        form.put(lambda.data(), problem, execution);
        if (const Residual now = measure(); now.finite() && now.l2 < report.residual.l2) {
          report.residual = now;
          best = lambda;
          if (now.l2 <= params_.tolerance)
            break;
        }
      }
      form.put(best.data(), problem, execution);
    }
    if (!report.residual.finite())
      report.status = SolveStatus::not_finite;
    else if (!(report.residual.l2 <= params_.tolerance))
      report.status = SolveStatus::not_converged;
    report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
  }

 private:
  /// Material that sticks between walls of friction bears self-stress of any size; interior points
  /// go to its middle, and from one step's to a larger one in the next. A warm start with so many
  /// times the energy of the step's velocity scale is dropped; n layers at rest have about n²/3.
  static constexpr double wedged = 1e6;

  /// The energy that the residual is compared with, in units of SparseProblem::lambda.
  template <int Dim>
  static double energy(const DualProblem<Dim>& problem, const SparseProblem& sparse) {
    double of_stress = 0;
    for (const auto& cone : sparse.cones)
      of_stress += cone.scale * jordan::dot(sparse.lambda.data() + cone.row,
                                            sparse.lambda.data() + cone.row, cone.size);
    const double least = sparse.moving_mass / Dim * problem.velocity_scale * problem.velocity_scale;
    const double energy = std::max(of_stress, least);
    if (energy > 0)
      return energy;
    double of_rates = 0; // without stress and gravity, all at rest: an obstacle moves
    for (const auto& cone : sparse.cones)
      if (cone.scale > 0)
        of_rates +=
            jordan::dot(sparse.start.data() + cone.row, sparse.start.data() + cone.row, cone.size) /
            cone.scale;
    return of_rates;
  }

  class Search {
   public:
    using Path = detail::CentralPath;
    Search(const SparseProblem& problem, double energy, const Params& params)
        : params_(params), path_(problem), energy_(energy), point_(path_.start(energy, false)) {}

    Eigen::VectorXd lambda() const { return path_.lambda(point_); }

    /// One step; false: it cannot go on.
    bool advance() {
      ++iterations_;
      if (iterations_ == params_.newton_iterations + 1) {
        point_ = path_.start(energy_, true);
        first_ = path_.residuals(point_);
        first_tau_ = energy_ / static_cast<double>(path_.cones());
      }
      if (iterations_ > params_.newton_iterations)
        return path_.factorise(point_, Path::Coupling::full) && arc_step();
      if (lagged_ == 0) {
        if (!path_.factorise(point_, Path::Coupling::full))
          return false;
        if (path_.sign() > 0)
          return newton_step();
        lagged_ = 20;
      }
      --lagged_;
      return path_.factorise(point_, Path::Coupling::lagged) && newton_step();
    }

   private:
    bool newton_step() {
      const auto left = path_.residuals(point_);
      const double tau = path_.energy(point_);
      const Eigen::VectorXd square = path_.square();
      const auto affine = path_.direction(left, -square);
      const double reach = path_.longest(point_, affine, 1);
      const double then =
          path_.energy({point_.v, point_.x + reach * affine.x, point_.z + reach * affine.z});
      double centring = std::clamp(std::pow(then / tau, 3), 1e-6, 1.0);
      if (reach < 0.1)
        centring = std::max(centring, 0.5);
      const auto step = path_.direction(left, centring * tau * path_.identity() - square -
                                                  path_.second_order(affine));
      const double length = std::min(1.0, 0.99 * path_.longest(point_, step, 2));
      return move(step, length);
    }

    /// A step along { residuals = t · those of the start, x ∘ z = t τ_0 e }: back to the path at
    /// right angles to it, and on along its tangent.
    bool arc_step() {
      const auto left = path_.residuals(point_);
      const double tau = t_ * first_tau_;
      const auto to_zero = path_.direction(left, -path_.square());
      const Path::Residuals minus{-first_.momentum, -first_.rates};
      const auto tangent = path_.direction(minus, first_tau_ * path_.identity());
      const auto corrector = sum(to_zero, t_, tangent);
      const Eigen::VectorXd along = path_.in_frame(tangent) / std::sqrt(tau),
                            back = path_.in_frame(corrector) / std::sqrt(tau);
      const double n = static_cast<double>(path_.cones());
      const double part = back.dot(along) / (along.squaredNorm() + n / (t_ * t_));
      auto step = sum(corrector, -part, tangent);
      double change = -part;
      const double off = path_.largest(back - part * along);
      const double direction = path_.sign() > 0 ? -1 : 1; // of t
      const auto ahead = scaled(tangent, direction);
      const double reach = path_.longest(point_, ahead, direction < 0 ? t_ : 1e3 * t_);
      if (off > 0.7 && moved_) {
        share_ = std::max(0.5 * share_, 0.02);
      } else {
        if (off < 0.3)
          share_ = std::min(0.95, 1.5 * share_);
        double further = share_ * reach * direction;
        if (t_ + change + further <= 0.01 * t_)
          further = 0.01 * t_ - t_ - change;
        step = sum(step, further, tangent);
        const Path::Residuals none{Eigen::VectorXd::Zero(left.momentum.size()),
                                   Eigen::VectorXd::Zero(left.rates.size())};
        step = sum(step, 1, path_.direction(none, -path_.second_order(step)));
        change += further;
      }
      moved_ = true;
      const double length = std::min(1.0, 0.98 * path_.longest(point_, step, 2));
      t_ = std::max(t_ + length * change, 1e-3 * t_);
      return move(step, length);
    }

    static Path::Point sum(const Path::Point& a, double factor, const Path::Point& b) {
      return {a.v + factor * b.v, a.x + factor * b.x, a.z + factor * b.z};
    }
    static Path::Point scaled(const Path::Point& a, double factor) {
      return {factor * a.v, factor * a.x, factor * a.z};
    }
    bool move(const Path::Point& step, double length) {
      point_ = sum(point_, length, step);
      return point_.v.allFinite() && point_.x.allFinite() && point_.z.allFinite();
    }

    const Params& params_;
    Path path_;
    double energy_;
    Path::Point point_;
    int iterations_ = 0, lagged_ = 0;
    Path::Residuals first_;
    double first_tau_ = 0, t_ = 1, share_ = 0.5;
    bool moved_ = false;
  };

  Params params_{};
};

} // namespace talus
