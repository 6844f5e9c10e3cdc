// Bonds that glue grains together until they break: parallel bonds (Potyondy & Cundall 2004), a cement disc
// or strip between two grains with normal, shear and bending stiffness and two strengths.
#pragma once

#include <cstdint>
#include <vector>

#include "neighbours.hpp"
#include "state.hpp"

namespace estuary::grains {

struct BondLaw {
  bool active = false;
  double distance = 0;          // gap up to which grains are bonded at the start [m]
  double normal_stiffness = 0;  // per area of the bond [Pa/m]
  double shear_stiffness = 0;   // [Pa/m]
  double radius_ratio = 1;      // bond radius / smaller grain radius
  double tensile_strength = 0;  // [Pa]
  double shear_strength = 0;    // [Pa]
  double damping = 0;           // share of the critical damping
};

template <int D>
struct Bonds {
  std::vector<std::uint32_t> first, second;  // places in the state; first < second
  std::vector<double> length;                // at rest [m]
  std::vector<double> shear;                 // shear displacement, D per bond [m]
  std::vector<double> turn;                  // relative rotation, one (three in space) per bond [rad]
  std::vector<double> force;                 // on `first`, D per bond; of the last evaluation
  std::vector<double> moment_first, moment_second;
  std::vector<std::uint8_t> broken;
  // Bonds of each grain, for adding forces in a fixed order.
  std::vector<std::uint32_t> grain_start, grain_bond;
  std::vector<double> damped, released;  // by each bond in the evaluation under way [J]

  [[nodiscard]] std::size_t size() const { return length.size(); }
};

/// Bonds every pair of the list whose gap is at most `law.distance`.
template <int D>
Bonds<D> make_bonds(const BondLaw& law, const Domain<D>& domain, const State<D>& state);

/// Follows the grains to their new places: `origin` is each place's former one.
template <int D>
void renumber(Bonds<D>& bonds, const std::vector<std::uint32_t>& origin);

/// Adds the bonds' forces to the state's; breaks those beyond their strength. Returns what damping took [J];
/// `lost` receives the energy of bonds that broke.
template <int D>
double add_bond_forces(const BondLaw& law, const Domain<D>& domain, double dt, Bonds<D>& bonds,
                       State<D>& state, double& lost);

/// Elastic energy of the bonds [J].
template <int D>
double bond_energy(const BondLaw& law, const Domain<D>& domain, const Bonds<D>& bonds, const State<D>& state);

}  // namespace estuary::grains
