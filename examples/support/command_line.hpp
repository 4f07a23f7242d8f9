// SPDX-License-Identifier: MIT
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

// toml++ asserts that some malformed files do not occur ("[=" is one), or assumes it in an
// optimised build. Its assertions become exceptions, in every build.
namespace support {
struct TomlAssertion {};
[[noreturn]] inline void toml_assertion_failed() {
  throw TomlAssertion();
}
} // namespace support
#pragma push_macro("NDEBUG")
#undef NDEBUG
#define TOML_ASSERT(expression)                                                                    \
  ((expression) ? static_cast<void>(0) : support::toml_assertion_failed())
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

#include "ranks.hpp"
#include "whole_numbers.hpp"

#include "talus/core/error.hpp"
#include "talus/core/execution.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <sys/file.h>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

/// \file
/// What all example programs share at their edges: common options, case files, errors, interrupts.

namespace support {

namespace fs = std::filesystem;

/// Folder of the examples' sources: case files and plot scripts.
inline fs::path examples_folder() {
  return TALUS_EXAMPLES_DIR;
}

namespace detail {
inline std::vector<int> locks; ///< file descriptors
}

/// Two programs that write the same files would tear them: a folder is this program's own until it
/// ends, whatever ends it. Throws std::invalid_argument if it is another one's.
inline void lock_folder(const fs::path& folder) {
  const fs::path path = folder / ".lock";
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file < 0 || flock(file, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    char process[32] = "";
    const bool known = file >= 0 && read(file, process, sizeof process - 1) > 0;
    if (file >= 0)
      close(file);
    if (error == EWOULDBLOCK)
      throw std::invalid_argument("--out is " + folder.string() +
                                  "; allowed: a folder that no other program writes to (process " +
                                  (known ? process : "unknown") + " does)");
    std::fprintf(stderr, "%s cannot be locked (%s): see to it that no other program writes there\n",
                 folder.c_str(), std::generic_category().message(error).c_str());
    return;
  }
  const std::string process = std::to_string(getpid());
  if (ftruncate(file, 0) != 0 || write(file, process.data(), process.size()) < 0)
    static_cast<void>(0); // it only serves the message above
  detail::locks.push_back(file);
}

/// --out, --threads, --quiet, --no-plot.
struct CommonOptions {
  std::string out;
  int threads = talus::available_threads();
  bool quiet = false, no_plot = false;

  /// Creates the output folder, checks that files can be written there, and keeps other programs
  /// out of it. Throws std::invalid_argument.
  fs::path prepare_out() const {
    std::error_code error;
    fs::create_directories(out, error);
    const fs::path probe = fs::path(out) / ".talus-write-test";
    std::FILE* file = error ? nullptr : std::fopen(probe.c_str(), "w");
    if (file == nullptr)
      throw std::invalid_argument("--out is " + out +
                                  "; allowed: a folder that can be created and written" +
                                  (error ? " (" + error.message() + ")" : ""));
    std::fclose(file);
    fs::remove(probe);
    lock_folder(out);
    return out;
  }
};

inline void add_common_options(CLI::App& app, CommonOptions& options,
                               const std::string& default_out) {
  options.out = default_out;
  app.add_option("--out", options.out, "Folder for the results")->capture_default_str();
  app.add_option("--threads", options.threads, "Threads; the result does not depend on it")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_flag("--quiet", options.quiet, "Print nothing but errors");
  app.add_flag("--no-plot", options.no_plot, "Draw no picture");
}

namespace detail {
inline volatile std::sig_atomic_t interrupt_flag = 0;
extern "C" inline void on_interrupt(int signal) {
  interrupt_flag = 1;
  if (signal == SIGINT)
    std::signal(SIGINT, SIG_DFL); // a second Ctrl-C ends the program at once
}
} // namespace detail

/// Has anyone asked the program to stop: the user (Ctrl-C), the terminal that was closed (SIGHUP)
/// or a batch system (SIGTERM, SIGXCPU, SIGUSR1, SIGUSR2)? The step is finished and results
/// written; a second Ctrl-C ends the program without.
inline bool interrupted() {
  return detail::interrupt_flag != 0;
}

namespace detail {
inline std::vector<std::string> arguments; ///< of the program, its name first
inline nlohmann::json options = nlohmann::json::object();
} // namespace detail

/// All options of the program that may change its result, by their names, with the values that they
/// have: whatever is added to the command line later is among them.
inline const nlohmann::json& options_as_inputs() {
  return detail::options;
}

/// A word as a shell reads it back.
inline std::string shell_quoted(const std::string& word) {
  const auto plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || std::strchr("-_./=+:,", c) != nullptr;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain))
    return word;
  std::string quoted = "'";
  for (const char c : word)
    quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

