// SPDX-License-Identifier: MIT
// Several materials: what nodes make of them, and what is refused.

#include "talus/diagnostics/checksum.hpp"
#include "talus/diagnostics/profile.hpp"
#include "talus/diagnostics/totals.hpp"
#include "talus/io/checkpoint.hpp"
#include "talus/rheology/local_friction.hpp"
#include "talus/rheology/materials.hpp"
#include "talus/scene/source.hpp"

#include "../support/about.hpp"
#include "../support/files.hpp"
#include "../support/materials.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace test_materials {

using namespace talus;
using scenes::Mixed, scenes::mixed_collapse, scenes::two_columns, support::about, support::contains,
    support::Folder, support::message_of;

static_assert(Rheology<Materials<ConstantFriction>> && OfMaterials<Materials<MuOfI>> &&
              !OfMaterials<MuOfI>);
static_assert(OfMaterials<WithViscosity<Materials<ConstantFriction>>> &&
              Viscous<WithViscosity<Materials<ConstantFriction>>>);
static_assert(has_cohesion<Materials<WithCohesion<MuOfI>>>() && !has_cohesion<Materials<MuOfI>>() &&
              has_cohesion<WithViscosity<Materials<WithCohesion<MuOfI>>>>());

namespace {

using OfThePlace = LocalFriction<decltype([](const auto& at) { return 0.2 + at.position[0]; })>;
static_assert(Rheology<OfThePlace> && SeesFlow<OfThePlace, 2> && SeesFlow<OfThePlace, 3>);
static_assert(Rheology<WithCohesion<OfThePlace>> && Rheology<Materials<OfThePlace>>);

/// Particles of three materials at random places and speeds in a box, loose enough to carry no
/// stress.
template <int Dim>
Particles<Dim> loose(const GridParams<Dim>& grid, int materials) {
  Random random(7);
  Particles<Dim> particles;
  for (int p = 0; p < 40; ++p) {
    Vec<Dim> x, v;
    for (int a = 0; a < Dim; ++a) {
      x[a] = grid.size[a] * random.uniform();
      v[a] = random.uniform() - 0.5;
    }
    particles.add(x, v, (1 + random.uniform()) * 1e-3 * grid.size.prod() / 40, p % materials);
  }
  return particles;
}

/// N_j(x_p) of a node.
template <int Dim>
double shape(const Grid<Dim>& grid, const Index<Dim>& node, const Vec<Dim>& x) {
  double weight = 1;
  for (int a = 0; a < Dim; ++a)
    weight *= std::max(0.0, 1 - std::abs(x[a] - grid.node_position(node)[a]) / grid.spacing()[a]);
  return weight;
}

template <int Dim>
void check_nodes() {
  using S = Mixed<Dim, ConstantFriction, Pic>;
  auto params = scenes::box_for<S>({0.3, 0.3, 0.3}, {3, 3, 3}, 0);
  params.faces = Faces<Dim>::all({FaceKind::open});
  params.gravity.setZero();
  const std::array<double, 3> density{1500, 900, 7000}, mu{0.2, 0.5, 0.9};
  for (std::size_t m = 0; m < 3; ++m)
    params.rheology.list.push_back({.density = density[m], .law = {.mu = mu[m]}});
  const auto particles = loose<Dim>(params.grid, 3);
  S sim(params, particles);
  REQUIRE(sim.step().completed());
  CHECK(sim.problem().cones() > 0);
  const auto& problem = sim.problem();
  std::size_t seen = 0;
  for (std::size_t i = 0; i < problem.cones(); ++i) {
    const int j = problem.node[i];
    const Index<Dim> node = sim.grid().node_index(j);
    double volume[3] = {0, 0, 0}, mass = 0, friction = 0;
    Vec<Dim> momentum = Vec<Dim>::Zero();
    for (std::size_t p = 0; p < particles.size(); ++p) {
      const auto m = static_cast<std::size_t>(particles.material[p]);
      const double share = particles.volume[p] * shape(sim.grid(), node, particles.position[p]);
      volume[m] += share;
      mass += density[m] * share;
      friction += mu[m] * share;
      momentum += density[m] * share * particles.velocity[p];
    }
    const double all = volume[0] + volume[1] + volume[2];
    CHECK(1 / problem.inverse_mass[j][0] == about(mass));
    CHECK(problem.opening[i] == about(cone_friction<Dim>(friction / all)));
    CHECK((sim.velocity(node) - momentum / mass).norm() < 1e-13);
    for (int m = 0; m < 3; ++m)
      CHECK(std::abs(sim.material_fraction(node, m) - volume[m] / all) < 1e-13);
    seen += volume[0] > 0 && volume[1] > 0 && volume[2] > 0 ? 1U : 0U;
  }
  CHECK(seen > 4);
}

template <int Dim>
void same_bits() {
  auto params = mixed_collapse<Dim>();
  using S = Mixed<Dim, WithCohesion<MuOfI>>;
  const auto particles = two_columns<Dim>(params.grid);
  const Folder folder;
  S sim(params, particles);
  const auto advance = [](S& s) {
    for (int n = 0; n < 30; ++n)
      REQUIRE(s.step().completed());
    return state_checksum(s.particles());
  };
  const double light = total_volume(particles, 0), heavy = total_volume(particles, 1);
  CHECK(light == about(total_volume(particles) / 2));
  advance(sim);
  write_checkpoint(folder / "a.talus", sim);
  const std::string expected = advance(sim);
  CHECK(total_volume(sim.particles(), 0) == light); // to the last bit
  CHECK(total_volume(sim.particles(), 1) > heavy);
  for (std::size_t p = 0; p < sim.particles().size(); ++p) {
    const std::size_t id = sim.particles().id[p];
    CHECK(sim.particles().material[p] == (id < particles.size() ? particles.material[id] : 1));
  }
  params.threads = 3;
  S threads(params, particles), restarted(params, particles);
  advance(threads);
  CHECK(advance(threads) == expected);
  read_checkpoint(folder / "a.talus", restarted);
  CHECK(advance(restarted) == expected);

  params.rheology.list[1].density = 2400;
  S other(params, particles);
  CHECK(
      contains(message_of<std::runtime_error>([&] { read_checkpoint(folder / "a.talus", other); }),
               "its material.density is 900 2500, this simulation's is 900 2400"));
}

} // namespace

