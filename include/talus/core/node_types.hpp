// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

/// \file
/// What nodes of the grid hold.

namespace talus {

/// A nodal velocity or inverse mass, padded to a power of two so that it loads as one vector.
template <int Dim>
using NodeVec = Vec<Dim == 2 ? 2 : 4>;

/// What couples one node i with its 3^d neighbours j, a column of d numbers (m^(d−1)) for each:
/// \f[ g_{ij} = \sum_p V_p\, N_i(x_p)\, ∇N_j(x_p), \f]
/// or in full cells the integral over the cell, see even_volume().
template <int Dim>
using GradientWeights = RectMat<Dim, ipow(3, Dim)>;

} // namespace talus
