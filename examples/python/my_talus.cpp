// SPDX-License-Identifier: MIT
//
// A Python module of one composition of talus: a flow in a box behind a gate, in 2-D and 3-D, whose
// friction is a number or a Python function of the inertial number. To bind a composition of your
// own, copy this file and change the types below. See docs/how-to/python.md.

#include "views.hpp"

#include "talus/boundary/faces.hpp"
#include "talus/boundary/gate.hpp"
#include "talus/boundary/obstacle.hpp"
#include "talus/core/error.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/section_flux.hpp"
#include "talus/diagnostics/strain_rate.hpp"
#include "talus/particles.hpp"
#include "talus/rheology/friction_law.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace py = pybind11;

namespace python {

using talus::Index;
using talus::Vec;

/// What Python makes a float of, numbers of numpy too; infinite if it is too large for one. Nothing
/// for True, for text and for all else.
inline std::optional<double> number_of(const py::object& object) {
  PyObject* const given = object.ptr();
  if (PyFloat_CheckExact(given))
    return PyFloat_AS_DOUBLE(given);
  const PyNumberMethods* const methods = Py_TYPE(given)->tp_as_number;
  if (PyBool_Check(given) || !methods || !(methods->nb_float || methods->nb_index))
    return std::nullopt;
  // numpy makes floats of its truth values, texts and complex numbers, too
  const py::object kind = py::getattr(py::getattr(object, "dtype", py::none()), "kind", py::none());
  if (py::isinstance<py::str>(kind) &&
      std::string_view("iuf").find(kind.cast<std::string>()) == std::string_view::npos)
    return std::nullopt;
  const double number = PyFloat_AsDouble(given);
  if (number != -1 || !PyErr_Occurred())
    return number;
  const py::error_already_set error;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (error.matches(PyExc_OverflowError))
    return object < py::int_(0) ? -infinity : infinity;
  if (error.matches(PyExc_TypeError) || error.matches(PyExc_ValueError)) // of several numbers, say
    return std::nullopt;
  throw error;
}

/// One friction coefficient, or a Python function of the inertial number.
class PythonLaw {
 public:
  PythonLaw() = default;
  explicit PythonLaw(const py::object& friction) {
    if (PyCallable_Check(friction.ptr()) != 0) {
      function_ = friction;
    } else if (const auto number = number_of(friction)) {
      talus::require_non_negative("friction", *number);
      constant_ = *number;
    } else {
      throw py::type_error("friction is " + repr(friction) +
                           "; allowed: a number >= 0, or a function of the inertial number");
    }
  }

  bool calls_python() const { return static_cast<bool>(function_); }

  double operator()(double inertial_number) const {
    if (!function_)
      return constant_;
    const py::object mu =
        function_(inertial_number); // may throw: it arrives at the caller of step()
    if (const auto number = number_of(mu))
      return *number;
    throw py::type_error("friction(" + talus::text_of(inertial_number) + ") gave " + repr(mu) +
                         "; allowed: a number >= 0");
  }

 private:
  static std::string repr(const py::object& object) { return py::repr(object).cast<std::string>(); }

  double constant_ = talus::not_given;
  py::object function_;
};

/// The gate of a collapse, in terms of Python's keywords.
struct Gate {
  double position, bottom, friction, speed, time_constant;
};

/// The composition that is bound.
template <int Dim>
class Simulation {
 public:
  static constexpr int dimension = Dim;
  using Sim =
      talus::Simulation<Dim, talus::FrictionLaw<PythonLaw>, talus::PolyPic, talus::GaussSeidel<>>;
  using Numbers = std::array<double, static_cast<std::size_t>(Dim)>;
  using Box = std::pair<Numbers, Numbers>;

  struct Options {
    Numbers size{};
    std::array<int, static_cast<std::size_t>(Dim)> cells{};
    double density = 0;
    Numbers gravity{};
    double time_step = 0;
    py::object friction;
    std::vector<py::object> lower, upper;
    std::vector<Box> boxes;
    std::optional<Gate> gate;
    std::optional<talus::InertialNumber> inertial;
    int particles_per_edge = 3, threads = 1;
    double jitter = 0.5, cfl = 0;
    std::uint64_t seed = 1;
  };

  explicit Simulation(const Options& options)
      : has_inertial_number_(options.inertial.has_value()), sim_(make(options)) {}

  // ---- what changes it

  talus::StepReport step() {
    views_.require_none("step()");
    const Busy busy(*this);
    const talus::StepReport report = sim_.step();
    if (!report.completed())
      throw std::runtime_error("the step was refused, all is as before it: " +
                               std::string(report.why()));
    return report;
  }

