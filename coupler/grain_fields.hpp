// Checks of what fluid and grains tell each other, on its way through the coupler.
#pragma once

#include "estuary/v1/payload.pb.h"
#include "participants.hpp"

namespace estuary::coupler {

/// Throws RunFailure: participant_lost for arrays of the wrong size, no_solution for a value that is not
/// finite, naming grain, field, window and iteration.
void check_grain_states(const v1::GrainStates& states, int dimension, const Position& position);
void check_grain_forces(const v1::GrainForces& forces, const v1::GrainStates& states,
                        const Position& position);

}  // namespace estuary::coupler
