// SPDX-License-Identifier: MIT
//
// Grains are poured slowly onto a heap: a wedge in 2-D, a cone in 3-D (a quarter of it, between two
// planes of symmetry). The slope of its surface against the angle of friction, as in the second
// test of the avalanche angle of Rousseau et al., J. Fluid Mech. 2023. The floor is rough.

#include "support/scene.hpp"

#include "talus/diagnostics/fits.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/scene/source.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

namespace {

/// The surface by its distance from the axis of the heap, both sides or all directions together.
struct Surface {
  std::vector<double> radius, height; ///< m, by radius
  double top = 0;                     ///< m, of what is not below the mouth
  bool is_heap = false;               ///< high enough to have a slope

  /// axis: its x, m; mouth: half its width, m.
  template <class Sim>
  Surface(const Sim& sim, double axis, double mouth) {
    constexpr int dim = Sim::dimension;
    const auto& grid = sim.grid();
    std::vector<std::pair<double, double>> points;
    for (int row = 0; row <= (dim == 3 ? grid.cells(1) : 0); ++row) {
      const talus::Profile profile = talus::measure_profile(sim, row);
      for (std::size_t i = 0; i < profile.x.size(); ++i) {
        const double y = dim == 3 ? grid.spacing()[1] * row : 0;
        points.emplace_back(std::hypot(profile.x[i] - axis, y), profile.height[i]);
      }
    }
    std::sort(points.begin(), points.end());
    for (const auto& [r, z] : points) {
      radius.push_back(r);
      height.push_back(z);
      if (r > mouth + grid.spacing()[0]) // a node feels the stream a cell away
        top = std::max(top, z);
    }
    is_heap = top > 6 * grid.spacing()[dim - 1];
  }

  /// Between a fifth and four fifths of the height; not a number as long as it is no heap.
  talus::LineFit line() const {
    if (!is_heap)
      return talus::fit_line_between({}, {}, 0, 0);
    return talus::fit_line_between(radius, height, 0.2 * top, 0.8 * top);
  }
  double angle() const { return support::degrees(std::atan(-line().slope)); } ///< degrees
};

/// Mean of a column from one time (s) to another, without what is not a number.
double mean_between(const support::Series& series, const std::string& name, double from,
                    double to) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < series["time_s"].size(); ++i)
    if (const double t = series["time_s"][i], value = series[name][i];
        t > from && t <= to && std::isfinite(value)) {
      sum += value;
      ++count;
    }
  return sum / count;
}

} // namespace

