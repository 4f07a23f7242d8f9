// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

/// \file
/// How loops over independent items are executed, on one thread or several. Results never depend on
/// the number of threads: items are independent, and sums are made over chunks of a fixed size in a
/// fixed order.

namespace talus {

/// Largest number of threads worth asking for on this machine.
inline int available_threads() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

namespace detail {

constexpr std::ptrdiff_t chunk = 256; ///< items of a partial sum

/// Where part `part` of `parts` of [0, count) begins, so that all weigh about the same.
/// before(i): the weight of all items below i, an integer.
template <class Before>
std::ptrdiff_t part_begin(std::ptrdiff_t count, const Before& before, int part, int parts) {
  if (part == 0 || part == parts)
    return part == 0 ? 0 : count;
  const auto none = static_cast<std::ptrdiff_t>(before(0));
  const auto all = static_cast<std::ptrdiff_t>(before(count)) - none;
  const std::ptrdiff_t wanted = none + all / parts * part + all % parts * part / parts;
  std::ptrdiff_t first = 0, last = count; // the lowest i with before(i) >= wanted
  while (first < last) {
    const std::ptrdiff_t middle = first + (last - first) / 2;
    if (static_cast<std::ptrdiff_t>(before(middle)) < wanted)
      first = middle + 1;
    else
      last = middle;
  }
  return first;
}

/// The exception of the lowest part, which must not leave its thread before all have ended.
class FirstException {
 public:
  void keep(int part) noexcept {
    const std::lock_guard lock(mutex_);
    if (part < part_) {
      part_ = part;
      exception_ = std::current_exception();
    }
  }
  void rethrow() const {
    if (exception_)
      std::rethrow_exception(exception_);
  }

 private:
  std::mutex mutex_;
  int part_ = std::numeric_limits<int>::max();
  std::exception_ptr exception_;
};

/// Waits until `value` is no longer `old`, and returns what it is: busily for some microseconds,
/// which most waits in a solve take, then asleep, so that a busy machine's other programs, or the
/// thread that all wait for, can have the core.
template <class T>
T wait_for_change(const std::atomic<T>& value, T old) {
  constexpr int busy = 20000; // loads
  for (int k = 0; k < busy; ++k)
    if (const T now = value.load(std::memory_order_acquire); now != old)
      return now;
  while (true) {
    value.wait(old, std::memory_order_acquire);
    if (const T now = value.load(std::memory_order_acquire); now != old)
      return now;
  }
}

/// Threads that wait for work. One thread at a time may call run().
class ThreadPool {
 public:
  /// size: with the thread that calls run(), >= 1. Throws std::system_error if the system gives no
  /// more threads.
  explicit ThreadPool(int size) : size_(size) {
    try {
      for (int rank = 1; rank < size; ++rank)
        threads_.emplace_back([this, rank] { work(rank); });
    } catch (...) {
      stop();
      throw;
    }
  }
  ~ThreadPool() { stop(); }
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int size() const { return size_; }

  /// Calls body(rank) once for each rank below size(), on a thread each; it must not throw.
  template <class Body>
  void run(const Body& body) {
    body_ = &body;
    call_ = [](const void* any, int rank) noexcept { (*static_cast<const Body*>(any))(rank); };
    at_work_.store(size_ - 1, std::memory_order_relaxed);
    round_.fetch_add(1, std::memory_order_release);
    round_.notify_all();
    call_(body_, 0);
    for (int left = at_work_.load(std::memory_order_acquire); left > 0;)
      left = wait_for_change(at_work_, left);
  }

 private:
  void work(int rank) {
    unsigned round = 0;
    while (true) {
      round = wait_for_change(round_, round);
      if (!call_)
        return;
      call_(body_, rank);
      if (at_work_.fetch_sub(1, std::memory_order_acq_rel) == 1)
        at_work_.notify_one();
    }
  }
  void stop() {
    call_ = nullptr;
    round_.fetch_add(1, std::memory_order_release);
    round_.notify_all();
    for (std::thread& thread : threads_)
      thread.join();
  }

  int size_;
  const void* body_ = nullptr;
  void (*call_)(const void*, int) noexcept = nullptr;
  std::atomic<unsigned> round_{0};
  std::atomic<int> at_work_{0};
  std::vector<std::thread> threads_;
};

} // namespace detail

/// The threads that work on one task together, see Execution::team. All of them must come to the
/// same calls in the same order; each call returns when all have done their part.
class Team {
 public:
  /// Where threads wait for each other.
  struct Meeting {
    std::atomic<int> arrived{0};
    std::atomic<unsigned> round{0};
  };

  Team(int rank, int size, Meeting& meeting) : rank_(rank), size_(size), meeting_(meeting) {}

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// Waits until all threads are here.
  void wait() const {
    if (size_ == 1)
      return;
    const unsigned round = meeting_.round.load(std::memory_order_relaxed);
    if (meeting_.arrived.fetch_add(1, std::memory_order_acq_rel) + 1 == size_) {
      meeting_.arrived.store(0, std::memory_order_relaxed);
      meeting_.round.store(round + 1, std::memory_order_release);
      meeting_.round.notify_all();
    } else {
      detail::wait_for_change(meeting_.round, round);
    }
  }

