// From pressures on the wet surface to consistent nodal forces, and the sums that show what was conserved.
#pragma once

#include <array>
#include <span>

#include "estuary/v1/payload.pb.h"

namespace estuary::coupler {

/// Consistent load of a pressure and a viscous traction that vary linearly along each segment (2D). The
/// pressure of a segment acts along that segment's own normal in the current configuration X + displacement,
/// so that uniform pressure on a closed contour is exactly self-equilibrated and moments are exact too. Each
/// end of a segment of length l receives l/6 (2 s_own + s_other), s = -p n + t.
///
/// `displacement`: nodes x 2, the configuration the fluid saw. Result: force per metre of depth [N/m].
v1::NodalForces consistent_nodal_forces(const v1::WetSurface& surface, std::span<const double> displacement,
                                        const v1::WetSurfacePressures& load);

/// Sum of the nodal forces, their moment about the origin in the configuration X + displacement, and their
/// power with the given nodal velocities.
struct LoadSums {
  std::array<double, 3> force{};
  double moment = 0;  // about the z axis [N m; N per metre of depth in 2D]
  double power = 0;   // [W]
};
LoadSums sum_load(const v1::WetSurface& surface, std::span<const double> displacement,
                  std::span<const double> velocity, std::span<const double> force);

}  // namespace estuary::coupler
