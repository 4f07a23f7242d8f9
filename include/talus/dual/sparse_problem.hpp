// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/nested_dissection.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"

#include <Eigen/LU>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace talus {

/// A dual problem as rows of numbers, cones and contacts alike, for solvers that factorise:
/// \f[ γ = H v + γ_0, \quad M v = H^T λ, \quad v = u − u_{\text{free}}, \f]
/// with one λ for all (twice the stress impulse, or a contact's impulse) and one law, Coulomb's.
/// Unknowns are the components of nodal velocities that can change, in an order in which factors
/// fill little, then the velocities of bodies.
struct SparseProblem {
  /// Rows row..row+size−1, normal first (that alone without friction); they share `columns`, and
  /// `entries` holds them row by row.
  struct Cone {
    int row = 0, size = 0;
    double friction = 0;
    double scale = 0; ///< tr(H M⁻¹ Hᵀ)/size of its rows
    std::size_t columns = 0, columns_end = 0, entries = 0;
  };
  Array<Cone> cones;
  Array<int> columns; ///< ascending in each cone
  Array<double> entries;
  Array<double> start;              ///< γ_0, #rows
  Array<double> lambda;             ///< #rows
  Eigen::SparseMatrix<double> mass; ///< diagonal but for the inertia of bodies
  double moving_mass = 0; ///< of nodes, and of bodies that touch something, kg; Σ over the axes
  int unknowns = 0;

  int rows() const { return static_cast<int>(start.size()); }

  /// result += H v, #rows.
  void add_rates(const double* v, double* result) const {
    for (const Cone& cone : cones)
      for (int k = 0; k < cone.size; ++k)
        result[cone.row + k] += row_dot(cone, k, v);
  }
  /// result += Hᵀ λ, #unknowns.
  void add_forces(const double* values, double* result) const {
    for (const Cone& cone : cones)
      for (int k = 0; k < cone.size; ++k) {
        const double value = values[cone.row + k];
        const double* entry = row(cone, k);
        for (std::size_t c = cone.columns; c < cone.columns_end; ++c)
          result[columns[c]] += value * *entry++;
      }
  }

  /// The matrix M + Σ H_iᵀ Q_i H_i with all Q zero, and room for them.
  Eigen::SparseMatrix<double> pattern() const {
    Array<Array<int>> neighbours(static_cast<std::size_t>(unknowns));
    for (const Cone& cone : cones)
      for (std::size_t a = cone.columns; a < cone.columns_end; ++a) {
        auto& list = neighbours[static_cast<std::size_t>(columns[a])];
        for (std::size_t b = cone.columns; b < cone.columns_end; ++b)
          list.push_back(columns[b]);
        if (list.size() > 4096)
          sort_unique(list);
      }
    Eigen::SparseMatrix<double> result(unknowns, unknowns);
    Eigen::Index entries_in_all = 0;
    for (int c = 0; c < unknowns; ++c) {
      auto& list = neighbours[static_cast<std::size_t>(c)];
      for (Eigen::SparseMatrix<double>::InnerIterator m(mass, c); m; ++m)
        list.push_back(static_cast<int>(m.row()));
      sort_unique(list);
      entries_in_all += static_cast<Eigen::Index>(list.size());
    }
    result.reserve(entries_in_all);
    for (int c = 0; c < unknowns; ++c) {
      result.startVec(c);
      for (const int r : neighbours[static_cast<std::size_t>(c)])
        result.insertBack(r, c) = 0;
    }
    result.finalize();
    return result;
  }

