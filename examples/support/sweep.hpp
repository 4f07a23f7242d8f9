// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"
#include "picture.hpp"
#include "published.hpp"
#include "resolution.hpp"
#include "results.hpp"
#include "resume.hpp"

#include "talus/io/csv.hpp"
#include "talus/io/csv_table.hpp"
#include "talus/io/progress.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <sys/file.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <system_error>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>
#if defined(__linux__)
#include <sys/prctl.h>
#endif

/// \file
/// Studies: many runs of another program, side by side, each in a folder of its own, and what is
/// read from their results.

namespace support {

/// A number as an argument.
inline std::string text(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.9g", value);
  return digits;
}

struct StudyOptions {
  std::string resolution = "coarse"; ///< of `collapse`; empty for other programs
  std::string write_jobs{};
  std::string job_time = "24:00:00", job_memory = "2G"; ///< of each job that is written
  std::optional<double> end_time{};                     ///< s; without: at rest
  bool overwrite = false, movie = false;
  CommonOptions common{};
  const CLI::Option* threads = nullptr; ///< --threads, as it was given

  bool reference() const { return resolution == "reference"; }

  /// Arguments for a channel so wide (m), with at least three cells across.
  std::vector<std::string> channel(double width) const {
    const Resolution& size = resolution_of(resolution);
    return {"--width",
            text(width),
            "--cell",
            text(size.along),
            text(std::min(size.across, width / 3)),
            text(size.up)};
  }
};

inline void add_study_options(CLI::App& app, StudyOptions& options, const std::string& name) {
  if (!options.resolution.empty()) {
    app.add_option("--resolution", options.resolution, "Of all runs")
        ->check(CLI::IsMember(resolution_names()))
        ->capture_default_str();
    app.add_option(
        "--end-time", options.end_time,
        "For a trial: end each run so many seconds after the gate's opening, not at rest");
  }
  app.add_flag("--overwrite", options.overwrite,
               "Replace the runs and results that are there; without, runs that are finished are "
               "taken as they are, and others go on");
  app.add_flag("--movie", options.movie, "Draw a movie of each run, in its folder");
  app.add_option("--write-jobs", options.write_jobs,
                 "Run nothing, but write an array-job script for a batch system (sbatch) to this "
                 "file; when its jobs are done, the same command without it gathers the results. "
                 "--threads is that of each job then, 1 if it is not given");
  app.add_option("--job-time", options.job_time, "Limit of each job's time, for --write-jobs")
      ->capture_default_str();
  app.add_option("--job-memory", options.job_memory, "Memory of each job, for --write-jobs")
      ->capture_default_str();
  add_common_options(app, options.common, "out/" + name);
  options.threads = app.get_option("--threads");
}

/// One run of a program.
struct Job {
  std::string name;                   ///< of its folder
  std::vector<std::string> arguments; ///< --out and --resolution come with the study
  std::string program = "collapse";
};

/// A measured value in a table: nan, as in all tables, if there is none.
inline std::string text(const nlohmann::json& value) {
  return value.is_null() ? "nan" : text(value.get<double>());
}

/// Thrown when the user asked to stop.
struct Interrupted {};

/// Runs jobs, as many at once as there are threads. A run that is finished is not run again and one
/// that was killed goes on (--resume), so that the same command goes on with a sweep that
/// was stopped, whatever stopped it. A folder with a run of other inputs ends it.
class Sweep {
 public:
  explicit Sweep(const StudyOptions& options)
      : options_(options), runs_(fs::absolute(options.common.prepare_out()) / "runs") {}

  /// The folder of a job's results.
  fs::path folder(const Job& job) const { return runs_ / job.name; }

