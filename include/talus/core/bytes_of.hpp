// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/communicator.hpp"

#include <cstddef>
#include <cstring>

namespace talus {

/// Appends the bytes of numbers to a message: Eigen's fixed-size matrices, indices, structs of
/// those. All ranks are taken to have the same representation of numbers.
template <class Value>
void put(Array<char>& bytes, const Value& value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof(Value));
  std::memcpy(bytes.data() + at, static_cast<const void*>(&value), sizeof(Value));
}

/// Reads them in the same order.
class Taker {
 public:
  explicit Taker(const Array<char>& bytes) : bytes_(bytes) {}
  bool at_end() const { return at_ == bytes_.size(); }
  template <class Value>
  void take(Value& value) {
    std::memcpy(static_cast<void*>(&value), bytes_.data() + at_, sizeof(Value));
    at_ += sizeof(Value);
  }
  template <class Value>
  Value take() {
    Value value;
    take(value);
    return value;
  }

 private:
  const Array<char>& bytes_;
  std::size_t at_ = 0;
};

/// What each rank tells all, in the order of the ranks. Collective.
inline Array<Message> told_to_all(const Array<char>& mine, const Communicator& communicator) {
  Array<Message> out;
  for (int to = 0; to < communicator.size(); ++to) {
    out.emplace_back();
    out.back().rank = to;
    out.back().bytes = mine;
  }
  return communicator.deliver(out);
}

} // namespace talus
