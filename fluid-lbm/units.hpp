// Between SI units and lattice units (spacing, time step and reference density are 1).
#pragma once

#include <numbers>

namespace estuary::fluid {

struct Units {
  double spacing = 1;    // [m]
  double time_step = 1;  // [s]
  double density = 1;    // reference density [kg/m3]
  double viscosity = 1;  // dynamic [Pa s]

  [[nodiscard]] double velocity_to_lattice() const { return time_step / spacing; }
  [[nodiscard]] double lattice_viscosity() const {
    return viscosity / density * time_step / (spacing * spacing);
  }
  /// Relaxation time of the even part, in steps.
  [[nodiscard]] double relaxation_time() const { return 3 * lattice_viscosity() + 0.5; }
  /// Pascals per lattice unit of pressure or stress.
  [[nodiscard]] double stress() const {
    const double speed = spacing / time_step;
    return density * speed * speed;
  }
  /// Density excess rho' of a gauge pressure [Pa].
  [[nodiscard]] double excess(double pressure) const { return 3 * pressure / stress(); }
  /// Newtons (in two dimensions per metre of depth) per lattice unit of force; times `spacing` for moments.
  [[nodiscard]] double force(int dimension = 2) const {
    return dimension == 3 ? stress() * spacing * spacing : stress() * spacing;
  }
  /// Lattice units per m/s2.
  [[nodiscard]] double acceleration_to_lattice() const { return time_step * time_step / spacing; }
  [[nodiscard]] double mach(double velocity) const {
    return velocity * velocity_to_lattice() * std::numbers::sqrt3;
  }
  [[nodiscard]] double grid_reynolds(double velocity) const {
    return velocity * spacing * density / viscosity;
  }
};

}  // namespace estuary::fluid
