// The sweep over pairs: where a grain simulation spends its time.
#pragma once

#include "contact_forces.hpp"
#include "contact_kernel.hpp"

namespace estuary::grains {

/// The touching pairs of a chunk of the list, one array per quantity. Which pairs touch is hard to predict,
/// and what a contact needs lies scattered: so they are found first, without a branch; then what they need is
/// fetched, their forces are computed, many at a time, and given to the grains.
template <int D, std::size_t Memory>
struct TouchingPairs {
  static constexpr std::size_t kMost = 256;
  static constexpr std::size_t spin = spin_components<D>;
  template <std::size_t PerPair>
  using Numbers = std::array<double, PerPair * kMost>;

  std::size_t count = 0;
  std::array<std::uint32_t, kMost> pair, i, target;  // as CrossForces::target
  Numbers<D> apart;                                  // from i to j
  Numbers<1> squared;                                // its length squared
  Numbers<1> radius_i, radius_j, root_mass, inverse_masses;
  Numbers<D> velocity;
  Numbers<spin> spin_i, spin_j;
  Numbers<Memory> memory;
  Numbers<D> force;                  // on i
  Numbers<spin> torque_i, torque_j;  // only where grains turn
  Numbers<1> lost_normal, lost_tangential, lost_rolling;
};

/// Of the pairs from `first` on to `last`, at most kMost of them. Pairs that part forget.
template <int D, std::size_t Memory>
inline void find_touching(const SweepInput<D>& input, const CrossForces<D>& cross, std::size_t first,
                          std::size_t last, State<D>& state, TouchingPairs<D, Memory>& touching) {
  const double* const position = state.position.data();
  const std::uint32_t* const partner = state.partner.data() + first;
  const std::uint32_t* const row = cross.row.data() + first;
  const std::uint8_t* const image = state.image.data() + first;
  const double* const reach = cross.reach_squared.data() + first;
  const std::size_t count = last - first;
  std::array<double, TouchingPairs<D, Memory>::kMost> squared;
  std::size_t n = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Vector<D> apart = load<D>(position, partner[k]) + input.shift[image[k]] - load<D>(position, row[k]);
    squared[k] = dot(apart, apart);
    touching.pair[n] = static_cast<std::uint32_t>(k);
    store<D>(touching.apart.data(), n, apart);
    n += squared[k] < reach[k] ? 1 : 0;
  }
  touching.count = n;
  if constexpr (Memory > 0) {
    double* const history = state.history.data() + Memory * first;
    for (std::size_t k = 0; k < count; ++k)
      for (std::size_t h = 0; h < Memory; ++h)
        history[Memory * k + h] = squared[k] < reach[k] ? history[Memory * k + h] : 0;
  }
  const double* const root_mass = state.root_mass.data() + first;
  const double* const history = state.history.data() + Memory * first;
  for (std::size_t m = 0; m < n; ++m) {
    const std::size_t k = touching.pair[m], i = row[k], j = partner[k];
    touching.i[m] = row[k];
    touching.target[m] = cross.target[first + k];
    touching.squared[m] = squared[k];
    const GrainPair<D> pair = grain_pair(state, i, j, root_mass[k]);
    touching.radius_i[m] = pair.radius_i;
    touching.radius_j[m] = pair.radius_j;
    touching.root_mass[m] = pair.root_mass;
    touching.inverse_masses[m] = pair.inverse_masses;
    store<D>(touching.velocity.data(), m, pair.velocity);
    store<spin_components<D>>(touching.spin_i.data(), m, pair.spin_i);
    store<spin_components<D>>(touching.spin_j.data(), m, pair.spin_j);
    for (std::size_t h = 0; h < Memory; ++h) touching.memory[Memory * m + h] = history[Memory * k + h];
  }
}

