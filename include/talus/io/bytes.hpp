// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/fingerprint.hpp"
#include "talus/io/number.hpp"

#include <Eigen/Core>

#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

/// \file
/// What binary files of the library are made of: a header of text lines, little-endian numbers, and
/// a fingerprint at the end.

namespace talus::detail {

static_assert(std::endian::native == std::endian::little,
              "talus: binary files are written on little-endian machines only");

/// Text lines and raw numbers, in memory.
class ByteWriter {
 public:
  void text(std::string_view text) { bytes_ += text; }
  /// One header line: a key and numbers with the fewest digits that read back equal.
  template <class... Numbers>
  void line(std::string_view key, const Numbers&... values) {
    bytes_ += key;
    (number(values), ...);
    bytes_ += '\n';
  }
  template <class Number>
  void number(const Number& value) {
    char digits[32];
    bytes_ += ' ';
    bytes_.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  }
  template <class Number>
  requires std::is_arithmetic_v<Number>
  void raw(const Number& value) {
    char buffer[sizeof value];
    std::memcpy(buffer, &value, sizeof value);
    bytes_.append(buffer, sizeof value);
  }
  template <class Derived>
  void raw(const Eigen::DenseBase<Derived>& values) {
    for (Eigen::Index c = 0; c < values.cols(); ++c)
      for (Eigen::Index r = 0; r < values.rows(); ++r)
        raw(typename Derived::Scalar(values(r, c)));
  }
  /// Ends with the fingerprint of all bytes before.
  void seal() {
    Fingerprint fingerprint;
    fingerprint.add(bytes_);
    raw(fingerprint.value());
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

[[noreturn]] inline void cannot_read(const std::filesystem::path& path, const std::string& reason) {
  throw std::runtime_error("cannot read " + path.string() + ": " + reason);
}

/// All of a file. Throws std::runtime_error that names it and the reason.
inline std::string read_bytes(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    cannot_read(path, "it is a folder");
  std::ifstream file(path, std::ios::binary);
  if (!file)
    cannot_read(path, std::generic_category().message(errno));
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Reads what ByteWriter wrote; every departure from it is a std::runtime_error that names the
/// file.
class ByteReader {
 public:
  explicit ByteReader(const std::filesystem::path& path) : ByteReader(path, read_bytes(path)) {}
  /// bytes: what is in the file.
  ByteReader(std::filesystem::path path, std::string bytes)
      : path_(std::move(path)), bytes_(std::move(bytes)), rest_(bytes_) {}

  [[noreturn]] void fail(const std::string& reason) const { cannot_read(path_, reason); }

  /// Takes the fingerprint off the end, compares and returns it.
  std::uint64_t check_fingerprint() {
    if (rest_.size() < sizeof(std::uint64_t))
      fail("it is truncated");
    std::uint64_t stored;
    const std::size_t payload = rest_.size() - sizeof stored;
    std::memcpy(&stored, rest_.data() + payload, sizeof stored);
    rest_.remove_suffix(sizeof stored);
    Fingerprint fingerprint;
    fingerprint.add(std::string_view(bytes_).substr(0, bytes_.size() - sizeof stored));
    if (fingerprint.value() != stored)
      fail("its checksum does not fit: it is damaged or truncated");
    return stored;
  }

  /// The rest of the header line that must begin with `key`.
  std::string_view line(std::string_view key) {
    const std::size_t end = rest_.find('\n');
    if (end == std::string_view::npos || end > 1000)
      fail("the line \"" + std::string(key) + "\" is missing");
    std::string_view line = rest_.substr(0, end);
    if (!line.starts_with(key))
      fail("the line \"" + std::string(key) + "\" is missing");
    line.remove_prefix(key.size());
    rest_.remove_prefix(end + 1);
    return line;
  }
  template <class... Numbers>
  void line(std::string_view key, Numbers&... values) {
    std::string_view text = line(key);
    const auto take = [&](auto& value) {
      if (text.starts_with(' '))
        text.remove_prefix(1);
      const std::string_view word = text.substr(0, text.find(' '));
      const auto number = parse_number<std::remove_reference_t<decltype(value)>>(word);
      if (!number)
        fail("\"" + std::string(word) + "\" in the line \"" + std::string(key) +
             "\" is no number of its kind");
      value = *number;
      text.remove_prefix(word.size());
    };
    (take(values), ...);
    if (!text.empty())
      fail("more than expected in the line \"" + std::string(key) + "\"");
  }

  /// Refuses what the rest of the file cannot hold, before memory is asked for.
  void need(std::size_t items, std::size_t bytes_each) const {
    if (items > rest_.size() / bytes_each)
      fail("it is truncated");
  }
  template <class Number>
  requires std::is_arithmetic_v<Number>
  void raw(Number& value) {
    need(1, sizeof value);
    std::memcpy(&value, rest_.data(), sizeof value);
    rest_.remove_prefix(sizeof value);
    if constexpr (std::is_floating_point_v<Number>)
      if (!std::isfinite(value))
        fail("a number is not finite");
  }
  template <class Derived>
  void raw(Eigen::DenseBase<Derived>& values) {
    for (Eigen::Index c = 0; c < values.cols(); ++c)
      for (Eigen::Index r = 0; r < values.rows(); ++r)
        raw(values(r, c));
  }
  /// The next bytes as they are.
  std::string_view take(std::size_t bytes) {
    need(bytes, 1);
    const std::string_view taken = rest_.substr(0, bytes);
    rest_.remove_prefix(bytes);
    return taken;
  }
  bool starts_with(std::string_view text) const { return rest_.starts_with(text); }
  bool at_end() const { return rest_.empty(); }

 private:
  std::filesystem::path path_;
  std::string bytes_;
  std::string_view rest_;
};

} // namespace talus::detail