/// The command line of this program that goes on with its run.
inline std::string command_to_resume() {
  std::string command;
  for (const std::string& argument : detail::arguments)
    if (argument != "--resume" && argument != "--overwrite")
      command += shell_quoted(argument) + ' ';
  return command + "--resume";
}

namespace detail {
/// The values of all options but those that say where to, how fast and how loudly. Numbers are
/// compared as numbers: .5 and 0.50 are 0.5.
inline nlohmann::json options_of(const CLI::App& app) {
  static const std::vector<std::string> others = {
      "help",       "out",      "threads",    "quiet",
      "no-plot",    "resume",   "overwrite",  "checkpoint-interval",
      "write-jobs", "job-time", "job-memory", "compare"};
  const auto value = [](const std::string& text) -> nlohmann::json {
    if (text.empty())
      return nullptr;
    if (text == "true" || text == "false") // CLI11 writes a default as 1 or 0
      return text == "true" ? 1.0 : 0.0;
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end); // .5 as well, which is no JSON
    const bool all_of_it = end == text.c_str() + text.size() && std::isfinite(number);
    return all_of_it ? nlohmann::json(number) : nlohmann::json(text);
  };
  nlohmann::json all = nlohmann::json::object();
  for (const CLI::Option* option : app.get_options()) {
    const std::string& name = option->get_single_name();
    if (std::find(others.begin(), others.end(), name) != others.end())
      continue;
    if (option->count() == 0) {
      all[name] = value(option->get_default_str());
      continue;
    }
    for (const std::string& word : option->results())
      all[name].push_back(value(word));
    if (all[name].size() == 1)
      all[name] = nlohmann::json(all[name][0]);
  }
  return all;
}
} // namespace detail

/// Parses the command line and runs `body`. Exit status: body's; 2 for wrong input, with a message
/// that names it; 1 for anything else.
template <class Body>
int run_program(CLI::App& app, int argc, char** argv, const Body& body) {
  check_numbers(app);
  [[maybe_unused]] const RanksOfProgram ranks{};
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int status = RanksOfProgram::first() ? app.exit(error) : error.get_exit_code();
    return status == 0 ? 0 : 2;
  }
  detail::arguments.assign(argv, argv + argc);
  detail::options = detail::options_of(app);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGXCPU, SIGUSR1, SIGUSR2})
    if (std::signal(signal, detail::on_interrupt) == SIG_IGN)
      std::signal(signal, SIG_IGN); // as nohup wants it
  const std::string name = fs::path(argv[0]).filename().string();
  const auto say = [&](const std::exception& error) { // what all ranks meet, one says
    if (RanksOfProgram::first())
      std::fprintf(stderr, "%s: %s\n", name.c_str(), error.what());
  };
  try {
    return body();
  } catch (const Served&) {
    return 0;
  } catch (const std::invalid_argument& error) {
    say(error);
    return 2;
  } catch (const std::exception& error) {
    say(error);
    return 1;
  }
}

/// A table of a TOML file whose errors name the file and the key.
class Toml {
 public:
  Toml(std::string where, toml::table table) : where_(std::move(where)), table_(std::move(table)) {}

