#include "lubrication.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace estuary::grains {

template <int D>
void sweep_lubrication(const Lubrication& lubrication, const SweepInput<D>& input, std::size_t block,
                       State<D>& state, CrossForces<D>& cross, EnergyLedger& ledger) {
  constexpr std::size_t spin = spin_components<D>;
  constexpr double pi = std::numbers::pi;
  const std::size_t begin = block_begin(block), end = block_end(block, state.size());
  double* slot = cross.value.data() + cross.first_slot[block] * (D + spin);
  const double cutoff = lubrication.cutoff;
  for (std::size_t i = begin; i < end; ++i)
    for (std::size_t k = state.row_start[i]; k < state.row_start[i + 1]; ++k) {
      const std::size_t j = state.partner[k];
      const Vector<D> apart =
          load<D>(state.position.data(), j) + input.shift[state.image[k]] - load<D>(state.position.data(), i);
      const double ri = state.radius[i] - lubrication.margin, rj = state.radius[j] - lubrication.margin;
      const double distance = norm(apart);
      Vector<D> on_i{};
      if (distance - ri - rj < cutoff) {
        const double gap = std::max(distance - ri - rj, lubrication.minimum_gap);
        const Vector<D> normal = (1 / distance) * apart;
        const double separating =
            dot(load<D>(state.velocity.data(), j) - load<D>(state.velocity.data(), i), normal);
        const double reduced = ri * rj / (ri + rj);
        double resistance = 0;
        if constexpr (D == 2) {
          resistance = 3 * std::numbers::sqrt2 * pi * lubrication.viscosity *
                       (std::pow(reduced / gap, 1.5) - std::pow(reduced / cutoff, 1.5));
        } else {
          resistance = 6 * pi * lubrication.viscosity * reduced * reduced * (1 / gap - 1 / cutoff);
        }
        on_i = (resistance * separating) * normal;
        ledger.normal += resistance * separating * separating * input.dt;
        add(state.force.data(), i, on_i);
      }
      if (j < end) {
        add(state.force.data(), j, -1.0 * on_i);
      } else {
        for (std::size_t c = 0; c < D; ++c) slot[c] -= on_i[c];
        slot += D + spin;
      }
    }
}

template void sweep_lubrication(const Lubrication&, const SweepInput<2>&, std::size_t, State<2>&,
                                CrossForces<2>&, EnergyLedger&);
template void sweep_lubrication(const Lubrication&, const SweepInput<3>&, std::size_t, State<3>&,
                                CrossForces<3>&, EnergyLedger&);

}  // namespace estuary::grains
