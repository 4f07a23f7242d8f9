// SPDX-License-Identifier: MIT
#pragma once

#include "talus/rheology/flow_state.hpp"
#include "talus/rheology/given_function.hpp"

#include <concepts>
#include <type_traits>

namespace talus {

/// A friction coefficient as a function of what a node sees: `law(at)` → μ ≥ 0, at:
/// FlowState<Dim>. Called from several threads.
template <class F, int Dim>
concept LocalFrictionFunction = std::copy_constructible<F> &&
    requires(const F law, const FlowState<Dim>& at) {
  { law(at) } -> std::convertible_to<double>;
};

/// A rheology from any function of place, strain rate, pressure and volume fraction:
///   const auto law = [](const FlowState<2>& at) { return at.position[0] < 1 ? 0.3 : 0.6; };
///   using Mine = LocalFriction<decltype(law)>; // and params.rheology = {.law = law}
/// An InertialNumber gives I = inertial(at.strain_rate, at.pressure) in it. If it has
/// `law.validate()`, that is called once to refuse its parameters. A step that gets no finite μ ≥ 0
/// is refused (StepReport::invalid_friction). Models Rheology and SeesFlow.
template <class LawT>
requires LocalFrictionFunction < std::remove_cv_t<LawT>,
2 > || LocalFrictionFunction<std::remove_cv_t<LawT>, 3> class LocalFriction {
  using Law = std::remove_cv_t<LawT>; // decltype of a constant is const

 public:
  struct Params {
    FunctionParameter<Law> law{}; ///< FlowState → μ
  };
  static constexpr bool rate_dependent = true;

  /// Throws std::invalid_argument if no law is given, or what law.validate() throws.
  explicit LocalFriction(const Params& params)
      : law_(given_function<Law>(params.law, "rheology.law", "a function of a FlowState")) {
    if constexpr (requires { law_.validate(); })
      law_.validate();
  }

  template <int Dim>
  requires LocalFrictionFunction<Law, Dim>
  double friction(const FlowState<Dim>& at) const { return law_(at); }

 private:
  Law law_;
};

} // namespace talus
