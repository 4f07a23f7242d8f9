// SPDX-License-Identifier: MIT
#pragma once

#include "talus/io/bytes.hpp"
#include "talus/io/number.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace talus {

/// A table of numbers: names of the columns, and the numbers of each, #columns × #rows.
struct CsvTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;
};

namespace detail {

/// A number as CsvWriter writes it: nan and inf, too.
inline std::optional<double> csv_number(std::string_view cell) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (cell == "nan")
    return std::numeric_limits<double>::quiet_NaN();
  if (cell == "inf" || cell == "-inf")
    return cell == "inf" ? infinity : -infinity;
  return parse_number<double>(cell);
}

/// Takes the next cell and what ends it off `text`, and the quotes off the cell. `last`: of its
/// line.
inline std::string next_csv_cell(std::string_view& text, bool& last) {
  std::string cell;
  const bool quoted = text.starts_with('"');
  std::size_t at = quoted ? 1 : 0;
  for (; at < text.size(); ++at) {
    if (quoted && text[at] == '"') {
      if (text.substr(at + 1, 1) != "\"")
        break;
      ++at; // two are one
    } else if (!quoted && (text[at] == ',' || text[at] == '\n')) {
      break;
    }
    cell += text[at];
  }
  if (quoted)
    at = std::min(text.find_first_of(",\n", at), text.size());
  else if (cell.ends_with('\r'))
    cell.pop_back();
  last = text.substr(at, 1) != ",";
  text.remove_prefix(std::min(at + 1, text.size()));
  return cell;
}

} // namespace detail

/// Reads a table of numbers that CsvWriter wrote: a line of names, then rows of as many numbers.
/// Throws std::runtime_error that names the file, the line and what is wrong if it cannot be read,
/// a row has another length or is cut off, or a cell is not a number as a whole (`0;5`, `2 mm`).
inline CsvTable read_csv(const std::filesystem::path& path) {
  const std::string bytes = detail::read_bytes(path);
  std::string_view text = bytes;
  if (text.starts_with("\xef\xbb\xbf")) // byte order mark of UTF-8, from a spreadsheet
    text.remove_prefix(3);
  if (text.empty())
    detail::cannot_read(path, "it is empty");
  CsvTable table;
  for (bool last = false; !last;)
    table.names.push_back(detail::next_csv_cell(text, last));
  table.columns.resize(table.names.size());
  for (std::size_t line = 2; !text.empty(); ++line) {
    const auto fail = [&](const std::string& reason) {
      detail::cannot_read(path, "line " + std::to_string(line) + ": " + reason);
    };
    if (text.find('\n') == std::string_view::npos)
      fail("it is cut off: no end of the line");
    std::size_t cells = 0;
    for (bool last = false; !last; ++cells) {
      const std::string cell = detail::next_csv_cell(text, last);
      if (cells >= table.columns.size())
        continue;
      const auto number = detail::csv_number(cell);
      if (!number)
        fail(table.names[cells] + " is \"" + cell + "\"; allowed: a number");
      table.columns[cells].push_back(*number);
    }
    if (cells != table.columns.size())
      fail("it has " + std::to_string(cells) + " cells instead of " +
           std::to_string(table.columns.size()));
  }
  return table;
}

} // namespace talus
