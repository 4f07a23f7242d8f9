// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/symmetric.hpp"
#include "talus/core/types.hpp"
#include "talus/dual/operator.hpp"
#include "talus/dual/problem.hpp"

#include <cmath>
#include <cstddef>

namespace talus {

/// The strain rate D = sym ∇u at the nodes, as the law of the last step sees it: the mean over the
/// material around a node, from the velocities that the step ended with.
template <int Dim>
class StrainRate {
 public:
  /// flow: anything with problem() and stress_volume(node), such as a Simulation, or with
  /// strain_rate(node); it is read at once, so the field stays that of its last step. Throws what
  /// problem() throws: before the first step there is none.
  template <class Flow>
  explicit StrainRate(const Flow& flow) : grid_(flow.grid()) {
    at_.assign(static_cast<std::size_t>(grid_.node_count()), Mat<Dim>::Zero());
    if constexpr (requires { flow.strain_rate(Index<Dim>()); }) {
      for (int j = 0; j < grid_.node_count(); ++j)
        at_[j] = flow.strain_rate(grid_.node_index(j));
    } else {
      const DualProblem<Dim>& problem = flow.problem();
      const Stencil<Dim> stencil(grid_);
      for (std::size_t i = 0; i < problem.cones(); ++i) {
        const int j = problem.node[i];
        at_[j] = vector_to_symmetric<Dim, double>(integrated_strain_rate(problem, stencil, i)) /
                 flow.stress_volume(grid_.node_index(j));
      }
    }
  }

  /// D, d × d, 1/s; zero where there is no material.
  const Mat<Dim>& operator()(const Index<Dim>& node) const {
    return at_[grid_.node_in_window(node)];
  }

  /// ‖D‖ = sqrt(D:D/2), 1/s: half of the shear rate of a simple shear.
  double norm(const Index<Dim>& node) const { return (*this)(node).norm() / std::sqrt(2.0); }

 private:
  Grid<Dim> grid_;
  Array<Mat<Dim>> at_; ///< #nodes
};

template <class Flow>
StrainRate(const Flow&) -> StrainRate<Flow::dimension>;

} // namespace talus