  /// Sets `matrix`, of that pattern, to M + Σ H_iᵀ Q_i H_i. block(i, q) fills the Q of cone i,
  /// size × size, row by row.
  template <class Block>
  void assemble(const Block& block, Eigen::SparseMatrix<double>& matrix) const {
    std::fill_n(matrix.valuePtr(), matrix.nonZeros(), 0.0);
    for (int c = 0; c < unknowns; ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator m(mass, c); m; ++m)
        matrix.coeffRef(m.row(), c) = m.value();
    double q[36];
    Array<double> product; // Q H, as `entries`
    for (std::size_t i = 0; i < cones.size(); ++i) {
      const Cone& cone = cones[i];
      const std::size_t n = cone.columns_end - cone.columns;
      block(i, q);
      product.assign(n * static_cast<std::size_t>(cone.size), 0);
      for (int r = 0; r < cone.size; ++r)
        for (int k = 0; k < cone.size; ++k)
          for (std::size_t c = 0; c < n; ++c)
            product[static_cast<std::size_t>(r) * n + c] += q[r * cone.size + k] * row(cone, k)[c];
      for (std::size_t c = 0; c < n; ++c) {
        const int column = columns[cone.columns + c];
        const int* inner = matrix.innerIndexPtr() + matrix.outerIndexPtr()[column];
        double* value = matrix.valuePtr() + matrix.outerIndexPtr()[column];
        for (std::size_t r = 0; r < n; ++r) {
          while (*inner < columns[cone.columns + r]) {
            ++inner;
            ++value;
          }
          for (int k = 0; k < cone.size; ++k)
            *value += row(cone, k)[r] * product[static_cast<std::size_t>(k) * n + c];
        }
      }
    }
  }

 private:
  const double* row(const Cone& cone, int k) const {
    return entries.data() + cone.entries +
           static_cast<std::size_t>(k) * (cone.columns_end - cone.columns);
  }
  double row_dot(const Cone& cone, int k, const double* v) const {
    const double* entry = row(cone, k);
    double sum = 0;
    for (std::size_t c = cone.columns; c < cone.columns_end; ++c)
      sum += *entry++ * v[columns[c]];
    return sum;
  }
  static void sort_unique(Array<int>& list) {
    std::sort(list.begin(), list.end());
    list.resize(static_cast<std::size_t>(std::unique(list.begin(), list.end()) - list.begin()));
  }
};

/// The sparse form of a problem on one rank, and back.
template <int Dim>
class SparseForm {
 public:
  SparseProblem sparse;

  /// `problem` stays as it is.
  explicit SparseForm(const DualProblem<Dim>& problem) : free_(problem), stencil_(problem.grid) {
    remove_impulses(free_, stencil_);
    free_.copies.copy(free_.velocity, Execution());
    number_unknowns();
    for (std::size_t i = 0; i < problem.cones(); ++i)
      add_cone(i, problem.stress_impulse[i]);
    for (std::size_t c = 0; c < problem.contacts.size(); ++c)
      add_contact(free_.contacts[c], problem.contacts[c].impulse, -1);
    for (std::size_t c = 0; c < problem.body_contacts.size(); ++c)
      add_contact(free_.body_contacts[c], problem.body_contacts[c].impulse, static_cast<int>(c));
    add_scales();
  }

  /// Gives `problem` the stresses and impulses `lambda` (#rows) and the velocities that go with
  /// them.
  void put(const double* lambda, DualProblem<Dim>& problem, const Execution& execution) const {
    constexpr int s = symmetric_size<Dim>;
    problem.velocity = free_.velocity;
    problem.bodies = free_.bodies;
    const int* row = row_.data();
    for (std::size_t i = 0; i < problem.cones(); ++i, ++row)
      for (int k = 0; k < s; ++k)
        if (*row >= 0)
          problem.stress_impulse[i][k] =
              k > 0 && !(problem.opening[i] > 0) ? 0 : 0.5 * lambda[*row + k];
    const auto put_contact = [&](Contact<Dim>& contact) {
      const Mat<Dim> axes = frame(contact.normal);
      if (*row >= 0) {
        contact.impulse = lambda[*row] * axes.col(0);
        for (int k = 1; k < Dim && contact.friction > 0; ++k)
          contact.impulse += lambda[*row + k] * axes.col(k);
      }
      ++row;
    };
    for (auto& contact : problem.contacts)
      put_contact(contact);
    for (auto& contact : problem.body_contacts)
      put_contact(contact);
    apply_impulses(problem, stencil_, execution);
  }

 private:
  using Cone = SparseProblem::Cone;

