// SPDX-License-Identifier: MIT
#pragma once

#include <bit>
#include <cstddef>

#ifdef __x86_64__
#include <emmintrin.h>
#endif

/// \file
/// Writing past the cache. What is written in the usual way is read into the cache first: where it
/// is all overwritten, and read again only after the cache has been used for other things, that is
/// half of the traffic for nothing.

namespace talus {

/// From how many bytes on an array is written past the cache: more than a core's caches hold.
inline constexpr std::size_t stream_from = std::size_t{16} << 20;

/// Writes `count` numbers, float or double, past the cache if the machine can. Other threads see
/// them after end_stream().
template <class Real>
void stream(Real* to, const Real* from, std::ptrdiff_t count) {
  for (std::ptrdiff_t i = 0; i < count; ++i) {
#ifdef __x86_64__
    if constexpr (sizeof(Real) == sizeof(long long))
      _mm_stream_si64(reinterpret_cast<long long*>(to + i), std::bit_cast<long long>(from[i]));
    else
      _mm_stream_si32(reinterpret_cast<int*>(to + i), std::bit_cast<int>(from[i]));
#else
    to[i] = from[i];
#endif
  }
}

inline void end_stream() {
#ifdef __x86_64__
  _mm_sfence();
#endif
}

} // namespace talus
