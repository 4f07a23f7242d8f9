// SPDX-License-Identifier: MIT
#pragma once

#include "talus/core/array.hpp"
#include "talus/core/error.hpp"
#include "talus/core/exact_sum.hpp"
#include "talus/core/execution.hpp"
#include "talus/core/grid.hpp"
#include "talus/core/types.hpp"
#include "talus/particles.hpp"
#include "talus/scene/fill.hpp"
#include "talus/scene/region.hpp"
#include "talus/step/exchange.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

/// \file
/// Sources and sinks, for Simulation::Params::exchange. StepReport tells what they did.

namespace talus {

/// When a source or a sink works.
struct Duration {
  double start = 0;                                     ///< s; >= 0
  double end = std::numeric_limits<double>::infinity(); ///< s; > start

  /// Throws std::invalid_argument if a time is out of range. what: "source", say, for messages.
  void validate(const std::string& what) const {
    require_non_negative(what + ".time.start", start);
    if (!(end > start))
      throw_invalid(what + ".time.end", end, "later than the start, or infinity");
  }
};

/// Material that comes into the box.
///
/// Through a strip, a box without thickness along one axis: layers of a jittered lattice, one after
/// the other, as a block of it would come through the strip at `velocity`. In a region, a box with
/// a volume: single particles at random places.
///
/// What is due by the time t comes in whole layers, or particles, of volume V:
/// \f[ V_\mathrm{in}(t) = V \lfloor Q (t − t_0)/V \rfloor, \f]
/// so it hangs on the time alone and not on the steps. V is that of Seeding::per_axis, fitted so
/// that in the end Q (t_1 − t_0) has come, if there is an end.
///
/// A particle that has no room is held back, for ever: StepReport::held_back_volume. It has room
/// if what is there weighs no more around its place x than dense material would,
/// \f[ \sum_p V_p w(x_p − x) \le \int w + m, \quad w(r) = \prod_a \max(0, 1 − |r_a|/h_a), \f]
/// h: a cell's edges. In a region the integral is over its part that is in the box, and m = −V/2.
/// For a strip x is the middle of the particle's share, without jitter, the integral is over the
/// box beyond the layer, and m is three times the standard deviation that jitter j gives the sum in
/// a dense block of shares with edges e,
/// \f[ m² = \tfrac34 j² V |h_1 \dots h_d| (2/3)^{d−1} \sum_a (e_a/h_a)². \f]
/// Obstacles are not seen.
template <int Dim, class Real = double>
class Source final : public Exchange<Dim, Real> {
 public:
  struct Params {
    Vec<Dim> lower = Vec<Dim>::Constant(not_given); ///< m: of the strip or region, in the grid
    Vec<Dim> upper = Vec<Dim>::Constant(not_given); ///< m: equal along one axis for a strip
    /// Of particles as they come, m/s; that of a strip crosses it, into the box.
    Vec<Dim> velocity = Vec<Dim>::Zero();
    /// Q, m^d/s of material as dense; > 0. A strip of area A lets |u_n| A through at most, which
    /// is what it does if nothing is given; less is a looser stream.
    double flux = not_given;
    /// Which part of the box lets material in, x in m; none: all of it.
    std::function<bool(const Vec<Dim>&)> inside{};
    Duration time{};
    Seeding seeding{}; ///< per_axis, jitter, seed, material; the pattern is as told above
  };

  /// grid: that of the simulation, periodic where that is, or what passes such a face on its way
  /// along a strip stays there. Throws std::invalid_argument if a parameter is out of range, the
  /// strip or region leaves the grid, a strip's material would not move into it, or `inside` lets
  /// nothing in.
  Source(const Grid<Dim>& grid, Params params) : grid_(grid), params_(std::move(params)) {
    params_.seeding.validate();
    params_.time.validate("source");
    edge_ = grid_.spacing() / params_.seeding.per_axis;
    find_axis();
    volume_ = edge_.prod();
    if (is_strip())
      place_layer();
    if (std::isnan(params_.flux) && !is_strip())
      throw_invalid("source.flux", "nan, not given", "a finite number > 0, m^d/s");
    require_positive("source.flux", params_.flux);
    period_ = volume_ / params_.flux;
    if (std::isfinite(params_.time.end)) {
      const double seconds = params_.time.end - params_.time.start;
      count_ = std::max(1.0, std::round(seconds / period_));
      period_ = seconds / count_;
      volume_ = params_.flux * period_;
    }
    if (!is_strip()) { // the first particle, so that a region that lets none in is refused here
      std::vector<Vec<Dim>> places, middles;
      group(0, params_.time.start, places, middles);
    }
  }

