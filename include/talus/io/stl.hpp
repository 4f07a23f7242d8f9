// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"
#include "talus/io/bytes.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace talus {

/// Corners of each triangle of a surface, m.
using TriangleMesh = std::vector<std::array<Vec<3>, 3>>;

namespace detail {

/// The next word of `text`, taken off it; empty at the end.
inline std::string_view next_word(std::string_view& text) {
  constexpr std::string_view blank = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(blank);
  if (begin == std::string_view::npos)
    return {};
  text.remove_prefix(begin);
  const std::string_view word = text.substr(0, text.find_first_of(blank));
  text.remove_prefix(word.size());
  return word;
}

} // namespace detail

/// Reads a triangle mesh from an STL file, binary or ASCII. The format knows no units: coordinates
/// are multiplied by `scale` (1e-3 for a drawing in mm). The normals in the file are ignored.
/// Throws std::runtime_error that names the file and the reason if it cannot be read, is truncated,
/// holds no triangle or a number that is not finite.
inline TriangleMesh read_stl(const std::filesystem::path& path, double scale = 1) {
  const auto fail = [&](const std::string& reason) { detail::cannot_read(path, reason); };
  const std::string bytes = detail::read_bytes(path);

  TriangleMesh mesh;
  constexpr std::size_t header = 80, facet = 50;
  std::uint32_t count = 0;
  if (bytes.size() >= header + sizeof count)
    std::memcpy(&count, bytes.data() + header, sizeof count);
  // Binary files may begin with "solid", too: their size decides.
  if (count > 0 && bytes.size() == header + sizeof count + facet * std::size_t{count}) {
    mesh.resize(count);
    const char* at = bytes.data() + header + sizeof count;
    for (auto& triangle : mesh) {
      std::array<float, 12> numbers; // normal, then the corners
      std::memcpy(numbers.data(), at, sizeof numbers);
      for (std::size_t k = 0; k < 9; ++k)
        triangle[k / 3][static_cast<Eigen::Index>(k % 3)] =
            scale * static_cast<double>(numbers[3 + k]);
      at += facet;
    }
  } else if (bytes.starts_with("solid")) {
    std::string_view rest = bytes;
    std::size_t corners = 0;
    for (std::string_view word = detail::next_word(rest); !word.empty();
         word = detail::next_word(rest)) {
      if (word != "vertex")
        continue;
      Vec<3> x;
      for (int a = 0; a < 3; ++a) {
        std::string_view number = detail::next_word(rest);
        if (number.starts_with('+'))
          number.remove_prefix(1);
        if (std::from_chars(number.data(), number.data() + number.size(), x[a]).ec != std::errc())
          fail("a vertex has a coordinate \"" + std::string(number) + "\"");
      }
      if (corners % 3 == 0)
        mesh.emplace_back();
      mesh.back()[corners++ % 3] = scale * x;
    }
    if (corners % 3 != 0)
      fail("its last triangle is not complete");
  } else {
    fail("it is neither ASCII nor, by its size, binary STL");
  }
  if (mesh.empty())
    fail("it holds no triangle");
  for (const auto& triangle : mesh)
    for (const Vec<3>& corner : triangle)
      if (!corner.allFinite())
        fail("a coordinate is not finite");
  return mesh;
}

} // namespace talus