  void set_gravity(const Numbers& gravity) {
    require_idle();
    sim_.set_gravity(vector(gravity));
  }

  // ---- arrays that look at its memory

  static py::array position(const py::object& self) {
    return of_particles(
        self, "position", [](const auto& p) -> auto& { return p.position; });
  }
  static py::array velocity(const py::object& self) {
    return of_particles(
        self, "velocity", [](const auto& p) -> auto& { return p.velocity; });
  }
  static py::array affine(const py::object& self) {
    return of_particles(
        self, "affine", [](const auto& p) -> auto& { return p.affine; });
  }
  static py::array volume(const py::object& self) {
    return of_particles(
        self, "volume", [](const auto& p) -> auto& { return p.volume; });
  }
  static py::array id(const py::object& self) {
    return of_particles(
        self, "id", [](const auto& p) -> auto& { return p.id; });
  }
  static py::array node_velocity(const py::object& self) {
    return of_nodes<Dim>(
        self, "node_velocity", [](const Sim& sim) -> auto& { return sim.problem().velocity; });
  }
  static py::array node_stress_impulse(const py::object& self) {
    return of_nodes<talus::symmetric_size<Dim>>(
        self, "node_stress_impulse",
        [](const Sim& sim) -> auto& { return sim.state().stress_impulse; });
  }

  // ---- arrays of their own: fields of the last step that are computed here

  py::array volume_fraction() const {
    return field([&](const Index<Dim>& n) { return sim().volume_fraction(n); });
  }
  py::array pressure() const {
    return field([&](const Index<Dim>& n) { return sim().pressure(n); });
  }
  py::array inertial_number() const {
    if (!has_inertial_number_)
      throw py::value_error(
          "inertial is not given; allowed: InertialNumber(grain_diameter, density, "
          "strain_factor), if inertial numbers are asked for");
    return field([&](const Index<Dim>& n) { return sim().inertial_number(n); });
  }
  py::array stress() const {
    return field([&](const Index<Dim>& n) { return sim().stress(n); });
  }
  py::array strain_rate() const {
    const talus::StrainRate<Dim> rate(sim());
    return field([&](const Index<Dim>& n) { return rate(n); });
  }

  /// The nodes' coordinates along each axis.
  py::tuple axes() const {
    const auto& grid = sim().grid();
    py::tuple axes(Dim);
    for (int a = 0; a < Dim; ++a) {
      py::array_t<double> x(grid.cells(a) + 1);
      for (int i = 0; i <= grid.cells(a); ++i)
        x.mutable_at(i) = grid.origin()[a] + grid.spacing()[a] * i;
      axes[static_cast<std::size_t>(a)] = x;
    }
    return axes;
  }

  py::dict profile(int row, double static_speed) const {
    const talus::Profile profile = talus::measure_profile(sim(), row, static_speed);
    py::dict columns;
    columns["x"] = copy(profile.x);
    columns["height"] = copy(profile.height);
    columns["static_height"] = copy(profile.static_height);
    return columns;
  }
  double front(double level, int row) const {
    return talus::front_position(talus::measure_profile(sim(), row), level);
  }
  double section_flux(int axis, double position) const {
    return talus::section_flux(sim(), axis, position);
  }

  /// For all that only looks. Throws RuntimeError within a step.
  const Sim& sim() const {
    require_idle();
    return sim_;
  }

 private:
  /// While it lives, a step is being made: the friction law may be calling back.
  class Busy {
   public:
    explicit Busy(Simulation& simulation) : simulation_(simulation) {
      simulation_.require_idle();
      simulation_.busy_ = true;
    }
    ~Busy() { simulation_.busy_ = false; }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;

   private:
    Simulation& simulation_;
  };

  void require_idle() const {
    if (busy_)
      throw std::runtime_error(
          "the simulation is in a step; allowed: to use it before or after it");
  }

  static Vec<Dim> vector(const Numbers& numbers) { return Vec<Dim>(numbers.data()); }

  /// no_slip, free_slip, open, periodic, or the friction coefficient of a frictional face.
  static talus::Face face(const std::string& name, const py::object& what) {
    using talus::FaceKind;
    if (const auto friction = number_of(what))
      return {FaceKind::frictional, *friction};
    const std::string kind = py::str(what);
    const std::pair<const char*, FaceKind> kinds[] = {{"no_slip", FaceKind::no_slip},
                                                      {"free_slip", FaceKind::free_slip},
                                                      {"open", FaceKind::open},
                                                      {"periodic", FaceKind::periodic}};
    for (const auto& [known, value] : kinds)
      if (kind == known)
        return {value};
    talus::throw_invalid(name, kind,
                         "no_slip, free_slip, open, periodic, or a friction coefficient");
  }
  static void set_faces(const std::string& name, const std::vector<py::object>& given,
                        talus::SmallArray<talus::Face, Dim>& faces) {
    if (given.size() != static_cast<std::size_t>(Dim))
      talus::throw_invalid("the number of faces in " + name, given.size(), std::to_string(Dim));
    for (int a = 0; a < Dim; ++a)
      faces[a] = face(name + "[" + std::to_string(a) + "]", given[static_cast<std::size_t>(a)]);
  }

