// SPDX-License-Identifier: MIT
#pragma once

#include "../physics/scenes.hpp"

#include "talus/rheology/cohesion.hpp"
#include "talus/rheology/materials.hpp"
#include "talus/scene/source.hpp"

namespace scenes {

/// Several materials of a kind of law, in the box of box().
template <int Dim, class Law = ConstantFriction, class Transfer = PolyPic>
using Mixed = Simulation<Dim, Materials<Law>, Transfer, GaussSeidel<>>;

/// box() for another rheology.
template <class S>
typename S::Params box_for(const Vec<3>& size, const Index<3>& cells, double angle_deg) {
  const auto plain = box<S::dimension>(size, cells, angle_deg, 0);
  typename S::Params params;
  params.grid = plain.grid;
  params.gravity = plain.gravity;
  params.time_step = plain.time_step;
  params.solver = plain.solver;
  params.faces = plain.faces;
  return params;
}

/// Fills the box between two heights with a material, on a regular lattice.
template <int Dim>
void add_layer(Particles<Dim>& particles, const GridParams<Dim>& grid, double z0, double z1,
               int material) {
  Vec<Dim> lower = grid.origin, upper = grid.origin + grid.size;
  lower[up_axis<Dim>] = z0;
  upper[up_axis<Dim>] = z1;
  fill_box(particles, Grid<Dim>(grid), lower, upper,
           {.per_axis = 2, .jitter = 0, .material = material});
}

/// Heavy, strong, cohesive material falls on and beside light, weak material; more of it comes in.
template <int Dim>
typename Mixed<Dim, WithCohesion<MuOfI>>::Params mixed_collapse() {
  using S = Mixed<Dim, WithCohesion<MuOfI>>;
  auto params = scenes::box_for<S>({0.3, 0.06, 0.18}, {15, 3, 9}, 0);
  params.time_step = 2e-3;
  params.friction_updates = 2;
  const InertialNumber grains{.grain_diameter = 2e-3, .density = 2500, .strain_factor = 2};
  const auto law = [&](double mu, double cohesion) {
    return WithCohesion<MuOfI>::Params{.law = {.mu_static = mu, .mu_limit = 2 * mu, .I_0 = 0.3},
                                       .inertial = grains,
                                       .cohesion = cohesion};
  };
  params.rheology.list = {{.density = 900, .law = law(0.2, 0)},
                          {.density = 2500, .law = law(0.4, 40)}};
  Vec<Dim> lower = Vec<Dim>::Zero(), upper = Vec<Dim>::Zero();
  lower[0] = 0.2;
  upper[0] = 0.26;
  if (Dim == 3)
    upper[1] = 0.06;
  lower[up_axis<Dim>] = upper[up_axis<Dim>] = 0.16;
  Vec<Dim> velocity = Vec<Dim>::Zero();
  velocity[up_axis<Dim>] = -0.5;
  params.exchange = make_source<Dim>(Grid<Dim>(params.grid), {.lower = lower,
                                                              .upper = upper,
                                                              .velocity = velocity,
                                                              .time = {.end = 0.05},
                                                              .seeding = {.material = 1}});
  return params;
}

template <int Dim>
Particles<Dim> two_columns(const GridParams<Dim>& grid) {
  Particles<Dim> particles;
  for (const int m : {0, 1}) {
    Vec<Dim> lower = Vec<Dim>::Zero(), upper = grid.size;
    upper[0] = 0.1;
    lower[up_axis<Dim>] = 0.06 * m;
    upper[up_axis<Dim>] = 0.06 * (m + 1);
    fill_box(particles, Grid<Dim>(grid), lower, upper, {.per_axis = 2, .material = m});
  }
  return particles;
}

} // namespace scenes