  /// An orthonormal frame: the normal and tangents.
  static Mat<Dim> frame(const Vec<Dim>& normal) {
    Eigen::Index along = 0;
    normal.cwiseAbs().minCoeff(&along);
    Mat<Dim> axes;
    axes.col(0) = normal;
    Vec<Dim> tangent = Vec<Dim>::Unit(along);
    tangent -= normal.dot(tangent) * normal;
    axes.col(1) = tangent.normalized();
    if constexpr (Dim == 3)
      axes.col(2) = torque<3>(axes.col(0), axes.col(1));
    return axes;
  }

  static bool rotates(const FreeBody<Dim>& body) { return !body.inverse_inertia.isZero(0); }

  bool touches(int body) const {
    return std::any_of(
        free_.body_contacts.begin(), free_.body_contacts.end(),
        [&](const BodyContact<Dim>& c) { return c.body == body || c.other == body; });
  }

  void number_unknowns() {
    unknown_.assign(free_.velocity.size() * Dim, -1);
    Array<double> masses;
    Array<int> nodes;
    for (int j = 0; j < free_.grid.node_count(); ++j)
      if (free_.grid.owner(j) == j && free_.inverse_mass[j].maxCoeff() > 0)
        nodes.push_back(j);
    dissect(free_.grid, nodes.data(), nodes.data() + nodes.size());
    for (const int j : nodes)
      for (int a = 0; a < Dim; ++a)
        if (const double w = free_.inverse_mass[j][a]; w > 0) {
          unknown_[Dim * j + a] = static_cast<int>(masses.size());
          masses.push_back(1 / w);
        }
    constexpr int spin = spin_size<Dim>;
    sparse.unknowns = static_cast<int>(masses.size());
    sparse.moving_mass = std::accumulate(masses.begin(), masses.end(), 0.0);
    for (std::size_t b = 0; b < free_.bodies.size(); ++b)
      if (touches(static_cast<int>(b)))
        sparse.moving_mass += Dim / free_.bodies[b].inverse_mass;
    for (const FreeBody<Dim>& body : free_.bodies) {
      body_unknown_.push_back(sparse.unknowns);
      sparse.unknowns += rotates(body) ? Dim + spin : Dim;
    }
    sparse.mass.resize(sparse.unknowns, sparse.unknowns);
    sparse.mass.reserve(Eigen::VectorXi::Constant(sparse.unknowns, spin));
    for (std::size_t j = 0; j < masses.size(); ++j)
      sparse.mass.insert(static_cast<int>(j), static_cast<int>(j)) = masses[j];
    for (std::size_t k = 0; k < free_.bodies.size(); ++k) {
      const FreeBody<Dim>& body = free_.bodies[k];
      const int at = body_unknown_[k];
      for (int a = 0; a < Dim; ++a)
        sparse.mass.insert(at + a, at + a) = 1 / body.inverse_mass;
      if (!rotates(body))
        continue;
      const Mat<spin> inertia = body.inverse_inertia.inverse();
      for (int b = 0; b < spin; ++b)
        for (int a = 0; a < spin; ++a)
          sparse.mass.insert(at + Dim + a, at + Dim + b) = inertia(a, b);
    }
    sparse.mass.makeCompressed();
  }

  /// One column of the rows of a cone: unknown and `size` numbers.
  using Columns = Array<std::pair<int, Vec<6>>>;

