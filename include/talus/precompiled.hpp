// SPDX-License-Identifier: MIT
#pragma once

#include "talus/rheology/laws.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

/// \file
/// Fast rebuilds, for those who want them: files that include this one do not compile the step of
/// the usual simulations again; exactly one file of the program includes
/// talus/precompiled_definitions.hpp, which does. For a combination of one's own, the same two
/// lines in one's own files do the same. Nothing else of the library includes this.

namespace talus {

extern template class Simulation<2, ConstantFriction, PolyPic, GaussSeidel<>>;
extern template class Simulation<3, ConstantFriction, PolyPic, GaussSeidel<>>;
extern template class Simulation<2, MuOfI, PolyPic, GaussSeidel<>>;
extern template class Simulation<3, MuOfI, PolyPic, GaussSeidel<>>;

} // namespace talus