  double flux() const { return params_.flux; } ///< Q, m^d/s
  /// V_in, m^d, if there is room for all: what has come by the time t, s.
  double volume_due(double t) const { return volume_ * due(t); }

  int materials() const override { return params_.seeding.material + 1; }

  void exchange(double from, double to, const Execution& execution, Particles<Dim, Real>& particles,
                Turnover& turnover) const override {
    const auto first = static_cast<std::uint64_t>(due(from));
    const auto last = static_cast<std::uint64_t>(due(to));
    if (first == last)
      return;
    std::vector<Entry> there;
    for (std::size_t p = 0; p < particles.size(); ++p)
      add_entry(particles.position[p], static_cast<double>(particles.volume[p]), there);
    std::vector<Vec<Dim>> places, middles;
    for (std::uint64_t k = first; k < last; ++k) {
      group(k, to, places, middles);
      const double volume = volume_ / static_cast<double>(places.size());
      const std::vector<char> room = room_for(middles, volume, there, execution);
      for (std::size_t i = 0; i < places.size(); ++i) {
        if (!execution.first_rank()) {
          particles.next_id += room[i] ? 1U : 0U;
        } else if (!room[i]) {
          turnover.held_back.add(static_cast<double>(static_cast<Real>(volume)));
        } else {
          particles.add(places[i], params_.velocity, volume, params_.seeding.material);
          turnover.inflow.add(static_cast<double>(particles.volume.back()));
          ++turnover.added;
          add_entry(places[i], volume, there);
        }
      }
    }
  }

 private:
  struct Entry {
    Vec<Dim> position;
    double volume;
  };

  bool is_strip() const { return axis_ >= 0; }
  bool may_enter(const Vec<Dim>& x) const { return !params_.inside || params_.inside(x); }

  /// How many layers, or particles, are due by the time t.
  double due(double t) const {
    if (!(t > params_.time.start))
      return 0;
    return t >= params_.time.end ? count_ : std::floor((t - params_.time.start) / period_);
  }

  /// Which axis a strip is flat along, and the part of the box that counts for its room.
  void find_axis() {
    const Vec<Dim> from = grid_.origin(), to = grid_.upper();
    for (int a = 0; a < Dim; ++a) {
      const std::string name = std::string(".") + "xyz"[a];
      const double lower = params_.lower[a], upper = params_.upper[a];
      require_finite("source.velocity" + name, params_.velocity[a]);
      if (!(lower >= from[a] && lower <= to[a]))
        throw_invalid("source.lower" + name, lower,
                      "in the grid, " + text_of(from[a]) + " to " + text_of(to[a]));
      if (!(upper >= lower && upper <= to[a]))
        throw_invalid("source.upper" + name, upper,
                      "in the grid, from source.lower" + name + " to " + text_of(to[a]));
      around_[a] = grid_.periodic(a) && lower == from[a] && upper == to[a];
      if (upper > lower)
        continue;
      if (is_strip())
        throw_invalid("source.upper - source.lower along " + std::string(1, "xyz"[a]), 0,
                      "a positive size: a strip is flat along one axis");
      axis_ = a;
    }
    room_lower_ = params_.lower;
    room_upper_ = params_.upper;
    if (!is_strip())
      return;
    const double u = params_.velocity[axis_], plane = params_.lower[axis_];
    into_ = u > 0;
    const double ahead = u > 0 ? to[axis_] - plane : u < 0 ? plane - from[axis_] : 0;
    if (!(ahead >= grid_.spacing()[axis_]))
      throw_invalid(std::string("source.velocity.") + "xyz"[axis_], u,
                    "a speed through the strip into the grid, with at least a cell ahead of it");
    (into_ ? room_upper_ : room_lower_)[axis_] = into_ ? to[axis_] : from[axis_];
  }

