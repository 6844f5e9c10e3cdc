#include "dynamics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "block_motion.hpp"
#include "on_team.hpp"

namespace estuary::grains {
namespace {

template <int D>
ListSettings list_settings(const DynamicsSettings<D>& settings, double smallest, double largest) {
  (void)smallest;
  (void)largest;
  ListSettings list;
  list.skin = settings.skin;
  if (settings.lubrication.active()) {
    list.range = settings.lubrication.range_of_pair();
    list.plane_range = settings.lubrication.range_at_plane();
  }
  if (settings.bond_law.active) list.range = std::max(list.range, settings.bond_law.distance);
  list.history_size = history_size_of<D>(settings.law);
  std::size_t next = 0;
  if (settings.law.friction == FrictionLaw::spring)
    for (int c = 0; c < spin_components<D>; ++c) list.turned_sign[next++] = D == 2 ? 1 : -1;
  if (settings.law.rolling == RollingLaw::spring)
    for (int c = 0; c < spin_components<D>; ++c) list.turned_sign[next++] = -1;  // the pivoting angle stays
  return list;
}

// Turns the nodes about the pivot through spin x dt (Rodrigues); the longest way of a node.
template <int D>
double turn_nodes(Wall<D>& wall, double dt) {
  const double rate = norm(wall.spin), sine = std::sin(rate * dt), versine = 1 - std::cos(rate * dt);
  if (rate == 0) return 0;
  const Spin<D> axis = (1 / rate) * wall.spin;
  double longest = 0;
  for (std::size_t k = 0; k < wall.node.size() / D; ++k) {
    const Vector<D> across = spin_times_arm(axis, load<D>(wall.node.data(), k) - wall.pivot);
    add(wall.node.data(), k, sine * across + versine * spin_times_arm(axis, across));
    longest = std::max(longest, norm(across));
  }
  return longest * rate * dt;
}

}  // namespace

template <int D>
Dynamics<D>::Dynamics(DynamicsSettings<D> settings, const InitialGrains<D>& grains,
                      std::vector<Wall<D>> walls)
    : settings_(std::move(settings)), walls_(std::move(walls)) {
  const std::size_t n = grains.size();
  constexpr std::size_t d = D, s = spin_components<D>;
  state_.position = grains.position;
  state_.velocity = grains.velocity;
  state_.spin = grains.spin;
  state_.radius = grains.radius;
  state_.force.assign(d * n, 0.0);
  state_.external_force.assign(d * n, 0.0);
  state_.wrapped.assign(d * n, 0.0);
  state_.torque.assign(s * n, 0.0);
  state_.external_torque.assign(s * n, 0.0);
  state_.inverse_mass.resize(n);
  state_.inverse_inertia.resize(n);
  state_.identity.resize(n);
  double largest = 0;
  smallest_radius_ = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < n; ++i) {
    const bool held = !grains.held.empty() && grains.held[i];
    state_.inverse_mass[i] = held ? 0 : 1 / grains.mass[i];
    state_.inverse_inertia[i] = held ? 0 : 1 / grains.inertia[i];
    state_.identity[i] = static_cast<std::uint32_t>(i);
    smallest_radius_ = std::min(smallest_radius_, grains.radius[i]);
    largest = std::max(largest, grains.radius[i]);
    for (std::size_t c = 0; c < d; ++c)
      if (!held) state_.external_force[d * i + c] = grains.mass[i] * settings_.gravity[c];
  }
  state_.wall_travel.assign(d * walls_.size(), 0.0);
  for (Wall<D>& wall : walls_) {
    wall.node_velocity.assign(wall.node.size(), 0.0);
    link_facets(wall);
    wall_target_.emplace_back();
    node_force_.emplace_back(wall.node.size(), 0.0);
  }
  list_ = list_settings(settings_, smallest_radius_, largest);
  law_ = law_functions<D>(settings_.law);
  input_.constants = settings_.constants;
  for (std::uint32_t code = 0; code < kImages<D>; ++code) input_.shift[code] = settings_.domain.shift(code);
  rebuild();
  if (settings_.bond_law.active) bonds_ = make_bonds(settings_.bond_law, settings_.domain, state_);
  evaluate(0.0);
  begin_audit();
}

