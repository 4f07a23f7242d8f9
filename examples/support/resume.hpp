// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"

#include "talus/core/error.hpp"
#include "talus/io/checkpoint.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
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
  app.add_flag("--overwrite", options.overwrite, "Replace an unfinished run in --out")
      ->excludes("--resume");
  app.add_option(
         "--checkpoint-interval", options.interval,
         "Seconds between checkpoints, from which --resume goes on; 0: only when interrupted")
      ->capture_default_str();
}

/// The checkpoint of a run in its folder, OUT/checkpoint.talus: there until the run is finished.
class Checkpoints {
 public:
  /// inputs: all that makes a run what it is; compared with those of the run to go on with.
  /// Throws std::invalid_argument if there is an unfinished run and the user did not say what to do
  /// with it, or if it had other inputs.
  Checkpoints(const fs::path& out, const ResumeOptions& options, nlohmann::json inputs)
      : file_(out / "checkpoint.talus"), summary_(out / "summary.json"), options_(options),
        inputs_(std::move(inputs)) {
    talus::require_non_negative("--checkpoint-interval", options.interval);
    if (options.overwrite)
      fs::remove(file_);
    else if (!options.resume && fs::exists(file_))
      throw std::invalid_argument(out.string() +
                                  " holds an unfinished run; add --resume to go on with it, "
                                  "--overwrite to start anew, or choose another --out");
  }

  /// Is this run here already, finished, and the user content with it (--resume)?
  bool finished() const {
    if (!options_.resume || fs::exists(file_) || !fs::exists(summary_))
      return false;
    std::ifstream file(summary_);
    const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
    return summary.is_object() && summary.value("inputs", nlohmann::json()) == inputs_;
  }

  /// Puts `sim` where the checkpoint was, if there is one, and returns the program's own notes.
  /// Throws std::invalid_argument if the run had other inputs, std::runtime_error if the file is
  /// damaged.
  template <class Sim>
  std::optional<nlohmann::json> resume(Sim& sim) const {
    if (!options_.resume || !fs::exists(file_))
      return std::nullopt;
    nlohmann::json notes = nlohmann::json::parse(talus::read_checkpoint(file_, sim));
    for (const auto& [key, value] : notes.at("inputs").items())
      if (!inputs_.contains(key) || inputs_.at(key) != value)
        throw std::invalid_argument("--resume: the run in " + file_.parent_path().string() +
                                    " had " + key + " = " + value.dump() + ", not " +
                                    inputs_.value(key, nlohmann::json()).dump());
    return notes.at("program");
  }

  /// Is it time for the next checkpoint?
  bool due() const {
    return options_.interval > 0 &&
           Clock::now() - last_ >= std::chrono::duration<double>(options_.interval);
  }

  template <class Sim>
  void save(const Sim& sim, const nlohmann::json& program) {
    const nlohmann::json notes = {{"inputs", inputs_}, {"program", program}};
    talus::write_checkpoint(file_, sim, notes.dump());
    last_ = Clock::now();
  }

  /// The run is finished and its results are written.
  void finish() const { fs::remove(file_); }

 private:
  using Clock = std::chrono::steady_clock;
  fs::path file_, summary_;
  ResumeOptions options_;
  nlohmann::json inputs_;
  Clock::time_point last_ = Clock::now();
};

} // namespace support
