// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

/// \file
/// Misuse is refused at construction, with a message that names the thing, its value and what is
/// allowed.

#if !defined(__cpp_exceptions)
#error "talus tells mistakes by exceptions: compile without -fno-exceptions"
#endif

namespace talus {

/// Throws std::invalid_argument: "`name` is `value`; allowed: `allowed`".
template <class T>
[[noreturn]] void throw_invalid(std::string_view name, const T& value, std::string_view allowed) {
  std::ostringstream message;
  message.precision(10);
  message << name << " is " << value << "; allowed: " << allowed;
  throw std::invalid_argument(message.str());
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

/// Throws std::invalid_argument unless `value` is finite.
inline void require_finite(std::string_view name, double value) {
  if (!std::isfinite(value))
    throw_invalid(name, value, "a finite number");
}

} // namespace talus