  /// Calls body(begin, end) on one range of [0, count) a thread, of about equal weight.
  /// before(i): the weight of all items below i, 0 ≤ i ≤ count; an integer that does not fall.
  template <class Before, class Body>
  void for_balanced(std::ptrdiff_t count, const Before& before, const Body& body) const {
    const std::ptrdiff_t begin = detail::part_begin(count, before, rank_, size_);
    const std::ptrdiff_t end = detail::part_begin(count, before, rank_ + 1, size_);
    if (begin < end)
      body(begin, end);
    wait();
  }

  /// The same with items of equal weight.
  template <class Body>
  void for_ranges(std::ptrdiff_t count, const Body& body) const {
    for_balanced(
        count, [](std::ptrdiff_t i) { return i; }, body);
  }

  /// As Execution::reduce; every thread gets the result.
  template <class Value, class Term, class Combine>
  Value reduce(std::ptrdiff_t count, Array<Value>& partials, Value start, const Term& term,
               const Combine& combine) const {
    const std::ptrdiff_t chunks = (count + detail::chunk - 1) / detail::chunk;
    if (rank_ == 0)
      partials.resize(static_cast<std::size_t>(chunks));
    wait();
    for_ranges(chunks, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t c = begin; c < end; ++c)
        partials[c] = term(c * detail::chunk, std::min(count, (c + 1) * detail::chunk));
    });
    Value total = start;
    for (const Value& partial : partials)
      total = combine(total, partial);
    wait(); // before another call changes the partials
    return total;
  }

 private:
  int rank_, size_;
  Meeting& meeting_;
};

/// Where and how loops run. A copy has threads of its own, so that copies of a simulation may step
/// side by side; no loop may run in another.
class Execution {
 public:
  /// Throws std::invalid_argument if threads < 1, std::system_error if the system gives no more
  /// threads.
  explicit Execution(int threads = 1) {
    if (threads < 1)
      throw_invalid("threads", threads, "an integer >= 1");
    if (threads > 1)
      pool_ = std::make_unique<detail::ThreadPool>(threads);
  }
  Execution(const Execution& other) : Execution(other.threads()) {}
  Execution(Execution&&) noexcept = default;
  Execution& operator=(const Execution& other) { return *this = Execution(other.threads()); }
  Execution& operator=(Execution&&) noexcept = default;
  ~Execution() = default;

  int threads() const { return pool_ ? pool_->size() : 1; }

  /// Calls body(team) on all threads at once. The body must not throw: the others would wait for
  /// ever, so the program ends.
  template <class Body>
  void team(const Body& body) const {
    Team::Meeting meeting;
    if (pool_)
      pool_->run([&](int rank) { body(Team(rank, pool_->size(), meeting)); });
    else
      body(Team(0, 1, meeting));
  }

  /// Calls body(begin, end) on one range of [0, count) a thread, of about equal weight, see
  /// Team::for_balanced. If some throw, the exception of the lowest range arrives at the caller,
  /// so that of the lowest item if a range is gone through in order.
  template <class Before, class Body>
  void for_balanced(std::ptrdiff_t count, const Before& before, const Body& body) const {
    if (count <= 0)
      return;
    if (!pool_ || count == 1) {
      body(std::ptrdiff_t{0}, count);
      return;
    }
    detail::FirstException first;
    pool_->run([&](int part) {
      try {
        const std::ptrdiff_t begin = detail::part_begin(count, before, part, pool_->size());
        const std::ptrdiff_t end = detail::part_begin(count, before, part + 1, pool_->size());
        if (begin < end)
          body(begin, end);
      } catch (...) {
        first.keep(part);
      }
    });
    first.rethrow();
  }

  /// The same with items of equal weight.
  template <class Body>
  void for_ranges(std::ptrdiff_t count, const Body& body) const {
    for_balanced(
        count, [](std::ptrdiff_t i) { return i; }, body);
  }

  /// Calls body(i) for 0 ≤ i < count, each once. If some throw, the exception of the lowest i
  /// arrives at the caller, for any number of threads; whether the body was called for items above
  /// that one is open.
  template <class Body>
  void for_each(std::ptrdiff_t count, const Body& body) const {
    for_ranges(count, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      for (std::ptrdiff_t i = begin; i < end; ++i)
        body(i);
    });
  }

  /// Reduces over chunks of a fixed size: `term(begin, end)` gives the partial result of one chunk,
  /// `combine` joins them from first to last, so the result is the same for any number of threads.
  /// `partials` is workspace that the caller keeps, so that a warm call allocates nothing.
  /// Exceptions: as for_each.
  template <class Value, class Term, class Combine>
  Value reduce(std::ptrdiff_t count, Array<Value>& partials, Value start, const Term& term,
               const Combine& combine) const {
    using detail::chunk;
    partials.resize(static_cast<std::size_t>((count + chunk - 1) / chunk));
    for_each(static_cast<std::ptrdiff_t>(partials.size()), [&](std::ptrdiff_t c) {
      partials[c] = term(c * chunk, std::min(count, (c + 1) * chunk));
    });
    Value total = start;
    for (const Value& partial : partials)
      total = combine(total, partial);
    return total;
  }

 private:
  std::unique_ptr<detail::ThreadPool> pool_;
};

} // namespace talus
