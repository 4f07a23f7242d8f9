// SPDX-License-Identifier: MIT
//
// A landslide on a terrain from a map: how far and how fast its front comes, and where it stays.
// The terrain is an ESRI ASCII grid (.asc) or an open sheet of triangles (.stl), the area of the
// release a polygon in a text file, the friction of the ground a number or a second grid. Without
// files of one's own it writes a valley made by a formula, and reads that.

#include "support/scene.hpp"

#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/io/atomic_file.hpp"
#include "talus/io/number.hpp"
#include "talus/io/stl.hpp"
#include "talus/terrain/ascii_grid.hpp"
#include "talus/terrain/deposit_maps.hpp"
#include "talus/terrain/polygon.hpp"
#include "talus/terrain/raster.hpp"
#include "talus/terrain/terrain.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using talus::Raster, talus::Vec;
namespace fs = support::fs;

/// The files of one run.
struct Files {
  std::string terrain, friction, release;
};

/// Writes a valley of 600 m × 160 m into `folder`, at a place in UTM: it falls from 30° to 3°,
/// bends, and widens; its bed is smoother than its sides.
void write_valley(const fs::path& folder, const Files& files) {
  constexpr double west = 632000.5, south = 5094000.5, cell = 5;
  Raster heights{120, 32, west, south, cell, std::vector<double>(120 * 32)};
  Raster friction = heights;
  const auto axis = [](double x) { return 80 + 20 * std::sin(2 * std::numbers::pi * x / 600); };
  for (int j = 0; j < heights.rows; ++j)
    for (int i = 0; i < heights.columns; ++i) {
      const double x = (i + 0.5) * cell, across = (j + 0.5) * cell - axis(x);
      const double radius = 60 + 0.6 * x;
      heights.at(i, j) = 1200 + 150 * std::exp(-x / 220) + across * across / (2 * radius);
      friction.at(i, j) = std::abs(across) < 30 ? 0.25 : 0.45;
    }
  write_ascii_grid(folder / files.terrain, heights);
  write_ascii_grid(folder / files.friction, friction);
  std::string corners = "x,y\n";
  for (const auto& [x, y] :
       {std::pair(30, 85), {60, 75}, {100, 90}, {110, 115}, {100, 140}, {60, 140}, {35, 125}})
    corners += talus::text_of(west + x) + ',' + talus::text_of(south + y) + '\n';
  talus::AtomicFile polygon(folder / files.release);
  polygon.write(corners);
  polygon.commit();
}

/// Heights from a map, or from a sheet of triangles, taken at squares of `cell` (m).
Raster read_heights(const fs::path& path, double cell) {
  return path.extension() == ".stl" || path.extension() == ".STL"
             ? talus::height_map(talus::read_stl(path), cell)
             : talus::read_ascii_grid(path);
}

/// Throws std::invalid_argument unless a map reaches over all from `lower` to `upper` (its own
/// coordinates, m), to rounding: beside it there are values, too, those of its edge.
void require_covers(const std::string& file, const Raster& map, const Vec<2>& lower,
                    const Vec<2>& upper, const std::string& what) {
  const auto extent = [](double from, double to) {
    return talus::text_of(from) + " to " + talus::text_of(to);
  };
  const double rounding = 1e-3 * map.cell;
  for (const int a : {0, 1}) {
    const double from = a == 0 ? map.x : map.y;
    const double to = from + map.cell * (a == 0 ? map.columns : map.rows);
    if (!(from <= lower[a] + rounding && to >= upper[a] - rounding))
      talus::throw_invalid(file + (a == 0 ? ": its extent in x" : ": its extent in y"),
                           extent(from, to), "all of " + what + ", " + extent(lower[a], upper[a]));
  }
}

