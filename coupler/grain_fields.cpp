#include "grain_fields.hpp"

#include <fmt/format.h>

#include <cmath>

#include "failure.hpp"

namespace estuary::coupler {
namespace {

void check(const char* participant, const char* field, const google::protobuf::RepeatedField<double>& values,
           int grains, int per_grain, const Position& position) {
  if (values.size() != grains * per_grain)
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("participant '{}' at window {}: {} holds {} numbers, expected {} for {} grains",
                    participant, position.window, field, values.size(), grains * per_grain, grains));
  for (int k = 0; k < values.size(); ++k) {
    if (std::isfinite(values[k])) continue;
    throw RunFailure(
        ExitStatus::no_solution,
        fmt::format("participant '{}' gave {} = {} for grain {}, window {}, iteration {}", participant, field,
                    values[k], k / per_grain, position.window, position.iteration),
        "its solution has blown up: try a smaller window, a finer fluid or a relaxation time further "
        "from 1/2");
  }
}

}  // namespace

void check_grain_states(const v1::GrainStates& states, int dimension, const Position& position) {
  if (static_cast<int>(states.dimension()) != dimension || states.radius_size() == 0)
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("participant 'grains' at window {}: {} grains in {} dimensions, the scene has {}",
                    position.window, states.radius_size(), states.dimension(), dimension));
  const int grains = states.radius_size();
  const int spins = dimension == 2 ? 1 : 3;
  check("grains", "grain_states.centre", states.centre(), grains, dimension, position);
  check("grains", "grain_states.radius", states.radius(), grains, 1, position);
  check("grains", "grain_states.velocity", states.velocity(), grains, dimension, position);
  check("grains", "grain_states.spin", states.spin(), grains, spins, position);
}

void check_grain_forces(const v1::GrainForces& forces, const v1::GrainStates& states,
                        const Position& position) {
  const int grains = states.radius_size();
  const auto dimension = static_cast<int>(states.dimension());
  check("fluid", "grain_forces.force", forces.force(), grains, dimension, position);
  check("fluid", "grain_forces.torque", forces.torque(), grains, dimension == 2 ? 1 : 3, position);
}

}  // namespace estuary::coupler
