// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/bytes_of.hpp"
#include "talus/core/communicator.hpp"

#include <cstdint>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>

namespace talus::distributed {

/// Gives all ranks the bytes that `from` gives. Collective.
inline Array<char> broadcast(const Communicator& ranks, Array<char> bytes = {}, int from = 0) {
  Array<Message> out;
  if (ranks.rank() == from)
    for (int to = 0; to < ranks.size(); ++to)
      if (to != from) {
        out.emplace_back();
        out.back().rank = to;
        out.back().bytes = bytes;
      }
  Array<Message> in = ranks.deliver(out);
  if (!in.empty())
    return std::move(in[0].bytes);
  return ranks.rank() == from ? std::move(bytes) : Array<char>();
}

/// The same for text.
inline std::string broadcast(const Communicator& ranks, const std::string& text, int from = 0) {
  Array<char> bytes;
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes = broadcast(ranks, std::move(bytes), from);
  return {bytes.begin(), bytes.end()};
}

/// Calls work(), which must not be collective. If it throws on some ranks, all throw a
/// std::runtime_error with the message of the lowest one of them. Collective.
template <class Work>
void together(const Communicator& ranks, const Work& work) {
  std::string message;
  std::int64_t failed = 0; // the higher, the lower the rank
  try {
    work();
  } catch (const std::exception& error) {
    failed = ranks.size() - ranks.rank();
    message = error.what();
  } catch (...) {
    failed = ranks.size() - ranks.rank();
    message = "an exception of unknown type";
  }
  ranks.maximum(&failed, 1);
  if (failed > 0)
    throw std::runtime_error(broadcast(ranks, message, static_cast<int>(ranks.size() - failed)));
}

} // namespace talus::distributed