  bool has(std::string_view key) const { return table_.contains(key); }

  double number(std::string_view key) const {
    const auto node = table_[key];
    const auto value = node.value<double>();
    if (!node || !value || !std::isfinite(*value))
      throw std::invalid_argument(where_ + (node ? line_of(*node.node()) : "") + ": " +
                                  std::string(key) + " is missing or not a finite number");
    return *value;
  }
  double number(std::string_view key, double fallback) const {
    return has(key) ? number(key) : fallback;
  }

  std::string text(std::string_view key) const {
    const auto value = table_[key].value<std::string>();
    if (!value)
      throw std::invalid_argument(where_ + (table_.contains(key) ? line_of(*table_.get(key)) : "") +
                                  ": " + std::string(key) + " is missing or not a text");
    return *value;
  }

  Toml table(std::string_view key) const {
    const toml::table* inner = table_[key].as_table();
    if (inner == nullptr)
      throw std::invalid_argument(where_ + ": [" + std::string(key) +
                                  "] is missing or not a table");
    return {where_ + ": [" + std::string(key) + "]", *inner};
  }

  /// Throws std::invalid_argument if there is any other key.
  void only(std::initializer_list<std::string_view> known) const {
    for (const auto& [key, value] : table_)
      if (std::find(known.begin(), known.end(), key.str()) == known.end()) {
        std::string message = where_ + ": unknown key " + std::string(key.str()) + "; allowed:";
        for (const std::string_view name : known)
          message += " " + std::string(name);
        throw std::invalid_argument(message);
      }
  }

  /// All numbers of this table and of the tables in it.
  nlohmann::json to_json() const {
    nlohmann::json json;
    for (const auto& [key, value] : table_)
      json[std::string(key.str())] =
          value.is_table() ? table(key.str()).to_json() : nlohmann::json(number(key.str()));
    return json;
  }

 private:
  static std::string line_of(const toml::node& node) {
    return ": line " + std::to_string(node.source().begin.line);
  }

  std::string where_;
  toml::table table_;
};

/// Names of the case files that come with the examples.
inline std::string case_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(examples_folder() / "cases", error))
    if (entry.path().extension() == ".toml" && entry.path().stem() != "materials")
      names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  std::string all;
  for (const std::string& name : names)
    all += (all.empty() ? "" : ", ") + name;
  return all;
}

/// The text of a case file, fit for toml++ 3.3, which is undefined for some characters that are not
/// ASCII: they become "?" in comments. Throws std::invalid_argument for others.
inline std::string case_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file)
    throw std::invalid_argument(path.string() + ": it cannot be read");
  int line = 1;
  bool comment = false;
  for (char& c : text) {
    if (c == '\n') {
      ++line;
      comment = false;
    } else if (c == '#') {
      comment = true;
    } else if (static_cast<unsigned char>(c) >= 0x80U) {
      if (!comment)
        throw std::invalid_argument(path.string() + ": line " + std::to_string(line) +
                                    ": only ASCII characters are allowed outside comments");
      c = '?';
    }
  }
  return text;
}

/// Reads a case by its name, or a user's own file by its path (*.toml). Throws
/// std::invalid_argument.
inline Toml load_case_file(const std::string& name) {
  fs::path path = name;
  if (path.extension() != ".toml")
    path = examples_folder() / "cases" / (name + ".toml");
  if (name.empty() || !fs::is_regular_file(path))
    throw std::invalid_argument("--case is " + name + "; allowed: " + case_names() +
                                ", or a .toml file like those in examples/cases");
  try {
    return {path.filename().string(), toml::parse(case_text(path), path.string())};
  } catch (const toml::parse_error& error) {
    throw std::invalid_argument(path.string() + ": line " +
                                std::to_string(error.source().begin.line) + ": " +
                                std::string(error.description()));
  } catch (const TomlAssertion&) {
    throw std::invalid_argument(path.string() + ": it is no TOML file");
  }
}

} // namespace support