  static Sim make(const Options& options) {
    typename Sim::Params params;
    params.grid.size = vector(options.size);
    std::copy(options.cells.begin(), options.cells.end(), params.grid.cells.values);
    params.material.density = options.density;
    params.gravity = vector(options.gravity);
    params.time_step = options.time_step;
    params.cfl = options.cfl;
    const talus::Grid<Dim> grid(params.grid);
    set_faces("lower", options.lower, params.faces.lower);
    set_faces("upper", options.upper, params.faces.upper);
    if (options.gate) {
      const double position = options.gate->position;
      if (!(position >= 0 && position <= options.size[0]))
        talus::throw_invalid("gate.position", position,
                             "in the box, 0 to " + talus::text_of(options.size[0]));
      params.obstacles.push_back(talus::make_obstacle<talus::Gate<Dim>>(
          {.position = position,
           .bottom = options.gate->bottom,
           .thickness = 0,
           .friction = options.gate->friction,
           .motion = {.opening_time = 0,
                      .terminal_speed = options.gate->speed,
                      .time_constant = options.gate->time_constant}}));
    }
    params.rheology.law = PythonLaw(options.friction);
    if (options.inertial)
      params.rheology.inertial = *options.inertial;
    else if (!params.rheology.law.calls_python()) // a constant does not depend on it
      params.rheology.inertial = {.grain_diameter = 1, .density = 1, .strain_factor = 1};
    params.threads = options.threads;
    if (params.rheology.law.calls_python() && options.threads != 1)
      talus::throw_invalid("threads", options.threads,
                           "1 with a friction law in Python, which runs in one thread at a time");
    talus::Particles<Dim> particles;
    talus::Seeding seeding{
        .per_axis = options.particles_per_edge, .jitter = options.jitter, .seed = options.seed};
    for (const Box& box : options.boxes) {
      talus::fill_box<Dim>(particles, grid, vector(box.first), vector(box.second), seeding);
      ++seeding.seed; // not the same numbers again
    }
    return Sim(std::move(params), std::move(particles));
  }

  /// What an array element holds besides itself: nothing, the entries of a vector, or of a matrix.
  template <class Number>
  requires std::is_arithmetic_v<Number>
  static void add_inner(const Number*, std::vector<py::ssize_t>&, std::vector<py::ssize_t>&) {}
  template <int Rows, int Columns>
  static void add_inner(const talus::RectMat<Rows, Columns>*, std::vector<py::ssize_t>& shape,
                        std::vector<py::ssize_t>& strides) {
    constexpr py::ssize_t number = sizeof(double);
    shape.push_back(Rows);
    strides.push_back(number);
    if (Columns > 1) { // stored by columns
      shape.push_back(Columns);
      strides.push_back(Rows * number);
    }
  }
  template <class Number>
  requires std::is_arithmetic_v<Number>
  static const Number* numbers(const Number* data) { return data; }
  template <int Rows, int Columns>
  static const double* numbers(const talus::RectMat<Rows, Columns>* data) {
    return reinterpret_cast<const double*>(data);
  }

  template <class Get>
  static py::array of_particles(const py::object& self, const char* name, const Get& get) {
    auto& simulation = self.cast<Simulation&>();
    const auto& values = get(simulation.sim().particles());
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(values.size())},
        strides{sizeof(values[0])};
    add_inner(values.data(), shape, strides);
    return simulation.views_.make(self, name, numbers(values.data()), std::move(shape),
                                  std::move(strides));
  }

  /// One entry a node of the box (the layer of nodes around it is left out), `count` numbers each.
  template <int count, class Get>
  static py::array of_nodes(const py::object& self, const char* name, const Get& get) {
    auto& simulation = self.cast<Simulation&>();
    const auto& grid = simulation.sim().grid();
    const auto& values = get(simulation.sim());
    std::vector<py::ssize_t> shape, strides;
    for (int a = 0; a < Dim; ++a) {
      shape.push_back(grid.cells(a) + 1);
      strides.push_back(static_cast<py::ssize_t>(sizeof(values[0])) * grid.node_stride(a));
    }
    shape.push_back(count); // of the numbers that a node's may be padded to
    strides.push_back(sizeof(double));
    return simulation.views_.make(self, name, numbers(&values[grid.node(Index<Dim>{})]),
                                  std::move(shape), std::move(strides));
  }

