// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/error.hpp"
#include "talus/core/exact_sum.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <ratio>
#include <stdexcept>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

/// \file
/// How loops over independent items are executed, on one thread or several, on one rank or several.
/// Results never depend on the number of either: items are independent, and sums of numbers that
/// would be rounded are exact.

namespace talus {

/// Largest number of threads worth asking for on this machine.
inline int available_threads() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

namespace detail {

constexpr std::ptrdiff_t chunk = 256; ///< items of a partial sum
constexpr int most_threads = 1024;
constexpr int pieces_a_thread = 8; ///< of a loop: what is left to others when one is late

/// Weights of items that weigh the same.
struct EqualWeights {
  std::ptrdiff_t operator()(std::ptrdiff_t i) const { return i; }
};

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
  void reset() {
    part_ = std::numeric_limits<int>::max();
    exception_ = nullptr;
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

/// Threads that help with loops. The thread that calls run() goes through its share of the pieces
/// and then takes what others have not begun, so it waits only for what another is at, never for
/// one to come: on a busy machine a thread that gets no core is not missed.
class ThreadPool {
 public:
  /// size: with the thread that calls run(), >= 1. Throws std::system_error if the system gives no
  /// more threads.
  explicit ThreadPool(int size)
      : size_(size), parts_(std::make_unique<Part[]>(static_cast<std::size_t>(size))) {
    try {
      for (int rank = 1; rank < size; ++rank)
        threads_.emplace_back([this, rank] { help(rank); });
    } catch (...) {
      stop();
      throw;
    }
  }
  ~ThreadPool() { stop(); }
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int size() const { return size_; }

  /// One piece of a loop: body points at what is to be called.
  using Call = void (*)(const void* body, int piece, int pieces);

  /// Calls call(body, piece, pieces) once for each piece. If some throw, the exception of the
  /// lowest piece arrives here. One thread at a time may call this.
  void run(Call call, const void* body, int pieces) {
    const std::int64_t begin = now();
    call_ = call;
    body_ = body;
    pieces_ = pieces;
    first_.reset();
    if (begin < alone_until_) {
      for (int piece = 0; piece < pieces; ++piece)
        do_piece(piece);
    } else {
      const int parts = size();
      for (int p = 0; p < parts; ++p)
        parts_[static_cast<std::size_t>(p)].pieces.store(range(part(p, parts), part(p + 1, parts)),
                                                         std::memory_order_relaxed);
      round_ += one_round;
      state_.store(round_ | open, std::memory_order_release);
      state_.notify_all();
      work(0);
      close(begin);
    }
    first_.rethrow();
  }

 private:
  /// Nanoseconds.
  static std::int64_t now() {
    using Clock = std::chrono::steady_clock;
    static_assert(std::is_same_v<Clock::period, std::nano>);
    return Clock::now().time_since_epoch().count();
  }

  void do_piece(int piece) noexcept {
    try {
      call_(body_, piece, pieces_);
    } catch (...) {
      first_.keep(piece);
    }
  }

  std::uint64_t part(int p, int parts) const {
    return static_cast<std::uint64_t>(pieces_) * static_cast<std::uint64_t>(p) /
           static_cast<std::uint64_t>(parts);
  }

  /// The pieces of a thread that nobody has taken: first, and behind the last, in 32 bits each.
  struct alignas(64) Part {
    std::atomic<std::uint64_t> pieces{0};
  };
  static std::uint64_t range(std::uint64_t first, std::uint64_t end) { return first << 32U | end; }

  // state_: the round, whether its loop is open to helpers, and how many are in it.
  static constexpr unsigned one_round = 1U << 12U, open = 1U << 11U, helpers = open - 1;

  /// Takes pieces until there are none: its own from the first on, those of others from the last.
  void work(int rank) {
    const int parts = size();
    for (int k = 0; k < parts; ++k) {
      std::atomic<std::uint64_t>& pieces =
          parts_[static_cast<std::size_t>((rank + k) % parts)].pieces;
      std::uint64_t left = pieces.load(std::memory_order_relaxed);
      while (true) {
        const std::uint64_t first = left >> 32U, end = left & 0xffffffffU;
        if (first == end)
          break;
        if (pieces.compare_exchange_weak(left,
                                         k == 0 ? range(first + 1, end) : range(first, end - 1),
                                         std::memory_order_relaxed)) {
          do_piece(static_cast<int>(k == 0 ? first : end - 1));
          left = pieces.load(std::memory_order_relaxed);
        }
      }
    }
  }

  /// Waits for the helpers that are at work and lets no more in. If that takes longer than all
  /// before it, a core was busy with something else: then work goes on alone for a while.
  void close(std::int64_t begin) {
    unsigned expected = round_ | open;
    if (state_.compare_exchange_strong(expected, round_, std::memory_order_acq_rel))
      return;
    const std::int64_t worked = now();
    do {
      if (expected != (round_ | open))
        wait_while(expected);
      expected = round_ | open;
    } while (!state_.compare_exchange_strong(expected, round_, std::memory_order_acq_rel));
    const std::int64_t waited = now() - worked, long_time = 1000000;
    if (waited > std::max(worked - begin, long_time))
      alone_until_ = worked + 16 * waited;
  }

  void help(int rank) {
    unsigned last = 0;
    while (true) {
      unsigned state = state_.load(std::memory_order_acquire);
      if (state == stopped)
        return;
      if ((state & open) == 0 || (state & ~(open | helpers)) == last) {
        wait_while(state);
        continue;
      }
      if (!state_.compare_exchange_weak(state, state + 1, std::memory_order_acquire))
        continue;
      last = state & ~(open | helpers);
      work(rank);
      if ((state_.fetch_sub(1, std::memory_order_release) & helpers) == 1)
        state_.notify_all();
    }
  }

  /// Waits until the state is no longer `old`: busily for some microseconds, which most waits take,
  /// then asleep, so that other programs can have the core.
  void wait_while(unsigned old) const {
    constexpr int busy = 20000; // loads
    for (int k = 0; k < busy; ++k)
      if (state_.load(std::memory_order_acquire) != old)
        return;
    state_.wait(old, std::memory_order_acquire);
  }

  void stop() {
    state_.store(stopped, std::memory_order_release);
    state_.notify_all();
    for (std::thread& thread : threads_)
      thread.join();
  }

  static constexpr unsigned stopped = ~0U & ~open; // no round has so many helpers

  Call call_ = nullptr;
  const void* body_ = nullptr;
  int pieces_ = 0;
  FirstException first_;
  unsigned round_ = 0;
  std::int64_t alone_until_ = std::numeric_limits<std::int64_t>::min();
  int size_;
  std::unique_ptr<Part[]> parts_; // one a thread
  std::atomic<unsigned> state_{0};
  std::vector<std::thread> threads_;
};

} // namespace detail

/// Where and how loops run. A copy has threads of its own, so that copies of a simulation may step
/// side by side; no loop may run in another.
class Execution {
 public:
  /// communicator: of the ranks that share the work; null: there is one. Throws
  /// std::invalid_argument if threads is not in 1..1024, std::system_error if the system gives no
  /// more threads.
  explicit Execution(int threads = 1, const Communicator* communicator = nullptr)
      : communicator_(communicator) {
    if (threads < 1 || threads > detail::most_threads)
      throw_invalid("threads", threads, "an integer in 1..1024");
    if (threads > 1)
      pool_ = std::make_unique<detail::ThreadPool>(threads);
  }
  Execution(const Execution& other) : Execution(other.threads(), other.communicator_) {}
  Execution(Execution&&) noexcept = default;
  Execution& operator=(const Execution& other) {
    if (this != &other)
      *this = Execution(other);
    return *this;
  }
  Execution& operator=(Execution&&) noexcept = default;
  ~Execution() = default;