/// A function of the place in the box that says where its file has no data, in the coordinates of
/// the file. origin: the point of the map that is (0, 0) in the box, m.
talus::GroundFunction<3> with_data(const std::string& file, const auto& map, const Vec<2>& origin) {
  return [=](const Vec<3>& x) {
    const double value = map(x);
    if (std::isnan(value))
      talus::throw_invalid(file + ": what is at (" + talus::text_of(origin[0] + x[0]) + ", " +
                               talus::text_of(origin[1] + x[1]) + ")",
                           "no data", "numbers under all that slides and around it");
    return value;
  };
}

/// The place and the speed of the front: of the hundredth of the volume that is farthest from where
/// the slide began.
struct Front {
  double distance, x, y, speed; ///< m, m/s

  Front(const talus::Particles<3>& sand, const Vec<3>& start) : distance(0), x(0), y(0), speed(0) {
    std::vector<std::pair<double, std::size_t>> far(sand.size());
    for (std::size_t p = 0; p < sand.size(); ++p)
      far[p] = {std::hypot(sand.position[p][0] - start[0], sand.position[p][1] - start[1]), p};
    std::sort(far.rbegin(), far.rend());
    const double share = 0.01 * talus::total_volume(sand);
    double volume = 0;
    for (const auto& [from_start, p] : far) {
      const double part = std::min(sand.volume[p], share - volume);
      distance = from_start;
      x += part * sand.position[p][0] / share;
      y += part * sand.position[p][1] / share;
      speed += part * sand.velocity[p].norm() / share;
      volume += part;
      if (!(volume < share))
        break;
    }
  }
};

} // namespace

