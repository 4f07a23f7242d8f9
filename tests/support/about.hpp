// SPDX-License-Identifier: MIT
#pragma once

#include <doctest/doctest.h>

namespace support {

/// Equal to `value` but for a relative error. doctest::Approx allows the error times (1 + |value|):
/// to it, 0 is 0.01 to 10 %.
inline doctest::Approx about(double value, double error = 1e-12) {
  return doctest::Approx(value).epsilon(error).scale(1e-300);
}

} // namespace support
