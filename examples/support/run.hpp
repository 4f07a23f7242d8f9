// SPDX-License-Identifier: MIT
#pragma once

#include "budget.hpp"
#include "command_line.hpp"
#include "results.hpp"
#include "resume.hpp"
#include "series.hpp"
#include "solids_at.hpp"
#include "vtk_frame.hpp"

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/rigid_motion.hpp"
#include "talus/core/types.hpp"
#include "talus/diagnostics/strain_rate.hpp"
#include "talus/dual/problem.hpp"
#include "talus/io/csv.hpp"
#include "talus/io/number.hpp"
#include "talus/io/progress.hpp"
#include "talus/io/vtk.hpp"
#include "talus/simulation.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

/// \file
/// The time loop that the example programs share: progress, tables, snapshots, checkpoints, summary
/// and picture. A program says what is simulated and what is measured.

namespace support {

struct RunOptions {
  double end_time = 1;  ///< s
  double time_zero = 0; ///< s of the simulation: times are counted from here, in results, too
  double sample_interval = 0.01, snapshot_interval = 0.1; ///< s
  std::string vtk = "last"; ///< which snapshots to write for ParaView: all, last or none
  bool movie = false;       ///< draw one in the end
  bool budget = false;      ///< write energy.csv and forces.csv, see watch_budget
  bool sections = true;     ///< write sections.csv
  /// Rows of nodes across that sections.csv shows (3-D), see channel_row, or all; the user's, if
  /// any, take the place of the program's own.
  std::vector<std::string> section_rows{};
  std::string section_row = "middle";
  int side_wall_cells = 0; ///< of solid walls at the sides: rows are counted from their inner faces
  ResumeOptions resume{};
  CommonOptions common{};

  /// Throws std::invalid_argument if a number is out of range.
  void validate() const {
    talus::require_positive("--snapshot-interval", snapshot_interval);
    talus::require_positive("--sample-interval", sample_interval);
    talus::require_positive("--end-time", end_time);
  }
};

/// The row of nodes across the channel that a text names: wall (next to the side wall y = 0),
/// middle, or a number that counts from the wall. option: what to call it in messages; cells: of
/// the grid across; side: of them those of a solid wall at each side; more: other texts that are
/// allowed, for the message. Throws std::invalid_argument for anything else.
inline int channel_row(const std::string& option, const std::string& text, int cells, int side,
                       const std::string& more = {}) {
  const int last = cells - 2 * side;
  if (text == "wall")
    return side;
  if (text == "middle")
    return cells / 2;
  const auto number = talus::parse_number<int>(text);
  if (!number || *number < 0 || *number > last)
    talus::throw_invalid(option, text, "wall, middle, " + more + "or 0 to " + std::to_string(last));
  return side + *number;
}

/// With --budget: gives the simulation that is made of `params` an EnergyBudget, whose tables the
/// run writes.
template <class Sim>
void watch_budget(const RunOptions& options, typename Sim::Params& params) {
  if (options.budget)
    params.observer = std::make_shared<typename BudgetTables<Sim>::Budget>();
}

/// --snapshot-interval, --sample-interval, --section-rows, --vtk, --movie, --budget.
inline void add_snapshot_options(CLI::App& app, RunOptions& options) {
  app.add_option("--snapshot-interval", options.snapshot_interval, "s")->capture_default_str();
  app.add_option("--sample-interval", options.sample_interval, "Of the table against time, s")
      ->capture_default_str();
  app.add_option(
      "--section-rows", options.section_rows,
      "Rows of nodes across that sections.csv shows in 3-D: wall, middle, all, or numbers "
      "from the wall (default: " +
          options.section_row + ")");
  app.add_option("--vtk", options.vtk, "Which snapshots to write for ParaView")
      ->check(CLI::IsMember({"all", "last", "none"}))
      ->capture_default_str();
  app.add_flag("--movie", options.movie,
               "Draw a movie of the snapshots, of which there are 100 or more then (see movie.py)");
  app.add_flag("--budget", options.budget,
               "Write energy.csv and forces.csv, step by step: where energy and momentum go");
}

/// All options of a run; what `options` holds is the default.
inline void add_run_options(CLI::App& app, RunOptions& options, const std::string& default_out) {
  if (std::isinf(options.end_time)) // it follows from others
    app.add_option("--end-time", options.end_time, "Simulated time, s; default: all of the scene");
  else
    app.add_option("--end-time", options.end_time, "Simulated time, s")->capture_default_str();
  add_snapshot_options(app, options);
  add_resume_options(app, options.resume);
  add_common_options(app, options.common, default_out);
}

/// One run of a simulation, and the files that it leaves in its folder: summary.json, sections.csv,
/// the program's own tables, VTK files.
///
///     Run run(sim, "silo", options, inputs);
///     if (run.finished()) // earlier, with --resume
///       return 0;
///     auto& flow = run.series("flow.csv", {"time_s", "out_m2"});
///     while (run.advance())
///       if (run.sample_due())
///         flow.row(run.time(), run.outflow_volume());
///     return run.finish({{"out_m2", run.outflow_volume()}},
///                       support::picture("Silo", "it empties", "time (s)", flow["time_s"],
///                                        "out (m²)", flow["out_m2"]));
template <class Sim>
class Run {
 public:
  static constexpr int dimension = Sim::dimension;
  using json = nlohmann::json;

