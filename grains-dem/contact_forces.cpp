#include "contact_forces.hpp"

#include <algorithm>
#include <cmath>
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

template <int D>
WallTouch<D> touch_plane(const Wall<D>& wall, const Vector<D>& x, double r) {
  return {-1.0 * wall.normal, r - dot(x - wall.point, wall.normal), wall.velocity, 0};
}

template <int D>
ContactKinematics<D> wall_kinematics(const WallTouch<D>& touch, const Spin<D>& wall_spin,
                                     const State<D>& state, std::size_t i, double lag) {
  const double r = state.radius[i];
  const Spin<D> spin = load<spin_components<D>>(state.spin.data(), i);
  ContactKinematics<D> k;
  k.normal = touch.normal;
  k.overlap = touch.overlap;
  k.spin = spin - wall_spin;
  split_velocity(k, touch.velocity - load<D>(state.velocity.data(), i), (r - k.overlap) * spin);
  k.radius_sum = 2 * r;
  k.reduced_radius = r;
  k.root_mass = std::sqrt(1 / state.inverse_mass[i]);
  k.slowing = lag * state.inverse_mass[i];
  return k;
}

template <int D>
std::size_t wall_memory(const State<D>& state) {
  return state.wall_contact.empty() ? 0 : (state.wall_history.size() - 8) / state.wall_contact.size();
}

template <int D>
std::array<std::uint32_t, kWallContacts> known_elements(const State<D>& state, std::size_t n) {
  std::array<std::uint32_t, kWallContacts> elements{};
  for (std::size_t k = 0; k < kWallContacts; ++k) elements[k] = state.wall_contact[n + k].element;
  return elements;
}

template <int D>
std::span<const std::uint32_t> near_facets(const State<D>& state, std::size_t n) {
  const WallContact& contact = state.wall_contact[n];
  return {state.wall_facet.data() + contact.near_begin, contact.near_end - contact.near_begin};
}

// What the contacts of one polyline or mesh remember goes with the pieces; of two that became one it is
// added.
template <int D>
void carry_history(const FacetTouches<D>& touches, std::size_t memory, double* history) {
  for (std::size_t k = 0; k < kWallContacts; ++k) {
    const std::size_t now = touches.now[k];
    if (now == k) continue;
    for (std::size_t h = 0; h < memory; ++h) {
      if (now < kWallContacts) history[memory * now + h] += history[memory * k + h];
      history[memory * k + h] = 0;
    }
  }
}

// Calls `use` with every wall contact from `begin` to `end` and how its grain touches; before those of a
// polyline or mesh, which come together, `found` with the first of them and all its touches.
template <int D, class Found, class Use>
void for_each_touch(const std::vector<Wall<D>>& walls, const State<D>& state, std::size_t begin,
                    std::size_t end, const Found& found, const Use& use) {
  for (std::size_t n = begin; n < end;) {
    const std::size_t i = state.wall_contact[n].grain;
    const Wall<D>& wall = walls[state.wall_contact[n].wall];
    const Vector<D> x = load<D>(state.position.data(), i);
    if (!wall.is_plane()) {
      const FacetTouches<D> touches =
          find_touches(wall, near_facets(state, n), x, state.radius[i], known_elements(state, n));
      found(n, touches);
      for (const WallTouch<D>& touch : touches.slot) use(n++, touch);
      continue;
    }
    use(n++, touch_plane(wall, x, state.radius[i]));
  }
}

// A touch that begins with the centre behind the line, and by far: one that went through from the grains'
// side was felt before, and is pushed back.
template <int D>
bool comes_from_behind(const Wall<D>& wall, const WallTouch<D>& touch, double radius) {
  return D == 2 && !wall.is_plane() && touch.overlap > 1.5 * radius;
}

}  // namespace

