// SPDX-License-Identifier: MIT
#pragma once

#include "talus/rheology/inertial_number.hpp"

#include <concepts>

namespace talus {

/// The friction law of the medium. A model R has
///   - `R::Params`, an aggregate that R is constructible from;
///   - `R::rate_dependent` (bool): if false, friction(I) must not depend on I, and the inertial
///     number is not computed;
///   - `r.friction(I)` → μ, finite and ≥ 0, for 0 ≤ I ≤ ∞; a step that gets anything else is
///   refused
///     and says so (StepReport::invalid_friction);
///   - if rate dependent, `r.inertial_number()` → the InertialNumber that the law was fitted with.
/// Models: ConstantFriction, FrictionLaw<Law> for any function Law of I; MuOfI and
/// HystereticFriction are of that kind.
template <class R>
concept Rheology = std::constructible_from<R, const typename R::Params&> &&
    requires(const R r, double inertial_number) {
  { R::rate_dependent } -> std::convertible_to<bool>;
  { r.friction(inertial_number) } -> std::convertible_to<double>;
} &&(!R::rate_dependent || requires(const R r) {
  { r.inertial_number() } -> std::convertible_to<InertialNumber>;
});

} // namespace talus