TEST_CASE("materials: masses and momenta of nodes add up, friction is a mean over volumes") {
  check_nodes<2>();
  check_nodes<3>();
}

TEST_CASE("materials: friction and cohesion of a node by hand") {
  const InertialNumber fine{.grain_diameter = 1e-3, .density = 2500, .strain_factor = 2};
  const InertialNumber coarse{.grain_diameter = 1e-2, .density = 2500, .strain_factor = 2};
  const auto law = [&](double mu, const InertialNumber& inertial, double cohesion) {
    return WithCohesion<MuOfI>::Params{.law = {.mu_static = mu, .mu_limit = 1, .I_0 = 0.3},
                                       .inertial = inertial,
                                       .cohesion = cohesion};
  };
  const Materials<WithCohesion<MuOfI>> two(
      {.list = {{.density = 1000, .law = law(0.2, fine, 0)},
                {.density = 2000, .law = law(0.5, coarse, 100)}}});
  const double volumes[] = {3, 1};
  FlowState<2> flow;
  flow.strain_rate = 2;
  flow.pressure = 1000;
  const double I_fine = fine(2, 1000), I_coarse = coarse(2, 1000 + 100 / 0.5);
  const auto found = flow_friction(two, flow, true, volumes);
  CHECK(found.inertial_number == about((3 * I_fine + I_coarse) / 4));
  CHECK(found.friction ==
        about((3 * two.law(0).friction(I_fine) + two.law(1).friction(I_coarse)) / 4));
  CHECK(flow_friction(two, flow, false, volumes).inertial_number ==
        about((3 * I_fine + coarse(2, 1000)) / 4));
  DualProblem<2> problem;
  problem.node = {1};
  problem.opening = {0.5};
  problem.free_volume_rate = {0};
  problem.stress_impulse = {Vec<3>::Zero()};
  const double by_node[] = {7, 7, 3, 1}; // of nodes 0 and 1
  CHECK(cone_cohesion(two, problem, 0, by_node) == about(25));
  add_cohesion_shift(two, problem, 0.5, by_node);
  CHECK(problem.stress_impulse[0][0] == about(0.5 * 25 / 0.5));
  problem.free_volume_rate = {1e-9};
  CHECK(cone_cohesion(two, problem, 0, by_node) == 0);
  CHECK(node_cohesion(two, volumes) == about(25));
  CHECK(node_cohesion(two, by_node) == about(50));
  const double fine_alone[] = {2, 0};
  CHECK(node_cohesion(two, fine_alone) == 0);
  // what a node has none of does not count, not even infinity
  const double one[] = {0, 2};
  flow.pressure = -100;
  CHECK(std::isinf(flow_friction(two, flow, true, volumes).inertial_number));
  CHECK(flow_friction(two, flow, true, one).inertial_number == about(coarse(2, 100)));
}

