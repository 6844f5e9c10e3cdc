#include "bonds.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "on_team.hpp"

namespace estuary::grains {
namespace {

// Shortest way from i to j, across periodic sides.
template <int D>
Vector<D> branch(const Domain<D>& domain, const State<D>& state, std::size_t i, std::size_t j) {
  Vector<D> apart = load<D>(state.position.data(), j) - load<D>(state.position.data(), i);
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
    if (domain.periodic[c]) apart[c] -= domain.length(c) * std::round(apart[c] / domain.length(c));
  return apart;
}

// Cross-section of a bond of radius R: a strip 2R wide in the plane, a disc in space.
template <int D>
struct Section {
  double area, inertia, polar, radius;
};
template <int D>
Section<D> section(const BondLaw& law, const State<D>& state, std::size_t i, std::size_t j) {
  const double r = law.radius_ratio * std::min(state.radius[i], state.radius[j]);
  if constexpr (D == 2) return {2 * r, 2.0 / 3 * r * r * r, 0, r};
  constexpr double pi = std::numbers::pi;
  return {pi * r * r, 0.25 * pi * r * r * r * r, 0.5 * pi * r * r * r * r, r};
}

template <int D>
double energy_of(const BondLaw& law, const Section<D>& s, double stretch, const Vector<D>& shear,
                 const Spin<D>& turn, const Vector<D>& normal) {
  double energy =
      0.5 * s.area * (law.normal_stiffness * stretch * stretch + law.shear_stiffness * dot(shear, shear));
  if constexpr (D == 2) {
    energy += 0.5 * law.normal_stiffness * s.inertia * dot(turn, turn);
  } else {
    const double twist = dot(turn, normal);
    energy += 0.5 * law.shear_stiffness * s.polar * twist * twist +
              0.5 * law.normal_stiffness * s.inertia * (dot(turn, turn) - twist * twist);
  }
  return energy;
}

template <int D>
void index_bonds(Bonds<D>& bonds, std::size_t grains) {
  bonds.grain_start.assign(grains + 1, 0);
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    ++bonds.grain_start[bonds.first[b] + 1];
    ++bonds.grain_start[bonds.second[b] + 1];
  }
  for (std::size_t i = 0; i < grains; ++i) bonds.grain_start[i + 1] += bonds.grain_start[i];
  std::vector<std::uint32_t> next(bonds.grain_start.begin(), bonds.grain_start.end() - 1);
  bonds.grain_bond.resize(2 * bonds.size());
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    bonds.grain_bond[next[bonds.first[b]]++] = static_cast<std::uint32_t>(b);
    bonds.grain_bond[next[bonds.second[b]]++] = static_cast<std::uint32_t>(b);
  }
}

}  // namespace

template <int D>
Bonds<D> make_bonds(const BondLaw& law, const Domain<D>& domain, const State<D>& state) {
  Bonds<D> bonds;
  for (std::size_t i = 0; i < state.size(); ++i)
    for (std::size_t k = state.row_start[i]; k < state.row_start[i + 1]; ++k) {
      const std::size_t j = state.partner[k];
      const double distance = norm(branch(domain, state, i, j));
      if (distance > state.radius[i] + state.radius[j] + law.distance) continue;
      bonds.first.push_back(static_cast<std::uint32_t>(i));
      bonds.second.push_back(static_cast<std::uint32_t>(j));
      bonds.length.push_back(distance);
    }
  const std::size_t n = bonds.size();
  bonds.shear.assign(D * n, 0.0);
  bonds.turn.assign(spin_components<D> * n, 0.0);
  bonds.force.assign(D * n, 0.0);
  bonds.moment_first.assign(spin_components<D> * n, 0.0);
  bonds.moment_second = bonds.moment_first;
  bonds.broken.assign(n, 0);
  index_bonds(bonds, state.size());
  return bonds;
}

template <int D>
void renumber(Bonds<D>& bonds, const std::vector<std::uint32_t>& origin) {
  if (bonds.size() == 0) return;
  std::vector<std::uint32_t> place(origin.size());
  for (std::size_t i = 0; i < origin.size(); ++i) place[origin[i]] = static_cast<std::uint32_t>(i);
  // The two ends keep their roles, so that what the bond remembers keeps its sign.
  for (auto* ends : {&bonds.first, &bonds.second})
    for (auto& end : *ends) end = place[end];
  index_bonds(bonds, origin.size());
}