  /// value(node) at all nodes of the box: numbers, or d × d each.
  template <class Function>
  py::array field(const Function& value) const {
    using Value = std::decay_t<decltype(value(Index<Dim>{}))>;
    constexpr bool matrix = !std::is_arithmetic_v<Value>;
    const auto& grid = sim().grid();
    std::vector<py::ssize_t> shape;
    std::size_t nodes = 1;
    for (int a = 0; a < Dim; ++a) {
      shape.push_back(grid.cells(a) + 1);
      nodes *= static_cast<std::size_t>(grid.cells(a) + 1);
    }
    if (matrix)
      shape.insert(shape.end(), {Dim, Dim});
    py::array_t<double> array(shape);
    double* next = array.mutable_data();
    for (std::size_t k = 0; k < nodes; ++k) {
      Index<Dim> node;
      std::size_t rest = k;
      for (int a = Dim - 1; a >= 0; --a) { // the last axis fastest
        const auto n = static_cast<std::size_t>(grid.cells(a) + 1);
        node[a] = static_cast<int>(rest % n);
        rest /= n;
      }
      const Value here = value(node);
      if constexpr (matrix) {
        for (int r = 0; r < Dim; ++r)
          for (int c = 0; c < Dim; ++c)
            *next++ = here(r, c);
      } else {
        *next++ = here;
      }
    }
    return array;
  }

  static py::array copy(const std::vector<double>& values) {
    return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
  }

  bool has_inertial_number_, busy_ = false;
  Sim sim_;
  Views views_;
};

template <int Dim>
void bind(py::module_& m, const char* name, const std::string& about) {
  using S = Simulation<Dim>;
  using Numbers = typename S::Numbers;
  using Cells = decltype(S::Options::cells);
  using Faces = std::vector<py::object>;
  using namespace py::literals;
  py::class_<S>(m, name, about.c_str())
      .def(
          py::init([](const Numbers& size, const Cells& cells, double density,
                      const Numbers& gravity, double time_step, const py::object& friction,
                      const Faces& lower, const Faces& upper,
                      const std::vector<typename S::Box>& boxes, const std::optional<Gate>& gate,
                      const std::optional<talus::InertialNumber>& inertial, int particles_per_edge,
                      double jitter, std::uint64_t seed, double cfl, int threads) {
            return std::make_unique<S>(typename S::Options{.size = size,
                                                           .cells = cells,
                                                           .density = density,
                                                           .gravity = gravity,
                                                           .time_step = time_step,
                                                           .friction = friction,
                                                           .lower = lower,
                                                           .upper = upper,
                                                           .boxes = boxes,
                                                           .gate = gate,
                                                           .inertial = inertial,
                                                           .particles_per_edge = particles_per_edge,
                                                           .threads = threads,
                                                           .jitter = jitter,
                                                           .cfl = cfl,
                                                           .seed = seed});
          }),
          R"(A box of `size` (m) from the origin on, cut into `cells`, with sand of `density` (kg/m³, dense) in it.

gravity: m/s². time_step: s. friction: a number, or a function of the inertial number, which needs
inertial=InertialNumber(...) and threads=1. lower, upper: what the faces at the lower and upper end of each axis are:
"no_slip", "free_slip", "open", "periodic", or a number, the friction of the wall. boxes: [(lower, upper), ...] in m, what
is filled, with particles_per_edge particles along a cell's edge, jitter in [0, 1] and seed. gate: a Gate. cfl: largest
share of a cell to cross in a step, 0: time_step is fixed. threads: the result does not depend on it.

Raises ValueError, with the name, the value and what is allowed.)",
          py::kw_only(), "size"_a, "cells"_a, "density"_a, "gravity"_a, "time_step"_a, "friction"_a,
          "lower"_a, "upper"_a, "boxes"_a, "gate"_a = py::none(), "inertial"_a = py::none(),
          "particles_per_edge"_a = 3, "jitter"_a = 0.5, "seed"_a = 1, "cfl"_a = 0.0,
          "threads"_a = 1)
      .def("step", &S::step,
           R"(One time step; returns its StepReport.

Raises BufferError while an array looks at the simulation's memory, RuntimeError if the step was refused (numbers that are
not finite, a friction law that gives none), and whatever a friction law in Python raises. In all of these cases all is
as before, but for the order of the particles, and the run can go on.)")
      .def("set_gravity", &S::set_gravity, "gravity"_a, "From the next step on, m/s².")
      .def_property_readonly(
          "time", [](const S& s) { return s.sim().time(); }, "s")
      .def_property_readonly(
          "time_step", [](const S& s) { return s.sim().time_step(); }, "Of the last step, s.")
      .def_property_readonly(
          "steps", [](const S& s) { return s.sim().steps(); }, "Made so far.")
      .def_property_readonly("axes", &S::axes, "The nodes' coordinates along each axis, m.")
      .def_property_readonly("position", &S::position, "View, (particles, d), m.")
      .def_property_readonly("velocity", &S::velocity, "View, (particles, d), m/s.")
      .def_property_readonly(
          "affine", &S::affine,
          "View, (particles, d, d), 1/s: the velocity gradient at the particles.")
      .def_property_readonly("volume", &S::volume,
                             "View, (particles,), m^d: volume at the dense packing.")
      .def_property_readonly(
          "id", &S::id,
          "View, (particles,): the number that stays with a particle, whatever its place.")
      .def_property_readonly("node_velocity", &S::node_velocity,
                             "View, (nodes along x, ..., d), m/s, of the last step.")
      .def_property_readonly("node_stress_impulse", &S::node_stress_impulse,
                             "View, (nodes along x, ..., d(d+1)/2), Pa s: the stress times the "
                             "time step as talus keeps it, see "
                             "symmetric_to_vector. In Pa, and as a tensor: stress().")
      .def("volume_fraction", &S::volume_fraction,
           "New array, (nodes along x, ...), of the last step; 1 is dense.")
      .def("pressure", &S::pressure, "New array, (nodes along x, ...), Pa.")
      .def("stress", &S::stress,
           "New array, (nodes along x, ..., d, d), Pa, positive in compression.")
      .def("strain_rate", &S::strain_rate, "New array, (nodes along x, ..., d, d), 1/s.")
      .def("inertial_number", &S::inertial_number, "New array, (nodes along x, ...).")
      .def("profile", &S::profile, "row"_a = talus::middle_row, "static_speed"_a = 0.01,
           "{x, height, static_height}, m: the surface along row `row` of nodes across (-1: the "
           "middle), and the top of "
           "what is slower than static_speed (m/s).")
      .def("front", &S::front, "level"_a, "row"_a = talus::middle_row,
           "Where the surface falls to `level` (m above the floor), m.")
      .def("section_flux", &S::section_flux, "axis"_a, "position"_a,
           "Volume through the plane x_axis = position (m) in a unit of time, m^d/s.");
}

} // namespace python

