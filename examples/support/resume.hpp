// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"

#include "talus/core/error.hpp"
#include "talus/core/fingerprint.hpp"
#include "talus/diagnostics/checksum.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/io/checkpoint_pieces.hpp"
#include "talus/version.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>

/// \file
/// Long runs that can be stopped, even killed, and go on where they were.

namespace support {

/// --resume, --overwrite, --checkpoint-interval.
struct ResumeOptions {
  bool resume = false, overwrite = false;
  double interval = 60; ///< s by the clock on the wall; 0: no checkpoints
};

inline void add_resume_options(CLI::App& app, ResumeOptions& options) {
  app.add_flag("--resume", options.resume,
               "Go on with the unfinished run in --out; nothing is done if it is finished");
  app.add_flag("--overwrite", options.overwrite, "Replace another or an unfinished run in --out")
      ->excludes("--resume");
  app.add_option(
         "--checkpoint-interval", options.interval,
         "Seconds between checkpoints, from which --resume goes on; 0: only when interrupted")
      ->capture_default_str();
}

/// A checksum of all that a file holds, for the inputs of a run: with another content it is another
/// run. Null for no file.
inline nlohmann::json content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (path.empty() || !file)
    return nullptr;
  talus::Fingerprint all;
  for (std::istreambuf_iterator<char> at(file), end; at != end; ++at)
    all.add(static_cast<unsigned char>(*at));
  return talus::checksum_text(all.value());
}

/// The first difference between two sets of inputs, "KEY = THERE, not HERE"; empty without one.
inline std::string input_difference(const nlohmann::json& there, const nlohmann::json& here,
                                    const std::string& prefix = {}) {
  const auto at = [](const nlohmann::json& all, const std::string& key) {
    return all.is_object() ? all.value(key, nlohmann::json()) : nlohmann::json();
  };
  nlohmann::json keys = there.is_object() ? there : nlohmann::json::object();
  keys.update(here);
  for (const auto& entry : keys.items()) {
    const nlohmann::json was = at(there, entry.key()), is = at(here, entry.key());
    if (was == is)
      continue;
    const std::string name = prefix + entry.key();
    if (is.is_object() && was.is_object())
      return input_difference(was, is, entry.key() == "options" ? "--" : name + ".");
    return name + " = " + was.dump() + ", not " + is.dump();
  }
  return {};
}

/// The summary of the run or study in a folder; an empty object if there is none that can be read.
inline nlohmann::json read_summary(const fs::path& path) {
  std::ifstream file(path);
  const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
  const bool usable = summary.is_object() && summary.contains("inputs") &&
                      summary.value("status", nlohmann::json()).is_string();
  return usable ? summary : nlohmann::json::object();
}

/// The checkpoint of a run in its folder, OUT/checkpoint.talus, on ranks with a piece of each
/// beside it: there until the run is finished; that of a run that failed stays.
class Checkpoints {
 public:
  /// inputs: what makes a run what it is, besides its options and the version of talus; compared
  /// with those of the run that is there. Throws std::invalid_argument if there is a finished run
  /// with other inputs or an unfinished one, and the user did not say what to do with it;
  /// std::runtime_error to go on with one that failed.
  Checkpoints(const fs::path& out, const ResumeOptions& options, nlohmann::json inputs)
      : file_(out / "checkpoint.talus"), options_(options), inputs_(std::move(inputs)) {
    talus::require_non_negative("--checkpoint-interval", options.interval);
    inputs_["options"] = options_as_inputs();
    inputs_["version"] = // patches of it give the same results
        std::to_string(TALUS_VERSION_MAJOR) + '.' + std::to_string(TALUS_VERSION_MINOR);
    const fs::path summary_file = out / "summary.json";
    if (options.overwrite) {
      talus::remove_checkpoint(file_);
      fs::remove(summary_file);
    }
    if (fs::exists(file_)) {
      if (!options.resume)
        throw std::invalid_argument(out.string() +
                                    " holds an unfinished run; add --resume to go on with it, "
                                    "--overwrite to start anew, or choose another --out");
      return;
    }
    const nlohmann::json summary = read_summary(summary_file);
    const std::string status = summary.value("status", "");
    if (status.empty() || status == "interrupted") // nothing that is worth to be kept
      return;
    if (const std::string difference = input_difference(summary.at("inputs"), inputs_);
        !difference.empty())
      throw std::invalid_argument(out.string() + " holds a finished run that had " + difference +
                                  "; add --overwrite to replace it, or choose another --out");
    if (options.resume && status.starts_with("failed"))
      throw std::runtime_error(summary_file.string() + ": the run " + status +
                               "; --overwrite runs it again");
    finished_ = options.resume;
  }

  /// All inputs, with the options and the version.
  const nlohmann::json& inputs() const { return inputs_; }

  /// Is this run here already, finished, and the user content with it (--resume)?
  bool finished() const { return finished_; }

  /// Puts `sim` where the checkpoint was, if there is one, and returns the program's own notes.
  /// Throws std::invalid_argument if the run had other inputs, std::runtime_error if the file is
  /// damaged.
  template <class Sim>
  std::optional<nlohmann::json> resume(Sim& sim) const {
    if (!options_.resume || !fs::exists(file_))
      return std::nullopt;
    std::string text;
    if constexpr (requires { sim.read_checkpoint(file_); }) // on ranks
      text = sim.read_checkpoint(file_);
    else
      text = talus::read_checkpoint(file_, sim);
    nlohmann::json notes = nlohmann::json::parse(text);
    if (const std::string difference = input_difference(notes.at("inputs"), inputs_);
        !difference.empty())
      throw std::invalid_argument("--resume: the run in " + file_.parent_path().string() + " had " +
                                  difference);
    return notes.at("program");
  }

  /// Is it time for the next checkpoint?
  bool due() const {
    return options_.interval > 0 &&
           Clock::now() - last_ >= std::chrono::duration<double>(options_.interval);
  }

  template <class Sim>
  void save(const Sim& sim, const nlohmann::json& program) {
    const std::string notes = nlohmann::json{{"inputs", inputs_}, {"program", program}}.dump();
    if constexpr (requires { sim.write_checkpoint(file_, notes); }) // on ranks
      sim.write_checkpoint(file_, notes);
    else
      talus::write_checkpoint(file_, sim, notes);
    last_ = Clock::now();
  }

  /// The results are written. If the run failed, what it can go on from stays.
  void finish(const std::string& status) const {
    if (!status.starts_with("failed"))
      talus::remove_checkpoint(file_);
  }

 private:
  using Clock = std::chrono::steady_clock;
  fs::path file_;
  ResumeOptions options_;
  nlohmann::json inputs_;
  bool finished_ = false;
  Clock::time_point last_ = Clock::now();
};

} // namespace support
