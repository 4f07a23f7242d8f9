// SPDX-License-Identifier: MIT
#pragma once

#include "talus/io/number.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

/// \file
/// The files of a checkpoint that ranks have written, see distributed/checkpoint.hpp.

namespace talus {

namespace detail {

/// A file beside a checkpoint's that a rank has written or begun: NAME.GENERATION-RANK or that with
/// .tmp.
struct Piece {
  std::filesystem::path path;
  std::size_t generation = 0;
};

inline std::filesystem::path piece_path(const std::filesystem::path& path, std::size_t generation,
                                        int rank) {
  return path.string() + "." + std::to_string(generation) + "-" + std::to_string(rank);
}

/// The pieces that are there, of whatever generation.
inline std::vector<Piece> find_pieces(const std::filesystem::path& path) {
  std::vector<Piece> pieces;
  std::error_code none;
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  const std::string begin = path.filename().string() + ".";
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(begin))
      continue;
    std::string_view rest = std::string_view(name).substr(begin.size());
    if (rest.ends_with(".tmp"))
      rest.remove_suffix(4);
    const std::size_t dash = std::min(rest.find('-'), rest.size());
    const auto generation = parse_number<std::size_t>(rest.substr(0, dash));
    if (generation && dash < rest.size() && parse_number<unsigned>(rest.substr(dash + 1)))
      pieces.push_back({entry.path(), *generation});
  }
  return pieces;
}

} // namespace detail

/// Removes the checkpoint at `path`, if there is one, with its pieces if ranks have written it.
inline void remove_checkpoint(const std::filesystem::path& path) {
  std::filesystem::remove(path); // first: what is there is always whole
  for (const detail::Piece& piece : detail::find_pieces(path))
    std::filesystem::remove(piece.path);
}

} // namespace talus