/// Whether one of a pair goes through the other.
template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
inline bool compute_forces(const ContactConstants constants, double dt, double lag,
                           TouchingPairs<D, history_size<D, F, R>>& touching) {
  constexpr std::size_t memory = history_size<D, F, R>;
  constexpr std::size_t spin = spin_components<D>;
  const double* __restrict const radius_i = touching.radius_i.data();
  const double* __restrict const radius_j = touching.radius_j.data();
  const double* __restrict const root_mass = touching.root_mass.data();
  const double* __restrict const inverse_masses = touching.inverse_masses.data();
  const double* __restrict const velocity = touching.velocity.data();
  const double* __restrict const spin_i = touching.spin_i.data();
  const double* __restrict const spin_j = touching.spin_j.data();
  const double* __restrict const squared = touching.squared.data();
  const double* __restrict const apart = touching.apart.data();
  double* __restrict const remembered = touching.memory.data();
  double* __restrict const force = touching.force.data();
  double* __restrict const torque_i = touching.torque_i.data();
  double* __restrict const torque_j = touching.torque_j.data();
  double* __restrict const lost_normal = touching.lost_normal.data();
  double* __restrict const lost_tangential = touching.lost_tangential.data();
  double* __restrict const lost_rolling = touching.lost_rolling.data();
  const std::size_t count = touching.count;
  std::int64_t through = 0;
// No array is read where another is written.
#ifdef __clang__
#pragma clang loop vectorize(assume_safety)
#else
#pragma GCC ivdep
#endif
  for (std::size_t m = 0; m < count; ++m) {
    const GrainPair<D> pair{radius_i[m],          radius_j[m],          root_mass[m],
                            inverse_masses[m],    load<D>(velocity, m), load<spin>(spin_i, m),
                            load<spin>(spin_j, m)};
    const double radii = pair.radius_i + pair.radius_j;
    through |= goes_through<D>(load<D>(apart, m), squared[m], radii, pair.velocity, dt) ? 1 : 0;
    const double distance = std::sqrt(squared[m]);
    const Vector<D> normal = (1 / distance) * load<D>(apart, m);
    const ContactKinematics<D> kinematics = pair_kinematics<D>(pair, normal, distance, lag);
    std::array<double, std::max<std::size_t>(memory, 1)> history{};
    for (std::size_t h = 0; h < memory; ++h) history[h] = remembered[memory * m + h];
    EnergyLedger lost;
    const ContactForce<D> f = contact<D, N, F, R, Cohesive>(constants, kinematics, dt, history.data(), lost);
    for (std::size_t h = 0; h < memory; ++h) remembered[memory * m + h] = history[h];
    store<D>(force, m, f.vector(normal));
    if constexpr (F != FrictionLaw::none || R != RollingLaw::none) {
      // The torque of the contact force about each centre has the same sense on both.
      const Spin<D> turn = f.torque(normal);
      const double half = 0.5 * kinematics.overlap;
      store<spin>(torque_i, m, (pair.radius_i - half) * turn + f.moment);
      store<spin>(torque_j, m, (pair.radius_j - half) * turn - f.moment);
    }
    lost_normal[m] = lost.normal;
    if constexpr (F != FrictionLaw::none) lost_tangential[m] = lost.tangential;
    if constexpr (R != RollingLaw::none) lost_rolling[m] = lost.rolling;
  }
  return through != 0;
}

/// In the order of the pairs.
template <int D, std::size_t Memory, bool Turns>
inline void give_forces(const TouchingPairs<D, Memory>& touching, std::size_t first, State<D>& state,
                        double* slots) {
  constexpr std::size_t spin = spin_components<D>;
  constexpr std::size_t width = D + spin;
  double* const force = state.force.data();
  double* const torque = state.torque.data();
  double* const history = state.history.data() + Memory * first;
  for (std::size_t m = 0; m < touching.count; ++m) {
    const std::size_t i = touching.i[m], j = touching.target[m];
    const Vector<D> on_i = load<D>(touching.force.data(), m);
    add(force, i, on_i);
    Spin<D> turns_j{};
    if constexpr (Turns) {
      add(torque, i, load<spin>(touching.torque_i.data(), m));
      turns_j = load<spin>(touching.torque_j.data(), m);
    }
    for (std::size_t h = 0; h < Memory; ++h)
      history[Memory * touching.pair[m] + h] = touching.memory[Memory * m + h];
    if (j < kSlot) {
      for (std::size_t c = 0; c < D; ++c) force[D * j + c] -= on_i[c];
      if constexpr (Turns) add(torque, j, turns_j);
    } else {
      double* const to = slots + width * (j - kSlot);
      for (std::size_t c = 0; c < D; ++c) to[c] = -on_i[c];
      for (std::size_t c = 0; c < spin; ++c) to[D + c] = turns_j[c];
    }
  }
}

