// SPDX-License-Identifier: MIT
#pragma once

#include "talus/io/number.hpp"

#include <CLI/CLI.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace support {

/// Makes every option of `app` that takes numbers refuse what is no finite decimal number as a
/// whole. CLI11 alone takes "" for 0, 010 for 8, 0x10, nan, inf and 1e999. To be called when all
/// options are there.
inline void check_numbers(CLI::App& app) {
  using talus::parse_number;
  for (CLI::Option* option : app.get_options()) {
    const std::string type = option->get_type_name(); // and what is checked already, after a colon
    const auto check = [&](auto is_number, const char* allowed) {
      option->check(CLI::Validator(
          [=](const std::string& text) {
            return is_number(std::string_view(text))
                       ? std::string()
                       : "\"" + text + "\" is given; allowed: " + allowed;
          },
          ""));
    };
    const auto octal = [](std::string_view text) { // as C reads it
      const std::size_t first = text.find_first_not_of("+-");
      return first + 1 < text.size() && text[first] == '0';
    };
    if (type.starts_with("FLOAT"))
      check([](std::string_view text) { return parse_number<double>(text).has_value(); },
            "a number such as -1.5e-3");
    else if (type.starts_with("UINT"))
      check(
          [=](std::string_view text) { return parse_number<std::uint64_t>(text) && !octal(text); },
          "an integer >= 0 without leading zeros");
    else if (type.starts_with("INT"))
      check([=](std::string_view text) { return parse_number<std::int64_t>(text) && !octal(text); },
            "an integer without leading zeros");
  }
}

} // namespace support
