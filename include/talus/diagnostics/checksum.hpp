// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/fingerprint.hpp"
#include "talus/particles.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>

namespace talus {

/// A 64-bit fingerprint of all bits of the particles' state, whatever their order: the sum, modulo
/// 2^64, of one for each particle. Those of ranks are to be added up. Arrays that may be left out
/// count as what they stand for, zeros: a rank may have none where one process has them.
template <int Dim, class Real>
std::uint64_t state_fingerprint(const Particles<Dim, Real>& particles) {
  std::uint64_t sum = 0;
  for (std::size_t p = 0; p < particles.size(); ++p) {
    Fingerprint fingerprint;
    const auto add_all = [&](const auto& values) {
      for (Eigen::Index i = 0; i < values.size(); ++i)
        fingerprint.add(std::bit_cast<std::uint64_t>(static_cast<double>(values.data()[i])));
    };
    fingerprint.add(std::uint64_t{particles.id[p]});
    add_all(particles.position[p]);
    add_all(particles.velocity[p]);
    add_all(particles.affine[p]);
    if (!particles.mixed.empty() && !particles.mixed[p].isZero(0))
      add_all(particles.mixed[p]);
    fingerprint.add(std::bit_cast<std::uint64_t>(static_cast<double>(particles.volume[p])));
    if (!particles.material.empty() && particles.material[p] != 0)
      fingerprint.add(static_cast<std::uint64_t>(particles.material[p]));
    const std::uint64_t bits = fingerprint.value(); // of FNV the high ones hang on few low ones
    sum += (bits ^ (bits >> 32U)) * 0x9e3779b97f4a7c15U;
  }
  return sum;
}

/// A fingerprint as 16 hexadecimal digits.
inline std::string checksum_text(std::uint64_t fingerprint) {
  constexpr char digits[] = "0123456789abcdef";
  std::string text(16, '0');
  for (std::size_t i = 0; i < 16; ++i, fingerprint <<= 4U)
    text[i] = digits[fingerprint >> 60U];
  return text;
}

/// The fingerprint of the particles as text: two runs are the same if and, but for chance, only if
/// their checksums are.
template <int Dim, class Real>
std::string state_checksum(const Particles<Dim, Real>& particles) {
  return checksum_text(state_fingerprint(particles));
}

} // namespace talus
