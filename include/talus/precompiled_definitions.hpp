// SPDX-License-Identifier: MIT
#pragma once

#include "talus/precompiled.hpp"

/// \file
/// What talus/precompiled.hpp promises. To be included by exactly one .cpp file of a program.

namespace talus {

template class Simulation<2, ConstantFriction, Apic, GaussSeidel<>>;
template class Simulation<3, ConstantFriction, Apic, GaussSeidel<>>;
template class Simulation<2, MuOfI, Apic, GaussSeidel<>>;
template class Simulation<3, MuOfI, Apic, GaussSeidel<>>;

} // namespace talus
