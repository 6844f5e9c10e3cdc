// The motion of the wet surface at the end of a window, and what is checked and measured on such fields.
#pragma once

#include <span>
#include <vector>

#include "estuary/v1/payload.pb.h"
#include "participants.hpp"

namespace estuary::coupler {

struct WetMotion {
  std::vector<double> displacement;      // nodes x dimension [m]
  std::vector<double> velocity;          // nodes x dimension [m/s]
  std::vector<std::uint32_t> torn = {};  // facets, by number
};

[[nodiscard]] WetMotion motion_of(const v1::Displacements& field);
[[nodiscard]] v1::Displacements message_of(const WetMotion& motion, const v1::WetSurface& surface);

[[nodiscard]] double l2_norm(std::span<const double> values);
[[nodiscard]] double l2_distance(std::span<const double> a, std::span<const double> b);

/// Size that displacements of the whole surface are judged by, in the L2 norm over its nodes: its largest
/// extent times the root of the number of nodes [m].
[[nodiscard]] double displacement_scale(const v1::WetSurface& surface);

/// What the participant answered, checked: it is there, belongs to the surface, has its length, is finite.
/// Throws RunFailure naming participant, field, node, window and iteration.
[[nodiscard]] WetMotion checked_motion(const RemoteParticipant& participant, const v1::Exchange& outputs,
                                       const v1::WetSurface& surface, const Position& position);
[[nodiscard]] const v1::WetSurfacePressures& checked_pressures(const RemoteParticipant& participant,
                                                               const v1::Exchange& outputs,
                                                               const v1::WetSurface& surface,
                                                               const Position& position);
[[nodiscard]] const v1::NodalForces& checked_forces(const RemoteParticipant& participant,
                                                    const v1::Exchange& outputs,
                                                    const v1::WetSurface& surface, const Position& position);

}  // namespace estuary::coupler
