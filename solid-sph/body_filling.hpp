// From the bodies of a scene to particles.
#pragma once

#include "shell.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {

/// Of a body that is a shell.
ShellSection shell_section(const SolidScene& scene, const BodyScene& body);

/// All bodies of the scene, one after another, with what is held marked. Throws std::invalid_argument naming
/// the body that cannot be filled (an outline finer than the spacing).
Body build_body(const SolidScene& scene);

}  // namespace estuary::solid