template <int D>
void Dynamics<D>::begin_audit() {
  state_.ledger = {};
  state_.external_work = 0;
  state_.bond_loss = 0;
  energy_at_start_ = energies().total();
}

template <int D>
void Dynamics<D>::set_external(std::span<const double> force, std::span<const double> torque) {
  constexpr std::size_t d = D, s = spin_components<D>;
  external_torque_ = !torque.empty();
  for (std::size_t i = 0; i < state_.size(); ++i) {
    const std::size_t k = state_.identity[i];
    const double mass = state_.inverse_mass[i] > 0 ? 1 / state_.inverse_mass[i] : 0;
    for (std::size_t c = 0; c < d; ++c) {
      const double before = state_.external_force[d * i + c];
      state_.external_force[d * i + c] = force[d * k + c] + mass * settings_.gravity[c];
      // The forces of the last evaluation, which the next half kick uses, hold the former ones.
      state_.force[d * i + c] += state_.external_force[d * i + c] - before;
    }
    for (std::size_t c = 0; c < s && external_torque_; ++c) {
      const double before = state_.external_torque[s * i + c];
      state_.external_torque[s * i + c] = torque[s * k + c];
      state_.torque[s * i + c] += state_.external_torque[s * i + c] - before;
    }
  }
}

template <int D>
void Dynamics<D>::set_wall_target(std::size_t wall, std::span<const double> target) {
  wall_target_[wall].assign(target.begin(), target.end());
}

template <int D>
void Dynamics<D>::check_finite() const {
  for (std::size_t i = 0; i < state_.size(); ++i)
    for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
      if (!std::isfinite(state_.position[D * i + c]) || !std::isfinite(state_.velocity[D * i + c]))
        throw Breakdown(state_.identity[i], "position or velocity is not finite");
}

template <int D>
void Dynamics<D>::name_pair_that_goes_through(double dt) const {
  check_finite();
  for (std::size_t i = 0; i < state_.size(); ++i)
    for (std::size_t k = state_.row_start[i]; k < state_.row_start[i + 1]; ++k) {
      const std::size_t j = state_.partner[k];
      const Vector<D> apart = load<D>(state_.position.data(), j) + input_.shift[state_.image[k]] -
                              load<D>(state_.position.data(), i);
      const Vector<D> velocity = load<D>(state_.velocity.data(), j) - load<D>(state_.velocity.data(), i);
      const double squared = dot(apart, apart), reach = state_.radius[i] + state_.radius[j];
      if (squared >= reach * reach || !goes_through<D>(apart, squared, reach, velocity, dt)) continue;
      throw Breakdown(
          std::min(state_.identity[i], state_.identity[j]),
          fmt::format("goes through grain {} at {:.3g} m/s", std::max(state_.identity[i], state_.identity[j]),
                      norm(velocity)),
          "the contact is too soft for that speed: raise normal_stiffness (Hertz: young_modulus); "
          "or use more steps_per_contact, or less "
          "overlap at the start");
    }
  throw std::logic_error("no grain goes through another");
}

template <int D>
void Dynamics<D>::name_grain_behind(std::size_t wall_contact) const {
  const WallContact& contact = state_.wall_contact[wall_contact];
  throw Breakdown(
      state_.identity[contact.grain],
      fmt::format("comes at the wall '{}' from behind", walls_[contact.wall].name),
      "a polyline holds grains on the left of its segments, walked from node to node: give its nodes "
      "in the other order, or a closed line around its thickness");
}

template <int D>
void Dynamics<D>::after_rebuild() {
  prepare_cross_forces(state_, cross_);
  const std::size_t blocks = block_count(state_.size());
  first_wall_contact_.assign(blocks + 1, 0);
  for (const WallContact& contact : state_.wall_contact)
    ++first_wall_contact_[contact.grain / kBlockSize + 1];
  for (std::size_t b = 0; b < blocks; ++b) first_wall_contact_[b + 1] += first_wall_contact_[b];
  wall_force_.assign(state_.wall_contact.size(), Vector<D>{});
  block_ledger_.resize(blocks);
  block_work_.resize(blocks);
  block_through_.resize(blocks);
  block_behind_.resize(blocks);
  block_displacement_.resize(blocks);
}

