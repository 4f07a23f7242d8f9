// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cstddef>
#include <vector>

namespace talus {

/// Material points, as a structure of arrays: entry p of each array belongs to particle p. The
/// order changes from step to step (particles are kept in cell order); `id` stays with its
/// particle. Real: what velocity, C and volume are kept in. float takes 84 bytes a particle in 3-D
/// instead of 136; docs/performance.md says what that gains and loses. Positions are always double:
/// a creeping particle moves by less than a float of a metre can tell.
template <int Dim, class Real = double>
struct Particles {
  using Scalar = Real;
  std::vector<Vec<Dim>> position;       ///< x_p, #p × d, m
  std::vector<Vec<Dim, Real>> velocity; ///< v_p, #p × d, m/s
  std::vector<Mat<Dim, Real>>
      affine;                  ///< C_p, #p × d × d, 1/s: the velocity gradient that APIC carries
  std::vector<Real> volume;    ///< V_p, #p, m^d: material volume at the dense packing
  std::vector<std::size_t> id; ///< #p, all different
  std::size_t next_id = 0;     ///< of the next particle: what left keeps its number for ever

  std::size_t size() const { return position.size(); }
  bool empty() const { return position.empty(); }

  /// Cuts off what is beyond `count`, or adds particles of volume 0 at the origin, with ids of
  /// their own.
  void resize(std::size_t count) {
    position.resize(count, Vec<Dim>::Zero());
    velocity.resize(count, Vec<Dim, Real>::Zero());
    affine.resize(count, Mat<Dim, Real>::Zero());
    volume.resize(count, Real(0));
    const std::size_t before = id.size();
    id.resize(count);
    for (std::size_t p = before; p < count; ++p)
      id[p] = next_id++;
  }

  /// Adds one particle: x (m), v (m/s), volume (m^d).
  void add(const Vec<Dim>& x, const Vec<Dim>& v, double material_volume) {
    position.push_back(x);
    velocity.push_back(v.template cast<Real>());
    affine.push_back(Mat<Dim, Real>::Zero());
    volume.push_back(static_cast<Real>(material_volume));
    id.push_back(next_id++);
  }

  /// Copies particle `from` of `other` to place `to`, with its id.
  void copy(std::size_t to, const Particles& other, std::size_t from) {
    position[to] = other.position[from];
    velocity[to] = other.velocity[from];
    affine[to] = other.affine[from];
    volume[to] = other.volume[from];
    id[to] = other.id[from];
  }
};

} // namespace talus
