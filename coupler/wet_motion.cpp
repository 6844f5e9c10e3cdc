#include "wet_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "failure.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using Values = google::protobuf::RepeatedField<double>;

void require_finite(const RemoteParticipant& participant, const Position& position, const char* field,
                    const Values& values, int per_node) {
  for (int i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    throw RunFailure(
        ExitStatus::no_solution,
        fmt::format("participant '{}' gave {} = {} at wet node {}, window {}, iteration {}",
                    participant.role(), field, values[i], i / per_node, position.window, position.iteration),
        "its solution has blown up: try a smaller time step or window, or more relaxation");
  }
}

// A message that breaks the contract ends the run as a lost participant does.
template <typename Check>
void require_valid(const RemoteParticipant& participant, const Position& position, const Check& check) {
  try {
    check();
  } catch (const std::invalid_argument& error) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("participant '{}' at window {}, iteration {}: {}", participant.role(),
                                 position.window, position.iteration, error.what()));
  }
}

}  // namespace

WetMotion motion_of(const v1::Displacements& field) {
  return {{field.displacement().begin(), field.displacement().end()},
          {field.velocity().begin(), field.velocity().end()},
          {field.torn().begin(), field.torn().end()}};
}

v1::Displacements message_of(const WetMotion& motion, const v1::WetSurface& surface) {
  v1::Displacements message;
  message.set_surface(surface.identity());
  message.mutable_displacement()->Assign(motion.displacement.begin(), motion.displacement.end());
  message.mutable_velocity()->Assign(motion.velocity.begin(), motion.velocity.end());
  message.mutable_torn()->Assign(motion.torn.begin(), motion.torn.end());
  return message;
}

double l2_norm(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum);
}

double l2_distance(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

double displacement_scale(const v1::WetSurface& surface) {
  double largest = 0;
  const auto dimension = static_cast<int>(surface.dimension());
  for (int axis = 0; axis < dimension; ++axis) {
    double low = surface.reference_positions(axis);
    double high = low;
    for (int i = axis; i < surface.reference_positions_size(); i += dimension) {
      low = std::min(low, surface.reference_positions(i));
      high = std::max(high, surface.reference_positions(i));
    }
    largest = std::max(largest, high - low);
  }
  return largest * std::sqrt(static_cast<double>(node_count(surface)));
}

WetMotion checked_motion(const RemoteParticipant& participant, const v1::Exchange& outputs,
                         const v1::WetSurface& surface, const Position& position) {
  const auto& field = outputs.displacements();
  const auto dimension = static_cast<int>(surface.dimension());
  require_finite(participant, position, "displacement", field.displacement(), dimension);
  require_finite(participant, position, "velocity", field.velocity(), dimension);
  require_valid(participant, position, [&] { check_displacements(field, surface); });
  return motion_of(field);
}

const v1::WetSurfacePressures& checked_pressures(const RemoteParticipant& participant,
                                                 const v1::Exchange& outputs, const v1::WetSurface& surface,
                                                 const Position& position) {
  const auto& field = outputs.pressures();
  require_finite(participant, position, "pressure", field.pressure(), 1);
  require_finite(participant, position, "viscous_traction", field.viscous_traction(),
                 static_cast<int>(surface.dimension()));
  require_valid(participant, position, [&] { check_pressures(field, surface); });
  return field;
}

const v1::NodalForces& checked_forces(const RemoteParticipant& participant, const v1::Exchange& outputs,
                                      const v1::WetSurface& surface, const Position& position) {
  const auto& field = outputs.forces();
  require_finite(participant, position, "force", field.force(), static_cast<int>(surface.dimension()));
  require_valid(participant, position, [&] { check_forces(field, surface); });
  return field;
}

}  // namespace estuary::coupler