  /// A cone that nothing can move has no rows.
  template <int N>
  void add(double friction, Columns& list, const Vec<N>& gamma, const Vec<N>& lambda) {
    row_.push_back(list.empty() ? -1 : sparse.rows());
    if (list.empty())
      return;
    std::sort(list.begin(), list.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    Cone cone;
    cone.row = sparse.rows();
    cone.size = friction > 0 ? N : 1; // without friction there is no tangent to solve for
    cone.friction = friction;
    cone.columns = sparse.columns.size();
    cone.entries = sparse.entries.size();
    for (const auto& column : list)
      sparse.columns.push_back(column.first);
    cone.columns_end = sparse.columns.size();
    for (int k = 0; k < cone.size; ++k) {
      for (const auto& column : list)
        sparse.entries.push_back(column.second[k]);
      sparse.start.push_back(gamma[k]);
      sparse.lambda.push_back(lambda[k]);
    }
    sparse.cones.push_back(cone);
  }

  void add_cone(std::size_t i, const Vec<symmetric_size<Dim>>& stress) {
    constexpr int s = symmetric_size<Dim>;
    Columns list;
    const GradientWeights<Dim>& g = free_.gradient_weights[i];
    for (int k = 0; k < ipow(3, Dim); ++k) {
      if (g.col(k).isZero(0))
        continue;
      const int j = free_.grid.owner(free_.node[i] + free_.grid.neighbour_offset(k));
      for (int a = 0; a < Dim; ++a)
        if (const int unknown = unknown_[Dim * j + a]; unknown >= 0) {
          Mat<Dim> gradient = Mat<Dim>::Zero();
          gradient.row(a) = g.col(k).transpose();
          Vec<6> column = Vec<6>::Zero();
          column.head<s>() = symmetric_to_vector<Dim, double>(gradient);
          list.emplace_back(unknown, column);
        }
    }
    Vec<s> gamma = integrated_strain_rate(free_, stencil_, i);
    gamma[0] += free_.free_volume_rate[i];
    add<s>(free_.opening[i], list, gamma, 2 * stress);
  }

  /// body_contact: its number, or −1.
  void add_contact(const Contact<Dim>& contact, const Vec<Dim>& impulse, int body_contact) {
    const Mat<Dim> axes = frame(contact.normal);
    Columns list;
    const auto put_column = [&](int unknown, const Vec<Dim>& velocity) {
      Vec<6> column = Vec<6>::Zero();
      column.template head<Dim>() = axes.transpose() * velocity;
      list.emplace_back(unknown, column);
    };
    if (contact.node >= 0)
      for (int a = 0; a < Dim; ++a)
        if (const int unknown = unknown_[Dim * free_.grid.owner(contact.node) + a]; unknown >= 0)
          put_column(unknown, Vec<Dim>::Unit(a));
    Vec<Dim> relative = -contact.wall_velocity;
    if (body_contact < 0) {
      relative += free_.velocity[contact.node].template head<Dim>();
    } else {
      const BodyContact<Dim>& of_body = free_.body_contacts[body_contact];
      relative = contact_velocity(of_body);
      const auto put_body = [&](int body, const Vec<Dim>& arm, double sign) {
        const int at = body_unknown_[body];
        for (int a = 0; a < Dim; ++a)
          put_column(at + a, sign * Vec<Dim>::Unit(a));
        for (int a = 0; a < spin_size<Dim> && rotates(free_.bodies[body]); ++a)
          put_column(at + Dim + a, sign * cross<Dim>(Spin<Dim>::Unit(a), arm));
      };
      put_body(of_body.body, of_body.arm, -1);
      if (of_body.other >= 0)
        put_body(of_body.other, of_body.other_arm, 1);
    }
    add<Dim>(contact.friction, list, axes.transpose() * relative, axes.transpose() * impulse);
  }

  Vec<Dim> contact_velocity(const BodyContact<Dim>& contact) const {
    return relative_velocity(free_, contact) - contact.wall_velocity;
  }

  void add_scales() {
    Array<double> inverse_mass(static_cast<std::size_t>(sparse.unknowns));
    for (int c = 0; c < sparse.unknowns; ++c)
      inverse_mass[static_cast<std::size_t>(c)] = 1 / sparse.mass.coeff(c, c);
    for (Cone& cone : sparse.cones) {
      const double* entry = sparse.entries.data() + cone.entries;
      for (int k = 0; k < cone.size; ++k)
        for (std::size_t c = cone.columns; c < cone.columns_end; ++c, ++entry)
          cone.scale += *entry * *entry *
                        inverse_mass[static_cast<std::size_t>(sparse.columns[c])] / cone.size;
    }
  }

  DualProblem<Dim> free_; ///< without stresses and impulses
  Stencil<Dim> stencil_;
  Array<int> unknown_;      ///< of component a of node j at Dim j + a; −1: none
  Array<int> body_unknown_; ///< first unknown of each body
  Array<int> row_;          ///< first row of each cone, contact and contact of a body; −1: none
};

} // namespace talus
