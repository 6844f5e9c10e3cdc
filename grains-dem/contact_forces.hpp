// Sweeps over the pairs and the wall contacts: each law is one compiled variant, chosen once.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "neighbours.hpp"
#include "state.hpp"
#include "walls.hpp"

namespace estuary::grains {

/// What a sweep reads besides the state.
template <int D>
struct SweepInput {
  ContactConstants constants;
  double dt = 0;
  double lag = 0;  // by which velocities are older than positions [s]
  std::array<Vector<D>, kImages<D>> shift{};
};

/// One touching contact, measured without moving its history on.
template <int D>
struct ContactRecord {
  std::uint32_t i = 0;
  std::uint32_t j = 0;  // the other grain, or the wall
  bool with_wall = false;
  ContactKinematics<D> kinematics{};
  ContactForce<D> force{};
  Vector<D> branch{};  // from the centre of i to that of j, or to the wall
  double energy = 0;   // stored [J]
};

template <int D>
struct LawFunctions {
  /// Forces of the pairs in rows of one block: added to its own grains, written to `cross` for others.
  /// Whether a touching pair went past each other in the last step, which no contact survives.
  bool (*sweep_pairs)(const SweepInput<D>&, std::size_t block, State<D>&, CrossForces<D>&,
                      EnergyLedger&) = nullptr;
  /// One contact, for walls and for measuring.
  ContactForce<D> (*contact)(const ContactConstants&, const ContactKinematics<D>&, double dt, double* history,
                             EnergyLedger&) = nullptr;
  double (*stored_energy)(const ContactConstants&, const ContactKinematics<D>&,
                          const double* history) = nullptr;
};

/// The compiled variant of `choice`. Throws std::invalid_argument for Hertz in the plane.
template <int D>
LawFunctions<D> law_functions(const LawChoice& choice);

/// What a contact has to know of its two grains.
template <int D>
struct GrainPair {
  double radius_i, radius_j;
  double root_mass;       // sqrt(m*)
  double inverse_masses;  // 1/m_i + 1/m_j
  Vector<D> velocity;     // of the centre of j relative to that of i
  Spin<D> spin_i, spin_j;
};

template <int D>
inline GrainPair<D> grain_pair(const State<D>& state, std::size_t i, std::size_t j, double root_mass) {
  return {state.radius[i],
          state.radius[j],
          root_mass,
          state.inverse_mass[i] + state.inverse_mass[j],
          load<D>(state.velocity.data(), j) - load<D>(state.velocity.data(), i),
          load<spin_components<D>>(state.spin.data(), i),
          load<spin_components<D>>(state.spin.data(), j)};
}

/// Whether one grain goes through another, which no contact survives: from then on its force drives them on.
/// In the step of `dt` that brought them here with `velocity` relative to each other, the line of their
/// centres, now `apart`, turned through more than a right angle; or they came nearer, and less than a
/// twentieth of the sum of their radii is left between the centres. The latter finds slow ones that miss each
/// other's centre by a little; beginning so near, grains fly apart.
template <int D>
inline bool goes_through(const Vector<D>& apart, double squared_distance, double radius_sum,
                         const Vector<D>& velocity, double dt) {
  const double turned = dt * dot(apart, velocity), near = 0.05 * radius_sum;
  const double came_nearer = 0.5 * dt * dt * dot(velocity, velocity) - turned;
  return squared_distance < (came_nearer > 0 ? std::max(turned, near * near) : turned);
}

/// Kinematics of a pair at distance `distance` along `normal`; the overlap is shared by both arms, so that
/// the forces turn both grains without changing the total angular momentum.
template <int D>
inline ContactKinematics<D> pair_kinematics(const GrainPair<D>& pair, const Vector<D>& normal,
                                            double distance, double lag) {
  ContactKinematics<D> k;
  k.normal = normal;
  k.radius_sum = pair.radius_i + pair.radius_j;
  k.overlap = k.radius_sum - distance;
  k.reduced_radius = pair.radius_i * pair.radius_j / k.radius_sum;
  k.root_mass = pair.root_mass;
  k.slowing = lag * pair.inverse_masses;
  const double arm_i = pair.radius_i - 0.5 * k.overlap, arm_j = pair.radius_j - 0.5 * k.overlap;
  split_velocity(k, pair.velocity, arm_i * pair.spin_i + arm_j * pair.spin_j);
  k.spin = pair.spin_i - pair.spin_j;
  return k;
}

inline constexpr std::size_t kNoWallContact = static_cast<std::size_t>(-1);

/// Forces of walls on the grains of one block; `wall_force` (one entry per wall contact) receives the force
/// on the wall. Gives back a contact whose grain came at a polyline from behind, which would throw it through
/// with energy from nowhere, or kNoWallContact.
template <int D>
std::size_t sweep_walls(const LawFunctions<D>& law, double dt, double lag, const std::vector<Wall<D>>& walls,
                        std::size_t block, const std::vector<std::uint32_t>& first_contact, State<D>& state,
                        std::vector<Vector<D>>& wall_force, EnergyLedger& ledger);

/// Divides the forces on polylines (one per wall contact) between their nodes: adds force times `dt` to
/// `node_force`, per wall 2 per node. In the order of the contacts, whatever the number of threads.
void add_node_forces(const std::vector<Wall<2>>& walls, const State<2>& state,
                     const std::vector<Vector<2>>& wall_force, double dt,
                     std::vector<std::vector<double>>& node_force);

/// All touching contacts as they are, in the order of the lists.
template <int D>
std::vector<ContactRecord<D>> measure_contacts(const LawFunctions<D>& law, const SweepInput<D>& input,
                                               const std::vector<Wall<D>>& walls, const State<D>& state);

}  // namespace estuary::grains