  int threads() const { return pool_ ? pool_->size() : 1; }

  /// Calls body(begin, end) on ranges that make up [0, count), some for each thread, of about equal
  /// weight. before(i): the weight of all items below i, 0 ≤ i ≤ count; an integer that does not
  /// fall. If some throw, the exception of the lowest range arrives at the caller, so that of the
  /// lowest item if a range is gone through in order.
  template <class Before, class Body>
  void for_balanced(std::ptrdiff_t count, const Before& before, const Body& body) const {
    if (count <= 0)
      return;
    const auto do_piece = [&](int piece, int pieces) {
      const std::ptrdiff_t begin = detail::part_begin(count, before, piece, pieces);
      const std::ptrdiff_t end = detail::part_begin(count, before, piece + 1, pieces);
      if (begin < end)
        body(begin, end);
    };
    // a pointer: the body is compiled once
    constexpr detail::ThreadPool::Call call = [](const void* any, int piece, int pieces) {
      (*static_cast<decltype(&do_piece)>(any))(piece, pieces);
    };
    if (!pool_ || count == 1)
      call(&do_piece, 0, 1);
    else
      pool_->run(call, &do_piece,
                 static_cast<int>(std::min<std::ptrdiff_t>(
                     count, std::ptrdiff_t{detail::pieces_a_thread} * pool_->size())));
  }

