// The sweep over pairs: where a grain simulation spends its time.
#pragma once

#include "contact_forces.hpp"
#include "contact_kernel.hpp"

namespace estuary::grains {

/// Pairs that touch, found before their forces are computed. Which ones do is hard to predict: the search has
/// no branch on it, and roots and quotients are taken of many at a time.
template <int D>
struct TouchingPairs {
  static constexpr std::size_t kMost = 256;
  std::array<std::uint32_t, kMost> pair, slot;  // slot: where the force on a partner of another block goes
  std::array<double, D * kMost> apart;
  std::array<double, kMost> distance, inverse;
  std::size_t count = 0;
};

/// Of the pairs from `first` on, at most kMost of them. Pairs that part forget. `slot` counts those that
/// cross blocks.
template <int D, std::size_t Memory>
inline void find_touching(const SweepInput<D>& input, const CrossForces<D>& cross, std::size_t first,
                          std::size_t last, std::size_t end, State<D>& state, std::uint32_t& slot,
                          TouchingPairs<D>& touching) {
  const double* const position = state.position.data();
  const double* const radius = state.radius.data();
  const std::uint32_t* const partner = state.partner.data();
  const std::uint32_t* const row = cross.row.data();
  const std::uint8_t* const image = state.image.data();
  double* const history = state.history.data();
  std::size_t n = 0;
  for (std::size_t k = first; k < last; ++k) {
    const std::size_t i = row[k], j = partner[k];
    const Vector<D> apart = load<D>(position, j) + input.shift[image[k]] - load<D>(position, i);
    const double touch = radius[i] + radius[j];
    const double squared = dot(apart, apart);
    touching.pair[n] = static_cast<std::uint32_t>(k);
    touching.slot[n] = slot;
    store<D>(touching.apart.data(), n, apart);
    touching.distance[n] = squared;
    const bool touches = squared < touch * touch;
    if constexpr (Memory > 0) {
      double remembered = 0;
      for (std::size_t h = 0; h < Memory; ++h) remembered += std::abs(history[Memory * k + h]);
      if (static_cast<int>(!touches) & static_cast<int>(remembered > 0))
        for (std::size_t h = 0; h < Memory; ++h) history[Memory * k + h] = 0;
    }
    n += touches ? 1 : 0;
    slot += j >= end ? 1 : 0;
  }
  for (std::size_t m = 0; m < n; ++m) touching.distance[m] = std::sqrt(touching.distance[m]);
  for (std::size_t m = 0; m < n; ++m) touching.inverse[m] = 1 / touching.distance[m];
  touching.count = n;
}

template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
void sweep_pairs(const SweepInput<D>& input, std::size_t block, State<D>& state, CrossForces<D>& cross,
                 EnergyLedger& ledger) {
  constexpr std::size_t spin = spin_components<D>;
  constexpr std::size_t width = D + spin;
  constexpr std::size_t memory = history_size<D, F, R>;
  constexpr bool turns = F != FrictionLaw::none || R != RollingLaw::none;
  const std::size_t end = block_end(block, state.size());
  double* const force = state.force.data();
  double* const torque = state.torque.data();
  double* const history = state.history.data();
  const double* const radius = state.radius.data();
  const double* const root_mass = state.root_mass.data();
  double* const slots = cross.value.data();
  std::fill(slots + width * cross.first_slot[block], slots + width * cross.first_slot[block + 1], 0.0);
  EnergyLedger lost;
  TouchingPairs<D> touching;
  auto slot = static_cast<std::uint32_t>(cross.first_slot[block]);
  // A row's sum is added when the row ends: in registers, and in an order that chunks do not change.
  std::size_t row = block_begin(block);
  Vector<D> row_force{};
  Spin<D> row_torque{};
  const auto end_row = [&] {
    add(force, row, row_force);
    if constexpr (turns) add(torque, row, row_torque);
  };
  const std::size_t last = state.row_start[end];
  for (std::size_t first = state.row_start[block_begin(block)]; first < last;
       first += TouchingPairs<D>::kMost) {
    find_touching<D, memory>(input, cross, first, std::min(last, first + TouchingPairs<D>::kMost), end, state,
                             slot, touching);
    for (std::size_t m = 0; m < touching.count; ++m) {
      const std::size_t k = touching.pair[m];
      const std::size_t i = cross.row[k], j = state.partner[k];
      if (i != row) {
        end_row();
        row = i;
        row_force = {};
        row_torque = {};
      }
      const Vector<D> normal = touching.inverse[m] * load<D>(touching.apart.data(), m);
      const auto kinematics =
          pair_kinematics(state, i, j, normal, touching.distance[m], root_mass[k], input.lag);
      const ContactForce<D> f =
          contact<D, N, F, R, Cohesive>(input.constants, kinematics, input.dt, history + memory * k, lost);
      const Vector<D> on_i = f.vector(normal);
      row_force = row_force + on_i;
      Spin<D> on_j_torque{};
      if constexpr (turns) {
        // The torque of the contact force about each centre has the same sense on both.
        const Spin<D> turn = f.torque(normal);
        const double half = 0.5 * kinematics.overlap;
        row_torque = row_torque + (radius[i] - half) * turn + f.moment;
        on_j_torque = (radius[j] - half) * turn - f.moment;
      }
      if (j < end) {
        for (std::size_t c = 0; c < D; ++c) force[D * j + c] -= on_i[c];
        if constexpr (turns) add(torque, j, on_j_torque);
      } else {
        double* const to = slots + width * touching.slot[m];
        for (std::size_t c = 0; c < D; ++c) to[c] = -on_i[c];
        for (std::size_t c = 0; c < spin; ++c) to[D + c] = on_j_torque[c];
      }
    }
  }
  end_row();
  ledger += lost;
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
