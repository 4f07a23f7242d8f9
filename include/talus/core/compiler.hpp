// SPDX-License-Identifier: MIT
#pragma once

/// \file
/// What a program must be compiled with. Anything else is refused here, before it goes wrong.

#if !(__cplusplus >= 202002L || (defined(_MSVC_LANG) && _MSVC_LANG >= 202002L))
#error "talus: C++20 is needed: -std=c++20"
#endif

// Without NaN and infinity every check of a number passes, and a solve that failed looks converged.
#if (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(__FAST_MATH__) ||           \
    defined(__ASSOCIATIVE_MATH__) || defined(_M_FP_FAST)
#error                                                                                             \
    "talus: not with -ffast-math, -Ofast, -ffinite-math-only, -funsafe-math-optimizations or /fp:fast: NaN is needed and the order of sums counts; -O3 -fno-math-errno is fine"
#endif

// A user's mistake is an exception.
#ifndef __cpp_exceptions
#error "talus: exceptions are needed: no -fno-exceptions"
#endif
