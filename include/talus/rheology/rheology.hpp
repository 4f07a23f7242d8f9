// SPDX-License-Identifier: MIT
#pragma once

#include "talus/rheology/flow_state.hpp"
#include "talus/rheology/inertial_number.hpp"

#include <concepts>

namespace talus {

/// A rheology that sees more than the inertial number: `r.friction(FlowState<Dim>)` → μ. Model:
/// LocalFriction.
template <class R, int Dim>
concept SeesFlow = requires(const R r, const FlowState<Dim>& at) {
  { r.friction(at) } -> std::convertible_to<double>;
};

/// Several rheologies, each with a density: `r.materials()` → their number n > 0; for 0 ≤ m < n
/// `r.density(m)` → ρ_m, kg/m³, and `r.law(m)`, a Rheology itself. Model: Materials.
template <class R>
concept OfMaterials = requires(const R r, int m) {
  { r.materials() } -> std::convertible_to<int>;
  { r.density(m) } -> std::convertible_to<double>;
  r.law(m);
};

/// Is it SeesFlow or OfMaterials? Not a concept: compilers would tell of each piece that is
/// missing.
template <class R>
inline constexpr bool sees_more = OfMaterials<R> || SeesFlow<R, 2> || SeesFlow<R, 3>;

/// The friction law of the medium. A model R has
///   - `R::Params`, an aggregate that R is constructible from;
///   - `R::rate_dependent` (bool): if false, friction(I) must not depend on I, and the inertial
///     number is not computed;
///   - `r.friction(I)` → μ, finite and ≥ 0, for 0 ≤ I ≤ ∞; a step that gets anything else is
///   refused
///     and says so (StepReport::invalid_friction);
///   - if rate dependent, `r.inertial_number()` → the InertialNumber that the law was fitted with.
/// In place of the last two it may see more of the flow, or have several materials: see SeesFlow
/// and OfMaterials.
/// Models: ConstantFriction, FrictionLaw<Law> for any function Law of I; MuOfI and
/// HystereticFriction are of that kind; LocalFriction, Materials.
template <class R>
concept Rheology = std::constructible_from<R, const typename R::Params&> && requires {
  { R::rate_dependent } -> std::convertible_to<bool>;
} &&(sees_more<R> ||
     requires(const R r, double inertial_number) {
       { r.friction(inertial_number) } -> std::convertible_to<double>;
     }) &&
    (sees_more<R> || !R::rate_dependent || requires(const R r) {
      { r.inertial_number() } -> std::convertible_to<InertialNumber>;
    });

} // namespace talus
