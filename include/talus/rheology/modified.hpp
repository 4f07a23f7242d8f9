// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/friction_law.hpp"
#include "talus/rheology/inertial_number.hpp"

#include <type_traits>

/// \file
/// The parameters of a rheology with something added, in one list: those of the rheology at the
/// bottom as `.law`, or `.law` and `.inertial` of a FrictionLaw, and then `.cohesion` and
/// `.viscosity`, whichever there are, in any order of the types.

namespace talus {

template <class Law>
class WithCohesion;
template <class Law>
class WithViscosity;

/// What a rheology is made of.
template <class R>
struct Composition {
  using Bottom = R;
  static constexpr bool cohesive = false, viscous = false;
};
template <class Law>
struct Composition<WithCohesion<Law>> : Composition<Law> {
  static constexpr bool cohesive = true;
};
template <class Law>
struct Composition<WithViscosity<Law>> : Composition<Law> {
  static constexpr bool viscous = true;
};

/// c: Pa, ≥ 0; η: Pa s, ≥ 0.
template <class Bottom, bool cohesive, bool viscous>
struct ModifiedParams;
template <class Bottom>
struct ModifiedParams<Bottom, true, false> {
  typename Bottom::Params law{};
  double cohesion = not_given;
};
template <class Bottom>
struct ModifiedParams<Bottom, false, true> {
  typename Bottom::Params law{};
  double viscosity = not_given;
};
template <class Bottom>
struct ModifiedParams<Bottom, true, true> {
  typename Bottom::Params law{};
  double cohesion = not_given;
  double viscosity = not_given;
};
template <class Law>
requires FrictionFunction<std::remove_cv_t<Law>>
struct ModifiedParams<FrictionLaw<Law>, true, false> {
  decltype(FrictionLaw<Law>::Params::law) law{};
  InertialNumber inertial{};
  double cohesion = not_given;
};
template <class Law>
requires FrictionFunction<std::remove_cv_t<Law>>
struct ModifiedParams<FrictionLaw<Law>, false, true> {
  decltype(FrictionLaw<Law>::Params::law) law{};
  InertialNumber inertial{};
  double viscosity = not_given;
};
template <class Law>
requires FrictionFunction<std::remove_cv_t<Law>>
struct ModifiedParams<FrictionLaw<Law>, true, true> {
  decltype(FrictionLaw<Law>::Params::law) law{};
  InertialNumber inertial{};
  double cohesion = not_given;
  double viscosity = not_given;
};

template <class R>
using ParamsOf = ModifiedParams<typename Composition<R>::Bottom, Composition<R>::cohesive,
                                Composition<R>::viscous>;

/// Those of Law among the parameters of a rheology that adds to it.
template <class Law, class Params>
typename Law::Params params_of_law(const Params& params) {
  using Of = typename Law::Params;
  if constexpr (std::is_same_v<Of, std::remove_cvref_t<decltype(params.law)>>) {
    return params.law;
  } else {
    Of of;
    of.law = params.law;
    if constexpr (requires { of.inertial = params.inertial; })
      of.inertial = params.inertial;
    if constexpr (requires { of.cohesion = params.cohesion; })
      of.cohesion = params.cohesion;
    if constexpr (requires { of.viscosity = params.viscosity; })
      of.viscosity = params.viscosity;
    return of;
  }
}

} // namespace talus
