#include "precice_vocabulary.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <utility>

namespace estuary::coupler {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string toml_string(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (static_cast<unsigned char>(c) >= ' ') quoted += c;
  }
  return quoted + "\"";
}

std::string field_of(const std::string& data) {
  constexpr std::array<std::pair<std::string_view, const char*>, 6> words = {
      {{"displacement", "displacement"},
       {"velocit", "velocity"},
       {"force", "force"},
       {"pressure", "force"},
       {"stress", "force"},
       {"traction", "force"}}};
  const std::string name = lower(data);
  for (const auto& [word, field] : words)
    if (name.find(word) != std::string::npos) return field;
  return {};
}

std::string role_of_name(const std::string& participant) {
  // Grains first: "FluidParticles" are particles. Programs that people couple are known by their names.
  constexpr std::array<std::pair<std::string_view, const char*>, 14> words = {{{"grain", "grains"},
                                                                               {"particle", "grains"},
                                                                               {"liggghts", "grains"},
                                                                               {"lammps", "grains"},
                                                                               {"mercury", "grains"},
                                                                               {"yade", "grains"},
                                                                               {"solid", "solid"},
                                                                               {"struct", "solid"},
                                                                               {"calculix", "solid"},
                                                                               {"fluid", "fluid"},
                                                                               {"openfoam", "fluid"},
                                                                               {"nastin", "fluid"},
                                                                               {"su2", "fluid"},
                                                                               {"palabos", "fluid"}}};
  const std::string name = lower(participant);
  for (const auto& [word, role] : words)
    if (name.find(word) != std::string::npos) return role;
  return {};
}

std::string kind_of(const pugi::xml_node& node) {
  const std::string name = node.name();
  const std::size_t colon = name.find(':');
  return colon == std::string::npos ? std::string() : name.substr(colon + 1);
}

std::string family_of(const pugi::xml_node& node) {
  const std::string name = node.name();
  return name.substr(0, name.find(':'));
}

BasisFunction basis_function(const std::string& precice) {
  if (precice == "thin-plate-splines") return {"thin-plate-spline", true};
  if (precice == "compact-polynomial-c2") return {"wendland-c2", true};
  if (precice == "compact-polynomial-c4") return {"wendland-c4", true};
  if (precice == "compact-polynomial-c0") return {"wendland-c2", false};
  if (precice.starts_with("compact-polynomial-c")) return {"wendland-c4", false};
  return {"nearest-projection", false};
}

}  // namespace estuary::coupler