  /// The jobs' summaries, in order. Throws std::runtime_error if a run failed, when all others are
  /// done, std::invalid_argument at once if one was refused, and Interrupted.
  std::vector<nlohmann::json> run(const std::vector<Job>& jobs, const std::string& label) {
    for (const Job& job : jobs)
      if (options_.overwrite && replaced_.insert(job.name).second)
        for (const char* file : {"summary.json", "checkpoint.talus"})
          fs::remove(folder(job) / file);
    if (!options_.write_jobs.empty()) {
      write_jobs(jobs);
      throw Interrupted{};
    }
    talus::Progress progress(label, {.quiet = options_.common.quiet});
    Running running;
    std::string failures;
    std::size_t next = 0, done = 0;
    while (done < jobs.size()) {
      while (!interrupted() && next < jobs.size() &&
             running.size() < static_cast<std::size_t>(options_.common.threads)) {
        running.emplace_back(start(jobs[next]), next);
        ++next;
      }
      int status = 0;
      const pid_t ended = waitpid(-1, &status, WNOHANG);
      if (ended > 0) {
        const auto at = std::find_if(running.begin(), running.end(),
                                     [&](const auto& entry) { return entry.first == ended; });
        if (at != running.end()) {
          const fs::path log = folder(jobs[at->second]) / "log.txt";
          running.erase(at);
          ++done;
          if (WIFEXITED(status) && WEXITSTATUS(status) == 2) { // wrong input
            stop(running);
            progress.finish("refused");
            throw std::invalid_argument(last_line(log));
          }
          if (!(WIFEXITED(status) && WEXITSTATUS(status) == 0))
            failures += "\n  " + log.string() + ": " + last_line(log);
        }
        continue;
      }
      if (interrupted()) {
        stop(running);
        progress.finish("interrupted");
        throw Interrupted{};
      }
      std::string names = std::to_string(done) + " of " + std::to_string(jobs.size()) + " done;";
      for (const auto& entry : running)
        names += " " + jobs[entry.second].name;
      progress.update(static_cast<double>(done) / static_cast<double>(jobs.size()), names);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    progress.finish(failures.empty() ? "completed" : "failed");
    if (!failures.empty())
      throw std::runtime_error("runs failed; the reasons are in" + failures);
    std::vector<nlohmann::json> summaries;
    for (const Job& job : jobs) {
      std::ifstream file(folder(job) / "summary.json");
      summaries.push_back(nlohmann::json::parse(file));
      remark(job, summaries.back());
    }
    return summaries;
  }

  /// What is doubtful about the results, by the name of the run: one that did not end as it should,
  /// or with steps whose solver stopped above its tolerance.
  const nlohmann::json& remarks() const { return remarks_; }

 private:
  using Running = std::vector<std::pair<pid_t, std::size_t>>; ///< process, number of the job

  static void stop(const Running& running) {
    for (const auto& entry : running)
      kill(entry.first, SIGTERM); // they save what they have
    for (const auto& entry : running)
      waitpid(entry.first, nullptr, 0);
  }

  static std::string last_line(const fs::path& path) {
    std::ifstream file(path);
    std::string last;
    for (std::string line; std::getline(file, line);)
      if (!line.empty())
        last = line;
    return last.empty() ? "it said nothing" : last;
  }

  void remark(const Job& job, const nlohmann::json& summary) {
    const std::string status = summary.at("status");
    const auto& solver = summary.at("solver");
    const std::size_t missed = solver.at("steps_not_converged");
    const auto& measured = summary.at("measured");
    const bool moves = measured.contains("rest_time_s") && measured.at("rest_time_s").is_null();
    if (remarks_.contains(job.name) || (status == "completed" && missed == 0 && !moves))
      return;
    remarks_[job.name] = {{"status", status},
                          {"still_moves", moves},
                          {"steps_not_converged", missed},
                          {"steps", summary.at("steps")},
                          {"residual_max", solver.at("residual_max")}};
    std::fprintf(stderr, "%s: %s%s; %zu of %zu steps above the solver's tolerance, residual %.1e\n",
                 job.name.c_str(), status.c_str(), moves ? ", still moves" : "", missed,
                 summary.at("steps").get<std::size_t>(), solver.at("residual_max").get<double>());
  }

  std::vector<std::string> command(const Job& job, int threads) const {
    std::vector<std::string> words;
    if (const char* const before = std::getenv("TALUS_MPIRUN")) { // see run.sh --ranks
      std::istringstream text_of_it(before);
      for (std::string word; text_of_it >> word;)
        words.push_back(word);
    }
    words.push_back(TALUS_PROGRAMS_DIR "/" + job.program);
    if (!options_.resolution.empty())
      words.insert(words.end(), {"--resolution", options_.resolution});
    words.insert(words.end(), job.arguments.begin(), job.arguments.end());
    if (options_.end_time)
      words.insert(words.end(), {"--end-time", text(*options_.end_time)});
    if (options_.movie)
      words.emplace_back("--movie");
    words.insert(words.end(), {"--threads", std::to_string(threads), "--vtk", "none", "--quiet",
                               "--no-plot", "--resume", "--out", folder(job).string()});
    return words;
  }

  pid_t start(const Job& job) const {
    fs::create_directories(folder(job));
    const std::vector<std::string> words = command(job, 1);
    const std::string log = (folder(job) / "log.txt").string();
    std::vector<char*> arguments;
    for (const std::string& word : words)
      arguments.push_back(const_cast<char*>(word.c_str())); // execvp's old signature
    arguments.push_back(nullptr);
    const pid_t parent = getpid();
    const pid_t child = fork();
    if (child < 0)
      throw std::system_error(errno, std::generic_category(), "cannot start " + words[0]);
    if (child > 0)
      return child;
    // From here to execvp only what is safe in a forked process.
    for (const int lock : detail::locks)
      close(lock); // the sweep's own: a new sweep need not wait for this one's runs
#if defined(__linux__)
    prctl(PR_SET_PDEATHSIG, SIGTERM); // not even kill -9 of the sweep leaves runs behind
    if (getppid() != parent)
      _exit(1);
#else
    static_cast<void>(parent);
#endif
    // The lock lasts as long as the run: one of a killed sweep may still be saving what it has.
    const int file = open(log.c_str(), O_WRONLY | O_CREAT, 0666);
    flock(file, LOCK_EX);
    if (interrupted() || ftruncate(file, 0) != 0)
      _exit(1);
    dup2(file, STDOUT_FILENO);
    dup2(file, STDERR_FILENO);
    execvp(arguments[0], arguments.data());
    _exit(127);
  }

  /// All paths are absolute: batch systems start jobs anywhere.
  void write_jobs(const std::vector<Job>& jobs) const {
    const int threads = options_.threads->count() > 0 ? options_.common.threads : 1;
    for (const Job& job : jobs)
      fs::create_directories(folder(job));
    std::ofstream file(options_.write_jobs);
    file << "#!/bin/sh\n#SBATCH --job-name=" << runs_.parent_path().filename().string()
         << "\n#SBATCH --array=1-" << jobs.size() << "\n#SBATCH --cpus-per-task=" << threads
         << "\n#SBATCH --time=" << options_.job_time << "\n#SBATCH --mem=" << options_.job_memory
         << "\n#SBATCH --output=" << shell_quoted((runs_ / "job_%a.log").string())
         << "\n# A job that meets its limit of time saves what it has; submit it again to go on.\n"
            "#SBATCH --signal=B:TERM@60\n"
            "# Other batch systems: run it once for each number, as the first argument.\n"
            "case ${SLURM_ARRAY_TASK_ID:-$1} in\n";
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      file << i + 1 << ")\n  exec";
      for (const std::string& word : command(jobs[i], threads))
        file << ' ' << shell_quoted(word);
      file << " >> " << shell_quoted((folder(jobs[i]) / "log.txt").string()) << " 2>&1 ;;\n";
    }
    file << "*)\n  echo \"usage: $0 NUMBER, 1 to " << jobs.size() << "\" >&2; exit 2 ;;\nesac\n";
    file.close();
    if (!file)
      throw std::runtime_error("cannot write " + options_.write_jobs);
    std::printf("%s: %zu jobs of %d threads; logs in %s\n", options_.write_jobs.c_str(),
                jobs.size(), threads, runs_.c_str());
  }