/// Of the first `count`; writes zeros behind them. In a fixed order that vector instructions can follow.
template <std::size_t K>
inline double sum_in_lanes(std::array<double, K>& values, std::size_t count) {
  constexpr std::size_t lanes = 8;
  static_assert(K % lanes == 0);
  const std::size_t padded = (count + lanes - 1) / lanes * lanes;
  for (std::size_t m = count; m < padded; ++m) values[m] = 0;
  std::array<double, lanes> sum{};
  for (std::size_t m = 0; m < padded; m += lanes)
    for (std::size_t l = 0; l < lanes; ++l) sum[l] += values[m + l];
  double total = 0;
  for (const double part : sum) total += part;
  return total;
}

template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
bool sweep_pairs(const SweepInput<D>& input, std::size_t block, State<D>& state, CrossForces<D>& cross,
                 EnergyLedger& ledger) {
  constexpr std::size_t width = D + spin_components<D>;
  constexpr std::size_t memory = history_size<D, F, R>;
  constexpr bool turns = F != FrictionLaw::none || R != RollingLaw::none;
  constexpr std::size_t most = TouchingPairs<D, memory>::kMost;
  const std::size_t end = block_end(block, state.size());
  double* const slots = cross.value.data();
  std::fill(slots + width * cross.first_slot[block], slots + width * cross.first_slot[block + 1], 0.0);
  TouchingPairs<D, memory> touching;
  bool through = false;
  const std::size_t last = state.row_start[end];
  for (std::size_t first = state.row_start[block_begin(block)]; first < last; first += most) {
    find_touching(input, cross, first, std::min(last, first + most), state, touching);
    if (compute_forces<D, N, F, R, Cohesive>(input.constants, input.dt, input.lag, touching)) through = true;
    give_forces<D, memory, turns>(touching, first, state, slots);
    ledger.normal += sum_in_lanes(touching.lost_normal, touching.count);
    if constexpr (F != FrictionLaw::none)
      ledger.tangential += sum_in_lanes(touching.lost_tangential, touching.count);
    if constexpr (R != RollingLaw::none)
      ledger.rolling += sum_in_lanes(touching.lost_rolling, touching.count);
  }
  return through;
}

template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
ContactForce<D> one_contact(const ContactConstants& c, const ContactKinematics<D>& k, double dt,
                            double* history, EnergyLedger& ledger) {
  return contact<D, N, F, R, Cohesive>(c, k, dt, history, ledger);
}

template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
LawFunctions<D> functions_of() {
  return {&sweep_pairs<D, N, F, R, Cohesive>, &one_contact<D, N, F, R, Cohesive>,
          &stored_energy<D, N, F, R, Cohesive>};
}

template <int D, NormalLaw N, FrictionLaw F, RollingLaw R>
LawFunctions<D> by_cohesion(bool cohesive) {
  return cohesive ? functions_of<D, N, F, R, true>() : functions_of<D, N, F, R, false>();
}

template <int D, NormalLaw N, FrictionLaw F>
LawFunctions<D> by_rolling(const LawChoice& choice) {
  switch (choice.rolling) {
    case RollingLaw::viscous:
      return by_cohesion<D, N, F, RollingLaw::viscous>(choice.cohesive);
    case RollingLaw::spring:
      return by_cohesion<D, N, F, RollingLaw::spring>(choice.cohesive);
    case RollingLaw::none:
      break;
  }
  return by_cohesion<D, N, F, RollingLaw::none>(choice.cohesive);
}

/// Defined in one file per dimension and normal law, which keeps them small to compile.
template <int D, NormalLaw N>
LawFunctions<D> by_friction(const LawChoice& choice);

template <int D, NormalLaw N>
LawFunctions<D> choose_friction(const LawChoice& choice) {
  switch (choice.friction) {
    case FrictionLaw::none:
      return by_rolling<D, N, FrictionLaw::none>(choice);
    case FrictionLaw::coulomb:
      return by_rolling<D, N, FrictionLaw::coulomb>(choice);
    case FrictionLaw::spring:
      break;
  }
  return by_rolling<D, N, FrictionLaw::spring>(choice);
}

}  // namespace estuary::grains
