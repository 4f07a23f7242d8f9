// SPDX-License-Identifier: MIT
#pragma once

#include "talus/cone/law.hpp"
#include "talus/core/array.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/small_vectors.hpp"
#include "talus/dual/body_contact.hpp"
#include "talus/dual/colouring.hpp"
#include "talus/dual/contact_law.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"

#include <algorithm>
#include <cmath>

namespace talus {

/// How far a dual problem is from being solved, dimensionless.
struct Residual {
  double l2 = 0;  ///< root mean square over cones and contacts
  double max = 0; ///< largest of a cone or contact

  bool finite() const { return std::isfinite(l2) && std::isfinite(max); }
};

/// Measures residuals. Cone i contributes the energy
/// \f[ e_i = w_i\, |f_{MFB}(γ_i/w_i, λ_i)|^2, \quad w_i = \mathrm{tr}\, W_{ii} / s, \f]
/// a contact w_j |f(w/w_j, r)|², w_j the node's inverse mass (a free body's: the bound of its W).
/// Compared with the energy of the solution itself,
/// \f[ l_2 = \sqrt{\sum e / E}, \quad E = \sum_i w_i |λ_i|^2 + \sum_j w_j |r_j|^2, \f]
/// E being at least that of the masses at the problem's velocity_scale; max is the largest sqrt(e)
/// in units of sqrt(E / number). All cones count, whatever a solver skipped. A solution whose
/// stresses are wrong by a fraction x shows a residual of about x. (Weights w_i, not volumes: a
/// tiny stress error on a light node is a large error of its velocity.)
template <int Dim>
class ResidualMeter {
 public:
  /// inverse_scales: 1/w_i, #cones, kg/m^(2d-2).
  Residual operator()(const DualProblem<Dim>& problem, const Stencil<Dim>& stencil,
                      const Array<double>& inverse_scales, const Execution& execution) {
    constexpr int n = symmetric_size<Dim>;
    const double speed2 = problem.velocity_scale * problem.velocity_scale;
    const auto of_block = [&](const Block& block, double* of) {
      Sums sums;
      for (std::size_t i = block.cone_begin; i < block.cone_end; ++i) {
        const double inverse_mass = problem.inverse_mass[problem.node[i]].maxCoeff();
        if (inverse_mass > 0)
          sums.least += speed2 / inverse_mass;
        if (!(inverse_scales[i] > 0))
          continue; // nothing around it moves
        Vec<n> gamma = integrated_strain_rate(problem, stencil, i);
        gamma[0] += problem.free_volume_rate[i];
        gamma *= inverse_scales[i];
        sums.add(law_residual(CoulombLaw{}, gamma, problem.stress_impulse[i], problem.opening[i])
                     .squaredNorm(),
                 problem.stress_impulse[i].squaredNorm(), 1 / inverse_scales[i]);
      }
      for (std::size_t c = block.contact_begin; c < block.contact_end; ++c) {
        const Contact<Dim>& contact = problem.contacts[c];
        const Vec<Dim> u = problem.velocity[contact.node].template head<Dim>();
        add_contact(sums, contact, u, contact_inverse_mass(problem, contact));
      }
      of[0] = sums.error;
      of[1] = sums.energy;
      of[2] = sums.least;
      of[3] = sums.count;
      of[4] = sums.worst;
    };
    const auto total = sum_over_blocks<5>(problem, execution, partials_, of_block);
    double worst = 0;
    for (std::size_t k = 4; k < partials_.size(); k += 5)
      worst = partials_[k] <= worst ? worst : partials_[k]; // a NaN is kept, not lost
    Sums sums{total[0], total[1], total[2], execution.largest(worst), total[3]};
    touched_.assign(problem.bodies.size(), 0); // what touches nothing is no part of the problem
    for (const BodyContact<Dim>& contact : problem.body_contacts) {
      touched_[contact.body] = 1;
      if (contact.other >= 0)
        touched_[contact.other] = 1;
    }
    for (std::size_t b = 0; b < problem.bodies.size(); ++b)
      if (touched_[b] != 0)
        sums.least += speed2 / problem.bodies[b].inverse_mass;
    for (const BodyContact<Dim>& contact : problem.body_contacts)
      add_contact(sums, contact, relative_velocity(problem, contact), contact.inverse_mass);
    stress_ = sums.least > 0 ? sums.energy / sums.least : 0;
    return sums.residual();
  }

  /// E of the impulses that were measured last over E of the step's velocity scale; 0 without one.
  double stress() const { return stress_; }

 private:
  struct Sums {
    double error = 0, energy = 0, least = 0, worst = 0, count = 0;

    void add(double error2, double value2, double weight) {
      const double e = weight * error2;
      error += e;
      energy += weight * value2;
      count += 1;
      worst = e <= worst ? worst : e; // a NaN is kept, not lost
    }
    Residual residual() const {
      if (error == 0)
        return {};
      const double scale = std::max(energy, least);
      if (scale == 0) // nothing to compare with, and not solved
        return {1, 1};
      return {std::sqrt(error / scale), std::sqrt(worst / (scale / count))};
    }
  };

  /// u: Dim, velocity at the contact; inverse_mass: w_j.
  static void add_contact(Sums& sums, const Contact<Dim>& contact, const Vec<Dim>& u,
                          double inverse_mass) {
    const Vec<Dim> w = scaled<Dim>(1 / inverse_mass, minus<Dim>(u, contact.wall_velocity));
    // (normal, tangential vector in the frame of the box): the law only sees norms of tangents
    Vec<Dim + 1> gamma, lambda;
    gamma[0] = dot<Dim>(w, contact.normal);
    lambda[0] = dot<Dim>(contact.impulse, contact.normal);
    for (int a = 0; a < Dim; ++a) {
      gamma[a + 1] = w[a] - gamma[0] * contact.normal[a];
      lambda[a + 1] = contact.impulse[a] - lambda[0] * contact.normal[a];
    }
    sums.add(law_residual(CoulombLaw{}, gamma, lambda, contact.friction).squaredNorm(),
             lambda.squaredNorm(), inverse_mass);
  }

  double stress_ = 0;
  Array<double> partials_; ///< #blocks × 5
  Array<int> touched_;     ///< 1 for bodies with a contact
};

} // namespace talus