  /// name: of the program. label: what the progress bar calls the run. inputs: all that makes the
  /// run what it is. Throws std::invalid_argument for wrong options, and as Checkpoints does.
  Run(Sim& sim, std::string name, const RunOptions& options, json inputs, std::string label = {})
      : sim_(sim), name_(std::move(name)), options_(options),
        out_((options.validate(), options.common.prepare_out())),
        checkpoints_(out_, options.resume, std::move(inputs)), section_rows_(section_rows()),
        next_snapshot_(options.time_zero),
        progress_(label.empty() ? name_ : std::move(label), {.quiet = options.common.quiet}) {
    if (options_.movie)
      options_.snapshot_interval = std::min(options_.snapshot_interval, options_.end_time / 100);
    if (sim.params().time_step > options.time_zero + options.end_time)
      talus::throw_invalid("time_step", sim.params().time_step, "at most the simulated time");
    finished_ = checkpoints_.finished();
    if (finished_) {
      if (!options_.common.quiet)
        std::printf("%s: finished already\n", summary_file().c_str());
      return;
    }
    earlier_ = checkpoints_.resume(sim_);
    fs::remove(summary_file()); // a summary always belongs to a finished run
    keep("frames", frames_);
    remove_frames(options_.vtk == "all" ? frames_.size() : 0);
    if (options_.vtk != "none") {
      fs::create_directories(out_ / "vtk");
      particle_series_.emplace(out_ / "particles.pvd");
      grid_series_.emplace(out_ / "grid.pvd");
    }
    keep("next_sample", next_sample_);
    keep("next_snapshot", next_snapshot_);
    keep(
        "seconds", [this] { return seconds(); },
        [this](const json& value) { earlier_seconds_ = value; });
    keep(
        "statistics", [this] { return statistics_.state(); },
        [this](const json& value) { statistics_.restore(value); });
    if (options_.sections)
      sections_ = &table("sections.csv", section_columns());
    budget_ = BudgetTables<Sim>::budget_of(sim_);
    if (budget_) {
      energy_ = &table("energy.csv", BudgetTables<Sim>::energy_columns(sim_));
      forces_ = &table("forces.csv", BudgetTables<Sim>::force_columns(sim_));
      keep(
          "budget", [this] { return to_json(budget_->record()); },
          [this](const json& earlier) { budget_->restore(energy_record(earlier)); });
    } else { // plot scripts would show those of an earlier run
      fs::remove(out_ / "energy.csv");
      fs::remove(out_ / "forces.csv");
    }
    if (options_.vtk == "all")
      for (std::size_t frame = 0; frame < frames_.size(); ++frame) {
        particle_series_->add(frames_[frame], earlier_frame_file("particles", frame));
        grid_series_->add(frames_[frame], earlier_frame_file("grid", frame));
      }
  }

  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// Was the run finished before, and --resume asks for no more?
  bool finished() const { return finished_; }

  /// A table in the run's folder; after a resume it goes on.
  talus::CsvWriter& table(const std::string& file, const std::vector<std::string>& columns) {
    Table& added = tables_.emplace_back();
    added.name = file;
    if (earlier_)
      added.writer.resume(out_ / file, columns, earlier_->at("bytes").at(file));
    else
      added.writer.open(out_ / file, columns);
    return added.writer;
  }

  /// The same for a table of numbers whose columns are read again in the end.
  Series& series(const std::string& file, const std::vector<std::string>& columns) {
    Series& added = series_.emplace_back(table(file, columns), columns);
    keep(
        file, [&added] { return json(added.columns()); },
        [&added](const json& earlier) { added.restore(earlier); });
    return added;
  }