template <int D>
std::size_t sweep_walls(const LawFunctions<D>& law, double dt, double lag, const std::vector<Wall<D>>& walls,
                        std::size_t block, const std::vector<std::uint32_t>& first_contact, State<D>& state,
                        std::vector<Vector<D>>& wall_force, EnergyLedger& ledger) {
  const std::size_t memory = wall_memory(state);
  std::size_t from_behind = kNoWallContact;
  const auto push = [&](std::size_t n, const WallTouch<D>& touch) {
    WallContact& contact = state.wall_contact[n];
    double* history = state.wall_history.data() + memory * n;
    wall_force[n] = {};
    const bool begins = contact.element == kNoElement;
    contact.element = touch.overlap > 0 ? touch.element : kNoElement;
    if (begins && comes_from_behind(walls[contact.wall], touch, state.radius[contact.grain])) from_behind = n;
    if (!(touch.overlap > 0)) {
      std::fill_n(history, memory, 0.0);
      return;
    }
    const Wall<D>& wall = walls[contact.wall];
    const ContactKinematics<D> k = wall_kinematics(touch, wall.spin, state, contact.grain, lag);
    const ContactForce<D> f = law.contact(wall.constants, k, dt, history, ledger);
    const Vector<D> force = f.vector(k.normal);
    ledger.given += (dot(force, touch.velocity) + dot(f.moment, wall.spin)) * dt;
    add(state.force.data(), contact.grain, force);
    add(state.torque.data(), contact.grain,
        (state.radius[contact.grain] - k.overlap) * f.torque(k.normal) + f.moment);
    wall_force[n] = -1.0 * force;
  };
  const auto carry = [&](std::size_t n, const FacetTouches<D>& touches) {
    carry_history(touches, memory, state.wall_history.data() + memory * n);
  };
  for_each_touch(walls, state, first_contact[block], first_contact[block + 1], carry, push);
  return from_behind;
}

void add_node_forces(const std::vector<Wall<2>>& walls, const State<2>& state,
                     const std::vector<Vector<2>>& wall_force, double dt,
                     std::vector<std::vector<double>>& node_force) {
  for (std::size_t n = 0; n < state.wall_contact.size(); ++n) {
    const WallContact& contact = state.wall_contact[n];
    if (contact.element == kNoElement || walls[contact.wall].is_plane()) continue;
    share_between_nodes(walls[contact.wall], near_facets(state, n),
                        load<2>(state.position.data(), contact.grain), state.radius[contact.grain],
                        contact.element, dt * wall_force[n], node_force[contact.wall]);
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
  const auto measure = [&](ContactRecord<D>& record, const ContactConstants& constants, const double* stored,
                           std::size_t count) {
    std::copy_n(stored, count, history.begin());
    record.force = law.contact(constants, record.kinematics, 0.0, history.data(), unused);
    record.energy = law.stored_energy(constants, record.kinematics, stored);
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
      record.kinematics = pair_kinematics(grain_pair(state, i, j, state.root_mass[k]),
                                          (1 / distance) * record.branch, distance, 0.0);
      measure(record, input.constants, state.history.data() + memory * k, memory);
    }
  const std::size_t remembered = wall_memory(state);
  const auto note = [&](std::size_t n, const WallTouch<D>& touch) {
    if (!(touch.overlap > 0)) return;
    const WallContact& contact = state.wall_contact[n];
    ContactRecord<D> record;
    record.kinematics = wall_kinematics(touch, walls[contact.wall].spin, state, contact.grain, 0.0);
    record.i = contact.grain;
    record.j = contact.wall;
    record.with_wall = true;
    record.branch = (state.radius[contact.grain] - touch.overlap) * touch.normal;
    measure(record, walls[contact.wall].constants, state.wall_history.data() + remembered * n, remembered);
  };
  for_each_touch(
      walls, state, 0, state.wall_contact.size(), [](std::size_t, const FacetTouches<D>&) {}, note);
  return records;
}

template LawFunctions<2> law_functions<2>(const LawChoice&);
template LawFunctions<3> law_functions<3>(const LawChoice&);
template std::size_t sweep_walls(const LawFunctions<2>&, double, double, const std::vector<Wall<2>>&,
                                 std::size_t, const std::vector<std::uint32_t>&, State<2>&,
                                 std::vector<Vector<2>>&, EnergyLedger&);
template std::size_t sweep_walls(const LawFunctions<3>&, double, double, const std::vector<Wall<3>>&,
                                 std::size_t, const std::vector<std::uint32_t>&, State<3>&,
                                 std::vector<Vector<3>>&, EnergyLedger&);
template std::vector<ContactRecord<2>> measure_contacts(const LawFunctions<2>&, const SweepInput<2>&,
                                                        const std::vector<Wall<2>>&, const State<2>&);
template std::vector<ContactRecord<3>> measure_contacts(const LawFunctions<3>&, const SweepInput<3>&,
                                                        const std::vector<Wall<3>>&, const State<3>&);

}  // namespace estuary::grains
