// From a scene to particles: the bodies, what is held, what is loaded.
#pragma once

#include <memory>
#include <vector>

#include "expression.hpp"
#include "shell.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {

/// Of a body that is a shell.
ShellSection shell_section(const SolidScene& scene, const BodyScene& body);
/// All bodies of the scene, one after another, with what is held marked. Throws std::invalid_argument naming
/// the body or condition that cannot be met (an outline finer than the spacing, a hold without particles).
Body build_body(const SolidScene& scene);

/// Of scenes whose bodies meet by impulses.
std::unique_ptr<Solver> make_impact_solver(const SolidScene& scene, const Body& body,
                                           const SolverOptions& options);

/// Initial velocities of the scene's bodies.
void set_velocities(const SolidScene& scene, const Body& body, State& state);

/// Everything that acts on the bodies except the wet surface. The expressions live in `expressions`.
Loading build_loading(const SolidScene& scene, const Body& body,
                      std::vector<std::unique_ptr<Expression>>& expressions);

}  // namespace estuary::solid
