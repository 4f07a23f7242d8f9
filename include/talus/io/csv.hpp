// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"

#include <cerrno>
#include <charconv>
#include <concepts>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

/// \file
/// Tables as comma-separated values, one row at a time.

namespace talus {

/// A value that CsvWriter::row accepts: a number, or a text.
template <class T>
concept CsvValue = std::is_arithmetic_v<T> || std::convertible_to<const T&, std::string_view>;

/// Writes a table: a line of column names, then rows. Numbers are written with the fewest digits
/// that read back as the same value, whatever the locale; not-a-number is `nan`. Texts that need it
/// are quoted. Rows reach the disk at the latest on flush() or close().
///
/// Every error in writing (no such folder, disk full) is a std::runtime_error that names the file
/// and the reason. The destructor closes the file but cannot throw: call close() to know.
class CsvWriter {
 public:
  CsvWriter() = default;

  /// As open().
  CsvWriter(const std::filesystem::path& path, const std::vector<std::string>& columns) {
    open(path, columns);
  }

  /// Creates the file, or empties it, and writes the column names; closes an earlier file.
  /// Throws std::invalid_argument without columns, std::runtime_error if it cannot be written.
  void open(const std::filesystem::path& path, const std::vector<std::string>& columns) {
    if (columns.empty())
      throw_invalid("the number of columns of " + path.string(), 0, "at least 1");
    close();
    path_ = path;
    columns_ = columns.size();
    file_.reset(std::fopen(path.string().c_str(), "w"));
    if (!file_)
      fail(errno);
    for (const std::string& column : columns)
      append(column);
    end_row();
    flush(); // what cannot be written is known at once
  }

  /// Goes on with a file that open() made: keeps its first `bytes` bytes, as size() gave them, and
  /// writes after them. Throws std::runtime_error if the file is shorter or cannot be written.
  void resume(const std::filesystem::path& path, const std::vector<std::string>& columns,
              std::uintmax_t bytes) {
    close();
    path_ = path;
    columns_ = columns.size();
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (!error && size < bytes)
      throw std::runtime_error("cannot go on with " + path.string() + ": it has " +
                               std::to_string(size) + " bytes instead of " + std::to_string(bytes));
    if (!error)
      std::filesystem::resize_file(path, bytes, error);
    if (error)
      fail(error.value());
    file_.reset(std::fopen(path.string().c_str(), "a"));
    if (!file_)
      fail(errno);
  }

  /// Bytes written so far. Flushes.
  std::uintmax_t size() {
    flush();
    return std::filesystem::file_size(path_);
  }

  bool is_open() const { return file_ != nullptr; }
  const std::filesystem::path& path() const { return path_; }

  /// Writes one row: as many numbers or texts as there are columns, else std::invalid_argument.
  template <CsvValue... Values>
  void row(const Values&... values) {
    check_row(sizeof...(Values));
    (append(values), ...);
    end_row();
  }

  /// Writes one row of numbers, #columns.
  void row(std::span<const double> values) {
    check_row(values.size());
    for (const double value : values)
      append(value);
    end_row();
  }

  /// Hands all rows so far to the system, for others to read.
  void flush() {
    if (file_ && std::fflush(file_.get()) != 0)
      fail(errno);
  }

  /// Flushes and closes; does nothing if no file is open.
  void close() {
    if (file_ && std::fclose(file_.release()) != 0)
      fail(errno);
  }

 private:
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  /// After an error the file is closed: a second message would only repeat the first.
  [[noreturn]] void fail(int error) {
    file_.reset();
    throw std::runtime_error("cannot write " + path_.string() + ": " +
                             std::generic_category().message(error));
  }

  void check_row(std::size_t values) const {
    if (!file_)
      throw std::logic_error("CsvWriter::row: no file is open");
    if (values != columns_)
      throw_invalid("the number of values in a row of " + path_.string(), values,
                    std::to_string(columns_));
  }

  template <CsvValue Value>
  void append(const Value& value) {
    if (!line_.empty())
      line_ += ',';
    if constexpr (std::is_same_v<Value, bool>) {
      line_ += value ? '1' : '0';
    } else if constexpr (std::is_arithmetic_v<Value>) {
      if (value != value) { // never "-nan"
        line_ += "nan";
        return;
      }
      char digits[64];
      line_.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
    } else {
      append_text(value);
    }
  }

  void append_text(std::string_view text) {
    if (!text.empty() && text.find_first_of(",\"\r\n") == std::string_view::npos) {
      line_ += text;
      return;
    }
    line_ += '"';
    for (const char c : text) {
      if (c == '"')
        line_ += '"';
      line_ += c;
    }
    line_ += '"';
  }

  void end_row() {
    line_ += '\n';
    const bool written = std::fwrite(line_.data(), 1, line_.size(), file_.get()) == line_.size();
    line_.clear();
    if (!written)
      fail(errno);
  }

  std::filesystem::path path_;
  std::size_t columns_ = 0;
  std::string line_; ///< the row being made
  std::unique_ptr<std::FILE, Closer> file_;
};

} // namespace talus
