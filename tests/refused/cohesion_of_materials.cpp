// SPDX-License-Identifier: MIT
// One cohesion for several materials: it hangs on the material.
// says: cohesion by material: Materials<WithCohesion<Law>>

#include <talus/talus.hpp>

using Law = talus::WithCohesion<talus::Materials<talus::ConstantFriction>>;
talus::Simulation<2, Law, talus::Apic, talus::GaussSeidel<>>* simulation;