int main(int argc, char** argv) {
  Files files;
  std::string surface;
  double depth = 20; // m
  support::Scene scene("landslide", "A landslide on a terrain from a map.");
  scene.cell = 5;
  scene.wall_friction = 0.3;
  scene.density = 1800;
  scene.run.end_time = 32;
  scene.run.sample_interval = 0.25;
  scene.run.snapshot_interval = 2;
  scene.run.sections = false;
  scene.option("--terrain", files.terrain, "terrain_file",
               "Heights: an ESRI ASCII grid (.asc) or an open sheet (.stl); without: a valley");
  scene.option(
      "--friction-map", files.friction, "friction_file",
      "Friction of the ground, an ESRI ASCII grid; without: --wall-friction (the valley has "
      "a map of its own unless that is given)");
  scene.option("--release", files.release, "release_file",
               "Area that slides: a text file of x,y in the coordinates of the terrain");
  scene.option("--release-depth", depth, "release_depth_m", "Of what slides, upright, m");
  scene.option("--release-surface", surface, "release_surface",
               "Its top instead: a height, m, or an ESRI ASCII grid of heights");
  return scene.main<3>(argc, argv, [&] {
    const bool own = !files.terrain.empty();
    if (own != !files.release.empty() || (!own && !files.friction.empty()))
      talus::throw_invalid(own ? "--release" : "--terrain", "not given",
                           "--terrain and --release together, with --friction-map if you like, or "
                           "none of them for the valley");
    if (!files.friction.empty() && scene.given("--wall-friction"))
      throw std::invalid_argument("--friction-map and --wall-friction exclude each other");
    if (!surface.empty() && scene.given("--release-depth"))
      throw std::invalid_argument("--release-surface and --release-depth exclude each other");
    const fs::path out = scene.run.common.out;
    Files read = files;
    if (!own) {
      const Files valley{"valley.asc", "valley_friction.asc", "valley_release.csv"};
      fs::create_directories(out);
      write_valley(out, valley);
      read = {out / valley.terrain, out / valley.friction, out / valley.release};
      if (scene.given("--wall-friction"))
        read.friction.clear();
    }

    // The map's corner is the corner of the box. All else of the map stays in its coordinates.
    talus::require_positive("--cell", scene.cell);
    const Raster terrain = read_heights(read.terrain, scene.cell / 2);
    const Vec<2> origin(terrain.x, terrain.y);
    const talus::BilinearMap heights(terrain, origin);
    const auto ground = with_data(read.terrain, heights, origin);
    const talus::Polygon area = talus::read_polygon(read.release).moved(-origin[0], -origin[1]);
    talus::require_positive("--release-depth", depth);

    // Its box, in whole cells, reaches from the lowest ground to the highest place of the release.
    const auto whole = [&](double size) { return std::floor(size / scene.cell + 1e-6); };
    const double columns = whole(terrain.columns * terrain.cell);
    const double rows = whole(terrain.rows * terrain.cell);
    const auto [low, high] = area.bounds();
    for (const int a : {0, 1}) {
      const double edge = (a == 0 ? columns : rows) * scene.cell;
      const auto at = static_cast<std::size_t>(a);
      if (!(low[at] > 0 && high[at] < edge))
        talus::throw_invalid(read.release + (a == 0 ? ": x of a corner" : ": y of a corner"),
                             origin[a] + (low[at] > 0 ? high[at] : low[at]),
                             "on the terrain, between " + talus::text_of(origin[a]) + " and " +
                                 talus::text_of(origin[a] + edge));
    }
    talus::GroundFunction<3> top = [=](const Vec<3>& x) { return heights(x) + depth; };
    if (const auto height = talus::parse_number<double>(surface)) {
      top = [=](const Vec<3>&) { return *height; };
    } else if (!surface.empty()) {
      const Raster map = talus::read_ascii_grid(surface);
      require_covers(surface, map, origin + Vec<2>(low[0], low[1]),
                     origin + Vec<2>(high[0], high[1]), "the area in " + read.release);
      top = talus::BilinearMap(map, origin);
    }
    double highest = -std::numeric_limits<double>::infinity();
    for (double x = low[0]; x <= high[0]; x += scene.cell)
      for (double y = low[1]; y <= high[1]; y += scene.cell)
        highest = std::max(highest, top({x, y, 0}));
    if (std::isinf(highest))
      talus::throw_invalid(read.release + ": the height of its top", "no data", "numbers");
    const double lowest = talus::range_of(terrain).first - 2 * scene.cell;
    talus::require_positive(read.release + ": the height of its top above the lowest ground",
                            highest - lowest);
    auto params = scene.box<3>({columns * scene.cell, rows * scene.cell,
                                (std::ceil((highest - lowest) / scene.cell) + 2) * scene.cell});
    params.grid.origin[2] = lowest;
    params.faces = talus::Faces<3>::all({talus::FaceKind::open});
    talus::Terrain<3>::Params soil{.height = ground, .friction = scene.wall_friction};
    if (!read.friction.empty()) {
      const Raster map = talus::read_ascii_grid(read.friction, 0);
      require_covers(read.friction, map, origin, origin + scene.cell * Vec<2>(columns, rows),
                     "the terrain");
      soil = {.height = ground,
              .friction_at = with_data(read.friction, talus::CellMap(map, origin), origin)};
    }
    params.obstacles = {talus::make_obstacle<talus::Terrain<3>>(soil)};
    talus::Particles<3> sand;
    fill(sand, talus::Grid<3>(params.grid),
         talus::Release({.area = area,
                         .bottom = ground,
                         .top = with_data(surface, top, origin),
                         .cell = terrain.cell}),
         scene.seeding);
    // Maps are edited under the name that they have.
    scene.input("terrain_content", support::content_of(read.terrain));
    scene.input("friction_content", support::content_of(read.friction));
    scene.input("release_content", support::content_of(read.release));
    scene.input("release_surface_content", talus::parse_number<double>(surface)
                                               ? nlohmann::json()
                                               : support::content_of(surface));
    const Vec<3> start = talus::centre_of_mass(sand);
    const double volume = talus::total_volume(sand);
    support::SceneSimulation<3> sim(params, sand);
    auto run = scene.start(sim);
    if (run.finished())
      return 0;

    // Maps of cells as large as those of the grid, in the coordinates of the terrain.
    write_ascii_grid(run.folder() / "terrain.asc", terrain);
    const Raster cells{static_cast<int>(columns),
                       static_cast<int>(rows),
                       terrain.x,
                       terrain.y,
                       scene.cell,
                       std::vector<double>(static_cast<std::size_t>(columns * rows))};
    Raster deepest = cells, fastest = cells;
    run.keep("deepest", deepest.values);
    run.keep("fastest", fastest.values);
    auto& maps = run.table("maps.csv", {"time_s", "x_m", "y_m", "depth_m", "speed_m_s"});
    run.on_snapshot = [&](double) {
      const Raster depths = depth_map(sim.particles(), cells, origin);
      const Raster speeds = speed_map(sim.particles(), cells, origin);
      for (int j = 0; j < cells.rows; ++j)
        for (int i = 0; i < cells.columns; ++i)
          if (depths.at(i, j) > 0)
            maps.row(run.time(), cells.x + (i + 0.5) * cells.cell, cells.y + (j + 0.5) * cells.cell,
                     depths.at(i, j), speeds.at(i, j));
    };
    auto& front = run.series("front.csv", {"time_s", "front_m", "x_m", "y_m", "speed_m_s",
                                           "speed_max_m_s", "volume_m3", "volume_out_m3"});
    while (run.advance()) {
      if (!run.sample_due() || sim.particles().size() == 0)
        continue;
      const Front now(sim.particles(), start);
      front.row(run.time(), now.distance, origin[0] + now.x, origin[1] + now.y, now.speed,
                talus::largest_speed(sim), talus::total_volume(sim.particles()),
                run.outflow_volume());
      const auto keep_largest = [](Raster& all, const Raster& here) {
        for (std::size_t k = 0; k < all.values.size(); ++k)
          all.values[k] = std::max(all.values[k], here.values[k]);
      };
      keep_largest(deepest, depth_map(sim.particles(), cells, origin));
      keep_largest(fastest, speed_map(sim.particles(), cells, origin));
    }

    const Raster deposit = depth_map(sim.particles(), cells, origin);
    write_ascii_grid(run.folder() / "deposit.asc", deposit);
    write_ascii_grid(run.folder() / "depth_max.asc", deepest);
    write_ascii_grid(run.folder() / "speed_max.asc", fastest);
    const double left = talus::total_volume(sim.particles());
    const double on_map = std::accumulate(deposit.values.begin(), deposit.values.end(), 0.0) *
                          cells.cell * cells.cell;
    const double balance = (left + run.outflow_volume() - volume) / volume;
    const double distance = front["front_m"].empty() ? 0 : front["front_m"].back();
    const double speed = front["speed_m_s"].empty() ? 0
                                                    : *std::max_element(front["speed_m_s"].begin(),
                                                                        front["speed_m_s"].end());
    const std::string fact = support::text(
        "%.0f m³ slid; the front came %.0f m far, at up to %.1f m/s; %.0f m³ left the map", volume,
        distance, speed, run.outflow_volume());
    run.write_summary({{"measured",
                        {{"volume_m3", volume},
                         {"volume_end_m3", left},
                         {"volume_out_m3", run.outflow_volume()},
                         {"volume_on_map_m3", on_map},
                         {"volume_balance", balance},
                         {"front_m", distance},
                         {"front_speed_max_m_s", speed},
                         {"depth_max_m", talus::range_of(deepest).second},
                         {"deposit_depth_max_m", talus::range_of(deposit).second},
                         {"speed_end_m_s", talus::largest_speed(sim)}}},
                       {"origin_m", {origin[0], origin[1]}},
                       {"picture", support::picture("Landslide", fact)}});
    if (!scene.run.common.quiet)
      std::printf("%s\nvolume balance: %.1e\n", fact.c_str(), balance);
    return run.finish("plot_landslide.py");
  });
}
