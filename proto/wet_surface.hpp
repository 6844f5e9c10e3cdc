// Checks on the wet surface and on the fields that live on it, used wherever one is received.
#pragma once

#include <span>
#include <string>

#include "estuary/v1/payload.pb.h"

namespace estuary {

/// Throws std::invalid_argument, naming the field, when the surface is not a valid one: dimension 2 or 3,
/// finite positions, facets of existing and different nodes, fewer than ten million nodes.
void check_wet_surface(const v1::WetSurface& surface);

[[nodiscard]] std::size_t node_count(const v1::WetSurface& surface);

/// Throw std::invalid_argument when a field belongs to another surface, has the wrong length, or holds a
/// value that is not finite. The message names field, node and value.
void check_displacements(const v1::Displacements& field, const v1::WetSurface& surface);
void check_pressures(const v1::WetSurfacePressures& field, const v1::WetSurface& surface);
void check_forces(const v1::NodalForces& field, const v1::WetSurface& surface);

}  // namespace estuary
