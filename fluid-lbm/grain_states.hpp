// The grains of a message: checked, moved inside a window, turned into lattice units.
#pragma once

#include "estuary/v1/payload.pb.h"
#include "grid.hpp"
#include "saturated_cells.hpp"
#include "units.hpp"

namespace estuary::fluid {

/// Throws BadInput naming the field: wrong dimension or length, values that are not finite, radii that are
/// not positive. SI units.
[[nodiscard]] Grains read_grains(const v1::GrainStates& message, int dimension);

/// The grains inside a window: centres the fraction `place` after `start`, by cubic Hermite interpolation, so
/// that they move off and arrive with their velocities; velocity and spin the fraction `motion` after it,
/// linearly.
[[nodiscard]] Grains between(const Grains& start, const Grains& end, double place, double motion,
                             double duration);

[[nodiscard]] Grains to_lattice(const Grains& grains, const Grid& grid, const Units& units);

/// Forces [N, in 2D N/m] and torques [N m, in 2D N].
void write_loads(const GrainLoads& loads, int dimension, const Units& units, v1::GrainForces& message);

}  // namespace estuary::fluid
