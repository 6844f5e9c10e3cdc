#include "coupler_state.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "checkpoint.hpp"

namespace estuary::coupler {
namespace {

using Json = nlohmann::ordered_json;

// Names and whole numbers as text; what has to keep its bits is in arrays of its own.
Json description_of(const CouplerState& state) {
  Json names = Json::array();
  for (const auto& [name, text] : state.messages) names.push_back(name);
  return {{"window", state.window}, {"total_iterations", state.total_iterations},
          {"frame", state.frame},   {"care", state.care},
          {"record", state.record}, {"messages_record", state.messages_record},
          {"messages", names}};
}

// Whatever else JSON calls a number would become some count or other.
std::uint64_t whole(const Json& value) {
  if (!value.is_number_unsigned())
    throw std::runtime_error(fmt::format("a {} is no count", value.type_name()));
  return value.get<std::uint64_t>();
}

std::map<std::string, std::uint64_t> whole_by_name(const Json& object) {
  std::map<std::string, std::uint64_t> result;
  for (const auto& [name, value] : object.items()) result[name] = whole(value);
  return result;
}

}  // namespace

void write_coupler_state(const std::filesystem::path& file, const CouplerState& state) {
  CheckpointWriter writer(file);
  writer.add_bytes("description", description_of(state).dump());
  writer.add("times", std::vector<double>{state.time, state.wall_s, state.history.earlier_duration});
  writer.add("displacement", state.history.accepted.motion.displacement);
  writer.add("velocity", state.history.accepted.motion.velocity);
  const auto& torn = state.history.accepted.motion.torn;
  writer.add("torn", std::vector<double>(torn.begin(), torn.end()));
  writer.add("forces", state.history.accepted.forces);
  writer.add("earlier velocity", state.history.earlier_velocity);
  writer.add("clock", state.clock);
  writer.add("convergence", state.convergence);
  writer.add("acceleration", state.acceleration);
  for (const auto& [name, text] : state.messages) writer.add_bytes("message of " + name, text);
  writer.commit();
}

CouplerState read_coupler_state(const std::filesystem::path& file) {
  const CheckpointReader reader(file);
  CouplerState state;
  try {
    const Json description = Json::parse(reader.read_bytes("description"));
    state.window = whole(description.at("window"));
    state.total_iterations = whole(description.at("total_iterations"));
    state.frame = whole(description.at("frame"));
    state.care = whole(description.at("care"));
    state.record = whole_by_name(description.at("record"));
    state.messages_record = whole_by_name(description.at("messages_record"));
    for (const auto& name : description.at("messages").get<std::vector<std::string>>())
      state.messages[name] = reader.read_bytes("message of " + name);
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: its description cannot be read: {}", file.string(), error.what()));
  }
  for (const auto& [name, size] : state.record) {
    // Names of files in the run's own folder, whoever wrote them.
    const std::filesystem::path path(name);
    if (path.is_absolute() || name.find("..") != std::string::npos)
      throw std::runtime_error(fmt::format("{}: names the file '{}'", file.string(), name));
  }
  const std::vector<double> times = reader.read_all("times");
  if (times.size() != 3)
    throw std::runtime_error(fmt::format("{}: has {} times", file.string(), times.size()));
  state.time = times[0];
  state.wall_s = times[1];
  state.history.earlier_duration = times[2];
  state.history.accepted.motion.displacement = reader.read_all("displacement");
  state.history.accepted.motion.velocity = reader.read_all("velocity");
  for (const double facet : reader.read_all("torn")) {
    if (!(facet >= 0 && facet < 4294967296.0))
      throw std::runtime_error(fmt::format("{}: names a torn facet {}", file.string(), facet));
    state.history.accepted.motion.torn.push_back(static_cast<std::uint32_t>(facet));
  }
  state.history.accepted.forces = reader.read_all("forces");
  state.history.earlier_velocity = reader.read_all("earlier velocity");
  state.clock = reader.read_all("clock");
  state.convergence = reader.read_all("convergence");
  state.acceleration = reader.read_all("acceleration");
  return state;
}

}  // namespace estuary::coupler
