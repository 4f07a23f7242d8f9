// SPDX-License-Identifier: MIT
#pragma once

#include "command_line.hpp"

#include "talus/rheology/laws.hpp"
#include "talus/rheology/rheology.hpp"
#include "talus/transfer/schemes.hpp"
#include "talus/transfer/transfer_scheme.hpp"

#include <optional>
#include <string>
#include <variant>

/// \file
/// Policies chosen at run time, for programs that offer them as options: models of the library's
/// concepts that hold one of its own models. A program that knows what it wants names the policy.

namespace support {

/// Any of the library's friction laws.
class AnyRheology {
 public:
  struct Params {
    std::variant<talus::ConstantFriction::Params, talus::MuOfI::Params,
                 talus::HystereticFriction::Params>
        law;
    talus::InertialNumber inertial{.grain_diameter = 0, .density = 1}; ///< of a constant law
  };
  static constexpr bool rate_dependent = true;

  explicit AnyRheology(const Params& params)
      : inertial_(params.inertial),
        law_(std::visit([](const auto& p) { return make(p); }, params.law)) {}

  double friction(double inertial_number) const {
    return std::visit([&](const auto& law) { return law.friction(inertial_number); }, law_);
  }
  talus::InertialNumber inertial_number() const {
    return std::visit(
        [&](const auto& law) {
          if constexpr (requires { law.inertial_number(); })
            return law.inertial_number();
          else
            return inertial_;
        },
        law_);
  }

 private:
  using Law = std::variant<talus::ConstantFriction, talus::MuOfI, talus::HystereticFriction>;
  static Law make(const talus::ConstantFriction::Params& p) { return talus::ConstantFriction(p); }
  static Law make(const talus::MuOfI::Params& p) { return talus::MuOfI(p); }
  static Law make(const talus::HystereticFriction::Params& p) {
    return talus::HystereticFriction(p);
  }
  talus::InertialNumber inertial_;
  Law law_;
};
static_assert(talus::Rheology<AnyRheology>);

/// Any of the library's transfer schemes.
class AnyTransfer {
 public:
  struct Params {
    std::variant<talus::PolyPic::Params, talus::Apic::Params, talus::Pic::Params,
                 talus::Flip::Params>
        scheme;
  };
  // a scheme that carries less leaves the rest zero
  static constexpr talus::ParticleField field = talus::ParticleField::multilinear;

  explicit AnyTransfer(const Params& params)
      : scheme_(std::visit([](const auto& p) { return make(p); }, params.scheme)) {}

  bool replaces() const { return !std::holds_alternative<talus::Flip>(scheme_); }

  void prepare(const talus::TransferStep& step) {
    std::visit(
        [&](auto& scheme) {
          if constexpr (requires { scheme.prepare(step); })
            scheme.prepare(step);
        },
        scheme_);
  }

  template <int Dim>
  void update(const talus::GridSample<Dim>& sample, talus::VelocityField<Dim>& p) const {
    std::visit([&](const auto& scheme) { scheme.update(sample, p); }, scheme_);
  }

 private:
  using Scheme = std::variant<talus::PolyPic, talus::Apic, talus::Pic, talus::Flip>;
  static Scheme make(const talus::PolyPic::Params& p) { return talus::PolyPic(p); }
  static Scheme make(const talus::Apic::Params& p) { return talus::Apic(p); }
  static Scheme make(const talus::Pic::Params& p) { return talus::Pic(p); }
  static Scheme make(const talus::Flip::Params& p) { return talus::Flip(p); }
  Scheme scheme_;
};
static_assert(talus::TransferScheme<AnyTransfer, 2> && talus::TransferScheme<AnyTransfer, 3>);

struct PolicyOptions {
  std::string rheology = "constant", transfer = "polypic";
};

inline void add_policy_options(CLI::App& app, PolicyOptions& options) {
  app.add_option(
         "--rheology", options.rheology,
         "constant: avalanche friction; stop: stopping friction; mu-i: mu(I); hysteretic: a "
         "ramp, or a step in the repository preset; hysteretic-step")
      ->check(CLI::IsMember({"constant", "stop", "mu-i", "hysteretic", "hysteretic-step"}))
      ->capture_default_str();
  app.add_option("--transfer", options.transfer, "Between particles and grid")
      ->check(CLI::IsMember({"polypic", "apic", "pic", "flip"}))
      ->capture_default_str();
}

/// A material of the paper; laws that were not measured for it are absent.
struct GrainMaterial {
  std::string name;
  double grain_diameter = 0, density = 0;
  double mu_avalanche = 0, mu_stop = 0, mu_wall = 0;
  std::optional<talus::MuOfI::Params> mu_of_i;
  std::optional<talus::HystereticFriction::Params> hysteretic;

  /// In the convention of Rousseau et al. 2023: |D| = sqrt(D:D/2), density of the medium.
  talus::InertialNumber inertial() const {
    return {.grain_diameter = grain_diameter, .density = density, .strain_factor = 1};
  }
};

inline GrainMaterial grain_material(const std::string& name, const Toml& file) {
  GrainMaterial material{.name = name,
                         .grain_diameter = file.number("grain_diameter"),
                         .density = file.number("density"),
                         .mu_avalanche = file.number("mu_avalanche"),
                         .mu_stop = file.number("mu_stop"),
                         .mu_wall = file.number("mu_wall"),
                         .mu_of_i = {},
                         .hysteretic = {}};
  const talus::InertialNumber inertial = material.inertial();
  if (file.has("I_0"))
    material.mu_of_i = talus::MuOfI::Params{.law = {.mu_static = file.number("mu_static"),
                                                    .mu_limit = file.number("mu_limit"),
                                                    .I_0 = file.number("I_0")},
                                            .inertial = inertial};
  if (file.has("I_star"))
    material.hysteretic =
        talus::HystereticFriction::Params{.law = {.mu = material.mu_stop,
                                                  .mu_excess = file.number("mu_excess"),
                                                  .I_star = file.number("I_star")},
                                          .inertial = inertial};
  return material;
}

/// The law that the options ask for. friction: a value of the user's, for the constant law only.
/// step: the hysteretic law as a step instead of a ramp.
inline AnyRheology::Params rheology_params(const PolicyOptions& options,
                                           const GrainMaterial& material,
                                           std::optional<double> friction, bool step) {
  if (friction && options.rheology != "constant")
    throw std::invalid_argument("--friction goes with --rheology constant, not " +
                                options.rheology);
  if (options.rheology == "constant")
    return {talus::ConstantFriction::Params{.mu = friction.value_or(material.mu_avalanche)},
            material.inertial()};
  if (options.rheology == "stop")
    return {talus::ConstantFriction::Params{.mu = material.mu_stop}, material.inertial()};
  if (options.rheology == "mu-i" && material.mu_of_i)
    return {*material.mu_of_i};
  if (options.rheology.starts_with("hysteretic") && material.hysteretic) {
    talus::HystereticFriction::Params params = *material.hysteretic;
    if (step || options.rheology == "hysteretic-step")
      params.law.shape = talus::HystereticCurve::Shape::step;
    return {params};
  }
  throw std::invalid_argument("--rheology is " + options.rheology +
                              "; it was not measured for the material " + material.name +
                              "; allowed: constant, stop");
}

inline AnyTransfer::Params transfer_params(const PolicyOptions& options) {
  if (options.transfer == "pic")
    return {talus::Pic::Params{}};
  if (options.transfer == "flip")
    return {talus::Flip::Params{}};
  if (options.transfer == "apic")
    return {talus::Apic::Params{}};
  return {talus::PolyPic::Params{}};
}

} // namespace support
