// From a scene to particles: the bodies, what is held, what is loaded.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "expression.hpp"
#include "shell.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {

/// Of a body that is a shell.
ShellSection shell_section(const SolidScene& scene, const BodyScene& body);
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

/// All bodies of the scene, one after another, with what is held marked. Throws std::invalid_argument naming
/// the body that cannot be filled (an outline finer than the spacing).
Body build_body(const SolidScene& scene);

/// Of scenes whose bodies meet by impulses.
std::unique_ptr<Solver> make_impact_solver(const SolidScene& scene, const Body& body,
                                           const SolverOptions& options);

/// Initial velocities of the scene's bodies.
void set_velocities(const SolidScene& scene, const Body& body, State& state);

/// Everything that acts on the bodies except the wet surface. The expressions live in `expressions`. Throws
/// UnmetConditions.
Loading build_loading(const SolidScene& scene, const Body& body,
                      std::vector<std::unique_ptr<Expression>>& expressions);

}  // namespace estuary::solid