template <int D>
double add_bond_forces(const BondLaw& law, const Domain<D>& domain, double dt, Bonds<D>& bonds,
                       State<D>& state, double& lost) {
  constexpr std::size_t spin = spin_components<D>;
  const std::size_t n = bonds.size();
  std::vector<double>&damped = bonds.damped, &released = bonds.released;
  damped.assign(n, 0.0);
  released.assign(n, 0.0);
  on_team(n > 4096, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t b = 0; b < n; ++b) {
      Vector<D> force{};
      Spin<D> moment_i{}, moment_j{};
      if (!bonds.broken[b]) {
        const std::size_t i = bonds.first[b], j = bonds.second[b];
        const Vector<D> apart = branch(domain, state, i, j);
        const double distance = norm(apart);
        const Vector<D> normal = (1 / distance) * apart;
        const Spin<D> wi = load<spin>(state.spin.data(), i), wj = load<spin>(state.spin.data(), j);
        const double half = 0.5 * distance;
        const Vector<D> velocity = load<D>(state.velocity.data(), j) - load<D>(state.velocity.data(), i) -
                                   spin_times_arm(half * (wi + wj), normal);
        const double opening = dot(velocity, normal);
        const Vector<D> sliding = velocity - opening * normal;
        const Spin<D> turning = wj - wi;
        Vector<D> shear = load<D>(bonds.shear.data(), b);
        if constexpr (D == 2) {
          // Kept as a number along the tangent, which turns with the bond; the first component holds it.
          const Vector<2> tangent{-normal[1], normal[0]};
          const double along = shear[0] + dt * dot(sliding, tangent);
          store<2>(bonds.shear.data(), b, Vector<2>{along, 0});
          shear = along * tangent;
        } else {
          const double size = norm(shear);
          shear = shear - dot(shear, normal) * normal;
          const double projected = norm(shear);
          if (projected > 0) shear = (size / projected) * shear;
          shear = shear + dt * sliding;
          store<3>(bonds.shear.data(), b, shear);
        }
        const Spin<D> turn = load<spin>(bonds.turn.data(), b) + dt * turning;
        store<spin>(bonds.turn.data(), b, turn);
        const Section<D> s = section<D>(law, state, i, j);
        const double stretch = distance - bonds.length[b];
        // Reduced mass of the pair; a held grain counts as infinitely heavy.
        const double mass = 1 / (state.inverse_mass[i] + state.inverse_mass[j]);
        const double normal_damping = 2 * law.damping * std::sqrt(law.normal_stiffness * s.area * mass);
        const double shear_damping = 2 * law.damping * std::sqrt(law.shear_stiffness * s.area * mass);
        const double pull = law.normal_stiffness * s.area * stretch;
        const Vector<D> elastic_shear = law.shear_stiffness * s.area * shear;
        Spin<D> bending{};
        double bending_size = 0, twist_size = 0;
        Vector<D> axis = normal;
        if constexpr (D == 2) {
          bending = law.normal_stiffness * s.inertia * turn;
          bending_size = norm(bending);
        } else {
          const double twist = dot(turn, normal);
          const Spin<D> bent = turn - twist * normal;
          twist_size = law.shear_stiffness * s.polar * std::abs(twist);
          bending_size = law.normal_stiffness * s.inertia * norm(bent);
          bending = law.normal_stiffness * s.inertia * bent + law.shear_stiffness * s.polar * twist * axis;
        }
        const double tension = pull / s.area + bending_size * s.radius / s.inertia;
        const double shearing =
            norm(elastic_shear) / s.area + (D == 3 ? twist_size * s.radius / s.polar : 0.0);
        if (tension > law.tensile_strength || shearing > law.shear_strength) {
          bonds.broken[b] = 1;
          released[b] = energy_of<D>(law, s, stretch, shear, turn, normal);
        } else {
          force = (pull + normal_damping * opening) * normal + elastic_shear + shear_damping * sliding;
          damped[b] = dt * (normal_damping * opening * opening + shear_damping * dot(sliding, sliding));
          const double spinning = 1 / (state.inverse_inertia[i] + state.inverse_inertia[j]);
          const double turn_damping =
              2 * law.damping * std::sqrt(law.normal_stiffness * s.inertia * spinning);
          bending = bending + turn_damping * turning;
          damped[b] += dt * turn_damping * dot(turning, turning);
          const Spin<D> of_force = arm_times_force(half * normal, force);
          moment_i = of_force + bending;
          moment_j = of_force - bending;
        }
      }
      store<D>(bonds.force.data(), b, force);
      store<spin>(bonds.moment_first.data(), b, moment_i);
      store<spin>(bonds.moment_second.data(), b, moment_j);
    }
  });
  double total = 0;
  for (std::size_t b = 0; b < n; ++b) {
    total += damped[b];
    lost += released[b];
  }
  on_team(n > 4096, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < state.size(); ++i)
      for (std::size_t k = bonds.grain_start[i]; k < bonds.grain_start[i + 1]; ++k) {
        const std::size_t b = bonds.grain_bond[k];
        const bool first = bonds.first[b] == i;
        add(state.force.data(), i, (first ? 1.0 : -1.0) * load<D>(bonds.force.data(), b));
        add(state.torque.data(), i,
            load<spin>(first ? bonds.moment_first.data() : bonds.moment_second.data(), b));
      }
  });
  return total;
}

template <int D>
double bond_energy(const BondLaw& law, const Domain<D>& domain, const Bonds<D>& bonds,
                   const State<D>& state) {
  double total = 0;
  for (std::size_t b = 0; b < bonds.size(); ++b) {
    if (bonds.broken[b]) continue;
    const std::size_t i = bonds.first[b], j = bonds.second[b];
    const Vector<D> apart = branch(domain, state, i, j);
    const double distance = norm(apart);
    total += energy_of<D>(law, section<D>(law, state, i, j), distance - bonds.length[b],
                          load<D>(bonds.shear.data(), b), load<spin_components<D>>(bonds.turn.data(), b),
                          (1 / distance) * apart);
  }
  return total;
}

#define ESTUARY_BONDS(D)                                                                                    \
  template Bonds<D> make_bonds(const BondLaw&, const Domain<D>&, const State<D>&);                          \
  template void renumber(Bonds<D>&, const std::vector<std::uint32_t>&);                                     \
  template double add_bond_forces(const BondLaw&, const Domain<D>&, double, Bonds<D>&, State<D>&, double&); \
  template double bond_energy(const BondLaw&, const Domain<D>&, const Bonds<D>&, const State<D>&);
ESTUARY_BONDS(2)
ESTUARY_BONDS(3)
#undef ESTUARY_BONDS

}  // namespace estuary::grains
