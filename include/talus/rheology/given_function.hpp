// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"

#include <concepts>
#include <optional>
#include <string_view>
#include <type_traits>

namespace talus {

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

  /// Throws std::invalid_argument if none was given. name, allowed: for the
  /// message.
  const F& get(std::string_view name, std::string_view allowed) const {
    if (!function_)
      throw_invalid(name, "not given", allowed);
    return *function_;
  }

 private:
  std::optional<F> function_;
};

template <class F>
inline constexpr bool has_default_function =
    std::default_initializable<F>&& std::is_copy_assignable_v<F>;

/// The type of a parameter that is a function: F itself where that can be.
template <class F>
using FunctionParameter = std::conditional_t<has_default_function<F>, F, GivenFunction<F>>;

/// The function that was given. Throws std::invalid_argument if there is none: name, allowed: for
/// the message.
template <class F>
const F& given_function(const FunctionParameter<F>& parameter, std::string_view name,
                        std::string_view allowed) {
  if constexpr (!has_default_function<F>) {
    return parameter.get(name, allowed);
  } else {
    // a pointer or a std::function
    if constexpr (std::is_constructible_v<bool, const F&> && !std::is_empty_v<F>)
      if (!static_cast<bool>(parameter))
        throw_invalid(name, "not given", allowed);
    return parameter;
  }
}

} // namespace talus