int main(int argc, char** argv) {
  double heap = 0.08, seconds = 8, rest = 1, above = 0.02, mouth = 0.03; // m, s
  support::Scene scene("pour", "Grains are poured slowly onto a heap: its slope against friction.");
  scene.cell = 0.005;
  scene.run.sample_interval = 0.05;
  scene.run.snapshot_interval = 0.5;
  scene.run.section_row = "wall"; // through the axis of the cone
  scene.without({"seeding"});     // a source pours a lattice
  scene.option("--heap-height", heap, "heap_height_m", "Of the heap at the angle of friction, m");
  scene.option("--pour-time", seconds, "pour_time_s", "In which it is poured, s: the rate");
  scene.option("--rest-time", rest, "rest_time_s", "After that, s");
  scene.option("--drop", above, "drop_m", "From the mouth to the top of the heap in the end, m");
  scene.option("--mouth", mouth, "mouth_m", "Width of the mouth, m");
  scene.run.end_time = std::numeric_limits<double>::infinity(); // what the options above say
  return scene.main<2, 3>(argc, argv, [&]<int dim>() {
    talus::require_positive("--heap-height", heap);
    talus::require_positive("--pour-time", seconds);
    talus::require_non_negative("--rest-time", rest);
    talus::require_positive("--drop", above);
    talus::require_positive("--mouth", mouth);
    talus::require_positive("--friction", scene.friction);
    if (std::isinf(scene.run.end_time))
      scene.run.end_time = seconds + rest;
    // the heap as the law has it, and the box around it
    const double radius = heap / scene.friction, reach = 1.35 * radius;
    const double half = std::ceil(reach / scene.cell) * scene.cell;
    const double length = dim == 2 ? 2 * half : half, axis = dim == 2 ? half : 0;
    const double plane = heap + above;
    auto params = scene.box<dim>({length, half, plane + 2 * scene.cell});
    const auto up = static_cast<std::size_t>(dim - 1);
    params.faces = talus::Faces<dim>::all({talus::FaceKind::open});
    params.faces.lower[up] = {talus::FaceKind::no_slip};
    if (dim == 3)
      params.faces.lower[0] = params.faces.lower[1] = {talus::FaceKind::free_slip};
    const talus::Grid<dim> grid(params.grid);
    typename talus::Source<dim>::Params pour;
    pour.lower = pour.upper = talus::Vec<dim>::Constant(mouth / 2);
    pour.lower.setZero();
    pour.lower[0] = dim == 2 ? axis - mouth / 2 : 0;
    pour.upper[0] = axis + mouth / 2;
    pour.lower[dim - 1] = pour.upper[dim - 1] = plane;
    if (dim == 3)
      pour.inside = [r = mouth / 2](const talus::Vec<dim>& x) {
        return std::hypot(x[0], x[1]) < r;
      };
    const double volume = dim == 2 ? heap * radius : std::numbers::pi / 12 * radius * radius * heap;
    pour.flux = volume / seconds;
    // Fast enough that a loose stream does not come in lumps of whole layers.
    const double area = dim == 2 ? mouth : std::numbers::pi / 16 * mouth * mouth;
    pour.velocity[dim - 1] = -std::max(0.2, 1.5 * pour.flux / area);
    pour.time.end = seconds;
    pour.seeding = scene.seeding;
    params.exchange = talus::make_source<dim>(grid, pour);
    support::SceneSimulation<dim> sim(params, {});
    auto run = scene.start(sim);
    if (run.finished())
      return 0;
    double in = 0, held_back = 0;
    run.keep("volume_in", in);
    run.keep("volume_held_back", held_back);
    auto& slope = run.series("slope.csv", {"time_s", "angle_deg", "height_m", "volume_in",
                                           "volume_out", "speed_max_m_s"});
    while (run.advance()) {
      in += run.report().inflow_volume;
      held_back += run.report().held_back_volume;
      if (!run.sample_due())
        continue;
      const Surface surface(sim, axis, mouth / 2);
      slope.row(run.time_before(), surface.angle(), surface.top, in, run.outflow_volume(),
                talus::largest_speed(sim));
    }

    const Surface surface(sim, axis, mouth / 2);
    const auto or_null = [](double value) {
      return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
    };
    const double friction_angle = support::degrees(std::atan(scene.friction));
    const double angle = mean_between(slope, "angle_deg", seconds / 2, seconds);
    const double now = talus::total_volume(sim.particles());
    const double balance = in > 0 ? (in - run.outflow_volume() - now) / in : 0;
    const auto degrees = [](double value) { // none below six cells
      return std::isfinite(value) ? support::text("%.1f°", value) : std::string("none");
    };
    const std::string fact =
        support::text("slope %s while it is poured, %s in the end; "
                      "friction angle %.1f°",
                      degrees(angle).c_str(), degrees(surface.angle()).c_str(), friction_angle);

    // The surface with a line at the angle of friction through the middle of the slope.
    const talus::LineFit line = surface.line();
    const double z_middle = surface.top / 2, r_middle = (z_middle - line.intercept) / line.slope;
    const double r_foot = r_middle + z_middle / scene.friction;
    const auto curve = [](const char* kind, const std::string& label, const auto& x,
                          const auto& y) {
      return nlohmann::json{{"kind", kind}, {"label", label}, {"x", x}, {"y", y}};
    };
    using Values = std::vector<double>;
    const std::string law = support::text("angle of friction, %.1f°", friction_angle);
    auto picture = support::picture(dim == 2 ? "A wedge is poured" : "A cone is poured", fact);
    picture["panels"] = {
        {{"x", "distance from the axis (m)"},
         {"y", "height of the surface (m)"},
         {"curves",
          {curve("points", "talus, in the end", surface.radius, surface.height),
           curve("dashed", law,
                 Values{std::max(0.0, r_foot - surface.top / scene.friction), r_foot},
                 Values{std::min(surface.top, r_foot * scene.friction), 0.0})}}},
        {{"x", "time (s)"},
         {"y", "slope (°)"},
         {"curves",
          {curve("line", "talus", slope["time_s"], slope["angle_deg"]),
           curve("dashed", law, Values{0, scene.run.end_time},
                 Values{friction_angle, friction_angle})}}}};
    return run.finish({{"angle_deg", or_null(angle)},
                       {"angle_end_deg", or_null(surface.angle())},
                       {"friction_angle_deg", friction_angle},
                       {"height_m", surface.top},
                       {"flux", pour.flux},
                       {"volume_in", in},
                       {"volume_held_back", held_back},
                       {"volume_out", run.outflow_volume()},
                       {"volume_end", now},
                       {"volume_balance", balance},
                       {"speed_end_m_s", talus::largest_speed(sim)}},
                      picture);
  });
}
