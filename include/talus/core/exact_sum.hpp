// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace talus {

/// A sum of doubles without any rounding before value(), so that the order of the terms does not
/// count: threads and ranks may add in any order and join their sums. All of the exponents are held
/// in one long integer, after Kulisch, Computer Arithmetic and Validity, 2013.
class ExactSum {
 public:
  /// At most 2^30 terms between two calls of normalise(); join() counts as one.
  void add(double x) {
    const auto bits = std::bit_cast<std::uint64_t>(x);
    const std::uint64_t exponent = bits >> 52U & 0x7ffU, fraction = bits & 0xfffffffffffffU;
    if (exponent == 0x7ff) {
      ++words_[fraction != 0 ? nan : x > 0 ? infinite : minus_infinite];
      return;
    }
    const std::uint64_t m = exponent == 0 ? fraction : fraction | std::uint64_t{1} << 52U;
    const std::uint64_t place = exponent == 0 ? 0 : exponent - 1; // of the lowest bit
    const std::uint64_t word = place / 32, shift = place % 32;
    const std::uint64_t low = (m & 0xffffffffU) << shift, high = (m >> 32U) << shift;
    const std::int64_t sign = x < 0 ? -1 : 1;
    words_[word] += sign * signed_of(low & 0xffffffffU);
    words_[word + 1] += sign * signed_of((low >> 32U) + (high & 0xffffffffU));
    words_[word + 2] += sign * signed_of(high >> 32U);
  }

  /// Adds what another has, which must be normalised.
  void join(const ExactSum& other) {
    for (int k = 0; k < size; ++k)
      words_[k] += other.words_[k];
  }

  /// Carries, so that all words but the last are in [0, 2^32): then words of up to 2^30 sums may be
  /// added one by one.
  void normalise() {
    std::int64_t carry = 0;
    for (int k = 0; k + 1 < digits; ++k) {
      const std::int64_t all = words_[k] + carry;
      carry = all >> 32;
      words_[k] = all - carry * one;
    }
    words_[digits - 1] += carry;
  }

  /// The sum, rounded to nearest, ties to even; as a loop of additions would have it if there were
  /// infinities or NaNs.
  double value() {
    constexpr double no_number = std::numeric_limits<double>::quiet_NaN();
    if (words_[nan] > 0 || (words_[infinite] > 0 && words_[minus_infinite] > 0))
      return no_number;
    if (words_[infinite] > 0 || words_[minus_infinite] > 0)
      return words_[infinite] > 0 ? std::numeric_limits<double>::infinity()
                                  : -std::numeric_limits<double>::infinity();
    normalise();
    if (words_[digits - 1] >= 0)
      return magnitude();
    ExactSum opposite;
    for (int k = 0; k < digits; ++k)
      opposite.words_[k] = -words_[k];
    opposite.normalise();
    return -opposite.magnitude();
  }

  /// The words, to be summed one by one over processes after normalise().
  static constexpr int size = 71;
  std::int64_t* words() { return words_.begin(); }

 private:
  static constexpr int digits = 68, nan = 68, infinite = 69, minus_infinite = 70;
  static constexpr std::int64_t one = std::int64_t{1} << 32;

  static std::int64_t signed_of(std::uint64_t x) { return static_cast<std::int64_t>(x); }

  std::uint64_t digit(int k) const { return k < 0 ? 0 : static_cast<std::uint64_t>(words_[k]); }

  double magnitude() const {
    int top = digits - 1;
    while (top > 0 && words_[top] == 0)
      --top;
    std::uint64_t leading = digit(top) << 32U | digit(top - 1);
    if (leading == 0)
      return 0;
    const int shift = std::countl_zero(leading); // < 32
    const std::uint64_t next = digit(top - 2) << shift;
    leading = leading << shift | next >> 32U;
    bool rest = (next & 0xffffffffU) != 0;
    for (int k = top - 3; k >= 0 && !rest; --k)
      rest = words_[k] != 0;
    // 64 bits, and what is below them decides ties.
    return std::ldexp(static_cast<double>(leading | (rest ? 1U : 0U)),
                      32 * (top - 1) - 1074 - shift);
  }

  SmallArray<std::int64_t, size> words_{};
};

} // namespace talus