  /// Makes a variable part of the checkpoint; after a resume it has the value that it had.
  template <class T>
  void keep(const std::string& key, T& value) {
    keep(
        key, [&value] { return json(value); },
        [&value](const json& earlier) { value = earlier.get<T>(); });
  }
  /// The same with get() -> json and set(json).
  void keep(const std::string& key, std::function<json()> get,
            const std::function<void(const json&)>& set) {
    if (earlier_)
      set(earlier_->at(key));
    kept_.emplace_back(key, std::move(get));
  }

  /// Finishes what belongs to the last step, then makes the next one. False after the last step, or
  /// when the run must end (see status). Throws std::runtime_error if already the first step fails.
  bool advance() {
    return advance([](const auto&) {});
  }
  /// The same, and calls before_solve(problem) as Simulation::step() does.
  template <class BeforeSolve>
  bool advance(const BeforeSolve& before_solve) {
    if (stepped_ && !end_step())
      return false;
    stepped_ = true;
    time_before_ = time();
    bodies_before_ = sim_.bodies();
    report_ = sim_.step(before_solve);
    statistics_.add(report_);
    if (!report_.completed()) {
      if (!completed_one_) // there is nothing to measure
        throw std::runtime_error("the first step failed: " + std::string(report_.why()));
      status = "failed: " + std::string(report_.why());
      return false;
    }
    completed_one_ = true;
    if (budget_)
      BudgetTables<Sim>::write(sim_, *budget_, time_before_, time(), *energy_, *forces_);
    last_ = sim_.time() >= last_time() - half_step();
    sampled_ = due(time(), options_.sample_interval, next_sample_);
    return true;
  }

  /// Makes this step the last one.
  void stop() { last_ = true; }

  /// Is it time for a row of the table against time?
  bool sample_due() const { return sampled_ || last_; }

  /// s, counted from options.time_zero: now, and before the last step. The grid's fields are those
  /// of the particles before it, so that tables of them have time_before().
  double time() const { return sim_.time() - options_.time_zero; }
  double time_before() const { return time_before_; }
  const talus::StepReport& report() const { return report_; }
  /// What left through free faces since the start, m^d.
  double outflow_volume() const { return statistics_.outflow_volume(); }
  const fs::path& folder() const { return out_; }

  std::function<void(double time)>
      on_snapshot;            ///< what else to write; time: that of the grid's fields
  std::string text;           ///< shown beside the progress bar
  std::optional<double> done; ///< share of the run; none: that of its time
  std::string status = "completed";

  /// Ends the progress bar, closes the tables and writes summary.json: what all runs tell, and
  /// `results`.
  void write_summary(const json& results) {
    progress_.finish(status);
    for (Table& table : tables_)
      table.writer.close();
    json summary = {{"program", name_},
                    {"versions", versions()},
                    {"status", status},
                    {"inputs", checkpoints_.inputs()},
                    {"threads", sim_.params().threads},
                    {"ranks", ranks_json(sim_)},
                    {"solver", statistics_.solver_json()},
                    {"seconds", statistics_.phase_json()},
                    {"steps", sim_.steps()},
                    {"wall_seconds", seconds()},
                    {"state_checksum", checksum()}};
    if (budget_)
      summary["energy_J"] = BudgetTables<Sim>::summary(sim_, budget_->record());
    summary.update(results);
    write_json(summary_file(), summary);
  }

  /// What a short program ends with: writes the summary, with what it measured and what plot_run.py
  /// is to draw (see run_picture.hpp), prints the facts, and finishes.
  int finish(const json& measured, const json& picture) {
    write_summary({{"measured", measured}, {"picture", picture}});
    if (!options_.common.quiet)
      for (const json& fact : picture.at("facts"))
        std::printf("%s\n", fact.get<std::string>().c_str());
    return finish("plot_run.py");
  }

  /// Prints what the run cost, draws the picture and the movie, removes the checkpoint unless the
  /// run failed. Returns the exit status.
  int finish(const std::string& plot_script) {
    if (!options_.common.quiet)
      statistics_.print(sim_.steps(), seconds());
    draw(options_.common, plot_script, out_);
    if (status == "interrupted") {
      std::fprintf(stderr, "to go on: %s\n", command_to_resume().c_str());
      return 130;
    }
    if (options_.movie) {
      CommonOptions common = options_.common;
      common.no_plot = false;
      draw(common, "movie.py", out_);
    }
    checkpoints_.finish(status);
    return status.starts_with("failed") ? 1 : 0;
  }

