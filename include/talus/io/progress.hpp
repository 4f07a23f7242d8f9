// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <utility>

#if defined(_WIN32)
#include <io.h>
#else
#include <unistd.h>
#endif

/// \file
/// How far a long run is: a bar on a terminal, now and then a line in a log.

namespace talus {

/// How Progress shows itself.
struct ProgressParams {
  bool quiet = false;          ///< shows nothing
  double bar_seconds = 0.1;    ///< on a terminal: least time between two pictures of the bar, s
  double log_seconds = 10;     ///< elsewhere: least time between two lines, s; they come at every
                               ///< 5 % or, if that takes longer, every six times this
  std::FILE* stream = nullptr; ///< where to; nullptr: stderr
};

/// Shows the share of a run that is done, a text (say, the simulated time), and the elapsed and the
/// estimated remaining time. Never throws for what it cannot show.
class Progress {
 public:
  using Params = ProgressParams;

  explicit Progress(std::string label, const Params& params = {})
      : label_(std::move(label)), params_(params), stream_(params.stream ? params.stream : stderr),
        terminal_(is_terminal(stream_)) {}
  ~Progress() { close_line(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// fraction: share done, 0 to 1, or not-a-number where it is unknown; text: what else to say.
  /// Cheap enough to call every step.
  void update(double fraction, std::string_view text = {}) {
    if (params_.quiet)
      return;
    const double now = elapsed();
    if (first_fraction_ < 0 && fraction >= 0) { // a resumed run does not start at 0
      first_fraction_ = fraction;
      first_time_ = now;
    }
    const double waited = now - shown_time_;
    if (terminal_) {
      if (waited >= params_.bar_seconds)
        show(fraction, text, now);
    } else if (waited >= 6 * params_.log_seconds ||
               (waited >= params_.log_seconds && fraction >= shown_fraction_ + 0.05)) {
      show(fraction, text, now);
    }
  }

  /// Shows the end of the run, with a line of its own; later updates start afresh below it.
  void finish(std::string_view text = {}) {
    if (params_.quiet)
      return;
    std::string line = label_ + "  done in " + duration(elapsed());
    if (!text.empty())
      line.append("  ").append(text);
    start_line();
    print(line + "\n");
  }

  /// Prints a line of its own without spoiling the bar; not when quiet.
  void note(std::string_view text) {
    if (params_.quiet)
      return;
    start_line();
    print(std::string(text) + "\n");
  }

  /// Seconds since construction.
  double elapsed() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

  /// "42 s", "3 min 05 s" or "2 h 07 min". seconds: ≥ 0.
  static std::string duration(double seconds) {
    const auto two_digits = [](long long n) { return (n < 10 ? "0" : "") + std::to_string(n); };
    const long long s = std::llround(std::clamp(seconds, 0.0, 1e15));
    if (s < 60)
      return std::to_string(s) + " s";
    if (s < 3600)
      return std::to_string(s / 60) + " min " + two_digits(s % 60) + " s";
    return std::to_string(s / 3600) + " h " + two_digits(s / 60 % 60) + " min";
  }

 private:
  static bool is_terminal(std::FILE* stream) {
#if defined(_WIN32)
    return _isatty(_fileno(stream)) != 0;
#else
    const char* const kind = std::getenv("TERM");
    return isatty(fileno(stream)) != 0 && kind != nullptr && std::string_view(kind) != "dumb";
#endif
  }

  void show(double fraction, std::string_view text, double now) {
    std::string line = label_;
    const bool known = fraction >= 0;
    if (known) {
      const double done = std::min(fraction, 1.0);
      if (terminal_) {
        constexpr int width = 20;
        const auto filled = static_cast<std::size_t>(done * width);
        line += "  [" + std::string(filled, '#') + std::string(width - filled, '.') + "]";
      }
      const std::string percent = std::to_string(static_cast<int>(100 * done));
      line += std::string(5 - percent.size(), ' ') + percent + " %";
    }
    if (!text.empty())
      line.append("  ").append(text);
    line += "  " + duration(now);
    if (known && fraction > first_fraction_ && fraction < 1)
      line += ", about " +
              duration((now - first_time_) * (1 - fraction) / (fraction - first_fraction_)) +
              " left";
    if (terminal_) {
      constexpr std::size_t columns = 79; // a line that wraps could not be replaced
      line.resize(std::min(line.size(), columns));
      start_line();
      print(line);
      open_line_ = true;
    } else {
      print(line + "\n");
    }
    shown_time_ = now;
    shown_fraction_ = known ? fraction : shown_fraction_;
  }

  /// Goes to the start of an empty line, over the bar if there is one.
  void start_line() {
    if (open_line_)
      print("\r\x1b[K");
    open_line_ = false;
  }

  void close_line() {
    if (open_line_)
      print("\n");
    open_line_ = false;
  }

  void print(const std::string& text) {
    std::fputs(text.c_str(), stream_);
    std::fflush(stream_);
  }

  std::string label_;
  Params params_;
  std::FILE* stream_;
  bool terminal_, open_line_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double shown_time_ = 0, shown_fraction_ = 0;
  double first_fraction_ = -1, first_time_ = 0;
};

} // namespace talus