TEST_CASE("materials: several that are the same are as one") {
  using One = scenes::Sim<2>;
  using Two = Mixed<2>;
  auto params = scenes::box<2>({0.3, 0, 0.2}, {15, 0, 10}, 0, 0.44);
  params.solver.tolerance = 1e-12;
  auto sand = scenes::block<2>(params.grid, 0, 0.1, 0, 0.12, 0.5);
  One one(params, sand);
  auto mixed = scenes::box_for<Two>({0.3, 0, 0.2}, {15, 0, 10}, 0);
  mixed.solver.tolerance = 1e-12;
  mixed.rheology.list.assign(2, {.density = 1500, .law = {.mu = 0.44}});
  sand.resize_material(sand.size());
  for (std::size_t p = 0; p < sand.size(); p += 3)
    sand.material[p] = 1;
  Two two(mixed, sand);
  for (int n = 0; n < 20; ++n) {
    REQUIRE(one.step().completed());
    REQUIRE(two.step().completed());
  }
  double largest = 0;
  std::vector<Vec<2>> by_id(sand.size());
  for (std::size_t p = 0; p < sand.size(); ++p)
    by_id[one.particles().id[p]] = one.particles().velocity[p];
  for (std::size_t p = 0; p < sand.size(); ++p)
    largest =
        std::max(largest, (two.particles().velocity[p] - by_id[two.particles().id[p]]).norm());
  CHECK(largest < 1e-8);
  CHECK(largest_speed(one) > 0.1);
  CHECK(two.face_wrench(1, false).force[1] == about(one.face_wrench(1, false).force[1], 1e-6));
}

TEST_CASE("materials: energies weigh each particle by its own density") {
  using Two = Mixed<2>;
  auto params = scenes::box_for<Two>({0.3, 0, 0.2}, {15, 0, 10}, 0);
  params.gravity = {0.5, -9.81};
  params.rheology.list = {{.density = 1000, .law = {.mu = 0.4}},
                          {.density = 2500, .law = {.mu = 0.4}}};
  Particles<2> sand;
  sand.add({0.1, 0.05}, {3, 4}, 2e-5);
  sand.add({0.2, 0.15}, {0, -2}, 1e-5, 1);
  const Two two(params, sand);
  CHECK(kinetic_energy(two) == about(1000 * 2e-5 * 25 / 2 + 2500 * 1e-5 * 4 / 2));
  CHECK(potential_energy(two) ==
        about(1000 * 2e-5 * (9.81 * 0.05 - 0.5 * 0.1) + 2500 * 1e-5 * (9.81 * 0.15 - 0.5 * 0.2)));
  auto plain = scenes::box<2>({0.3, 0, 0.2}, {15, 0, 10}, 0, 0.44);
  sand.material.clear(); // of one material
  const scenes::Sim<2> one(plain, sand);
  CHECK(kinetic_energy(one) == about(kinetic_energy(sand, plain.material.density)));
}

