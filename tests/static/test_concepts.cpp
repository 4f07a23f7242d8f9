// SPDX-License-Identifier: MIT
// Concepts accept the library's models and a user's own, and refuse what lacks a piece.

#include "talus/cone/fischer_burmeister_newton.hpp"
#include "talus/cone/secular.hpp"
#include "talus/rheology/laws.hpp"
#include "talus/solver/gauss_seidel.hpp"
#include "talus/transfer/schemes.hpp"

#include <doctest/doctest.h>

using namespace talus;

static_assert(Rheology<ConstantFriction> && Rheology<MuOfI> && Rheology<HystereticFriction>);
static_assert(TransferScheme<Apic, 2> && TransferScheme<Apic, 3> && TransferScheme<Pic, 3> &&
              TransferScheme<Flip, 3>);
static_assert(LocalSolver<SecularSolver, CoulombLaw, 6> &&
              LocalSolver<SecularSolver, AssociatedLaw, 3>);
static_assert(LocalSolver<FischerBurmeisterNewton, CoulombLaw, 2> &&
              LocalSolver<FischerBurmeisterNewton, AssociatedLaw, 6>);
static_assert(Solver<GaussSeidel<SecularSolver>, 2> && Solver<GaussSeidel<SecularSolver>, 3> &&
              Solver<GaussSeidel<FischerBurmeisterNewton, CoulombLaw>, 3>);

namespace {

/// A friction law of a user's own: five lines.
struct Linear {
  struct Params {
    double mu = 0.3;
  };
  static constexpr bool rate_dependent = false;
  explicit Linear(const Params& params) : mu(params.mu) {}
  double friction(double) const { return mu; }
  double mu;
};
static_assert(Rheology<Linear>);

struct NoFriction : Linear {
  double friction(double) const = delete;
};
static_assert(!Rheology<NoFriction>);

struct RateDependentWithoutInertialNumber : Linear {
  static constexpr bool rate_dependent = true;
  using Linear::Linear;
};
static_assert(!Rheology<RateDependentWithoutInertialNumber>);

struct NotAScheme {
  struct Params {};
  static constexpr bool affine = false;
  explicit NotAScheme(const Params&) {}
};
static_assert(!TransferScheme<NotAScheme, 2>);
static_assert(!Solver<SecularSolver, 3>);
static_assert(!LocalSolver<Apic, CoulombLaw, 6>);

} // namespace

TEST_CASE("concepts are checked when this file compiles") {
  CHECK(true);
}
