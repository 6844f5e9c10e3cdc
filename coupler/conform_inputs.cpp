#include "conform_inputs.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/reflection.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "failure.hpp"
#include "load_transfer.hpp"
#include "participants.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using google::protobuf::FieldDescriptor;

// Largest motion of the test, as a share of the surface's extent or a grain's radius: below anything that
// could upset a solver, above the last digits.
constexpr double small_share = 1e-6;

void resize(google::protobuf::RepeatedField<double>& field, int size, double value = 0.0) {
  field.Clear();
  field.Resize(size, value);
}

// A shear that leaves the lowest (leftmost) nodes where they are, as a fin stands on its floor.
void shear(const v1::WetSurface& surface, double share, v1::Displacements& motion) {
  const int dimension = static_cast<int>(surface.dimension());
  const auto extent = [&](int axis) {
    double low = surface.reference_positions(axis), high = low;
    for (int i = axis; i < surface.reference_positions_size(); i += dimension) {
      low = std::min(low, surface.reference_positions(i));
      high = std::max(high, surface.reference_positions(i));
    }
    return std::pair(low, high - low);
  };
  const bool upright = extent(1).second > 0;
  const auto [low, size] = extent(upright ? 1 : 0);
  for (int i = 0; i < motion.displacement_size(); i += dimension) {
    const double along = surface.reference_positions(i + (upright ? 1 : 0)) - low;
    const int moved = i + (upright ? 0 : 1);
    motion.set_displacement(moved, motion.displacement(moved) + share * along);
  }
}

bool finite(const google::protobuf::Message& message) {
  const auto* reflection = message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection->ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE && !field->is_repeated()) {
      if (!finite(reflection->GetMessage(message, field))) return false;
    }
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE || !field->is_repeated()) continue;
    const auto values = reflection->GetRepeatedFieldRef<double>(message, field);
    if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }))
      return false;
  }
  return true;
}

}  // namespace

v1::Exchange what_others_bring(const CheckedScene& scene, const std::string& role,
                               const std::filesystem::path& folder, const std::atomic<int>& interrupt) {
  CouplingScene others = scene.coupling;
  std::erase_if(others.participants, [&](const ParticipantScene& participant) {
    return participant.role == role || participant.role == "fluid" || role == "solid";
  });
  v1::Exchange brought;
  if (others.participants.empty()) return brought;
  // Asked for what they bring in the whole scene, not for what they can do in this part of it.
  std::filesystem::create_directories(folder / "log");
  Participants participants(others, folder, false, interrupt, {});
  for (const auto* name : {"solid", "grains"}) {
    RemoteParticipant* other = participants.find(name);
    if (other == nullptr) continue;
    v1::Request configure;
    *configure.mutable_configure() = configure_message(scene.given, name);
    const v1::Reply configured = participants.ask(*other, std::move(configure), {});
    for (const auto& problem : configured.configured().problems())
      throw RunFailure(ExitStatus::wrong_scene, fmt::format("{}: {}", name, problem.message()));
    v1::Request start;
    *start.mutable_start()->mutable_initial() = brought;
    const v1::Reply started = participants.ask(*other, std::move(start), {});
    brought.MergeFrom(started.started().initial());
  }
  participants.stop(1.0);
  return brought;
}

ConformInputs::ConformInputs(const CouplingScene& scene, std::string role, v1::Exchange initial,
                             v1::Exchange brought, double pressure)
    : scene_(scene),
      role_(std::move(role)),
      initial_(std::move(initial)),
      brought_(std::move(brought)),
      pressure_(pressure) {}

const v1::WetSurface& ConformInputs::surface() const {
  return brought_.has_wet_surface() ? brought_.wet_surface() : initial_.wet_surface();
}

v1::Exchange ConformInputs::inputs(int variant) const {
  v1::Exchange inputs;
  const bool wet = surface().reference_positions_size() > 0;
  if (role_ == "solid") {
    if (!wet || (!has("fluid") && !has("grains"))) return inputs;
    v1::WetSurfacePressures load;
    load.set_surface(surface().identity());
    const auto nodes = static_cast<int>(node_count(surface()));
    // Not uniform: uniform pressure on a closed contour moves nothing.
    for (int node = 0; node < nodes; ++node)
      load.add_pressure(pressure_ * variant * (1.0 + static_cast<double>(node) / nodes));
    const std::vector<double> still(static_cast<std::size_t>(surface().reference_positions_size()), 0.0);
    *inputs.mutable_forces() = consistent_nodal_forces(surface(), still, load);
    return inputs;
  }
  if (has("solid") && wet) {
    auto& motion = *inputs.mutable_displacements();
    if (brought_.has_wet_surface()) {
      motion.set_surface(surface().identity());
      resize(*motion.mutable_displacement(), surface().reference_positions_size());
      resize(*motion.mutable_velocity(), surface().reference_positions_size());
    } else {
      motion = initial_.displacements();
    }
    shear(surface(), small_share * variant, motion);
  }
  if (role_ == "fluid" && has("grains")) {
    auto& states = *inputs.mutable_grain_states() = initial_.grain_states();
    for (int i = 0; i < states.centre_size(); ++i)
      states.set_centre(i, states.centre(i) + small_share * variant * states.radius(0));
  }
  if (role_ == "grains" && has("fluid")) {
    const auto& states = brought_.grain_states();
    auto& forces = *inputs.mutable_grain_forces();
    // As it hangs in the fluid, a grain of water's density of this radius would weigh so much.
    const double weight = states.radius_size() > 0 ? 9.81e3 * states.radius(0) * states.radius(0) : 0.0;
    resize(*forces.mutable_force(), states.centre_size(), small_share * variant * weight);
    resize(*forces.mutable_torque(), states.spin_size());
  }
  return inputs;
}

