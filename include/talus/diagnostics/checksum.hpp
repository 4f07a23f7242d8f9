// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/fingerprint.hpp"
#include "talus/particles.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>

namespace talus {

/// A 64-bit fingerprint (FNV-1a) of all bits of the particles' state, as 16 hexadecimal digits: two
/// runs are the same if and, but for chance, only if their checksums are.
template <int Dim, class Real>
std::string state_checksum(const Particles<Dim, Real>& particles) {
  Fingerprint fingerprint;
  const auto add_all = [&](const auto& values) {
    for (Eigen::Index i = 0; i < values.size(); ++i)
      fingerprint.add(std::bit_cast<std::uint64_t>(static_cast<double>(values.data()[i])));
  };
  for (std::size_t p = 0; p < particles.size(); ++p) {
    fingerprint.add(std::uint64_t{particles.id[p]});
    add_all(particles.position[p]);
    add_all(particles.velocity[p]);
    add_all(particles.affine[p]);
    if (!particles.mixed.empty())
      add_all(particles.mixed[p]);
    fingerprint.add(std::bit_cast<std::uint64_t>(static_cast<double>(particles.volume[p])));
  }
  std::uint64_t hash = fingerprint.value();
  constexpr char digits[] = "0123456789abcdef";
  std::string text(16, '0');
  for (std::size_t i = 0; i < 16; ++i, hash <<= 4U)
    text[i] = digits[hash >> 60U];
  return text;
}

} // namespace talus
