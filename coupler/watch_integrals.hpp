// Figures of the wet surface as a whole, for a watch of the participant "coupling".
#pragma once

#include <string>

#include "interface_state.hpp"

namespace estuary::coupler {

/// force_x, force_y [N/m], moment about the origin [N] and power [W/m] of the nodal forces; the mean of the
/// displacement over the length of the reference surface, mean_displacement_x, _y [m]; its deformed length
/// [m]; iterations of the window. In 3D (forces in N) the moment is that about the z axis, an area takes the
/// place of the length, and force_z and mean_displacement_z are added.
v1::WatchSample surface_integrals(const std::string& name, const v1::WetSurface& surface,
                                  const InterfaceState& state, std::uint64_t iterations);

}  // namespace estuary::coupler
