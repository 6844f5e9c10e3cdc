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
// sqrt(2 Pi:Pi) / rho, with one root because rate mu(rate) grows; it is found by secant steps inside a
// bracket, once for each entry of a table over the stress, in which a step looks it up.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

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

/// `viscosity_from_stress` as cubic polynomials over pieces of the stress, 64 to each power of two, so that
/// the piece is found from the number's own bits. Within 1e-8 of the root everywhere: where a cubic is not
/// (at the smallest and the largest viscosity, beside a yield stress), and above 2^12, the root is found.
/// Below 2^-60 it is that of a fluid at rest, where the law has come to it by then.
class ViscosityTable {
public:
  explicit ViscosityTable(const ViscosityLaw& law);
  [[nodiscard]] double operator()(double stress) const {
    const auto bits = std::bit_cast<std::uint64_t>(stress);
    const std::uint64_t piece = (bits >> piece_bits) - first_piece;  // large also of smaller stresses
    if (piece < pieces) [[likely]] {
      // The bits below those of the piece as a number from 0 to 1.
      constexpr std::uint64_t one = std::bit_cast<std::uint64_t>(1.0);
      const double t =
          std::bit_cast<double>((bits << (52 - piece_bits) & (one_above_fraction - 1)) | one) - 1;
      const auto& c = coefficients_[piece];
      const double value = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
      if (value == value) [[likely]]
        return value;
    } else if (stress < smallest_stress && at_rest_ == at_rest_) {
      return at_rest_;
    }
    return viscosity_from_stress(law_, stress);
  }

private:
  static constexpr int piece_bits = 52 - 6;
  static constexpr std::uint64_t one_above_fraction = std::uint64_t{1} << 52;
  static constexpr double smallest_stress = 0x1p-60;
  static constexpr double largest_stress = 0x1p12;
  static constexpr std::uint64_t first_piece = std::bit_cast<std::uint64_t>(smallest_stress) >> piece_bits;
  static constexpr std::uint64_t pieces =
      (std::bit_cast<std::uint64_t>(largest_stress) >> piece_bits) - first_piece;

  ViscosityLaw law_;
  // Not a number where the root has to be found.
  std::vector<std::array<double, 4>> coefficients_;
  double at_rest_;
};

}  // namespace estuary::fluid