TEST_CASE("materials: the same bits for any number of threads, and from a checkpoint on") {
  same_bits<2>();
  same_bits<3>();
}

TEST_CASE_TEMPLATE("materials: momentum is kept where they meet", Transfer, Pic, Apic, PolyPic) {
  using S = Mixed<2, ConstantFriction, Transfer>;
  auto params = scenes::box_for<S>({0.4, 0, 0.4}, {10, 0, 10}, 0);
  params.faces = Faces<2>::all({FaceKind::open});
  params.gravity.setZero();
  params.rheology.list = {{.density = 100, .law = {.mu = 0.3}},
                          {.density = 10000, .law = {.mu = 0.5}}};
  Particles<2> particles;
  const Grid<2> grid(params.grid);
  fill_box<2>(particles, grid, {0.1, 0.1}, {0.2, 0.2}, {.per_axis = 2, .material = 0});
  fill_box<2>(particles, grid, {0.2, 0.1}, {0.3, 0.2}, {.per_axis = 2, .material = 1});
  for (std::size_t p = 0; p < particles.size(); ++p)
    particles.velocity[p] = particles.material[p] == 0 ? Vec<2>(0.5, 0) : Vec<2>(-0.2, 0.1);
  S sim(params, particles);
  const auto momentum = [&] {
    Vec<2> sum = Vec<2>::Zero();
    const auto& of = sim.particles();
    for (std::size_t p = 0; p < of.size(); ++p)
      sum += sim.density(of.material[p]) * of.volume[p] * of.velocity[p];
    return sum;
  };
  const Vec<2> before = momentum();
  for (int n = 0; n < 40; ++n)
    REQUIRE(sim.step().completed());
  CHECK((momentum() - before).norm() < 1e-12 * before.norm());
  // the light block cannot push the heavy one: it is thrown back
  double light = 0, count = 0;
  for (std::size_t p = 0; p < sim.particles().size(); ++p)
    if (sim.particles().material[p] == 0) {
      light += sim.particles().velocity[p][0];
      ++count;
    }
  CHECK(light / count < 0.1);
}

TEST_CASE("a law that sees the flow: place, strain rate, pressure and volume fraction") {
  double pressure = -1, fraction = -1, strain_rate = -1;
  const std::function<double(const FlowState<2>&)> law = [&](const FlowState<2>& at) {
    if ((at.position - Vec<2>(0.04, 0.04)).norm() < 1e-9) {
      pressure = at.pressure;
      fraction = at.volume_fraction;
      strain_rate = at.strain_rate;
    }
    return 0.2 + at.position[0];
  };
  using S = Simulation<2, LocalFriction<std::function<double(const FlowState<2>&)>>, PolyPic,
                       GaussSeidel<>>;
  auto params = scenes::box_for<S>({0.1, 0, 0.1}, {5, 0, 5}, 0);
  params.material.density = 1500;
  params.rheology.law = law;
  const Grid<2> grid(params.grid);
  auto particles = scenes::block<2>(params.grid, 0, 0.1, 0, 0.08);
  for (std::size_t p = 0; p < particles.size(); ++p) {
    particles.velocity[p] = {0.5 * particles.position[p][1], 0};
    particles.affine[p](0, 1) = 0.5;
  }
  S sim(params, particles);
  REQUIRE(sim.step().completed());
  CHECK(pressure == 0); // there was no step before
  CHECK(fraction == about(1));
  CHECK(strain_rate == about(0.25)); // half of the shear rate
  for (std::size_t i = 0; i < sim.problem().cones(); ++i) {
    const double x = grid.node_position(sim.grid().node_index(sim.problem().node[i]))[0];
    CHECK(sim.problem().opening[i] == about(cone_friction<2>(0.2 + x)));
  }
  // the mean over the node and its neighbours, of the last stress in the volumes of this step
  const auto share = [&](const Index<2>& n) {
    return std::min(1.0, sim.stress_volume(n) / grid.node_volume(n));
  };
  std::vector<double> last;
  for (int k = 0; k < 9; ++k)
    last.push_back(sim.pressure({1 + k % 3, 1 + k / 3}) / share({1 + k % 3, 1 + k / 3}));
  REQUIRE(sim.step().completed());
  double sum = 0, volume = 0;
  for (int k = 0; k < 9; ++k) {
    const Index<2> n{1 + k % 3, 1 + k / 3};
    const double part = (n[0] == 2 ? 2 : 1) * (n[1] == 2 ? 2 : 1) * sim.stress_volume(n);
    sum += part * share(n) * last[static_cast<std::size_t>(k)];
    volume += part;
  }
  CHECK(pressure == about(sum / volume));
}