  /// The middles of a layer's shares.
  void place_layer() {
    Index<Dim> count;
    std::size_t total = 1;
    for (int a = 0; a < Dim; ++a) {
      count[a] = 1;
      if (a == axis_)
        continue;
      const double size = params_.upper[a] - params_.lower[a];
      count[a] = std::max(1, static_cast<int>(std::lround(size / edge_[a])));
      edge_[a] = size / count[a];
      total *= static_cast<std::size_t>(count[a]);
    }
    for (std::size_t k = 0; k < total; ++k) {
      Vec<Dim> x = params_.lower;
      std::size_t rest = k;
      for (int a = Dim - 1; a >= 0; --a) {
        const auto n = static_cast<std::size_t>(count[a]);
        if (a != axis_)
          x[a] += edge_[a] * (static_cast<double>(rest % n) + 0.5);
        rest /= n;
      }
      if (may_enter(x))
        layer_.push_back(x);
    }
    if (layer_.empty())
      throw_invalid("source.inside: the number of places of a layer that it lets in", 0,
                    "at least 1");
    volume_ = edge_.prod() * static_cast<double>(layer_.size());
    const double speed = std::abs(params_.velocity[axis_]);
    const double most = speed * volume_ / edge_[axis_];
    if (std::isnan(params_.flux))
      params_.flux = most;
    if (!(params_.flux <= most * (1 + 1e-9)))
      throw_invalid("source.flux", params_.flux,
                    "at most the strip's area times the speed, " + text_of(most) + " m^d/s");
  }

  /// The places (m) at the time `to` of the layer, or of the particle, of number k; middles: of
  /// their shares.
  void group(std::uint64_t k, double to, std::vector<Vec<Dim>>& places,
             std::vector<Vec<Dim>>& middles) const {
    Random random(params_.seeding.seed ^ ((k + 1) * 0xd1342543de82ef95U)); // a stream of its own
    if (!is_strip()) {
      places = middles = {draw(random)};
      return;
    }
    const double due_at = params_.time.start + static_cast<double>(k + 1) * period_;
    const double age = std::max(0.0, to - due_at);
    places = middles = layer_;
    const auto bring = [&](Vec<Dim>& x) {
      x[axis_] += (into_ ? 0.5 : -0.5) * edge_[axis_];
      x = grid_.wrapped(x + age * params_.velocity);
      x = x.cwiseMax(grid_.origin()).cwiseMin(grid_.upper());
    };
    for (std::size_t i = 0; i < places.size(); ++i) {
      for (int a = 0; a < Dim; ++a)
        places[i][a] += edge_[a] * params_.seeding.jitter * (random.uniform() - 0.5);
      bring(places[i]);
      bring(middles[i]);
    }
  }

  Vec<Dim> draw(Random& random) const {
    constexpr int most_draws = 100000;
    for (int n = 0; n < most_draws; ++n) {
      Vec<Dim> x;
      for (int a = 0; a < Dim; ++a)
        x[a] = params_.lower[a] + random.uniform() * (params_.upper[a] - params_.lower[a]);
      if (may_enter(x))
        return x;
    }
    throw_invalid("source.inside: the number of random places that it refuses", most_draws,
                  "a region that has a volume");
  }

  void add_entry(const Vec<Dim>& x, double volume, std::vector<Entry>& entries) const {
    if ((x.array() >= room_lower_.array()).all() && (x.array() <= room_upper_.array()).all())
      entries.push_back({x, volume});
  }

  /// w(y − x).
  double weight(const Vec<Dim>& x, const Vec<Dim>& y) const {
    double w = 1;
    for (int a = 0; a < Dim && w > 0; ++a) {
      const auto hat = [h = grid_.inverse_spacing()[a]](double r) {
        return std::max(0.0, 1 - r * h);
      };
      const double apart = std::abs(y[a] - x[a]);
      w *= around_[a] ? hat(apart) + hat(grid_.size()[a] - apart) : hat(apart);
    }
    return w;
  }

  /// ∫ w(y − x) dy over the part that counts, for a strip beyond the layer of x, m^d.
  double capacity(const Vec<Dim>& x) const {
    double product = 1;
    for (int a = 0; a < Dim; ++a) {
      const double h = grid_.spacing()[a];
      const auto half = [h](double s) {
        const double reach = std::clamp(s, 0.0, h);
        return reach - reach * reach / (2 * h);
      };
      const double below = around_[a] ? h : x[a] - room_lower_[a];
      const double above = around_[a] ? h : room_upper_[a] - x[a];
      product *=
          a != axis_ ? half(below) + half(above) : half(into_ ? above : below) - half(edge_[a] / 2);
    }
    return product;
  }

  /// m, m^d.
  double margin(double volume) const {
    if (!is_strip())
      return -volume / 2;
    const double jitter = params_.seeding.jitter;
    const double shares = edge_.cwiseProduct(grid_.inverse_spacing()).squaredNorm();
    return jitter *
           std::sqrt(0.75 * volume * grid_.cell_volume() * std::pow(2.0 / 3, Dim - 1) * shares);
  }

