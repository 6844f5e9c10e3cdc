#include "contact_forces.hpp"

#include <algorithm>
#include <stdexcept>

#include "pair_sweep.hpp"

namespace estuary::grains {

template <>
LawFunctions<2> by_friction<2, NormalLaw::linear>(const LawChoice&);
template <>
LawFunctions<3> by_friction<3, NormalLaw::linear>(const LawChoice&);
template <>
LawFunctions<3> by_friction<3, NormalLaw::hertz>(const LawChoice&);

template <int D>
LawFunctions<D> law_functions(const LawChoice& choice) {
  if constexpr (D == 3)
    if (choice.normal == NormalLaw::hertz) return by_friction<3, NormalLaw::hertz>(choice);
  if (choice.normal == NormalLaw::hertz)
    throw std::invalid_argument("the Hertz law is for spheres: discs have no such force law");
  return by_friction<D, NormalLaw::linear>(choice);
}

namespace {

// False when they do not touch.
template <int D>
bool wall_kinematics(const Wall<D>& wall, const WallContact& contact, const State<D>& state,
                     ContactKinematics<D>& k, NearestPoint<D>& nearest) {
  const std::size_t i = contact.grain;
  const double r = state.radius[i];
  nearest = nearest_point(wall, contact.element, load<D>(state.position.data(), i));
  if (!nearest.near || nearest.distance >= r) return false;
  // A grain whose centre is a radius behind a thin wall belongs to its other side.
  if (!wall.is_plane() && nearest.distance <= -r) return false;
  k.normal = nearest.normal;
  k.overlap = r - nearest.distance;
  k.spin = load<spin_components<D>>(state.spin.data(), i);
  split_velocity(k, nearest.velocity - load<D>(state.velocity.data(), i), (r - k.overlap) * k.spin);
  k.radius_sum = 2 * r;
  k.reduced_radius = r;
  k.root_mass = std::sqrt(1 / state.inverse_mass[i]);
  return true;
}

}  // namespace

template <int D>
void sweep_walls(const LawFunctions<D>& law, double dt, const std::vector<Wall<D>>& walls, std::size_t block,
                 const std::vector<std::uint32_t>& first_contact, State<D>& state,
                 std::vector<Vector<D>>& wall_force, EnergyLedger& ledger) {
  const std::size_t memory =
      (state.wall_history.size() - 8) / std::max<std::size_t>(1, state.wall_contact.size());
  for (std::size_t n = first_contact[block]; n < first_contact[block + 1]; ++n) {
    const WallContact& contact = state.wall_contact[n];
    const Wall<D>& wall = walls[contact.wall];
    ContactKinematics<D> k;
    NearestPoint<D> nearest;
    double* history = state.wall_history.data() + memory * n;
    wall_force[n] = {};
    if (!wall_kinematics(wall, contact, state, k, nearest)) {
      std::fill_n(history, memory, 0.0);
      continue;
    }
    const ContactForce<D> f = law.contact(wall.constants, k, dt, history, ledger);
    const Vector<D> force = f.vector(k.normal);
    ledger.given += dot(force, nearest.velocity) * dt;
    add(state.force.data(), contact.grain, force);
    add(state.torque.data(), contact.grain,
        (state.radius[contact.grain] - k.overlap) * f.torque(k.normal) + f.moment);
    wall_force[n] = -1.0 * force;
  }
}

template <int D>
std::vector<ContactRecord<D>> measure_contacts(const LawFunctions<D>& law, const SweepInput<D>& input,
                                               const std::vector<Wall<D>>& walls, const State<D>& state) {
  std::vector<ContactRecord<D>> records;
  EnergyLedger unused;
  std::array<double, 8> history{};
  const std::size_t pairs = state.partner.size();
  const std::size_t memory = pairs == 0 ? 0 : (state.history.size() - 8) / pairs;
  const auto measure = [&](ContactRecord<D>& record, const ContactConstants& constants,
                           const double* remembered, std::size_t count) {
    std::copy_n(remembered, count, history.begin());
    record.force = law.contact(constants, record.kinematics, 0.0, history.data(), unused);
    record.energy = law.stored_energy(constants, record.kinematics, remembered);
    records.push_back(record);
  };
  for (std::size_t i = 0; i < state.size(); ++i)
    for (std::size_t k = state.row_start[i]; k < state.row_start[i + 1]; ++k) {
      const std::size_t j = state.partner[k];
      ContactRecord<D> record;
      record.branch =
          load<D>(state.position.data(), j) + input.shift[state.image[k]] - load<D>(state.position.data(), i);
      const double distance = norm(record.branch);
      if (distance >= state.radius[i] + state.radius[j]) continue;
      record.i = static_cast<std::uint32_t>(i);
      record.j = static_cast<std::uint32_t>(j);
      record.kinematics =
          pair_kinematics(state, i, j, (1 / distance) * record.branch, distance, state.root_mass[k]);
      measure(record, input.constants, state.history.data() + memory * k, memory);
    }
  const std::size_t wall_memory =
      state.wall_contact.empty() ? 0 : (state.wall_history.size() - 8) / state.wall_contact.size();
  for (std::size_t n = 0; n < state.wall_contact.size(); ++n) {
    const WallContact& contact = state.wall_contact[n];
    ContactRecord<D> record;
    NearestPoint<D> nearest;
    if (!wall_kinematics(walls[contact.wall], contact, state, record.kinematics, nearest)) continue;
    record.i = contact.grain;
    record.j = contact.wall;
    record.with_wall = true;
    record.branch = nearest.distance * nearest.normal;
    measure(record, walls[contact.wall].constants, state.wall_history.data() + wall_memory * n, wall_memory);
  }
  return records;
}

template LawFunctions<2> law_functions<2>(const LawChoice&);
template LawFunctions<3> law_functions<3>(const LawChoice&);
template void sweep_walls(const LawFunctions<2>&, double, const std::vector<Wall<2>>&, std::size_t,
                          const std::vector<std::uint32_t>&, State<2>&, std::vector<Vector<2>>&,
                          EnergyLedger&);
template void sweep_walls(const LawFunctions<3>&, double, const std::vector<Wall<3>>&, std::size_t,
                          const std::vector<std::uint32_t>&, State<3>&, std::vector<Vector<3>>&,
                          EnergyLedger&);
template std::vector<ContactRecord<2>> measure_contacts(const LawFunctions<2>&, const SweepInput<2>&,
                                                        const std::vector<Wall<2>>&, const State<2>&);
template std::vector<ContactRecord<3>> measure_contacts(const LawFunctions<3>&, const SweepInput<3>&,
                                                        const std::vector<Wall<3>>&, const State<3>&);

}  // namespace estuary::grains
