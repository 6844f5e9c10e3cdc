// Viscosity that depends on the rate of strain, found at each node from the non-equilibrium stress, without
// gradients.
//
// Smagorinsky: nu = nu_0 + (C Delta)^2 |S|, |S| = sqrt(2 S:S), Delta one spacing; closed form in the stress:
// Hou, Sterling, Chen, Doolen, Fields Inst. Commun. 6 (1996).
//
// Generalised Newtonian, mu(rate) with rate = sqrt(2 S:S):
//   power law               K rate^(n-1)
//   Carreau-Yasuda          mu_inf + (mu_0 - mu_inf) (1 + (lambda rate)^a)^((n-1)/a)
//   Bingham-Papanastasiou   mu_p + tau_y (1 - exp(-m rate)) / rate
// each kept between a smallest and a largest viscosity. The stress tau gives rate (1/2 + 3 nu(rate)) = 3/2
// sqrt(2 Pi:Pi) / rho, with one root because rate mu(rate) grows; it is found by Newton steps inside a
// bracket.
#pragma once

namespace estuary::fluid {

enum class ViscosityModel { constant, smagorinsky, generalised_newtonian };
enum class Rheology { power_law, carreau_yasuda, bingham_papanastasiou };

/// SI units; scales to lattice units. Only the members of the chosen model matter.
struct ViscosityLaw {
  double base_viscosity = 0;        // lattice units: nu_0 of Smagorinsky
  double smagorinsky_constant = 0;  // C
  Rheology rheology = Rheology::power_law;
  double consistency = 0;     // K [Pa s^n]
  double index = 1;           // n
  double zero_shear = 0;      // mu_0 [Pa s]
  double infinite_shear = 0;  // mu_inf, mu_p [Pa s]
  double time_constant = 0;   // lambda, m [s]
  double yasuda = 2;          // a
  double yield_stress = 0;    // tau_y [Pa]
  double smallest = 0;        // [Pa s]
  double largest = 0;
  double rate_scale = 1;       // 1/s per lattice unit of rate: 1/dt
  double viscosity_scale = 1;  // lattice units per Pa s: dt / (rho dx^2)
};

/// Dynamic viscosity [Pa s] at a rate of strain [1/s].
[[nodiscard]] double dynamic_viscosity(const ViscosityLaw& law, double rate);
/// Kinematic viscosity in lattice units where `stress` = 3/2 sqrt(2 Pi:Pi) / rho.
[[nodiscard]] double viscosity_from_stress(const ViscosityLaw& law, double stress);

}  // namespace estuary::fluid
