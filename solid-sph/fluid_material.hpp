// Weakly compressible fluids: pressure and elastic energy of a density.
#pragma once

#include <limits>

namespace estuary::solid {

enum class EquationOfState {
  acoustic,        // p = rho0 c^2 (1 - rho0 / rho): in proportion to the loss of volume, so that waves of any
                   // strength travel at c relative to the material and p = rho0 c V holds exactly
  linear_density,  // p = c^2 (rho - rho0), the same to first order
  tait             // p = rho0 c^2 / 7 ((rho / rho0)^7 - 1), water (Cole 1948)
};

struct FluidMaterial {
  double density = 0;      // at rest [kg/m3]
  double sound_speed = 0;  // at rest [m/s]
  EquationOfState equation_of_state = EquationOfState::acoustic;
  double tension_limit = std::numeric_limits<double>::infinity();  // largest tension it bears [Pa]
  double viscosity = 0;                                            // dynamic [Pa s]
  double linear = 0, quadratic = 0;                                // artificial viscosity: alpha, beta
  double diffusion = 0;                                            // delta
  // In place of both: what an acoustic Riemann problem between each pair of particles dissipates.
  bool riemann = false;
  double limiter = 3;  // of its dissipation, in speeds of approach; at most that of sound

  /// Of a density [kg/m3].
  [[nodiscard]] double pressure(double density) const;        // [Pa]
  [[nodiscard]] double energy(double density) const;          // elastic, per mass [J/kg]
  [[nodiscard]] double sound_speed_at(double density) const;  // [m/s]

private:
  [[nodiscard]] double elastic_pressure(double density) const;
  [[nodiscard]] double elastic_energy(double density) const;
  [[nodiscard]] double cavitation_density() const;
};

}  // namespace estuary::solid
