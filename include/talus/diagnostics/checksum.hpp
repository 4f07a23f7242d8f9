// SPDX-License-Identifier: MIT
#pragma once

#include "talus/particles.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>

namespace talus {

/// A 64-bit fingerprint (FNV-1a) of all bits of the particles' state, as 16 hexadecimal digits: two
/// runs are the same if and, but for chance, only if their checksums are.
template <int Dim>
std::string state_checksum(const Particles<Dim>& particles) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  const auto add = [&hash](std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte, bits >>= 8U)
      hash = (hash ^ (bits & 0xffU)) * 0x100000001b3U;
  };
  const auto add_all = [&add](const auto& values) {
    for (Eigen::Index i = 0; i < values.size(); ++i)
      add(std::bit_cast<std::uint64_t>(values.data()[i]));
  };
  for (std::size_t p = 0; p < particles.size(); ++p) {
    add(particles.id[p]);
    add_all(particles.position[p]);
    add_all(particles.velocity[p]);
    add_all(particles.affine[p]);
    add(std::bit_cast<std::uint64_t>(particles.volume[p]));
  }
  constexpr char digits[] = "0123456789abcdef";
  std::string text(16, '0');
  for (std::size_t i = 0; i < 16; ++i, hash <<= 4U)
    text[i] = digits[hash >> 60U];
  return text;
}

} // namespace talus
