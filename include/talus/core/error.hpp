// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/compiler.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

/// \file
/// Misuse is refused at construction, with a message that names the thing, its value and what is
/// allowed.

namespace talus {

/// A value as messages show it, the same in all locales.
template <class T>
std::string text_of(const T& value) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(10);
  text << value;
  return text.str();
}

/// A text as it is.
inline const std::string& text_of(const std::string& text) {
  return text;
}
inline std::string text_of(const char* text) {
  return text;
}

namespace detail {

[[noreturn]] inline void throw_invalid_text(std::string_view name, const std::string& value,
                                            std::string_view allowed) {
  throw std::invalid_argument(
      std::string(name).append(" is ").append(value).append("; allowed: ").append(allowed));
}

} // namespace detail

/// Throws std::invalid_argument: "`name` is `value`; allowed: `allowed`".
template <class T>
[[noreturn]] void throw_invalid(std::string_view name, const T& value, std::string_view allowed) {
  detail::throw_invalid_text(name, text_of(value), allowed);
}
[[noreturn]] inline void throw_invalid(std::string_view name, const char* value,
                                       std::string_view allowed) {
  detail::throw_invalid_text(name, value, allowed);
}

/// "x = (0.1, 0.2) m": where a user's function was called. x: a point, m.
template <int Dim, class Point>
std::string place_text(const Point& x) {
  std::ostringstream text;
  text.precision(10);
  for (int a = 0; a < Dim; ++a)
    text << (a == 0 ? "x = (" : ", ") << x[a];
  text << ") m";
  return text.str();
}

/// Throws std::invalid_argument unless `value` is finite and > 0.
inline void require_positive(std::string_view name, double value) {
  if (!(std::isfinite(value) && value > 0))
    throw_invalid(name, value, "a finite number > 0");
}

/// Throws std::invalid_argument unless `value` is finite and >= 0.
inline void require_non_negative(std::string_view name, double value) {
  if (!(std::isfinite(value) && value >= 0))
    throw_invalid(name, value, "a finite number >= 0");
}

/// Throws std::invalid_argument unless 0 <= index < count.
inline void require_index(std::string_view name, std::ptrdiff_t index, std::ptrdiff_t count) {
  if (index < 0 || index >= count)
    throw_invalid(name, index,
                  count > 0 ? "0 to " + std::to_string(count - 1) : "none: there is not one");
}

/// What a parameter without a default is until it is given: a scene that forgets it is refused.
inline constexpr double not_given = std::numeric_limits<double>::quiet_NaN();

/// Throws std::invalid_argument unless `value`, not_given by default, is finite and >= 0.
inline void require_given_non_negative(std::string_view name, double value) {
  if (std::isnan(value))
    throw_invalid(name, "nan, not given", "a finite number >= 0; it has no default");
  require_non_negative(name, value);
}

/// Throws std::invalid_argument unless `value` is finite.
inline void require_finite(std::string_view name, double value) {
  if (!std::isfinite(value))
    throw_invalid(name, value, "a finite number");
}

} // namespace talus
