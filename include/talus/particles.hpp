// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/types.hpp"

#include <cstddef>
#include <vector>

namespace talus {

/// The derivatives of a multilinear velocity by several axes, d × (2^d − 1 − d): in 2-D the column
/// ∂²u/∂x∂y (1/(m s)); in 3-D ∂²u/∂y∂z, ∂²u/∂x∂z, ∂²u/∂x∂y and ∂³u/∂x∂y∂z (1/(m² s)).
template <int Dim, class Real = double>
using MixedDerivatives = Eigen::Matrix<Real, Dim, ipow(2, Dim) - 1 - Dim>;

/// Material points, as a structure of arrays: entry p of each array belongs to particle p. The
/// order changes from step to step (particles are kept in cell order); `id` stays with its
/// particle. Real: what velocity, C and volume are kept in. float takes 132 bytes a particle in 3-D
/// instead of 232 (without `mixed` 84 instead of 136); docs/performance.md says what that gains and
/// loses. Positions are always double: a creeping particle moves by less than a float of a metre
/// can tell.
template <int Dim, class Real = double>
struct Particles {
  using Scalar = Real;
  std::vector<Vec<Dim>> position;       ///< x_p, #p × d, m
  std::vector<Vec<Dim, Real>> velocity; ///< v_p, #p × d, m/s
  std::vector<Mat<Dim, Real>>
      affine; ///< C_p, #p × d × d, 1/s: the velocity gradient at the particle
  /// #p; empty: all zero. Only a transfer that carries them (PolyPic) fills it.
  std::vector<MixedDerivatives<Dim, Real>> mixed;
  std::vector<Real> volume;    ///< V_p, #p, m^d: material volume at the dense packing
  std::vector<int> material;   ///< #p, index into a list of materials; empty: all 0. See Materials
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
    if (!mixed.empty())
      resize_mixed(count);
    volume.resize(count, Real(0));
    if (!material.empty())
      resize_material(count);
    const std::size_t before = id.size();
    id.resize(count);
    for (std::size_t p = before; p < count; ++p)
      id[p] = next_id++;
  }

  /// Gives each of `count` particles mixed derivatives; zero if it has none yet.
  void resize_mixed(std::size_t count) { mixed.resize(count, MixedDerivatives<Dim, Real>::Zero()); }

  /// Gives each of `count` particles a material; 0 if it has none yet.
  void resize_material(std::size_t count) { material.resize(count); }

  /// Adds one particle: x (m), v (m/s), volume (m^d), index of its material.
  void add(const Vec<Dim>& x, const Vec<Dim>& v, double material_volume, int of_material = 0) {
    position.push_back(x);
    velocity.push_back(v.template cast<Real>());
    affine.push_back(Mat<Dim, Real>::Zero());
    if (!mixed.empty())
      resize_mixed(position.size());
    volume.push_back(static_cast<Real>(material_volume));
    if (of_material != 0 || !material.empty()) {
      resize_material(position.size());
      material.back() = of_material;
    }
    id.push_back(next_id++);
  }

  /// Copies particle `from` of `other` to place `to`, with its id.
  void copy(std::size_t to, const Particles& other, std::size_t from) {
    position[to] = other.position[from];
    velocity[to] = other.velocity[from];
    affine[to] = other.affine[from];
    if (!mixed.empty())
      mixed[to] = other.mixed.empty()
                      ? MixedDerivatives<Dim, Real>(MixedDerivatives<Dim, Real>::Zero())
                      : other.mixed[from];
    volume[to] = other.volume[from];
    if (!material.empty())
      material[to] = other.material.empty() ? 0 : other.material[from];
    id[to] = other.id[from];
  }
};

} // namespace talus
