// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/io/atomic_file.hpp"
#include "talus/io/bytes.hpp"
#include "talus/io/number.hpp"
#include "talus/terrain/raster.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

/// \file
/// ESRI ASCII grids (.asc), the text form of a raster that programs for maps read and write: a
/// header of keys and numbers, then the values, from the north-western one row by row (Esri, "Esri
/// ASCII raster format", documentation of ArcGIS Pro). docs/how-to/terrain.md says what is read.

namespace talus {

namespace detail {

/// Words between blanks, with the line that each is in.
class LineWords {
 public:
  explicit LineWords(std::string_view text) : text_(text) {}
  /// The next word; empty at the end.
  std::string_view next() {
    while (at_ < text_.size() && blank(text_[at_])) {
      if (text_[at_] == '\n' || (text_[at_] == '\r' && text_.substr(at_ + 1, 1) != "\n"))
        ++line_;
      ++at_;
    }
    const std::size_t begin = at_;
    while (at_ < text_.size() && !blank(text_[at_]))
      ++at_;
    return text_.substr(begin, at_ - begin);
  }
  std::size_t line() const { return line_; } ///< of the last word, from 1

 private:
  static bool blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
  std::string_view text_;
  std::size_t at_ = 0, line_ = 1;
};

inline std::string lower_case_of(std::string_view word) {
  std::string lower(word);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z')
      c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

/// Is it the value for no data? Also where one of the two was rounded to a float, half of its last
/// digit away: −3.4028235e38 for −3.4028234663852886e38.
inline bool is_no_data(double value, double no_data) {
  return std::abs(value - no_data) <= 0x1p-24 * std::abs(no_data);
}

} // namespace detail

/// Reads an ESRI ASCII grid, whatever the locale. The header's keys may be in any order and in
/// capitals: ncols, nrows, xllcorner and yllcorner or xllcenter and yllcenter, cellsize, and
/// NODATA_value, −9999 if it is missing. Values equal to that, as floats, become not-a-number.
/// lowest: the least value that makes sense, 0 for a friction.
///
/// Throws std::runtime_error that names the file, the line, the value and what is allowed if a key
/// is missing, unknown or there twice, corner and centre are both there, something is no number as
/// a whole (`0,5`, `2m`, `nan`), a value is below `lowest`, or there are more or fewer values than
/// ncols · nrows.
inline Raster read_ascii_grid(const std::filesystem::path& path,
                              double lowest = -std::numeric_limits<double>::infinity()) {
  const std::string bytes = detail::read_bytes(path);
  std::string_view text = bytes;
  if (text.starts_with("\xef\xbb\xbf")) // byte order mark of UTF-8
    text.remove_prefix(3);
  detail::LineWords words(text);
  const auto fail = [&](const std::string& what, std::string_view value,
                        const std::string& allowed) {
    detail::cannot_read(path, "line " + std::to_string(words.line()) + ": " + what + " is \"" +
                                  std::string(value) + "\"; allowed: " + allowed);
  };

  struct Key {
    std::string_view name;
    std::optional<double> value{};
  };
  Key columns{"ncols"}, rows{"nrows"}, cell{"cellsize"}, none{"nodata_value"};
  Key x_corner{"xllcorner"}, y_corner{"yllcorner"}, x_centre{"xllcenter"}, y_centre{"yllcenter"};
  Key* const keys[] = {&columns, &rows, &x_corner, &y_corner, &x_centre, &y_centre, &cell, &none};
  std::string_view word = words.next();
  for (; !word.empty() && !parse_number<double>(word); word = words.next()) {
    const std::string name = detail::lower_case_of(word);
    Key* const* const key =
        std::find_if(std::begin(keys), std::end(keys), [&](Key* k) { return k->name == name; });
    if (key == std::end(keys))
      fail(columns.value && rows.value && cell.value ? "a key or the first value" : "a key", word,
           "ncols, nrows, xllcorner or xllcenter, yllcorner or yllcenter, cellsize (one: cells are "
           "square), NODATA_value, then finite numbers");
    if ((*key)->value)
      fail("a key", word, "each key once");
    word = words.next();
    if (key[0] == &columns || key[0] == &rows) {
      const auto count = parse_number<int>(word);
      if (!count || *count < 1)
        fail(name, word, "an integer >= 1");
      (*key)->value = *count;
    } else {
      const auto number = parse_number<double>(word);
      if (!number || (key[0] == &cell && !(*number > 0)))
        fail(name, word, key[0] == &cell ? "a number > 0" : "a finite number");
      (*key)->value = *number;
    }
  }
  const auto need = [&](bool there, const char* key) {
    if (!there)
      detail::cannot_read(path, "its header has no " + std::string(key));
  };
  need(columns.value.has_value(), "ncols");
  need(rows.value.has_value(), "nrows");
  need(cell.value.has_value(), "cellsize");
  need(x_corner.value || x_centre.value, "xllcorner or xllcenter");
  need(y_corner.value || y_centre.value, "yllcorner or yllcenter");
  const auto one_of = [&](const Key& corner, const Key& centre) {
    if (corner.value && centre.value)
      detail::cannot_read(path, "its header has " + std::string(corner.name) + " and " +
                                    std::string(centre.name) + "; allowed: one of the two");
  };
  one_of(x_corner, x_centre);
  one_of(y_corner, y_centre);

  Raster map;
  map.columns = static_cast<int>(*columns.value);
  map.rows = static_cast<int>(*rows.value);
  map.cell = *cell.value;
  map.x = x_corner.value ? *x_corner.value : *x_centre.value - map.cell / 2;
  map.y = y_corner.value ? *y_corner.value : *y_centre.value - map.cell / 2;
  const std::size_t row_length = static_cast<std::size_t>(map.columns);
  const std::size_t count = row_length * static_cast<std::size_t>(map.rows);
  const double no_data = none.value.value_or(-9999);
  // Rows need not be lines, but where they are, one of another length is where a value is missing.
  std::size_t read = 0, line = 0, in_line = 0;
  std::string odd_line;
  const auto end_line = [&] {
    if (line > 0 && in_line != row_length && odd_line.empty())
      odd_line = "; line " + std::to_string(line) + " has " + std::to_string(in_line);
  };
  map.values.reserve(std::min(count, text.size()));
  for (; !word.empty(); word = words.next(), ++read) {
    const auto value = parse_number<double>(word);
    if (!value)
      fail("a value", word, "a finite number such as -1.5e-3");
    if (words.line() != line) {
      end_line();
      line = words.line();
      in_line = 0;
    }
    ++in_line;
    const bool there = !detail::is_no_data(*value, no_data);
    if (there && *value < lowest)
      fail("a value", word, "a number >= " + text_of(lowest) + ", or NODATA_value");
    if (read < count)
      map.values.push_back(there ? *value : std::numeric_limits<double>::quiet_NaN());
  }
  end_line();
  if (read != count)
    detail::cannot_read(path, "the number of values is " + std::to_string(read) +
                                  "; allowed: ncols * nrows = " + std::to_string(count) + odd_line);
  for (int row = 0; row < map.rows / 2; ++row) // from the south
    for (int column = 0; column < map.columns; ++column)
      std::swap(map.at(column, row), map.at(column, map.rows - 1 - row));
  return map;
}

/// Writes a map as an ESRI ASCII grid: each number with the fewest digits that read back as the
/// same value, whatever the locale; not-a-number as no_data. Throws as Raster::validate,
/// std::invalid_argument if no_data is not finite or a value is infinite or, as a float, the same
/// as no_data, std::runtime_error that names the file if it cannot be written.
inline void write_ascii_grid(const std::filesystem::path& path, const Raster& map,
                             double no_data = -9999) {
  map.validate();
  require_finite("no_data", no_data);
  std::string text;
  const auto number = [&](const auto& value) {
    char digits[32];
    text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  };
  const auto line = [&](const char* key, const auto& value) {
    text += key;
    number(value);
    text += '\n';
  };
  line("ncols ", map.columns);
  line("nrows ", map.rows);
  line("xllcorner ", map.x);
  line("yllcorner ", map.y);
  line("cellsize ", map.cell);
  line("NODATA_value ", no_data);
  for (int row = map.rows - 1; row >= 0; --row)
    for (int column = 0; column < map.columns; ++column) {
      const double value = map.at(column, row);
      if (std::isinf(value) || detail::is_no_data(value, no_data))
        throw_invalid("a value of " + path.string(), value,
                      "finite numbers other than that for no data, " + text_of(no_data));
      number(std::isnan(value) ? no_data : value);
      text += column + 1 < map.columns ? ' ' : '\n';
    }
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

} // namespace talus
