// Inside of the scene reader: changes to a scene that were given on the command line.
#pragma once

#include <stdexcept>
#include <string>

#include "toml.hpp"

namespace estuary::detail {

/// Says why an override cannot be applied, without naming it.
struct OverrideError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Applies `text`, "fluid.viscosity=1e-3" or "watch.0.name=tip" (arrays count from 0), making tables that are
/// missing. The value is TOML; what is not TOML and does not begin like a string, array or table is taken as
/// a string. "fluid=off" takes a participant out of the scene, with the watches of it and their checks.
void apply_override(toml::table& root, const std::string& text);

}  // namespace estuary::detail
