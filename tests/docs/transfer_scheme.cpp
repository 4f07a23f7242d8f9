// SPDX-License-Identifier: MIT
// The program of docs/concepts/transfer_scheme.md: a transfer of one's own.

#include <talus/talus.hpp>

#include <cstdio>

// [scheme]
/// APIC with a part of the strain rate left out: C_p = W + (1 − share) D, W the spin and D the
/// symmetric part of Σ u_i ⊗ ∇N_i. share = 1 keeps rigid rotation only, as RPIC does (Jiang et al.
/// 2015); angular momentum is conserved for any share.
class CalmApic {
 public:
  struct Params {
    double share = 0.1; ///< in [0, 1]
  };
  static constexpr talus::ParticleField field = talus::ParticleField::affine; // v_p and C_p

  explicit CalmApic(const Params& params) : share_(params.share) {
    if (!(share_ >= 0 && share_ <= 1))
      talus::throw_invalid("transfer.share", share_, "a number in [0, 1]");
  }

  template <int Dim>
  void update(const talus::GridSample<Dim>& sample, talus::VelocityField<Dim>& p) const {
    p.velocity = sample.velocity;
    p.gradient = sample.gradient - share_ / 2 * (sample.gradient + sample.gradient.transpose());
  }

 private:
  double share_;
};
static_assert(talus::TransferScheme<CalmApic, 2> && talus::TransferScheme<CalmApic, 3>);
// [scheme]

template <class Transfer>
double front(const typename Transfer::Params& transfer) {
  using Sim = talus::Simulation<2, talus::ConstantFriction, Transfer, talus::GaussSeidel<>>;
  typename Sim::Params params;
  params.grid = {.origin = {0, 0}, .size = {0.4, 0.2}, .cells = {20, 10}};
  params.material.density = 1500;
  params.gravity = {0, -9.81};
  params.time_step = 2e-3;
  params.transfer = transfer;
  params.rheology.mu = 0.44;
  params.faces = talus::Faces<2>::all({talus::FaceKind::free_slip});
  params.faces.lower[1] = {talus::FaceKind::no_slip};
  params.faces.upper[1] = {talus::FaceKind::open};
  talus::Particles<2> sand;
  talus::fill_box<2>(sand, talus::Grid<2>(params.grid), {0, 0}, {0.1, 0.15}, {});
  Sim sim(params, sand);
  while (sim.time() < 0.3)
    if (!sim.step().completed())
      return 0;
  return talus::front_position(talus::measure_profile(sim), 0.01);
}

int main() {
  // [use]
  const double calm = front<CalmApic>({.share = 0.5});
  const double apic = front<talus::Apic>({}), pic = front<talus::Pic>({});
  std::printf("front after 0.3 s: APIC %.3f m, calm %.3f m, PIC %.3f m\n", apic, calm, pic);
  // [use]
  return calm > 0.1 && apic > 0.1 && pic > 0.1 ? 0 : 1;
}
