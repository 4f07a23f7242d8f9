// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/error.hpp"
#include "talus/rheology/rheology.hpp"
#include "talus/rheology/viscosity.hpp"

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

namespace talus {

/// Several materials in one simulation, of one kind of rheology with parameters of their own:
///   using Two = Materials<ConstantFriction>;
///   params.rheology.list = {{.density = 1500, .law = {.mu = 0.44}},
///                           {.density = 900, .law = {.mu = 0.6}}};
/// Which one a particle is of says Particles::material, which Seeding::material sets. At a node,
/// with \f$V_{im} = \sum_{p ∈ m} V_p N_i(x_p)\f$, masses add up, and so do yield stresses at the
/// node's pressure and strain rate, by volume:
/// \f[ m_i = \sum_m ρ_m V_{im}, \quad
///     μ_i p + c_i = \frac{\sum_m V_{im} (μ_m p + c_m)}{\sum_m V_{im}}. \f]
/// μ_m and c_m are what a node full of material m would have. Cohesion by material is
/// Materials<WithCohesion<Law>>; viscosity is one for all, WithViscosity<Materials<Law>>. Models
/// Rheology and OfMaterials.
template <Rheology Law>
requires(!OfMaterials<Law> && !Viscous<Law>) class Materials {
 public:
  struct Material {
    double density = 0;         ///< ρ_m of the dense packing, kg/m³; > 0
    typename Law::Params law{}; ///< friction, and cohesion if it has some
  };
  struct Params {
    std::vector<Material> list{}; ///< at least one
  };
  static constexpr bool rate_dependent = Law::rate_dependent;

  /// Throws std::invalid_argument if the list is empty or a parameter is out of range.
  explicit Materials(const Params& params) {
    if (params.list.empty())
      throw_invalid("rheology.list: the number of materials", 0, "at least 1");
    for (const Material& material : params.list) {
      const std::string name = "rheology.list[" + std::to_string(laws_.size()) + "]";
      require_positive(name + ".density", material.density);
      densities_.push_back(material.density);
      try {
        laws_.emplace_back(material.law);
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(name + ".law: " + error.what());
      }
    }
  }

  int materials() const { return static_cast<int>(laws_.size()); }
  double density(int material) const { return densities_[static_cast<std::size_t>(material)]; }
  const Law& law(int material) const { return laws_[static_cast<std::size_t>(material)]; }

 private:
  std::vector<double> densities_;
  std::vector<Law> laws_;
};

} // namespace talus