template <int D>
void Dynamics<D>::rebuild() {
  check_finite();
  rebuild_list(settings_.domain, list_, state_, origin_);
  rebuild_wall_contacts(walls_, list_, origin_, state_);
  renumber(bonds_, origin_);
  for (auto* derivatives : {&gear_position_, &gear_angle_})
    for (auto& values : *derivatives) {
      const std::size_t per_grain = values.size() / std::max<std::size_t>(1, state_.size());
      const std::vector<double> old = values;
      for (std::size_t i = 0; i < origin_.size(); ++i)
        for (std::size_t c = 0; c < per_grain; ++c)
          values[per_grain * i + c] = old[per_grain * origin_[i] + c];
    }
  after_rebuild();
  state_.wall_moved = 0;
  ++rebuilds_;
}

template <int D>
void Dynamics<D>::rebuild_if_due(double displacement_squared) {
  const double displacement = std::sqrt(displacement_squared);
  // Also when it is not a number.
  if (std::max(2 * displacement, displacement + state_.wall_moved) <= settings_.skin) return;
  const bool jumped = displacement > settings_.skin + smallest_radius_;
  if (jumped) {
    check_finite();
    std::size_t worst = 0;
    double most = 0;
    for (std::size_t i = 0; i < state_.size(); ++i) {
      const double way =
          norm(load<D>(state_.position.data(), i) - load<D>(state_.reference_position.data(), i));
      if (way > most) {
        most = way;
        worst = i;
      }
    }
    throw Breakdown(state_.identity[worst], "moved " + std::to_string(most / smallest_radius_) +
                                                " radii of the smallest grain in one step");
  }
  rebuild();
}

template <int D>
void Dynamics<D>::move_walls(double dt) {
  double moved = 0;
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    Wall<D>& wall = walls_[w];
    double way = 0;
    if (wall_spin && !wall.is_plane()) {
      wall.spin = wall_spin(w, state_.time - 0.5 * dt);
      way = turn_nodes(wall, dt);
    }
    if (wall_velocity) {
      wall.velocity = wall_velocity(w, state_.time - 0.5 * dt);
      const Vector<D> step = dt * wall.velocity;
      wall.point = wall.point + step;
      wall.pivot = wall.pivot + step;
      for (std::size_t k = 0; k < wall.node.size(); ++k) wall.node[k] += step[k % D];
      add(state_.wall_travel.data(), w, step);
      way += norm(step);
    }
    moved = std::max(moved, way);
    if constexpr (D == 2)
      for (std::size_t k = 0; k + 1 < wall.node.size(); k += 2) {
        for (std::size_t c = 0; c < 2; ++c) wall.node[k + c] += dt * wall.node_velocity[k + c];
        moved = std::max(moved, dt * std::hypot(wall.node_velocity[k], wall.node_velocity[k + 1]));
      }
  }
  state_.wall_moved += moved;
}

template <int D>
void Dynamics<D>::gather(std::size_t b) {
  constexpr std::size_t width = D + spin_components<D>;
  for (std::size_t k = cross_.incoming_start[b]; k < cross_.incoming_start[b + 1]; ++k) {
    const std::size_t j = cross_.incoming_grain[k];
    const double* value = cross_.value.data() + width * cross_.incoming_slot[k];
    for (std::size_t c = 0; c < D; ++c) state_.force[D * j + c] += value[c];
    for (std::size_t c = 0; c < spin_components<D>; ++c)
      state_.torque[spin_components<D> * j + c] += value[D + c];
  }
}

