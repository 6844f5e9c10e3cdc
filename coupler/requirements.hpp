// What a scene needs a participant to be able to do, compared with what its Welcome says it can: said before
// anything is computed, with what to change.
#pragma once

#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "estuary/v1/protocol.pb.h"

namespace estuary::coupler {

/// A capability of the contract (protocol.proto, Welcome.capabilities) and what to do when it is missing.
struct Requirement {
  std::string capability;
  std::string why;     // "a window is repeated until fluid and solid agree"
  std::string change;  // of the scene, or of the solver
};

/// What the participant of this role has to be able to do in this scene.
[[nodiscard]] std::vector<Requirement> requirements(const CouplingScene& scene, const std::string& role);

[[nodiscard]] bool can(const v1::Welcome& welcome, const std::string& capability);

/// Throws RunFailure (wrong_scene) naming everything that `welcome` lacks: role, dimension, capabilities.
void require(const CouplingScene& scene, const std::string& role, const v1::Welcome& welcome,
             const std::string& endpoint);

}  // namespace estuary::coupler
