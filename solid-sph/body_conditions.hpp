// What a scene holds, moves and loads, on the particles of its bodies.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "expression.hpp"
#include "loading.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {

/// A [[solid.hold]] or [[solid.load]] that meets no particle, and what to try.
struct UnmetCondition {
  const char* table;   // "hold" or "load"
  std::size_t number;  // from 0, in the order of the scene
  std::string message;
};
/// All of a scene.
struct UnmetConditions : std::invalid_argument {
  explicit UnmetConditions(std::vector<UnmetCondition> found);
  std::vector<UnmetCondition> conditions;
};

/// Marks the components of particles that a [[solid.hold]] holds.
void mark_held(const SolidScene& scene, Body& body);
/// Those of one of them, counted from 0.
std::vector<std::uint32_t> held_particles(const SolidScene& scene, const Body& body, std::size_t hold);

/// Initial velocities of the scene's bodies.
void set_velocities(const SolidScene& scene, const Body& body, State& state);

/// Everything that acts on the bodies except the wet surface. The expressions live in `expressions`. Throws
/// UnmetConditions.
Loading build_loading(const SolidScene& scene, const Body& body,
                      std::vector<std::unique_ptr<Expression>>& expressions);

}  // namespace estuary::solid
