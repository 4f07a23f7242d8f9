// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <limits>
#include <mutex>
#include <vector>

#ifdef _OPENMP
#include <omp.h>
#endif

/// \file
/// Loops over independent items, on threads when the program is compiled with OpenMP (all of its
/// translation units alike) and serial otherwise. Results never depend on the number of threads:
/// items are independent, and sums are made over chunks of a fixed size in a fixed order.

namespace talus {

/// Largest number of threads worth asking for on this machine; 1 without OpenMP.
inline int available_threads() {
#ifdef _OPENMP
  return omp_get_num_procs();
#else
  return 1;
#endif
}

namespace detail {

/// Keeps the exception of the lowest item out of a loop on threads, where it must not leave its
/// thread.
class FirstException {
 public:
  void keep(std::ptrdiff_t item) noexcept {
    const std::lock_guard lock(mutex_);
    if (item < item_) {
      item_ = item;
      exception_ = std::current_exception();
    }
  }
  void rethrow() const {
    if (exception_)
      std::rethrow_exception(exception_);
  }

 private:
  std::mutex mutex_;
  std::ptrdiff_t item_ = std::numeric_limits<std::ptrdiff_t>::max();
  std::exception_ptr exception_;
};

} // namespace detail

/// Calls body(i) for 0 ≤ i < count, each once, in any order, on up to `threads` threads. If some
/// throw, the exception of the lowest i arrives at the caller, for any number of threads; whether
/// the body was called for items above that one is open.
template <class Body>
void parallel_for(int threads, std::ptrdiff_t count, const Body& body) {
#ifdef _OPENMP
  if (threads > 1 && count > 1) {
    detail::FirstException first;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::ptrdiff_t i = 0; i < count; ++i)
      try {
        body(i);
      } catch (...) {
        first.keep(i);
      }
    first.rethrow();
    return;
  }
#endif
  static_cast<void>(threads);
  for (std::ptrdiff_t i = 0; i < count; ++i)
    body(i);
}

/// Calls body(begin, end) on consecutive chunks of [0, count) of `chunk` items each: less overhead
/// than parallel_for where an item is little work.
template <class Body>
void parallel_chunks(int threads, std::ptrdiff_t count, std::ptrdiff_t chunk, const Body& body) {
  const std::ptrdiff_t chunks = (count + chunk - 1) / chunk;
  parallel_for(threads, chunks,
               [&](std::ptrdiff_t c) { body(c * chunk, std::min(count, (c + 1) * chunk)); });
}

/// Reduces over chunks of a fixed size: `term(begin, end)` gives the partial result of one chunk,
/// `combine` joins them from first to last, so the result is the same for any number of threads.
/// `partials` is workspace that the caller keeps, so that a warm call allocates nothing.
template <class Value, class Term, class Combine>
Value parallel_reduce(int threads, std::ptrdiff_t count, std::vector<Value>& partials, Value start,
                      const Term& term, const Combine& combine) {
  constexpr std::ptrdiff_t chunk = 256;
  partials.resize(static_cast<std::size_t>((count + chunk - 1) / chunk));
  parallel_chunks(threads, count, chunk, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    partials[static_cast<std::size_t>(begin / chunk)] = term(begin, end);
  });
  Value total = start;
  for (const Value& partial : partials)
    total = combine(total, partial);
  return total;
}

} // namespace talus
