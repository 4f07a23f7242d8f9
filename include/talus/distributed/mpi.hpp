// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/distributed/ranks.hpp"

#include <mpi.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>

namespace talus::distributed {

/// Ranks that talk through MPI, in a communicator of their own, so that messages of the program
/// itself are not mixed up with theirs. An error of MPI ends the program, as MPI does by default.
class Mpi final : public Communicator {
 public:
  /// Collective. Throws std::logic_error if MPI_Init was not called.
  explicit Mpi(MPI_Comm communicator = MPI_COMM_WORLD) {
    int ready = 0;
    MPI_Initialized(&ready);
    if (!ready)
      throw std::logic_error("talus: MPI_Init must be called before ranks are made");
    MPI_Comm_dup(communicator, &communicator_);
    MPI_Comm_rank(communicator_, &rank_);
    MPI_Comm_size(communicator_, &size_);
  }
  ~Mpi() override {
    int ended = 0;
    MPI_Finalized(&ended);
    if (!ended)
      MPI_Comm_free(&communicator_);
  }

  int rank() const override { return rank_; }
  int size() const override { return size_; }

  void sum(std::int64_t* values, int count) const override { reduce(values, count, MPI_SUM); }
  void sum(ExactSum* sums, int count) const override {
    Array<std::int64_t> words;
    for (int k = 0; k < count; ++k) {
      sums[k].normalise();
      words.insert(words.end(), sums[k].words(), sums[k].words() + ExactSum::size);
    }
    reduce(words.data(), count * ExactSum::size, MPI_SUM);
    const std::int64_t* from = words.data();
    for (int k = 0; k < count; ++k, from += ExactSum::size)
      std::copy_n(from, ExactSum::size, sums[k].words());
  }
  void maximum(std::int64_t* values, int count) const override { reduce(values, count, MPI_MAX); }

  void start(const Array<Message>& out, Array<Message>& in) const override {
    for (Message& message : in)
      if (!message.bytes.empty())
        receive(message);
    for (const Message& message : out)
      if (!message.bytes.empty())
        send(message);
  }
  void finish() const override {
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    requests_.clear();
  }

  Array<Message> deliver(const Array<Message>& out) const override {
    Array<std::int64_t> sizes(static_cast<std::size_t>(size_), 0), theirs(sizes.size(), 0);
    for (const Message& message : out)
      sizes[message.rank] = static_cast<std::int64_t>(message.bytes.size());
    MPI_Alltoall(sizes.data(), 1, MPI_INT64_T, theirs.data(), 1, MPI_INT64_T, communicator_);
    Array<Message> in;
    for (int r = 0; r < size_; ++r)
      if (theirs[r] > 0) {
        in.emplace_back();
        in.back().rank = r;
        in.back().bytes.resize(static_cast<std::size_t>(theirs[r]));
      }
    start(out, in);
    finish();
    return in;
  }

 private:
  static constexpr int tag = 1;

  void reduce(std::int64_t* values, int count, MPI_Op operation) const {
    MPI_Allreduce(MPI_IN_PLACE, values, count, MPI_INT64_T, operation, communicator_);
    ++counted.reductions;
  }

  /// Messages above 2 GiB go in parts: MPI 3 counts in int.
  template <class Byte, class Post>
  void in_parts(Byte* bytes, std::size_t size, const Post& post) const {
    constexpr std::size_t most = std::size_t{1} << 30U;
    for (std::size_t first = 0; first < size; first += most) {
      requests_.emplace_back();
      post(bytes + first, static_cast<int>(size - first < most ? size - first : most),
           &requests_.back());
    }
  }
  void send(const Message& message) const {
    ++counted.messages;
    counted.bytes += message.bytes.size();
    in_parts(message.bytes.data(), message.bytes.size(),
             [&](const char* bytes, int count, MPI_Request* request) {
               MPI_Isend(bytes, count, MPI_BYTE, message.rank, tag, communicator_, request);
             });
  }
  void receive(Message& message) const {
    in_parts(message.bytes.data(), message.bytes.size(),
             [&](char* bytes, int count, MPI_Request* request) {
               MPI_Irecv(bytes, count, MPI_BYTE, message.rank, tag, communicator_, request);
             });
  }

 public:
  /// What this rank has sent since the start.
  struct Counted {
    std::size_t messages = 0, bytes = 0, reductions = 0;
  };
  mutable Counted counted;

 private:
  MPI_Comm communicator_ = MPI_COMM_NULL;
  int rank_ = 0, size_ = 1;
  mutable Array<MPI_Request> requests_;
};

/// The ranks of an MPI communicator, as Params::ranks of one simulation. Collective; throws as Mpi
/// and Ranks.
template <int Dim, class Real = double>
std::shared_ptr<Ranks<Dim, Real>> make_ranks(MPI_Comm communicator = MPI_COMM_WORLD,
                                             const Dealing& dealing = {}) {
  return std::make_shared<Ranks<Dim, Real>>(std::make_shared<Mpi>(communicator), dealing);
}

} // namespace talus::distributed
