// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/core/parallel.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace talus {

/// How far a dual problem is from being solved, dimensionless.
struct Residual {
  double l2 = 0;  ///< root mean square over cones and contacts
  double max = 0; ///< largest of a cone or contact

  bool finite() const { return std::isfinite(l2) && std::isfinite(max); }
};

/// Measures residuals. Cone i contributes f_MFB(γ_i/w_i, λ_i), w_i = tr W_ii / s, a stress impulse;
/// l2 = sqrt(Σ v_i |f_i|² / Σ v_i |λ_i|²) and max is relative to the same mean stress. Contacts
/// count in the same way with f(w/w_j, r) and the mean impulse. Where there is no stress to compare
/// with, the problem's stress_scale takes its place. All cones count, whatever a solver skipped. A
/// solution whose stresses are wrong by a fraction x shows a residual of about x.
template <int Dim>
class ResidualMeter {
 public:
  /// inverse_scales: 1/w_i, #cones, kg/m^(2d-2).
  Residual operator()(const DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                      const std::vector<double>& inverse_scales, int threads) {
    constexpr int n = symmetric_size<Dim>;
    const Sums bulk = parallel_reduce(
        threads, static_cast<std::ptrdiff_t>(problem.cones()), partials_, Sums{},
        [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
          Sums sums;
          for (std::size_t i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end);
               ++i) {
            Vec<n> gamma = strain_rate(problem, stencil, i);
            gamma[0] += problem.void_rate[i];
            gamma *= inverse_scales[i];
            const double error =
                law_residual(CoulombLaw{}, gamma, problem.stress[i], problem.friction[i])
                    .squaredNorm();
            sums.add(error, problem.stress[i].squaredNorm(), problem.volume[i]);
          }
          return sums;
        },
        Sums::join);

    const double impulse_scale =
        problem.stress_scale * problem.grid.cell_volume() / problem.grid.spacing().minCoeff();
    Sums contacts;
    for (const Contact<Dim>& contact : problem.contacts) {
      const Vec<Dim> w =
          (problem.velocity[static_cast<std::size_t>(contact.node)].template head<Dim>() -
           contact.wall_velocity) /
          contact_inverse_mass(problem, contact);
      // (normal, tangential vector in the frame of the box): the law only sees norms of tangents
      Vec<Dim + 1> gamma, lambda;
      gamma << w.dot(contact.normal), w - w.dot(contact.normal) * contact.normal;
      lambda << contact.impulse.dot(contact.normal),
          contact.impulse - contact.impulse.dot(contact.normal) * contact.normal;
      contacts.add(law_residual(CoulombLaw{}, gamma, lambda, contact.friction).squaredNorm(),
                   lambda.squaredNorm(), 1);
    }

    const double bulk_scale2 = bulk.scale2(problem.stress_scale),
                 contact_scale2 = contacts.scale2(impulse_scale);
    Residual residual;
    residual.l2 = std::sqrt(bulk.mean_error2(bulk_scale2) + contacts.mean_error2(contact_scale2));
    residual.max =
        std::sqrt(std::max(bulk.worst_error2(bulk_scale2), contacts.worst_error2(contact_scale2)));
    return residual;
  }

 private:
  struct Sums {
    double error2 = 0, value2 = 0, weight = 0, worst2 = 0;

    void add(double e2, double v2, double w) {
      error2 += w * e2;
      value2 += w * v2;
      weight += w;
      worst2 = e2 <= worst2 ? worst2 : e2; // a NaN is kept, not lost
    }
    static Sums join(const Sums& a, const Sums& b) {
      return {a.error2 + b.error2, a.value2 + b.value2, a.weight + b.weight,
              b.worst2 <= a.worst2 ? a.worst2 : b.worst2};
    }
    double scale2(double fallback) const {
      return weight > 0 ? std::max(value2 / weight, fallback * fallback) : 0;
    }
    double mean_error2(double scale2) const { return error2 == 0 ? 0 : error2 / weight / scale2; }
    double worst_error2(double scale2) const { return worst2 == 0 ? 0 : worst2 / scale2; }
  };

  std::vector<Sums> partials_;
};

} // namespace talus