TEST_CASE("a law that gives no friction is refused by the step, of one material and of several") {
  using F = std::function<double(const FlowState<2>&)>;
  const F law = [](const FlowState<2>& at) { return at.position[0] < 0.05 ? 0.3 : -0.1; };
  const auto check = [](auto sim) {
    const StepReport report = sim.step();
    CHECK(!report.completed());
    CHECK(report.invalid_friction > 0);
    CHECK(contains(std::string(report.why()), "no finite number >= 0"));
  };
  using One = Simulation<2, LocalFriction<F>, PolyPic, GaussSeidel<>>;
  auto one = scenes::box_for<One>({0.1, 0, 0.1}, {5, 0, 5}, 0);
  one.material.density = 1500;
  one.rheology.law = law;
  auto sand = scenes::block<2>(one.grid, 0, 0.1, 0, 0.08);
  check(One(one, sand));
  // others' friction does not hide it
  using Two = Mixed<2, LocalFriction<F>>;
  auto two = scenes::box_for<Two>({0.1, 0, 0.1}, {5, 0, 5}, 0);
  two.rheology.list = {{.density = 1500, .law = {.law = law}},
                       {.density = 1500, .law = {.law = [](const FlowState<2>&) { return 0.9; }}}};
  sand.resize_material(sand.size());
  for (std::size_t p = 0; p < sand.size(); p += 2)
    sand.material[p] = 1;
  check(Two(two, sand));
}

TEST_CASE("a law that sees the flow has cohesion as any other, of one material and of several") {
  using F = std::function<double(const FlowState<2>&)>;
  using Plain = WithCohesion<ConstantFriction>;
  using Seeing = WithCohesion<LocalFriction<F>>;
  const auto run = []<class Law>(const typename Law::Params& rheology, double density) {
    using S = Simulation<2, Law, PolyPic, GaussSeidel<>>;
    auto params = scenes::box_for<S>({0.2, 0, 0.1}, {20, 0, 10}, 0);
    params.material.density = density;
    params.rheology = rheology;
    S sim(params, scenes::block<2>(params.grid, 0, 0.08, 0, 0.08));
    StepReport report;
    for (int n = 0; n < 20; ++n)
      report = sim.step();
    return std::pair(report, state_checksum(sim.particles()));
  };
  const auto plain = [&](double cohesion) {
    return run.operator()<Plain>({.law = {.mu = 0.4}, .cohesion = cohesion}, 1500);
  };
  const auto one = [&](const F& law) {
    return run.operator()<Seeing>({.law = {.law = law}, .cohesion = 100}, 1500);
  };
  const auto several = [&](const F& law) {
    return run.operator()<Materials<Seeing>>(
        {.list = {{.density = 1500, .law = {.law = {.law = law}, .cohesion = 100}}}}, 0);
  };
  const F constant = [](const FlowState<2>&) { return 0.4; };
  const auto expected = plain(100);
  CHECK(expected.first.completed());
  CHECK(plain(0).second != expected.second);
  CHECK(one(constant).second == expected.second);
  CHECK(several(constant).second ==
        run.operator()<Materials<Plain>>(
               {.list = {{.density = 1500, .law = {.law = {.mu = 0.4}, .cohesion = 100}}}}, 0)
            .second);
  // no friction, no apex: the step tells, since only it asks the law
  const F none = [](const FlowState<2>& at) { return at.position[0] < 0.04 ? 0.4 : 0; };
  for (const StepReport& refused : {one(none).first, several(none).first}) {
    CHECK(!refused.completed());
    CHECK(refused.invalid_friction > 0);
    CHECK(contains(std::string(refused.why()), "> 0 where there is cohesion"));
  }
}

