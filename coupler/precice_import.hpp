// Translates a preCICE configuration (versions 2 and 3, two or three participants) into a scene: scheme,
// windows, convergence measures, acceleration, mapping, watch points. What has no counterpart is listed,
// never dropped silently.
#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace estuary::coupler {

struct PreciceImport {
  std::string scene;               // TOML
  std::vector<std::string> notes;  // "precice-config.xml:12: ...": no counterpart, or to be looked at
};

/// `name` of the file is for messages. `roles` says which participant plays "fluid", "solid" or "grains"
/// where the data it writes do not tell. Throws std::runtime_error, with line, when the file is no such
/// configuration.
PreciceImport import_precice(const std::string& name, const std::string& text,
                             const std::map<std::string, std::string>& roles);

}  // namespace estuary::coupler
