// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/given_function.hpp"
#include "talus/rheology/inertial_number.hpp"

#include <cmath>
#include <concepts>
#include <limits>
#include <string>
#include <type_traits>

namespace talus {

/// A friction coefficient as a function of the inertial number: `law(I)` → μ ≥ 0 for 0 ≤ I ≤ ∞. A
/// lambda or a struct; if it has `law.validate()`, that is called once to refuse its parameters.
/// Called from several threads.
template <class F>
concept FrictionFunction = std::copy_constructible<F> && requires(const F law, double I) {
  { law(I) } -> std::convertible_to<double>;
};

/// A rheology from any function of the inertial number and the convention that it was fitted with:
///   using Mine = FrictionLaw<decltype([](double I) { return 0.4 + 0.1 * std::min(I, 1.0); })>;
/// or, with captures,
///   const auto law = [mu](double I) { return mu + 0.1 * std::min(I, 1.0); };
///   using Mine = FrictionLaw<decltype(law)>; // and params.rheology = {.law = law, .inertial = …}
/// Models Rheology.
template <class LawT>
requires FrictionFunction<std::remove_cv_t<LawT>>
class FrictionLaw {
  using Law = std::remove_cv_t<LawT>; // decltype of a constant is const

 public:
  struct Params {
    FunctionParameter<Law> law{}; ///< I → μ
    InertialNumber inertial{};
  };
  static constexpr bool rate_dependent = true;

  /// Throws std::invalid_argument if a parameter is out of range, or if the law gives no finite
  /// μ ≥ 0 at I = 0, at I = ∞ or at a power of ten from 1e-6 to 1e3 between them.
  explicit FrictionLaw(const Params& params)
      : law_(given_function<Law>(params.law, "rheology.law", "a function of the inertial number")),
        inertial_(params.inertial) {
    if constexpr (requires { law_.validate(); })
      law_.validate();
    inertial_.validate();
    check(0);
    for (double I = 1e-6; I < 2e3; I *= 10)
      check(I);
    check(std::numeric_limits<double>::infinity());
  }

  double friction(double inertial_number) const { return law_(inertial_number); }
  const InertialNumber& inertial_number() const { return inertial_; }

 private:
  void check(double I) const {
    if (const double mu = law_(I); !(mu >= 0 && std::isfinite(mu)))
      throw_invalid("rheology.law at I = " + text_of(I), mu, "a finite number >= 0");
  }

  Law law_;
  InertialNumber inertial_;
};

} // namespace talus