 private:
  std::string checksum() const {
    if constexpr (requires { sim_.fingerprint(); })
      return talus::checksum_text(sim_.fingerprint());
    else
      return talus::state_checksum(sim_.particles());
  }

  struct Table {
    std::string name;
    talus::CsvWriter writer{};
  };

  double half_step() const { return 0.5 * sim_.time_step(); }

  /// Is it time for what is due at `next`, s? Then the next such time is later than now, however
  /// long this step was.
  bool due(double now, double interval, double& next) const {
    const double late = now + half_step() - next;
    if (!(late >= 0))
      return false;
    next += interval * (1 + std::floor(late / interval));
    return true;
  }
  double last_time() const { return options_.time_zero + options_.end_time; }
  double seconds() const { return earlier_seconds_ + stopwatch_.seconds(); }
  fs::path summary_file() const { return out_ / "summary.json"; }

  bool end_step() {
    if (due(sim_.time(), options_.snapshot_interval, next_snapshot_) || last_)
      snapshot(last_);
    const double share = done.value_or(sim_.time() / last_time());
    if (text.empty()) {
      char line[64];
      std::snprintf(line, sizeof line, "t = %.3f s, %d sweeps", time(), report_.solve.iterations);
      progress_.update(share, line);
    } else {
      progress_.update(share, text);
    }
    if (last_)
      return false;
    if (interrupted()) {
      status = "interrupted";
      save();
      snapshot(true); // not part of the checkpoint: a run that goes on does not have it
      return false;
    }
    if (checkpoints_.due())
      save();
    return true;
  }

  void save() {
    json notes;
    for (Table& table : tables_)
      notes["bytes"][table.name] = table.writer.size();
    for (const auto& [key, get] : kept_)
      notes[key] = get();
    checkpoints_.save(sim_, notes);
  }

  void snapshot(bool last) {
    const talus::StrainRate strain_rate(sim_);
    if (options_.sections)
      write_section(strain_rate);
    if (on_snapshot)
      on_snapshot(time_before_);
    if (options_.vtk == "all" || (last && options_.vtk == "last"))
      write_vtk(frames_.size(), strain_rate);
    frames_.push_back(time());
    for (Table& table : tables_)
      table.writer.flush();
  }

  std::vector<int> section_rows() const {
    if constexpr (dimension == 2) {
      if (!options_.section_rows.empty())
        talus::throw_invalid("--section-rows", options_.section_rows.front(),
                             "nothing in 2-D: there are no rows across");
      return {0};
    } else {
      const int cells = sim_.grid().cells(1), side = options_.side_wall_cells;
      std::vector<std::string> names = options_.section_rows;
      if (names.empty())
        names = {options_.section_row};
      std::vector<int> rows;
      for (const std::string& name : names) {
        if (name != "all")
          rows.push_back(channel_row("--section-rows", name, cells, side, "all, "));
        else
          for (int row = side; row <= cells - side; ++row)
            rows.push_back(row);
      }
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      return rows;
    }
  }

  /// Is there anything rigid besides the faces of the box?
  bool has_solids() const {
    return !sim_.params().obstacles.empty() || !sim_.params().bodies.empty();
  }

  std::vector<std::string> section_columns() const {
    std::vector<std::string> names{"time_s"};
    for (int a = 0; a < dimension; ++a)
      names.push_back(axis_name<dimension>(a) + std::string("_m"));
    names.insert(names.end(), {"volume_fraction", "speed_m_s"});
    for (int a = 0; a < dimension; ++a)
      names.push_back("velocity_" + std::string(axis_name<dimension>(a)) + "_m_s");
    names.emplace_back("pressure_Pa");
    for (int a = 0; a < dimension; ++a)
      for (int b = a; b < dimension; ++b)
        names.push_back("stress_" + std::string(axis_name<dimension>(a)) + axis_name<dimension>(b) +
                        "_Pa");
    names.emplace_back("strain_rate_1_s");
    for (int m = 1; m < sim_.materials(); ++m)
      names.push_back("material_" + std::to_string(m) + "_fraction");
    if (has_solids())
      names.emplace_back("solid_fraction");
    return names;
  }

