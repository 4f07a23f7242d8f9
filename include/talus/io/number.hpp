// SPDX-License-Identifier: MIT
#pragma once

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <system_error>
#include <type_traits>

namespace talus {

/// The number that `word` is from its first character to its last, whatever the locale: an optional
/// sign, digits with at most one point, an optional exponent e or E. Nothing for any other text: a
/// decimal comma, a Fortran exponent (1.5D+03), a unit (2mm), hexadecimal digits, blanks, nan, inf,
/// a point or an exponent where Number is an integer, a value out of its range.
template <class Number>
requires std::is_arithmetic_v<Number> std::optional<Number> parse_number(std::string_view word) {
  if (word.starts_with('+') && !word.starts_with("+-")) // std::from_chars takes only '-'
    word.remove_prefix(1);
  Number value{};
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error != std::errc() || stop != end)
    return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>)
    if (!std::isfinite(value))
      return std::nullopt;
  return value;
}

} // namespace talus
