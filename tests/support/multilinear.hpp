// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"

#include <array>

namespace talus {

/// Multilinear shape functions on one cell: N_c(ξ) = Π_a l_{c_a}(ξ_a) with l_0 = 1 − ξ, l_1 = ξ.
template <int Dim>
struct Multilinear {
  static constexpr int corners = ipow(2, Dim);

  /// N of each corner. ξ: d, local coordinates in [0, 1].
  static std::array<double, corners> values(const Vec<Dim>& xi) {
    std::array<double, corners> n;
    for (int c = 0; c < corners; ++c) {
      double product = 1;
      for (int a = 0; a < Dim; ++a)
        product *= Grid<Dim>::corner_bit(c, a) ? xi[a] : 1 - xi[a];
      n[static_cast<std::size_t>(c)] = product;
    }
    return n;
  }

  /// ∇N of each corner, 1/m. ξ as above; inverse_spacing: d, 1/m.
  static std::array<Vec<Dim>, corners> gradients(const Vec<Dim>& xi,
                                                 const Vec<Dim>& inverse_spacing) {
    std::array<Vec<Dim>, corners> g;
    for (int c = 0; c < corners; ++c)
      for (int b = 0; b < Dim; ++b) {
        double product = Grid<Dim>::corner_bit(c, b) ? inverse_spacing[b] : -inverse_spacing[b];
        for (int a = 0; a < Dim; ++a)
          if (a != b)
            product *= Grid<Dim>::corner_bit(c, a) ? xi[a] : 1 - xi[a];
        g[static_cast<std::size_t>(c)][b] = product;
      }
    return g;
  }
};

} // namespace talus