  StudyOptions options_;
  fs::path runs_;
  nlohmann::json remarks_ = nlohmann::json::object();
  std::set<std::string> replaced_; ///< jobs whose earlier results are gone, for --overwrite
};

/// Columns of a table that a run left.
class RunTable {
 public:
  explicit RunTable(const fs::path& path) : path_(path), table_(talus::read_csv(path)) {
    if (table_.columns[0].empty())
      throw std::runtime_error(path.string() + ": no rows");
  }
  const Values& operator[](const std::string& name) const {
    const auto at = std::find(table_.names.begin(), table_.names.end(), name);
    if (at == table_.names.end())
      throw std::runtime_error(path_.string() + ": no column " + name);
    return table_.columns[static_cast<std::size_t>(at - table_.names.begin())];
  }
  /// The part of a column that belongs to the time (column time_s) nearest to `time`.
  Values at(double time, const std::string& name) const {
    const Values& times = (*this)["time_s"];
    const double nearest = *std::min_element(times.begin(), times.end(), [&](double a, double b) {
      return std::abs(a - time) < std::abs(b - time);
    });
    Values part;
    for (std::size_t i = 0; i < times.size(); ++i)
      if (times[i] == nearest)
        part.push_back((*this)[name][i]);
    return part;
  }
  double last_time() const { return (*this)["time_s"].back(); }

