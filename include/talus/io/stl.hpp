// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/core/types.hpp"
#include "talus/io/bytes.hpp"
#include "talus/io/number.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace talus {

/// Corners of each triangle of a surface, m.
using TriangleMesh = std::vector<std::array<Vec<3>, 3>>;

namespace detail {

inline constexpr std::string_view stl_blank{" \t\r\n\f\v", 6};
/// What files are filled up with behind their end; 0x1a is the end of a file in CP/M and DOS.
inline constexpr std::string_view stl_padding{" \t\r\n\f\v\0\x1a", 8};

/// Words of an ASCII STL file, in lower case.
class StlWords {
 public:
  explicit StlWords(std::string_view text) : text_(text) {}

  /// The next word; empty at the end. "end loop" is "endloop".
  std::string next() {
    std::string word = lower_case(raw());
    if (word == "end") {
      const std::size_t before = at_;
      const std::string second = lower_case(raw());
      if (second == "loop" || second == "facet" || second == "solid")
        return word + second;
      at_ = before;
    }
    return word;
  }
  /// The next word as it is written.
  std::string_view raw() {
    at_ = std::min(text_.find_first_not_of(stl_blank, at_), text_.size());
    begin_ = at_;
    at_ = std::min(text_.find_first_of(stl_blank, at_), text_.size());
    return text_.substr(begin_, at_ - begin_);
  }
  /// Passes over the name of a solid: to the end of the line, or to a facet that begins in it.
  void skip_name() {
    const std::size_t line_end = std::min(text_.find_first_of("\r\n", at_), text_.size());
    while (at_ < line_end) {
      const std::size_t before = at_;
      if (lower_case(raw()) == "facet" && lower_case(raw()) == "normal" &&
          parse_number<double>(raw())) {
        at_ = before;
        return;
      }
    }
    at_ = line_end;
  }
  /// Line of the last word, from 1. Lines end with \n, \r\n or \r.
  std::size_t line() const {
    std::size_t lines = 1;
    for (std::size_t k = 0; k < begin_; ++k)
      if (text_[k] == '\n' || (text_[k] == '\r' && text_.substr(k + 1, 1) != "\n"))
        ++lines;
    return lines;
  }

 private:
  static std::string lower_case(std::string_view word) {
    std::string lower(word);
    for (char& c : lower)
      if (c >= 'A' && c <= 'Z')
        c = static_cast<char>(c - 'A' + 'a');
    return lower;
  }

  std::string_view text_;
  std::size_t begin_ = 0, at_ = 0; ///< of the last word
};

/// fail(reason) throws.
template <class Fail>
TriangleMesh read_ascii_stl(std::string_view text, double scale, const Fail& fail) {
  TriangleMesh mesh;
  StlWords words(text);
  std::size_t corners = 0; // of this facet
  bool open = false;       // after "outer loop", before its end
  const auto end_facet = [&] {
    if (corners % 3 != 0 || corners > 3)
      fail("line " + std::to_string(words.line()) + ": a facet has " + std::to_string(corners) +
           " corners; allowed: 3");
    corners = 0;
    open = false;
  };
  for (std::string word = words.next(); !word.empty(); word = words.next()) {
    if (word == "vertex") {
      Vec<3> x;
      for (int a = 0; a < 3; ++a) {
        const std::string_view written = words.raw();
        const auto number = parse_number<double>(written);
        if (!number)
          fail("line " + std::to_string(words.line()) + ": a corner's coordinate is \"" +
               std::string(written) + "\"; allowed: a finite number such as -1.5e-3");
        x[a] = scale * *number;
      }
      if (corners == 3 && !open) // a dialect without loops
        corners = 0;
      if (corners == 0)
        mesh.emplace_back();
      if (corners < 3)
        mesh.back()[corners] = x;
      ++corners;
    } else if (word == "loop") {
      end_facet();
      open = true;
    } else if (word == "endloop" || word == "endfacet" || word == "facet") {
      end_facet();
    } else if (word == "solid" || word == "endsolid") {
      end_facet();
      words.skip_name();
    }
  }
  if (open)
    fail("it ends within a facet: it is truncated");
  end_facet();
  return mesh;
}

template <class Fail>
TriangleMesh read_binary_stl(std::string_view bytes, std::size_t count, double scale,
                             const Fail& fail) {
  TriangleMesh mesh(count);
  const char* at = bytes.data();
  for (std::size_t t = 0; t < count; ++t) {
    std::array<float, 12> numbers; // normal, then the corners
    std::memcpy(numbers.data(), at, sizeof numbers);
    for (std::size_t k = 0; k < 9; ++k) {
      const double x = static_cast<double>(numbers[3 + k]);
      if (!std::isfinite(x))
        fail("triangle " + std::to_string(t + 1) + ": a coordinate is not finite");
      mesh[t][k / 3][static_cast<int>(k % 3)] = scale * x;
    }
    at += 50;
  }
  return mesh;
}

} // namespace detail