// Pair and wall forces by block, then bonds; forces that cross blocks wait in their slots for `gather`.
template <int D>
void Dynamics<D>::evaluate(double dt) {
  input_.dt = dt;
  input_.lag = settings_.integrator == Integrator::verlet ? 0.5 * dt : 0;
  const std::size_t n = state_.size(), blocks = block_count(n);
  constexpr std::size_t s = spin_components<D>;
  // Stretches and angles move on with the step; energies are summed in the order of the blocks.
  on_team(blocks >= kParallelBlocks, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t b = 0; b < blocks; ++b) {
      const std::size_t begin = block_begin(b), end = block_end(b, n);
      std::copy(state_.external_force.begin() + static_cast<std::ptrdiff_t>(D * begin),
                state_.external_force.begin() + static_cast<std::ptrdiff_t>(D * end),
                state_.force.begin() + static_cast<std::ptrdiff_t>(D * begin));
      std::copy(state_.external_torque.begin() + static_cast<std::ptrdiff_t>(s * begin),
                state_.external_torque.begin() + static_cast<std::ptrdiff_t>(s * end),
                state_.torque.begin() + static_cast<std::ptrdiff_t>(s * begin));
      block_ledger_[b] = {};
      block_through_[b] = law_.sweep_pairs(input_, b, state_, cross_, block_ledger_[b]) ? 1 : 0;
      if (settings_.lubrication.active())
        sweep_lubrication(settings_.lubrication, input_, b, state_, cross_, block_ledger_[b]);
      block_behind_[b] = kNoWallContact;
      if (first_wall_contact_[b] == first_wall_contact_[b + 1]) continue;
      block_behind_[b] = sweep_walls(law_, dt, input_.lag, walls_, b, first_wall_contact_, state_,
                                     wall_force_, block_ledger_[b]);
      if (settings_.lubrication.active())
        sweep_plane_lubrication(settings_.lubrication, dt, input_.lag, walls_, b, first_wall_contact_, state_,
                                wall_force_, block_ledger_[b]);
    }
  });
  for (std::size_t b = 0; b < blocks; ++b) state_.ledger += block_ledger_[b];
  for (const std::uint8_t through : block_through_)
    if (through != 0) name_pair_that_goes_through(dt);
  for (const std::size_t behind : block_behind_)
    if (behind != kNoWallContact) name_grain_behind(behind);
  if (bonds_.size() > 0)
    state_.ledger.normal +=
        add_bond_forces(settings_.bond_law, settings_.domain, dt, bonds_, state_, state_.bond_loss);
}

template <int D>
double Dynamics<D>::update(double kick, double drift, bool gather_first, double dt) {
  const std::size_t n = state_.size(), blocks = block_count(n);
  on_team(blocks >= kParallelBlocks, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t b = 0; b < blocks; ++b) {
      if (gather_first) gather(b);
      const std::size_t begin = block_begin(b), end = block_end(b, n);
      const BlockMotion motion = move_block(kick, drift, begin, end, state_);
      block_displacement_[b] = motion.displacement_squared;
      double work = motion.work;
      constexpr std::size_t s = spin_components<D>;
      if (external_torque_)
        for (std::size_t k = s * begin; k < s * end; ++k) work += state_.external_torque[k] * state_.spin[k];
      block_work_[b] = work * drift;
      block_ledger_[b] = {};
      // A grain that moves as prescribed gives what the others do on it.
      double given = 0;
      for (std::size_t i = begin; i < end; ++i) {
        if (state_.inverse_mass[i] != 0) continue;
        for (std::size_t c = 0; c < D; ++c) given -= state_.force[D * i + c] * state_.velocity[D * i + c];
        for (std::size_t c = 0; c < s; ++c) given -= state_.torque[s * i + c] * state_.spin[s * i + c];
      }
      block_ledger_[b].given = given * dt;
    }
  });
  double worst = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    if (!std::isnan(worst) && !(block_displacement_[b] <= worst)) worst = block_displacement_[b];
    state_.external_work += block_work_[b];
    state_.ledger.given += block_ledger_[b].given;
  }
  return worst;
}

template <int D>
void Dynamics<D>::advance_verlet(double dt, std::uint64_t steps, const StepMonitor& monitor) {
  // The half kicks at the end of one step and at the start of the next are one.
  for (std::uint64_t step = 0; step < steps; ++step) {
    const double displacement = update(step == 0 ? 0.5 * dt : dt, dt, step > 0, dt);
    state_.time += dt;
    if (!walls_.empty()) move_walls(dt);
    rebuild_if_due(displacement);
    evaluate(dt);
    if constexpr (D == 2) add_node_forces(walls_, state_, wall_force_, dt, node_force_);
    if (monitor) monitor(step + 1);
  }
  update(0.5 * dt, 0.0, true, 0.0);
}