std::string ConformInputs::fault_of(const v1::Exchange& outputs) const {
  if (!finite(outputs)) return "a value is not finite";
  const bool wet = surface().reference_positions_size() > 0;
  try {
    if (role_ == "solid" && wet) {
      if (!outputs.has_displacements()) return "no displacements";
      check_displacements(outputs.displacements(), surface());
    }
    if (role_ == "fluid" && has("solid")) {
      if (outputs.has_forces()) {
        check_forces(outputs.forces(), surface());
      } else {
        if (!outputs.has_pressures()) return "neither pressures nor forces";
        check_pressures(outputs.pressures(), surface());
      }
    }
    if (role_ == "grains" && has("solid")) {
      if (!outputs.has_forces()) return "no forces on the wet surface";
      check_forces(outputs.forces(), surface());
    }
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  if (role_ == "fluid" && has("grains")) {
    const auto& states = initial_.grain_states();
    if (outputs.grain_forces().force_size() != states.centre_size() ||
        outputs.grain_forces().torque_size() != states.spin_size())
      return fmt::format("grain_forces: {} and {} values for {} grains", outputs.grain_forces().force_size(),
                         outputs.grain_forces().torque_size(), states.radius_size());
  }
  if (role_ == "grains" && has("fluid") &&
      outputs.grain_states().centre_size() != brought_.grain_states().centre_size())
    return fmt::format("grain_states: {} values of `centre`, {} at the start",
                       outputs.grain_states().centre_size(), brought_.grain_states().centre_size());
  return {};
}

std::vector<WrongExchange> wrong_fields(const v1::Exchange& right) {
  std::vector<WrongExchange> result;
  std::vector<const FieldDescriptor*> fields;
  right.GetReflection()->ListFields(right, &fields);
  for (const FieldDescriptor* field : fields) {
    v1::Exchange without = right;
    without.GetReflection()->ClearField(&without, field);
    result.push_back({fmt::format("no {}", field->name()), std::move(without)});
    const auto& part = right.GetReflection()->GetMessage(right, field);
    std::vector<const FieldDescriptor*> values;
    part.GetReflection()->ListFields(part, &values);
    for (const FieldDescriptor* value : values) {
      const auto changed = [&](const char* how, const auto& change) {
        v1::Exchange wrong = right;
        auto* message = wrong.GetReflection()->MutableMessage(&wrong, field);
        change(*message->GetReflection(), message);
        result.push_back({fmt::format("{}.{} {}", field->name(), value->name(), how), std::move(wrong)});
      };
      if (value->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE && value->is_repeated()) {
        changed("not a number", [&](const auto& reflection, auto* message) {
          reflection.SetRepeatedDouble(message, value, 0, std::numeric_limits<double>::quiet_NaN());
        });
        changed("one value longer",
                [&](const auto& reflection, auto* message) { reflection.AddDouble(message, value, 0.0); });
      }
      if (value->name() == "surface") {
        changed("of another surface", [&](const auto& reflection, auto* message) {
          reflection.SetUInt64(message, value, reflection.GetUInt64(*message, value) + 1);
        });
      }
    }
  }
  return result;
}

std::vector<WrongExchange> wrong_surfaces(const v1::Exchange& right) {
  std::vector<WrongExchange> result;
  if (!right.has_wet_surface()) return result;
  const auto changed = [&](const char* what, const auto& change) {
    v1::Exchange wrong = right;
    change(*wrong.mutable_wet_surface());
    result.push_back({what, std::move(wrong)});
  };
  changed("a position that is not a number", [](v1::WetSurface& surface) {
    surface.set_reference_positions(0, std::numeric_limits<double>::quiet_NaN());
  });
  changed("a facet of a node that is not there", [](v1::WetSurface& surface) {
    surface.set_connectivity(0, static_cast<std::uint32_t>(node_count(surface)));
  });
  changed("seven dimensions", [](v1::WetSurface& surface) { surface.set_dimension(7); });
  changed("no nodes", [](v1::WetSurface& surface) { surface.clear_reference_positions(); });
  return result;
}

}  // namespace estuary::coupler
