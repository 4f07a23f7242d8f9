// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/fingerprint.hpp"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>

#include <unistd.h>

/// What the fuzzers share: the bytes to try, as a file.

namespace fuzz {

namespace fs = std::filesystem;

/// A folder of this process, on a disk in memory where there is one; gone at the end.
class Folder {
 public:
  Folder() { fs::create_directories(path); }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  const fs::path path =
      (fs::is_directory("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) /
      ("talus_fuzz_" + std::to_string(::getpid()));
};
inline const fs::path& folder() {
  static const Folder folder;
  return folder.path;
}

inline fs::path write(const char* name, std::string_view bytes) {
  fs::path path = folder() / name;
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr || std::fwrite(bytes.data(), 1, bytes.size(), file) != bytes.size())
    std::abort();
  std::fclose(file);
  return path;
}

/// The same with the right fingerprint at the end, else every change would be found by it.
inline fs::path write_sealed(const char* name, std::string_view bytes) {
  talus::Fingerprint fingerprint;
  fingerprint.add(bytes);
  std::string sealed(bytes);
  for (int byte = 0; byte < 8; ++byte)
    sealed +=
        static_cast<char>((fingerprint.value() >> (8U * static_cast<unsigned>(byte))) & 0xffU);
  return write(name, sealed);
}

} // namespace fuzz