TEST_CASE("wrong materials are refused, by name and value") {
  using S = Mixed<2>;
  const auto good = [] {
    auto params = scenes::box_for<S>({0.1, 0, 0.1}, {5, 0, 5}, 0);
    params.rheology.list = {{.density = 1000, .law = {.mu = 0.4}},
                            {.density = 2000, .law = {.mu = 0.4}}};
    return params;
  };
  auto sand = scenes::block<2>(good().grid, 0, 0.1, 0, 0.05);
  const auto message = [&](const S::Params& params) {
    return message_of<std::invalid_argument>([&] { S(params, sand); });
  };
  auto wrong = good();
  wrong.rheology.list.clear();
  CHECK(message(wrong) == "rheology.list: the number of materials is 0; allowed: at least 1");
  wrong = good();
  wrong.rheology.list[1].density = -1;
  CHECK(message(wrong) == "rheology.list[1].density is -1; allowed: a finite number > 0");
  wrong.rheology.list[1] = {.density = 1000};
  CHECK(contains(message(wrong), "rheology.list[1].law: rheology.mu is nan, not given"));
  wrong = good();
  wrong.material.density = 1500;
  CHECK(contains(message(wrong), "material.density is 1500; allowed: nothing"));

  sand.resize_material(sand.size());
  sand.material[3] = 2;
  CHECK(message(good()) == "a particle's material is 2; allowed: 0 to 1: indices into the list of "
                           "2 materials");
  sand.material[3] = -1;
  CHECK(contains(message(good()), "a particle's material is -1"));
  sand.material.pop_back();
  sand.material[3] = 0;
  CHECK(contains(message(good()), "the number of the particles' materials is"));
  sand.material.assign(sand.size(), 1);
  S sim(good(), sand);
  REQUIRE(sim.step().completed());
  const auto before = state_checksum(sim.particles());
  Particles<2> more;
  more.add({0.05, 0.09}, {0, 0}, 1e-6, 2);
  CHECK(contains(message_of<std::invalid_argument>([&] { sim.add(more); }),
                 "a particle's material is 2"));
  auto state = sim.state();
  state.particles.material[0] = 2;
  CHECK(contains(message_of<std::invalid_argument>([&] { sim.restore(state); }),
                 "a particle's material is 2"));
  CHECK(state_checksum(sim.particles()) == before);

  // one material has no index but 0
  using One = scenes::Sim<2>;
  const auto one = scenes::box<2>({0.1, 0, 0.1}, {5, 0, 5}, 0, 0.44);
  CHECK(contains(message_of<std::invalid_argument>([&] { One(one, sand); }),
                 "a particle's material is 1; allowed: 0 to 0: indices into the list of one "
                 "material (several: see Materials)"));
  CHECK(contains(message_of<std::invalid_argument>([&] {
                   Particles<2> none;
                   fill_box<2>(none, Grid<2>(one.grid), {0, 0}, {0.1, 0.1}, {.material = -1});
                 }),
                 "seeding.material is -1; allowed: an index, >= 0"));
  auto pours = one;
  pours.exchange = together<2>({make_source<2>(
      Grid<2>(one.grid),
      {.lower = {0, 0}, .upper = {0.1, 0.1}, .flux = 1e-3, .seeding = {.material = 1}})});
  CHECK(contains(message_of<std::invalid_argument>([&] { One(pours, Particles<2>()); }),
                 "the material of a source is 1; allowed: 0 to 0"));
  using F = LocalFriction<std::function<double(const FlowState<2>&)>>;
  CHECK(message_of<std::invalid_argument>([] { F(F::Params{}); }) ==
        "rheology.law is not given; allowed: a function of a FlowState");
}

} // namespace test_materials