  /// Which of the places have room; the same on all ranks, whatever the order of the particles.
  std::vector<char> room_for(const std::vector<Vec<Dim>>& places, double volume,
                             const std::vector<Entry>& there, const Execution& execution) const {
    std::vector<ExactSum> sums(places.size());
    for (std::size_t i = 0; i < places.size(); ++i)
      for (const Entry& entry : there)
        if (const double w = weight(places[i], entry.position); w > 0)
          sums[i].add(w * entry.volume);
    execution.join(sums.data(), static_cast<int>(sums.size()));
    std::vector<char> room(places.size());
    for (std::size_t i = 0; i < places.size(); ++i)
      room[i] = sums[i].value() <= capacity(places[i]) + margin(volume) ? 1 : 0;
    return room;
  }

  Grid<Dim> grid_;
  Params params_;
  int axis_ = -1;     ///< that a strip is flat along; -1: a region
  bool into_ = false; ///< does a strip's material go up that axis?
  Vec<Dim> edge_;     ///< of a particle's share, m
  std::vector<Vec<Dim>> layer_;
  Vec<Dim> room_lower_, room_upper_; ///< the part of the box that counts, m
  SmallArray<bool, Dim> around_{};   ///< does it go all around the box along a periodic axis?
  double volume_ = 0;                ///< V, m^d
  double period_ = 0;                ///< V/Q, s
  double count_ = 0;                 ///< of layers, or particles, by the end, if there is one
};

/// A region that takes particles out at the end of each step.
template <int Dim, class Real = double>
class Sink final : public Exchange<Dim, Real> {
 public:
  struct Params {
    std::function<bool(const Vec<Dim>&)> region{}; ///< which places are in it, x in m
    Duration time{};
  };

  /// Throws std::invalid_argument if there is no region or a time is out of range.
  explicit Sink(Params params) : params_(std::move(params)) {
    if (!params_.region)
      throw_invalid("sink.region", "nothing", "a function of the place");
    params_.time.validate("sink");
  }

  /// In each step that ends after the start, and not after the end.
  void exchange(double, double to, const Execution&, Particles<Dim, Real>& particles,
                Turnover& turnover) const override {
    if (to > params_.time.start && to <= params_.time.end)
      turnover.removed += take_out(
          particles, [&](std::size_t p) { return params_.region(particles.position[p]); },
          turnover.outflow);
  }

 private:
  Params params_;
};

/// A source for Simulation::Params::exchange: make_source<2>(grid, {.lower = {0, 0.2}, …}). Throws
/// as Source does.
template <int Dim, class Real = double>
std::shared_ptr<const Source<Dim, Real>> make_source(const Grid<Dim>& grid,
                                                     typename Source<Dim, Real>::Params params) {
  return std::make_shared<const Source<Dim, Real>>(grid, std::move(params));
}

/// A sink for Simulation::Params::exchange. region: see Region. Throws as Sink does.
template <int Dim, class Real = double, Region<Dim> R>
std::shared_ptr<const Sink<Dim, Real>> make_sink(R region, const Duration& time = {}) {
  return std::make_shared<const Sink<Dim, Real>>(typename Sink<Dim, Real>::Params{
      .region = [region =
                     std::move(region)](const Vec<Dim>& x) { return contains<Dim>(region, x); },
      .time = time});
}

namespace detail {

template <int Dim, class Real>
class Together final : public Exchange<Dim, Real> {
 public:
  using Parts = std::vector<std::shared_ptr<const Exchange<Dim, Real>>>;

  explicit Together(Parts parts) : parts_(std::move(parts)) {
    for (const auto& part : parts_)
      if (!part)
        throw_invalid("a source or sink", "null", "a valid pointer");
  }
  void exchange(double from, double to, const Execution& execution, Particles<Dim, Real>& particles,
                Turnover& turnover) const override {
    for (const auto& part : parts_)
      part->exchange(from, to, execution, particles, turnover);
  }
  int materials() const override {
    int most = 1;
    for (const auto& part : parts_)
      most = std::max(most, part->materials());
    return most;
  }

 private:
  Parts parts_;
};

} // namespace detail

/// Several sources and sinks as one: a step asks them in their order. Throws std::invalid_argument
/// if one is null.
template <int Dim, class Real = double>
std::shared_ptr<const Exchange<Dim, Real>>
together(std::vector<std::shared_ptr<const Exchange<Dim, Real>>> parts) {
  return std::make_shared<const detail::Together<Dim, Real>>(std::move(parts));
}

} // namespace talus
