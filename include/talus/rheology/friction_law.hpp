// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/inertial_number.hpp"

#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

namespace talus {

/// A friction coefficient as a function of the inertial number: `law(I)` → μ ≥ 0 for 0 ≤ I ≤ ∞. A
/// lambda or a struct; if it has `law.validate()`, that is called once to refuse its parameters.
/// Called from several threads.
template <class F>
concept FrictionFunction = std::copy_constructible<F> && requires(const F law, double I) {
  { law(I) } -> std::convertible_to<double>;
};

/// A function that has no default, or that cannot be assigned, such as a lambda with captures, as a
/// parameter: empty until it is given, and assignable.
template <std::copy_constructible F>
class GivenFunction {
 public:
  GivenFunction() = default;
  GivenFunction(const F& function) : function_(function) {} // NOLINT: as if it were the function
  GivenFunction(const GivenFunction&) = default;
  GivenFunction(GivenFunction&&) noexcept(std::is_nothrow_move_constructible_v<F>) = default;
  GivenFunction& operator=(const GivenFunction& other) {
    if (this != &other) {
      function_.reset();
      if (other.function_)
        function_.emplace(*other.function_);
    }
    return *this;
  }
  ~GivenFunction() = default;

  /// Throws std::invalid_argument if none was given.
  const F& get(std::string_view name) const {
    if (!function_)
      throw_invalid(name, "not given", "a function of the inertial number");
    return *function_;
  }

 private:
  std::optional<F> function_;
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
  static constexpr bool has_default =
      std::default_initializable<Law> && std::is_copy_assignable_v<Law>;

 public:
  struct Params {
    std::conditional_t<has_default, Law, GivenFunction<Law>> law{}; ///< I → μ
    InertialNumber inertial{};
  };
  static constexpr bool rate_dependent = true;

  /// Throws std::invalid_argument if a parameter is out of range, or if the law gives no finite
  /// μ ≥ 0 at I = 0, at I = ∞ or at a power of ten from 1e-6 to 1e3 between them.
  explicit FrictionLaw(const Params& params) : law_(given(params.law)), inertial_(params.inertial) {
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
  static const Law& given(const Law& law) requires has_default {
    // a pointer or a std::function
    if constexpr (std::is_constructible_v<bool, const Law&> && !std::is_empty_v<Law>)
      if (!static_cast<bool>(law))
        throw_invalid("rheology.law", "not given", "a function of the inertial number");
    return law;
  }
  static const Law& given(const GivenFunction<Law>& law) { return law.get("rheology.law"); }

  void check(double I) const {
    if (const double mu = law_(I); !(mu >= 0 && std::isfinite(mu)))
      throw_invalid("rheology.law at I = " + text_of(I), mu, "a finite number >= 0");
  }

  Law law_;
  InertialNumber inertial_;
};

} // namespace talus
