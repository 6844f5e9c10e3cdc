// Words of preCICE configurations and what they are called here.
#pragma once

#include <pugixml.hpp>
#include <string>

namespace estuary::coupler {

[[nodiscard]] std::string lower(std::string text);
/// A TOML string with quotes.
[[nodiscard]] std::string toml_string(const std::string& text);

/// What a field of any name is on our wet surface: "displacement", "velocity", "force", or empty.
[[nodiscard]] std::string field_of(const std::string& data);
/// The part that a participant of this name plays: "fluid", "solid", "grains", or empty.
[[nodiscard]] std::string role_of_name(const std::string& participant);

/// "serial-implicit" and "coupling-scheme" of <coupling-scheme:serial-implicit>.
[[nodiscard]] std::string kind_of(const pugi::xml_node& node);
[[nodiscard]] std::string family_of(const pugi::xml_node& node);

struct BasisFunction {
  std::string name;    // of coupling.mapping.kind
  bool exact = false;  // or merely the nearest that there is
};
/// Of a radial basis function's name ("thin-plate-splines", "compact-polynomial-c2").
[[nodiscard]] BasisFunction basis_function(const std::string& precice);

}  // namespace estuary::coupler