  void write_section(const talus::StrainRate<dimension>& strain_rate) {
    constexpr int up = talus::up_axis<dimension>;
    const auto& grid = sim_.grid();
    const SolidsAt<dimension> solids(sim_.params(), bodies_before_,
                                     time_before_ + options_.time_zero);
    std::vector<double> row;
    for (const int across : section_rows_)
      for (int i = 0; i <= grid.cells(0); ++i)
        for (int k = 0; k <= grid.cells(up); ++k) {
          talus::Index<dimension> node;
          if constexpr (dimension == 3)
            node[1] = across;
          node[0] = i;
          node[up] = k;
          const talus::Vec<dimension> x = grid.node_position(node), v = sim_.velocity(node);
          const talus::Mat<dimension> stress = sim_.stress(node);
          row.assign({time_before_});
          row.insert(row.end(), x.begin(), x.end());
          row.insert(row.end(), {sim_.volume_fraction(node), v.norm()});
          row.insert(row.end(), v.begin(), v.end());
          row.push_back(sim_.pressure(node));
          for (int a = 0; a < dimension; ++a)
            for (int b = a; b < dimension; ++b)
              row.push_back(stress(a, b));
          row.push_back(strain_rate.norm(node));
          for (int m = 1; m < sim_.materials(); ++m)
            row.push_back(sim_.material_fraction(node, m));
          if (has_solids())
            row.push_back(solids.fraction(x, grid.spacing()));
          sections_->row(row);
        }
  }

  /// Frames from number `first` on, of an earlier run or an interruption: ParaView would show them
  /// as a part of this one.
  void remove_frames(std::size_t first) const {
    for (const char* series : {"particles.pvd", "grid.pvd"})
      fs::remove(out_ / series);
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(out_ / "vtk", none)) {
      const std::string name = entry.path().filename().string();
      if ((name.starts_with("particles_") || name.starts_with("grid_")) &&
          (name.ends_with(".vtu") || name.ends_with(".pvtu")) &&
          std::strtoull(name.c_str() + name.find('_') + 1, nullptr, 10) >= first)
        fs::remove(entry.path());
    }
  }

  /// kind: particles or grid. Ranks write pieces and an index of them.
  fs::path frame_file(const std::string& kind, std::size_t frame) const {
    char number[32];
    std::snprintf(number, sizeof number, "_%04zu", frame);
    return out_ / "vtk" / (kind + number + (on_ranks ? ".pvtu" : ".vtu"));
  }
  /// The run may have begun on one process.
  fs::path earlier_frame_file(const std::string& kind, std::size_t frame) const {
    fs::path path = frame_file(kind, frame);
    return fs::exists(path) ? path : path.replace_extension(on_ranks ? ".vtu" : ".pvtu");
  }

  void write_vtk(std::size_t frame, const talus::StrainRate<dimension>& strain_rate) {
    const fs::path particles = frame_file("particles", frame), grid = frame_file("grid", frame);
    if constexpr (on_ranks)
      sim_.call(particles.string() + '\n' + grid.string());
    else
      write_vtk_frame(WholeVtk(sim_), sim_, strain_rate, particles, grid);
    particle_series_->add(time(), particles);
    grid_series_->add(time(), grid);
  }

  static constexpr bool on_ranks = requires(const Sim& sim) { sim.call(std::string()); };

  Sim& sim_;
  std::string name_;
  RunOptions options_;
  fs::path out_;
  Checkpoints checkpoints_;
  std::optional<json> earlier_; ///< notes of the checkpoint that the run goes on from
  bool finished_ = false;
  std::list<Table> tables_; ///< their addresses are given away
  std::list<Series> series_;
  talus::CsvWriter* sections_ = nullptr;
  std::shared_ptr<typename BudgetTables<Sim>::Budget> budget_; ///< null: none
  talus::CsvWriter *energy_ = nullptr, *forces_ = nullptr;
  std::vector<std::pair<std::string, std::function<json()>>> kept_;
  std::optional<talus::VtkSeries> particle_series_, grid_series_;
  std::vector<int> section_rows_;                            ///< of nodes across
  std::vector<double> frames_;                               ///< times of the snapshots
  talus::Array<talus::RigidState<dimension>> bodies_before_; ///< the last step
  double next_sample_ = 0, next_snapshot_ = 0, earlier_seconds_ = 0, time_before_ = 0;
  bool stepped_ = false, completed_one_ = false, last_ = false, sampled_ = false;
  talus::StepReport report_;
  SolverStatistics statistics_;
  Stopwatch stopwatch_;
  talus::Progress progress_;
};

} // namespace support
