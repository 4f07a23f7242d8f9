// SPDX-License-Identifier: MIT
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#if __has_include(<unistd.h>)
#include <fcntl.h>
#include <unistd.h>
#define TALUS_HAS_FSYNC
#endif

namespace talus {

/// A file that gets its name when it is complete: written as NAME.tmp and renamed by commit();
/// given up, it leaves nothing behind. What cannot be written is a std::runtime_error that names
/// the file and the reason.
class AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& path)
      : path_(path), temporary_(path.string() + ".tmp"),
        file_(std::fopen(temporary_.string().c_str(), "wb")) {
    if (!file_) {
      const int error = errno;
      temporary_.clear(); // not ours to remove
      fail(error);
    }
  }
  ~AtomicFile() { give_up(); }
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes) {
    if (bytes > 0 && std::fwrite(data, 1, bytes, file_) != bytes)
      fail(errno);
  }
  void write(std::string_view text) { write(text.data(), text.size()); }

  /// Durable: on the disk before it gets its name, so that not even a loss of power leaves a file
  /// that is named but incomplete; and the name, too, where the file system can do that.
  enum class Durable { no, yes };

  void commit(Durable durable = Durable::no) {
    if (std::fflush(file_) != 0)
      fail(errno);
#ifdef TALUS_HAS_FSYNC
    if (durable == Durable::yes && ::fsync(::fileno(file_)) != 0)
      fail(errno);
#else
    static_cast<void>(durable);
#endif
    if (std::fclose(std::exchange(file_, nullptr)) != 0)
      fail(errno);
    std::error_code error;
    std::filesystem::rename(temporary_, path_, error);
    if (error)
      fail(error.value());
    temporary_.clear();
    if (durable == Durable::yes)
      keep_name();
  }

 private:
  void keep_name() const noexcept {
#ifdef TALUS_HAS_FSYNC
    const std::filesystem::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
    if (const int opened = ::open(folder.c_str(), O_RDONLY); opened >= 0) {
      ::fsync(opened); // some file systems refuse
      ::close(opened);
    }
#endif
  }

  [[noreturn]] void fail(int error) {
    give_up();
    throw std::runtime_error("cannot write " + path_.string() + ": " +
                             std::generic_category().message(error));
  }

  void give_up() noexcept {
    if (file_)
      std::fclose(std::exchange(file_, nullptr));
    std::error_code ignored;
    if (!temporary_.empty())
      std::filesystem::remove(temporary_, ignored);
  }

  std::filesystem::path path_, temporary_;
  std::FILE* file_;
};

} // namespace talus
