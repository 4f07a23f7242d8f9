// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/scene/fill.hpp"
#include "talus/simulation.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <stdexcept>
#include <vector>

/// Flows with a known answer that need no collapse: what the transfer and the room at free surfaces
/// cost in accuracy. 2-D; tests assert orders, bench/accuracy prints tables.
namespace accuracy {

using namespace talus;

template <class Transfer>
using Sim = Simulation<2, ConstantFriction, Transfer, GaussSeidel<>>;

/// Resolution and policies of one run.
template <class Transfer>
struct Setting {
  double cell = 0.01;      ///< h, m
  double time_step = 1e-3; ///< δt, s
  typename Transfer::Params transfer{};
  Packing packing{};
  double jitter = 0;
  int per_axis = 3;
};

/// A box of square cells that slips along its faces.
template <class Transfer>
typename Sim<Transfer>::Params box(const Setting<Transfer>& setting, double length, double height,
                                   double friction) {
  typename Sim<Transfer>::Params params;
  const auto cells = [&](double size) {
    return static_cast<int>(std::lround(size / setting.cell));
  };
  params.grid = {
      .origin = {0, 0}, .size = {length, height}, .cells = {cells(length), cells(height)}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = setting.time_step;
  params.transfer = setting.transfer;
  params.packing = setting.packing;
  params.rheology.mu = friction;
  params.solver.tolerance = 1e-5;
  params.solver.max_sweeps = 20000;
  for (std::size_t a = 0; a < 2; ++a)
    params.faces.lower[a].kind = params.faces.upper[a].kind = FaceKind::free_slip;
  return params;
}

/// Fills part of the box.
template <class Transfer>
void fill(Particles<2>& particles, const typename Sim<Transfer>::Params& params,
          const Setting<Transfer>& setting, const Vec<2>& lower, const Vec<2>& upper) {
  fill_box(particles, Grid<2>(params.grid), lower, upper,
           {.per_axis = setting.per_axis, .jitter = setting.jitter});
}

/// Advances to `time` (s). Throws std::runtime_error if a step is refused.
template <class S>
void advance(S& sim, double time) {
  while (sim.time() < time - sim.params().time_step / 2)
    if (!sim.step().completed())
      throw std::runtime_error("accuracy: numbers are not finite");
}

/// Σ V_p |v_p|², m⁴/s².
inline double energy(const Particles<2>& particles) {
  double sum = 0;
  for (std::size_t p = 0; p < particles.size(); ++p)
    sum += particles.volume[p] * particles.velocity[p].squaredNorm();
  return sum;
}

/// Sets the velocity field u(x) with its gradient, by differences.
template <class Field>
void set_velocity(Particles<2>& particles, const Field& u) {
  constexpr double step = 1e-6;
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const Vec<2> x = particles.position[p];
    particles.velocity[p] = u(x);
    for (int a = 0; a < 2; ++a) {
      const Vec<2> d = step * Vec<2>::Unit(a);
      particles.affine[p].col(a) = (u(x + d) - u(x - d)) / (2 * step);
    }
  }
}

/// A steady vortex of a frictionless fluid that fills a closed box of 0.2 m, `waves` half waves
/// along an edge: the rate at which it loses energy, 1/s (exact: 0).
template <class Transfer>
double vortex_loss(const Setting<Transfer>& setting, int waves = 2, double seconds = 0.1) {
  constexpr double size = 0.2, speed = 0.2;
  auto params = box(setting, size, size, 0);
  params.gravity *= 1e-4;
  if constexpr (requires { params.transfer.damping; })
    params.transfer.damping *= 100; // as with all of gravity
  params.packing.dilatancy = 0;     // it is denser than dense, so that nothing settles
  Particles<2> fluid;
  fill(fluid, params, setting, {0, 0}, {size, size});
  for (double& volume : fluid.volume)
    volume *= 1.1;
  const double k = waves * std::numbers::pi / size;
  set_velocity(fluid, [&](const Vec<2>& x) {
    return Vec<2>(speed * std::sin(k * x[0]) * std::cos(k * x[1]),
                  -speed * std::cos(k * x[0]) * std::sin(k * x[1]));
  });
  Sim<Transfer> sim(params, fluid);
  advance(sim, 0.02); // the first steps put the field on the grid
  const double first = energy(sim.particles());
  advance(sim, 0.02 + seconds);
  return -std::log(energy(sim.particles()) / first) / seconds;
}

/// What a disc of 0.1 m loses that turns at 2 rad/s and, with nothing that holds it, flies apart in
/// straight lines: relative changes of its energy and of its angular momentum (exact: 0).
struct Rotation {
  double energy = 0, angular_momentum = 0;
};
template <class Transfer>
Rotation disc_turns(const Setting<Transfer>& setting, double seconds = 0.2) {
  constexpr double radius = 0.1, rate = 2; // m, rad/s
  auto params = box(setting, 4 * radius, 4 * radius, 0.44);
  params.gravity *= 1e-4;
  if constexpr (requires { params.transfer.damping; })
    params.transfer.damping *= 100; // as with all of gravity
  const Vec<2> middle(2 * radius, 2 * radius);
  Particles<2> disc;
  talus::fill(disc, Grid<2>(params.grid),
              [&](const Vec<2>& x) { return (x - middle).norm() < radius; },
              {.per_axis = setting.per_axis, .jitter = setting.jitter});
  set_velocity(disc, [&](const Vec<2>& x) {
    return Vec<2>(-rate * (x[1] - middle[1]), rate * (x[0] - middle[0]));
  });
  Sim<Transfer> sim(params, disc);
  const auto measured = [&] { // around the centre of mass
    const auto& particles = sim.particles();
    double volume = 0, angular = 0;
    Vec<2> centre = Vec<2>::Zero(), velocity = Vec<2>::Zero();
    for (std::size_t p = 0; p < particles.size(); ++p) {
      volume += particles.volume[p];
      centre += particles.volume[p] * particles.position[p];
      velocity += particles.volume[p] * particles.velocity[p];
    }
    for (std::size_t p = 0; p < particles.size(); ++p) {
      const Vec<2> r = particles.position[p] - centre / volume,
                   v = particles.velocity[p] - velocity / volume;
      angular += particles.volume[p] * (r[0] * v[1] - r[1] * v[0]);
    }
    return Rotation{energy(particles), angular};
  };
  const Rotation first = measured();
  advance(sim, seconds);
  const Rotation last = measured();
  return {last.energy / first.energy - 1, last.angular_momentum / first.angular_momentum - 1};
}

/// A layer `layer` (m) thick slides over a bed of its own kind, 0.05 m deep and inclined by 15°:
/// its acceleration, m/s² (exact: g (sin θ − μ cos θ) = −1.630).
template <class Transfer>
double sliding_layer(const Setting<Transfer>& setting, double layer, double seconds = 0.1) {
  constexpr double length = 0.8, bed = 0.05, speed = 0.5, friction = 0.44;
  constexpr double angle = 15 * std::numbers::pi / 180;
  auto params = box(setting, length, 0.16, friction);
  params.gravity = {9.81 * std::sin(angle), -9.81 * std::cos(angle)};
  params.faces.lower[1].kind = FaceKind::no_slip;
  params.faces.upper[1].kind = FaceKind::open;
  Particles<2> sand;
  fill(sand, params, setting, {0, 0}, {length, bed});
  const std::size_t at_rest = sand.size();
  fill(sand, params, setting, {0.1, bed}, {0.6, bed + layer});
  std::vector<char> middle(sand.size(), 0); // by id: far from the ends of the layer
  for (std::size_t p = at_rest; p < sand.size(); ++p) {
    sand.velocity[p][0] = speed;
    middle[sand.id[p]] = std::abs(sand.position[p][0] - 0.35) < 0.1;
  }
  Sim<Transfer> sim(params, sand);
  const auto mean = [&] {
    double momentum = 0, volume = 0;
    for (std::size_t p = 0; p < sim.particles().size(); ++p)
      if (middle[sim.particles().id[p]]) {
        momentum += sim.particles().volume[p] * sim.particles().velocity[p][0];
        volume += sim.particles().volume[p];
      }
    return momentum / volume;
  };
  const double settle = 0.03; // s: the jump of the velocity becomes the grid's
  advance(sim, settle);
  const double first = mean(), start = sim.time();
  advance(sim, settle + seconds);
  return (mean() - first) / (sim.time() - start);
}

/// What a block does that falls on a bed in a shaft as wide as it.
struct Landing {
  double gap = 0;     ///< of the mean height above that of dense material, m (exact: 0)
  double rebound = 0; ///< fastest upward mean velocity after the impact over that before it
  double rest = 0;    ///< time from the impact to the last speed above 1 mm/s, s
  double noise = 0;   ///< largest speed at the end, m/s
};

/// A block 0.06 m high falls by `fall` (m) on a bed of 0.04 m in a shaft that slips.
template <class Transfer>
Landing block_lands(const Setting<Transfer>& setting, double fall = 0.05, double seconds = 0.5) {
  constexpr double width = 0.1, bed = 0.04, block = 0.06;
  auto params = box(setting, width, 0.2, 0.44);
  params.faces.lower[1].kind = FaceKind::no_slip;
  params.faces.upper[1].kind = FaceKind::open;
  Particles<2> sand;
  fill(sand, params, setting, {0, 0}, {width, bed});
  const std::size_t at_rest = sand.size();
  fill(sand, params, setting, {0, bed + fall}, {width, bed + fall + block});
  std::vector<char> falls(sand.size(), 0);
  double volume = 0;
  for (std::size_t p = at_rest; p < sand.size(); ++p)
    falls[sand.id[p]] = 1;
  for (const double v : sand.volume)
    volume += v;
  Sim<Transfer> sim(params, sand);
  const double impact = std::sqrt(2 * fall / 9.81), speed = 9.81 * impact;
  Landing landing;
  while (sim.time() < impact + seconds) {
    if (!sim.step().completed())
      throw std::runtime_error("accuracy: numbers are not finite");
    if (sim.time() < impact)
      continue;
    double momentum = 0, mass = 0, fastest = 0;
    for (std::size_t p = 0; p < sim.particles().size(); ++p) {
      fastest = std::max(fastest, sim.particles().velocity[p].norm());
      if (falls[sim.particles().id[p]]) {
        momentum += sim.particles().velocity[p][1];
        mass += 1;
      }
    }
    landing.rebound = std::max(landing.rebound, momentum / mass / speed);
    if (fastest > 1e-3)
      landing.rest = sim.time() - impact;
    landing.noise = fastest;
  }
  double height = 0; // twice that of the centre of mass: the height of a dense layer
  for (std::size_t p = 0; p < sim.particles().size(); ++p)
    height += 2 * sim.particles().volume[p] * sim.particles().position[p][1] / volume;
  landing.gap = height - volume / width;
  return landing;
}

/// In a shaft without ends a slab hits a column while both fall freely, under `gravity` (m/s²): how
/// far the velocities are from the common one in the end, root mean square over the slab's first
/// speed (exact: 0), and the change of momentum against that of free fall.
struct Collision {
  double spread = 0, momentum = 0;
};
template <class Transfer>
Collision slab_hits_column(const Setting<Transfer>& setting, double gravity = 9.81) {
  constexpr double width = 0.05, speed = 0.5, seconds = 0.23;
  auto params = box(setting, width, 0.6, 0.44);
  params.gravity = {0, -gravity};
  params.faces.lower[1].kind = params.faces.upper[1].kind = FaceKind::open;
  Particles<2> sand;
  fill(sand, params, setting, {0, 0.38}, {width, 0.46});
  const std::size_t column = sand.size();
  fill(sand, params, setting, {0, 0.50}, {width, 0.54}); // they meet after 0.08 s
  for (std::size_t p = column; p < sand.size(); ++p)
    sand.velocity[p][1] = -speed;
  Sim<Transfer> sim(params, sand);
  advance(sim, seconds);
  const Vec<2> common(0, -speed / 3 - gravity * sim.time());
  double volume = 0, momentum = 0, square = 0;
  for (std::size_t p = 0; p < sim.particles().size(); ++p) {
    volume += sim.particles().volume[p];
    momentum += sim.particles().volume[p] * sim.particles().velocity[p][1];
    square += sim.particles().volume[p] * (sim.particles().velocity[p] - common).squaredNorm();
  }
  return {std::sqrt(square / volume) / speed, momentum / volume / common[1] - 1};
}

} // namespace accuracy
