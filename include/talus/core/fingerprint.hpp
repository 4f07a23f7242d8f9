// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <string_view>

namespace talus {

/// A 64-bit fingerprint of bytes (FNV-1a).
class Fingerprint {
 public:
  void add(unsigned char byte) { value_ = (value_ ^ byte) * 0x100000001b3U; }
  /// The eight bytes of a word, lowest first.
  void add(std::uint64_t word) {
    for (int byte = 0; byte < 8; ++byte, word >>= 8U)
      add(static_cast<unsigned char>(word & 0xffU));
  }
  void add(std::string_view bytes) {
    for (const char byte : bytes)
      add(static_cast<unsigned char>(byte));
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

} // namespace talus