  /// The same with items of equal weight.
  template <class Body>
  void for_ranges(std::ptrdiff_t count, const Body& body) const {
    for_balanced(count, detail::EqualWeights{}, body);
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
  /// Of this rank alone. `partials` is workspace that the caller keeps, so that a warm call
  /// allocates nothing. Exceptions: as for_each.
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

  // Over all ranks; collective.

  /// The largest of a value >= 0 that each rank has, or NaN if one has that.
  double largest(double value) const {
    if (!communicator_)
      return value;
    // numbers >= 0 are ordered as their bits are, and NaNs come after infinity
    auto bits = static_cast<std::int64_t>(std::bit_cast<std::uint64_t>(value) << 1U >> 1U);
    communicator_->maximum(&bits, 1);
    return std::bit_cast<double>(bits);
  }
  std::size_t sum(std::size_t count) const {
    auto total = static_cast<std::int64_t>(count);
    if (communicator_)
      communicator_->sum(&total, 1);
    return static_cast<std::size_t>(total);
  }
  /// Joins the sums of all ranks.
  void join(ExactSum* sums, int count) const {
    if (communicator_)
      communicator_->sum(sums, count);
  }

  /// Calls check(). If it throws on some ranks, all throw, those what it threw, and the others
  /// std::invalid_argument with the message of the lowest of these, of which it has the first 511
  /// characters: else they would wait for ranks that are gone. What check() has to do with other
  /// ranks must come before it throws.
  template <class Check>
  void check_on_all(const Check& check) const {
    if (!communicator_)
      return check();
    std::exception_ptr refusal;
    std::string message = "an exception of unknown type";
    try {
      check();
    } catch (const std::exception& error) {
      refusal = std::current_exception();
      message = error.what();
    } catch (...) {
      refusal = std::current_exception();
    }
    share_refusal(refusal, message);
  }

  const Communicator* communicator() const { return communicator_; } ///< null: one rank
  bool first_rank() const { return !communicator_ || communicator_->rank() == 0; }

 private:
  /// See check_on_all. refusal: null if this rank refuses nothing.
  void share_refusal(const std::exception_ptr& refusal, const std::string& message) const {
    const int ranks = communicator_->size();
    std::int64_t lowest = refusal ? ranks - communicator_->rank() : 0; // the higher, the lower
    communicator_->maximum(&lowest, 1);
    if (lowest == 0)
      return;
    std::int64_t text[512] = {};
    if (communicator_->rank() == ranks - lowest)
      for (std::size_t k = 0; k < std::min<std::size_t>(message.size(), 511); ++k)
        text[k] = static_cast<unsigned char>(message[k]);
    communicator_->maximum(text, 512);
    if (refusal)
      std::rethrow_exception(refusal);
    std::string of_lowest;
    for (int k = 0; text[k] != 0; ++k)
      of_lowest += static_cast<char>(text[k]);
    throw std::invalid_argument(of_lowest);
  }

  std::unique_ptr<detail::ThreadPool> pool_;
  const Communicator* communicator_ = nullptr;
};

} // namespace talus
