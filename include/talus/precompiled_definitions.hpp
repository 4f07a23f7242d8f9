// SPDX-License-Identifier: MIT
#pragma once

#include "talus/precompiled.hpp"

/// \file
/// What talus/precompiled.hpp promises. To be included by exactly one .cpp file of a program.

namespace talus {

template class Simulation<2, ConstantFriction, PolyPic, GaussSeidel<>>;
template class Simulation<3, ConstantFriction, PolyPic, GaussSeidel<>>;
template class Simulation<2, MuOfI, PolyPic, GaussSeidel<>>;
template class Simulation<3, MuOfI, PolyPic, GaussSeidel<>>;

} // namespace talus