template <int D>
void Dynamics<D>::advance(double duration, std::uint64_t steps, const StepMonitor& monitor) {
  if (steps == 0) return;
  const double dt = duration / static_cast<double>(steps);
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    std::fill(node_force_[w].begin(), node_force_[w].end(), 0.0);
    for (std::size_t k = 0; k < wall_target_[w].size(); ++k)
      walls_[w].node_velocity[k] = (wall_target_[w][k] - walls_[w].node[k]) / duration;
  }
  if (settings_.integrator == Integrator::verlet)
    advance_verlet(dt, steps, monitor);
  else
    advance_gear(dt, steps, monitor);
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    for (double& force : node_force_[w]) force /= duration;
    // No drift of rounding errors.
    if (!wall_target_[w].empty() && !wall_velocity && !wall_spin) walls_[w].node = wall_target_[w];
  }
  check_finite();
}

template <int D>
Energies Dynamics<D>::energies() const {
  Energies energies;
  for (std::size_t i = 0; i < state_.size(); ++i) {
    if (state_.inverse_mass[i] == 0) continue;
    const auto v = load<D>(state_.velocity.data(), i);
    const auto w = load<spin_components<D>>(state_.spin.data(), i);
    energies.translation += 0.5 * dot(v, v) / state_.inverse_mass[i];
    energies.rotation += 0.5 * dot(w, w) / state_.inverse_inertia[i];
  }
  for (const auto& record : contacts()) energies.contacts += record.energy;
  energies.bonds = bond_energy(settings_.bond_law, settings_.domain, bonds_, state_);
  return energies;
}

template <int D>
double Dynamics<D>::energy_error() const {
  const double now = energies().total();
  const double came = state_.external_work + state_.ledger.given;
  const double left = state_.ledger.dissipated() + state_.bond_loss;
  const double scale = std::max({std::abs(energy_at_start_), std::abs(now), std::abs(state_.external_work),
                                 std::abs(state_.ledger.given), std::abs(left)});
  return scale > 0 ? (now + left - came - energy_at_start_) / scale : 0;
}

template <int D>
std::vector<ContactRecord<D>> Dynamics<D>::contacts() const {
  return measure_contacts(law_, input_, walls_, state_);
}

template <int D>
Vector<D> Dynamics<D>::wall_force(std::size_t wall) const {
  Vector<D> sum{};
  for (std::size_t n = 0; n < state_.wall_contact.size(); ++n)
    if (state_.wall_contact[n].wall == wall) sum = sum + wall_force_[n];
  return sum;
}

template <int D>
Spin<D> Dynamics<D>::wall_torque(std::size_t wall) const {
  Spin<D> sum{};
  for (const ContactRecord<D>& record : contacts()) {
    if (!record.with_wall || record.j != wall) continue;
    const Vector<D> at = load<D>(state_.position.data(), record.i) + record.branch;
    // A rolling resistance is felt too.
    sum = sum - arm_times_force(at - walls_[wall].pivot, record.force.vector(record.kinematics.normal)) -
          record.force.moment;
  }
  if (!settings_.lubrication.active() || !walls_[wall].is_plane()) return sum;
  for (const WallContact& contact : state_.wall_contact) {
    if (contact.wall != wall) continue;
    const Vector<D> x = load<D>(state_.position.data(), contact.grain);
    // A film pushes along the normal through the grain's centre.
    sum = sum - arm_times_force(x - walls_[wall].pivot,
                                plane_film_force(settings_.lubrication, walls_[wall], state_, contact.grain));
  }
  return sum;
}

template <int D>
void Dynamics<D>::restore(const Snapshot& snapshot) {
  state_ = snapshot.state;
  bonds_ = snapshot.bonds;
  walls_ = snapshot.walls;
  after_rebuild();
  gear_position_ = snapshot.gear_position;
  gear_angle_ = snapshot.gear_angle;
}

template class Dynamics<2>;
template class Dynamics<3>;

}  // namespace estuary::grains