 private:
  fs::path path_;
  talus::CsvTable table_;
};

/// The deposit of a run, from profiles.csv.
inline void add_final_profile(Panel& panel, const std::string& label, const fs::path& folder) {
  const RunTable table(folder / "profiles.csv");
  panel.add("line", label, table.at(table.last_time(), "x_m"),
            table.at(table.last_time(), "height_m"));
}

/// The run-out of a run against time, from front.csv.
inline void add_front(Panel& panel, const std::string& label, const fs::path& folder) {
  const RunTable table(folder / "front.csv");
  panel.add("line", label, table["time_s"], table["runout_m"]);
}

/// Published run-out and rest time, where there are any.
inline void add_published(Panel& panel, const nlohmann::json& published) {
  for (const auto& [source, label] :
       {std::pair("exp", "experiment"), std::pair("sim", "authors' simulation")}) {
    const auto time = published_value(published, "rest_time", source, "_s");
    const auto runout = published_value(published, "runout", source, "_m");
    if (time && runout)
      panel.published(label, time->value, time->half_width, runout->value, runout->half_width);
  }
}

/// What a study leaves besides its runs: OUT/summary.json, OUT/NAME.csv and OUT/NAME.png.
struct StudyResults {
  nlohmann::json inputs = nlohmann::json::object(); ///< but the resolution
  nlohmann::json measured;
  std::vector<std::string> columns; ///< of the table
  std::vector<std::vector<std::string>> rows;
  std::vector<Panel> panels;
  std::string title;
};

/// study(sweep) -> StudyResults.
template <class Study>
int run_study(const StudyOptions& options, const std::string& name, const Study& study) {
  const Stopwatch stopwatch;
  Sweep sweep(options);
  const fs::path summary_file = fs::path(options.common.out) / "summary.json";
  if (!options.overwrite) {
    const nlohmann::json earlier = read_summary(summary_file).value("options", nlohmann::json());
    if (const std::string difference = input_difference(earlier, options_as_inputs(), "--");
        !earlier.is_null() && !difference.empty())
      throw std::invalid_argument(options.common.out + " holds a study that had " + difference +
                                  "; add --overwrite to replace it, or choose another --out");
  }
  if (options.write_jobs.empty())
    fs::remove(summary_file); // a summary always belongs to a finished study
  try {
    const StudyResults results = study(sweep);
    const fs::path out = options.common.out;
    std::ofstream table(out / (name + ".csv"));
    const auto write_row = [&](const std::vector<std::string>& row) {
      for (std::size_t i = 0; i < row.size(); ++i)
        table << (i > 0 ? "," : "") << row[i];
      table << '\n';
    };
    write_row(results.columns);
    for (const auto& row : results.rows)
      write_row(row);
    table.close();
    if (!table)
      throw std::runtime_error("cannot write " + (out / (name + ".csv")).string());
    nlohmann::json inputs = results.inputs;
    std::string title = results.title;
    if (!options.resolution.empty()) {
      inputs["resolution"] = options.resolution;
      title += ", " + options.resolution + " resolution";
    }
    write_json(summary_file, {{"program", name},
                              {"versions", versions()},
                              {"status", "completed"},
                              {"inputs", inputs},
                              {"options", options_as_inputs()},
                              {"measured", results.measured},
                              {"remarks", sweep.remarks()},
                              {"wall_seconds", stopwatch.seconds()}});
    if (!options.common.quiet) {
      std::vector<std::vector<std::string>> lines = {results.columns};
      lines.insert(lines.end(), results.rows.begin(), results.rows.end());
      std::vector<std::size_t> widths(results.columns.size());
      for (const auto& line : lines)
        for (std::size_t c = 0; c < widths.size(); ++c)
          widths[c] = std::max(widths[c], line.at(c).size());
      for (const auto& line : lines) {
        for (std::size_t c = 0; c < widths.size(); ++c)
          std::printf("%s%*s", c > 0 ? "  " : "", static_cast<int>(widths[c]), line[c].c_str());
        std::printf("\n");
      }
    }
    write_panels(out, name, title, results.panels);
    draw(options.common, "plot_study.py", out);
    if (options.movie && !options.common.quiet)
      std::printf("a movie of each run: %s/runs/*/\n", out.c_str());
    return 0;
  } catch (const Interrupted&) {
    if (!options.write_jobs.empty())
      return 0;
    std::fprintf(stderr, "to go on: the same command again%s\n",
                 options.overwrite ? ", without --overwrite" : "");
    return 130;
  }
}

} // namespace support
