#include "lubrication.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace estuary::grains {

template <int D>
double film_resistance(const Lubrication& lubrication, double reduced_radius, double gap) {
  constexpr double pi = std::numbers::pi;
  if (gap >= lubrication.cutoff) return 0;
  const double film = std::max(gap, lubrication.minimum_gap);
  if constexpr (D == 2)
    return 3 * std::numbers::sqrt2 * pi * lubrication.viscosity *
           (std::pow(reduced_radius / film, 1.5) - std::pow(reduced_radius / lubrication.cutoff, 1.5));
  else
    return 6 * pi * lubrication.viscosity * reduced_radius * reduced_radius *
           (1 / film - 1 / lubrication.cutoff);
}

template <int D>
void sweep_lubrication(const Lubrication& lubrication, const SweepInput<D>& input, std::size_t block,
                       State<D>& state, CrossForces<D>& cross, EnergyLedger& ledger) {
  constexpr std::size_t spin = spin_components<D>;
  const std::size_t begin = block_begin(block), end = block_end(block, state.size());
  double* slot = cross.value.data() + cross.first_slot[block] * (D + spin);
  for (std::size_t i = begin; i < end; ++i)
    for (std::size_t k = state.row_start[i]; k < state.row_start[i + 1]; ++k) {
      const std::size_t j = state.partner[k];
      const Vector<D> apart =
          load<D>(state.position.data(), j) + input.shift[state.image[k]] - load<D>(state.position.data(), i);
      const double ri = state.radius[i] - lubrication.margin, rj = state.radius[j] - lubrication.margin;
      const double distance = norm(apart);
      Vector<D> on_i{};
      if (distance - ri - rj < lubrication.cutoff) {
        const Vector<D> normal = (1 / distance) * apart;
        const double separating =
            dot(load<D>(state.velocity.data(), j) - load<D>(state.velocity.data(), i), normal);
        const double resistance = film_resistance<D>(lubrication, ri * rj / (ri + rj), distance - ri - rj);
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

namespace {

template <int D>
double film_at_plane(const Lubrication& lubrication, const Wall<D>& wall, const State<D>& state,
                     std::size_t i) {
  const double r = state.radius[i] - lubrication.margin;
  const double height = dot(load<D>(state.position.data(), i) - wall.point, wall.normal);
  return film_resistance<D>(lubrication, r, height - r);
}

template <int D>
double separating_speed(const Wall<D>& wall, const State<D>& state, std::size_t i) {
  return dot(load<D>(state.velocity.data(), i) - wall.velocity, wall.normal);
}

}  // namespace

template <int D>
Vector<D> plane_film_force(const Lubrication& lubrication, const Wall<D>& wall, const State<D>& state,
                           std::size_t i) {
  return (-film_at_plane(lubrication, wall, state, i) * separating_speed(wall, state, i)) * wall.normal;
}

template <int D>
void sweep_plane_lubrication(const Lubrication& lubrication, double dt, double lag,
                             const std::vector<Wall<D>>& walls, std::size_t block,
                             const std::vector<std::uint32_t>& first_contact, State<D>& state,
                             std::vector<Vector<D>>& wall_force, EnergyLedger& ledger) {
  for (std::size_t n = first_contact[block]; n < first_contact[block + 1]; ++n) {
    const std::size_t i = state.wall_contact[n].grain;
    const Wall<D>& wall = walls[state.wall_contact[n].wall];
    if (!wall.is_plane()) continue;
    const double resistance = film_at_plane(lubrication, wall, state, i);
    const double separating = separating_speed(wall, state, i);
    const Vector<D> force = (-resistance * separating) * wall.normal;
    add(state.force.data(), i, force);
    wall_force[n] = wall_force[n] - force;
    // Velocities are `lag` older than positions; the work is that of the mean over the step. What presses the
    // grain against the film counts too: where they balance the velocity does not change.
    const double gained = lag * state.inverse_mass[i] * dot(load<D>(state.force.data(), i), wall.normal);
    ledger.normal += resistance * separating * (separating + gained) * dt;
    ledger.given += dot(force, wall.velocity) * dt;
  }
}

template double film_resistance<2>(const Lubrication&, double, double);
template double film_resistance<3>(const Lubrication&, double, double);
template void sweep_lubrication(const Lubrication&, const SweepInput<2>&, std::size_t, State<2>&,
                                CrossForces<2>&, EnergyLedger&);
template void sweep_lubrication(const Lubrication&, const SweepInput<3>&, std::size_t, State<3>&,
                                CrossForces<3>&, EnergyLedger&);
template Vector<2> plane_film_force(const Lubrication&, const Wall<2>&, const State<2>&, std::size_t);
template Vector<3> plane_film_force(const Lubrication&, const Wall<3>&, const State<3>&, std::size_t);
template void sweep_plane_lubrication(const Lubrication&, double, double, const std::vector<Wall<2>>&,
                                      std::size_t, const std::vector<std::uint32_t>&, State<2>&,
                                      std::vector<Vector<2>>&, EnergyLedger&);
template void sweep_plane_lubrication(const Lubrication&, double, double, const std::vector<Wall<3>>&,
                                      std::size_t, const std::vector<std::uint32_t>&, State<3>&,
                                      std::vector<Vector<3>>&, EnergyLedger&);

}  // namespace estuary::grains
