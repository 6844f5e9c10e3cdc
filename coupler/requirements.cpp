#include "requirements.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "failure.hpp"

namespace estuary::coupler {

std::vector<Requirement> requirements(const CouplingScene& scene, const std::string& role) {
  const bool coupled = scene.participants.size() > 1;
  const bool wet = coupled && scene.find("solid") != nullptr;
  const bool grains_in_fluid = scene.find("grains") != nullptr && scene.find("fluid") != nullptr;
  const bool steady = scene.mode == CouplingMode::steady;
  std::vector<Requirement> needed;
  if (steady) {
    needed.push_back({"steady", "the scene asks for one common equilibrium",
                      "set coupling.mode = \"transient\" with `window` and `end_time`"});
  } else {
    needed.push_back({"transient", "the scene goes on in time",
                      "set coupling.mode = \"steady\", or take a solver that can"});
  }
  if (wet)
    needed.push_back({"wet-surface", "it is coupled at a wet surface",
                      fmt::format("take another solver, or leave one out: --set {}=off",
                                  role == "solid" ? "fluid" : "solid")});
  if (grains_in_fluid && role != "solid")
    needed.push_back({"grains", "grains and fluid exchange forces", "take another solver"});
  if (wet && scene.implicit() && !steady)
    needed.push_back({"rewind",
                      "an implicit scheme repeats each window from its start until the solvers agree",
                      "set coupling.scheme = \"serial-explicit\""});
  return needed;
}

bool can(const v1::Welcome& welcome, const std::string& capability) {
  return std::find(welcome.capabilities().begin(), welcome.capabilities().end(), capability) !=
         welcome.capabilities().end();
}

void require(const CouplingScene& scene, const std::string& role, const v1::Welcome& welcome,
             const std::string& endpoint) {
  const std::string who = fmt::format("{}: {} {} at {}", role, welcome.name(), welcome.version(), endpoint);
  if (std::find(welcome.roles().begin(), welcome.roles().end(), role) == welcome.roles().end()) {
    throw RunFailure(
        ExitStatus::wrong_scene,
        fmt::format("{} cannot play this part; it can be: {}", who, fmt::join(welcome.roles(), ", ")),
        fmt::format("name another program in {}.solver", role));
  }
  const auto dimension = static_cast<std::uint32_t>(scene.dimension);
  if (std::find(welcome.dimensions().begin(), welcome.dimensions().end(), dimension) ==
      welcome.dimensions().end()) {
    throw RunFailure(ExitStatus::wrong_scene,
                     fmt::format("{} does not compute in {} dimensions; it does in: {}", who, dimension,
                                 fmt::join(welcome.dimensions(), ", ")),
                     welcome.dimensions().empty()
                         ? std::string("its Welcome names no `dimensions`")
                         : fmt::format("set dimension = {}, or name another program in {}.solver",
                                       welcome.dimensions(0), role));
  }
  std::string lacks, change;
  for (const Requirement& requirement : requirements(scene, role)) {
    if (can(welcome, requirement.capability)) continue;
    lacks +=
        fmt::format("{}\"{}\" ({})", lacks.empty() ? "" : " and ", requirement.capability, requirement.why);
    change += (change.empty() ? "" : "; ") + requirement.change;
  }
  if (lacks.empty()) return;
  throw RunFailure(
      ExitStatus::wrong_scene,
      fmt::format("{} lacks {}; it can: {}", who, lacks, fmt::join(welcome.capabilities(), ", ")), change);
}

}  // namespace estuary::coupler
