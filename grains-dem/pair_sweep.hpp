// The sweep over pairs: where a grain simulation spends its time.
#pragma once

#include "contact_forces.hpp"
#include "contact_kernel.hpp"

namespace estuary::grains {

template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
void sweep_pairs(const SweepInput<D>& input, std::size_t block, State<D>& state, CrossForces<D>& cross,
                 EnergyLedger& ledger) {
  constexpr std::size_t spin = spin_components<D>;
  constexpr std::size_t memory = history_size<D, F, R>;
  const std::size_t begin = block_begin(block), end = block_end(block, state.size());
  double* const force = state.force.data();
  double* const torque = state.torque.data();
  double* const history = state.history.data();
  const double* const position = state.position.data();
  const double* const radius = state.radius.data();
  const std::uint32_t* const partner = state.partner.data();
  const std::uint8_t* const image = state.image.data();
  const double* const root_mass = state.root_mass.data();
  double* slot = cross.value.data() + cross.first_slot[block] * (D + spin);
  EnergyLedger lost;
  for (std::size_t i = begin; i < end; ++i) {
    const Vector<D> xi = load<D>(position, i);
    const double ri = radius[i];
    Vector<D> force_i{};
    Spin<D> torque_i{};
    const std::size_t last = state.row_start[i + 1];
    for (std::size_t k = state.row_start[i]; k < last; ++k) {
      const std::size_t j = partner[k];
      const Vector<D> apart = load<D>(position, j) + input.shift[image[k]] - xi;
      const double touch = ri + radius[j];
      const double squared = dot(apart, apart);
      Vector<D> on_i{};
      Spin<D> on_j_torque{};
      if (squared < touch * touch) {
        const double distance = std::sqrt(squared);
        const Vector<D> normal = (1 / distance) * apart;
        const auto kinematics = pair_kinematics(state, i, j, normal, distance, root_mass[k]);
        const ContactForce<D> f =
            contact<D, N, F, R, Cohesive>(input.constants, kinematics, input.dt, history + memory * k, lost);
        on_i = f.vector(normal);
        force_i = force_i + on_i;
        if constexpr (F != FrictionLaw::none || R != RollingLaw::none) {
          // The torque of the contact force about each centre has the same sense on both.
          const Spin<D> turn = f.torque(normal);
          const double half = 0.5 * kinematics.overlap;
          torque_i = torque_i + (ri - half) * turn + f.moment;
          on_j_torque = (radius[j] - half) * turn - f.moment;
        }
      } else {
        for (std::size_t h = 0; h < memory; ++h) history[memory * k + h] = 0;
      }
      if (j < end) {
        if (squared < touch * touch) {
          for (std::size_t c = 0; c < D; ++c) force[D * j + c] -= on_i[c];
          if constexpr (F != FrictionLaw::none || R != RollingLaw::none) add(torque, j, on_j_torque);
        }
      } else {
        for (std::size_t c = 0; c < D; ++c) slot[c] = -on_i[c];
        for (std::size_t c = 0; c < spin; ++c) slot[D + c] = on_j_torque[c];
        slot += D + spin;
      }
    }
    add(force, i, force_i);
    if constexpr (F != FrictionLaw::none || R != RollingLaw::none) add(torque, i, torque_i);
  }
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
