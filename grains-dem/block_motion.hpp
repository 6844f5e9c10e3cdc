// The kick and drift of velocity Verlet for a block of grains.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "state.hpp"

namespace estuary::grains {

struct BlockMotion {
  double displacement_squared = 0;  // the largest since the last rebuild; not a number when any is not
  double work = 0;                  // power of the external forces [W]
};

/// Kicks and drifts the grains from `begin` to `end`, at most kBlockSize. No branch, and sums in a fixed
// number of lanes: written to be compiled to vector instructions.
template <int D>
inline BlockMotion move_block(double kick, double drift, std::size_t begin, std::size_t end,
                              State<D>& state) {
  constexpr std::size_t d = D, s = spin_components<D>, lanes = 8;
  static_assert(kBlockSize % lanes == 0);
  const std::size_t count = end - begin;
  std::array<double, kBlockSize> squared, power;
  double* __restrict const velocity = state.velocity.data() + d * begin;
  double* __restrict const position = state.position.data() + d * begin;
  double* __restrict const spin = state.spin.data() + s * begin;
  const double* __restrict const force = state.force.data() + d * begin;
  const double* __restrict const torque = state.torque.data() + s * begin;
  const double* __restrict const external = state.external_force.data() + d * begin;
  const double* __restrict const reference = state.reference_position.data() + d * begin;
  const double* __restrict const inverse_mass = state.inverse_mass.data() + begin;
  const double* __restrict const inverse_inertia = state.inverse_inertia.data() + begin;
  for (std::size_t i = 0; i < count; ++i) {
    const double push = kick * inverse_mass[i];
    double way_squared = 0, work = 0;
    for (std::size_t c = 0; c < d; ++c) {
      const std::size_t k = d * i + c;
      const double v = velocity[k] + push * force[k];
      const double x = position[k] + drift * v, way = x - reference[k];
      velocity[k] = v;
      position[k] = x;
      way_squared += way * way;
      work += external[k] * v;
    }
    squared[i] = way_squared;
    power[i] = work;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const double turn = kick * inverse_inertia[i];
    for (std::size_t c = 0; c < s; ++c) spin[s * i + c] += turn * torque[s * i + c];
  }
  const std::size_t padded = (count + lanes - 1) / lanes * lanes;
  for (std::size_t i = count; i < padded; ++i) squared[i] = power[i] = 0;
  std::array<double, lanes> worst{}, sum{}, work{};
  for (std::size_t i = 0; i < padded; i += lanes)
    for (std::size_t l = 0; l < lanes; ++l) {
      worst[l] = squared[i + l] <= worst[l] ? worst[l] : squared[i + l];
      sum[l] += squared[i + l];
      work[l] += power[i + l];
    }
  BlockMotion motion;
  double total = 0;
  for (std::size_t l = 0; l < lanes; ++l) {
    motion.displacement_squared = std::max(motion.displacement_squared, worst[l]);
    motion.work += work[l];
    total += sum[l];
  }
  if (!std::isfinite(total)) motion.displacement_squared = std::numeric_limits<double>::quiet_NaN();
  return motion;
}

}  // namespace estuary::grains