/// Reads a triangle mesh from an STL file, binary or ASCII. The format knows no units: coordinates
/// are multiplied by `scale` (1e-3 for a drawing in mm). Normals, names and colours in the file are
/// ignored, several solids are joined. docs/how-to/scene.md lists the dialects that are read.
/// Throws std::runtime_error that names the file, the line or the triangle, and the reason if it
/// cannot be read, is truncated, holds no triangle or something else where a finite number belongs;
/// std::invalid_argument unless 0 < scale < ∞.
inline TriangleMesh read_stl(const std::filesystem::path& path, double scale = 1) {
  require_positive("read_stl: scale", scale);
  const auto fail = [&](const std::string& reason) { detail::cannot_read(path, reason); };
  const std::string file = detail::read_bytes(path);

  // Binary files may begin with "solid", too, and may be filled up: sizes decide, then zero bytes.
  constexpr std::size_t header = 80, facet = 50;
  std::uint32_t count = 0;
  const std::size_t start = header + sizeof count;
  if (file.size() >= start)
    std::memcpy(&count, file.data() + header, sizeof count);
  const std::string_view body = std::string_view(file).substr(std::min(start, file.size()));
  const std::size_t said = facet * std::size_t{count};
  if (count > 0 && body.size() == said)
    return detail::read_binary_stl(body, count, scale, fail);

  std::string_view text = file;
  if (text.starts_with("\xef\xbb\xbf")) // byte order mark of UTF-8
    text.remove_prefix(3);
  text = text.substr(0, text.find_last_not_of(detail::stl_padding) + 1);
  const std::string first = detail::StlWords(text).next();
  TriangleMesh mesh;
  if ((first == "solid" || first == "facet") && text.find('\0') == std::string_view::npos) {
    mesh = detail::read_ascii_stl(text, scale, fail);
  } else if (body.empty()) {
    fail("it is neither ASCII nor binary STL");
  } else if ((count == 0 || count == std::numeric_limits<std::uint32_t>::max()) &&
             body.size() % facet == 0) { // a writer that never came back to fill in the number
    mesh = detail::read_binary_stl(body, body.size() / facet, scale, fail);
  } else if (body.size() < said) {
    fail("it is neither ASCII nor complete binary STL: of " + std::to_string(count) +
         " triangles that it announces it can hold " + std::to_string(body.size() / facet));
  } else {
    const std::string_view rest = body.substr(said);
    if (rest.size() >= facet &&
        rest.find_last_not_of(detail::stl_padding) != std::string_view::npos)
      fail("it is neither ASCII nor binary STL: there is more in it than the " +
           std::to_string(count) + " triangles that it announces");
    mesh = detail::read_binary_stl(body, count, scale, fail);
  }
  if (mesh.empty())
    fail("it holds no triangle");
  return mesh;
}

} // namespace talus