PYBIND11_MODULE(my_talus, m) {
  using namespace py::literals;
  using python::Gate, talus::InertialNumber, talus::StepReport;
  m.doc() = "Granular flows by talus, in one composition: see docs/how-to/python.md.";
  py::class_<Gate>(m, "Gate", "A plate across the channel that rises from time 0 on.")
      .def(py::init([](double position, double bottom, double friction, double speed,
                       double time_constant) {
             return Gate{position, bottom, friction, speed, time_constant};
           }),
           py::kw_only(), "position"_a, "bottom"_a, "friction"_a, "speed"_a = 0.7,
           "time_constant"_a = 0.13,
           "position: x, m. bottom: of the closed gate, m. speed: it comes to, m/s. time_constant: "
           "s.");
  py::class_<InertialNumber>(m, "InertialNumber",
                             "The convention that a friction law was fitted with.")
      .def(py::init([](double grain_diameter, double density, double strain_factor) {
             return InertialNumber{grain_diameter, density, strain_factor};
           }),
           "grain_diameter"_a, "density"_a, "strain_factor"_a,
           "m; kg/m³; 1 for half of the shear rate (Rousseau et al. 2023), 2 for the shear rate.");
  py::class_<StepReport>(m, "StepReport", "What a step did.")
      .def_property_readonly("sweeps", [](const StepReport& r) { return r.solve.iterations; })
      .def_property_readonly("residual", [](const StepReport& r) { return r.solve.residual.l2; })
      .def_property_readonly(
          "converged",
          [](const StepReport& r) { return r.solve.status == talus::SolveStatus::converged; },
          "False: the step was taken, with stresses that are wrong by about the residual.")
      .def_readonly("outflow", &StepReport::outflow, "Particles that left through open faces.")
      .def_readonly("courant", &StepReport::courant, "Cells that the fastest node crossed.");
  python::bind<2>(m, "Simulation2", "A granular flow in 2-D, x and up.");
  python::bind<3>(m, "Simulation3", "A granular flow in 3-D: x, across, up.");
}
