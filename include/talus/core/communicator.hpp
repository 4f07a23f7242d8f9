// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/exact_sum.hpp"

#include <cstddef>
#include <cstdint>

namespace talus {

/// Bytes for, or from, another rank.
struct Message {
  int rank = 0;
  Array<char> bytes;
};

/// The processes that share a simulation, its ranks, and how they talk. Every function but rank()
/// and size() is collective: all ranks call it, in the same order. A model: distributed::Mpi.
class Communicator {
 public:
  Communicator() = default;
  virtual ~Communicator() = default;
  Communicator(const Communicator&) = delete;
  Communicator& operator=(const Communicator&) = delete;

  virtual int rank() const = 0;
  virtual int size() const = 0;

  /// Replaces each of `count` values by its sum, or its largest one, over all ranks.
  virtual void sum(std::int64_t* values, int count) const = 0;
  virtual void sum(ExactSum* sums, int count) const = 0;
  virtual void maximum(std::int64_t* values, int count) const = 0;

  /// Starts to send `out` and to receive `in`, whose ranks and sizes fit the other ranks'; neither
  /// may be touched before finish(). One exchange at a time.
  virtual void start(const Array<Message>& out, Array<Message>& in) const = 0;
  virtual void finish() const = 0;

  /// Sends `out`, at most one message for each rank, and returns what others sent here, by rank.
  virtual Array<Message> deliver(const Array<Message>& out) const = 0;
};

} // namespace talus
