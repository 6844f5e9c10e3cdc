#include "grain_states.hpp"

#include <fmt/format.h>

#include <cmath>

#include "participant.hpp"

namespace estuary::fluid {
namespace {

std::vector<double> checked(const google::protobuf::RepeatedField<double>& values, const char* name,
                            std::size_t per_grain, std::size_t grains) {
  const std::string field = std::string("grain_states.") + name;
  if (static_cast<std::size_t>(values.size()) != per_grain * grains) {
    throw BadInput(
        field, fmt::format("{} values for {} grains: {} each are needed", values.size(), grains, per_grain));
  }
  for (int k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) {
      throw BadInput(
          field, fmt::format("grain {}: the value is not finite", static_cast<std::size_t>(k) / per_grain));
    }
  }
  return {values.begin(), values.end()};
}

}  // namespace

Grains read_grains(const v1::GrainStates& message, int dimension) {
  if (message.dimension() != static_cast<std::uint32_t>(dimension)) {
    throw BadInput("grain_states.dimension",
                   fmt::format("grains of {} dimensions in a fluid of {}", message.dimension(), dimension));
  }
  const auto count = static_cast<std::size_t>(message.radius_size());
  const auto components = static_cast<std::size_t>(dimension);
  Grains grains;
  grains.dimension = dimension;
  grains.centre = checked(message.centre(), "centre", components, count);
  grains.radius = checked(message.radius(), "radius", 1, count);
  grains.velocity = checked(message.velocity(), "velocity", components, count);
  grains.spin = checked(message.spin(), "spin", dimension == 3 ? 3 : 1, count);
  for (std::size_t n = 0; n < count; ++n) {
    if (!(grains.radius[n] > 0)) {
      throw BadInput("grain_states.radius",
                     fmt::format("grain {}: {:g} m is not positive", n, grains.radius[n]));
    }
  }
  return grains;
}

Grains between(const Grains& start, const Grains& end, double place, double motion, double duration) {
  Grains now = end;
  if (place < 1) {
    const double s = place;
    const double h00 = (1 + 2 * s) * (1 - s) * (1 - s);
    const double h10 = s * (1 - s) * (1 - s) * duration;
    const double h01 = s * s * (3 - 2 * s);
    const double h11 = s * s * (s - 1) * duration;
    for (std::size_t k = 0; k < end.centre.size(); ++k)
      now.centre[k] =
          h00 * start.centre[k] + h10 * start.velocity[k] + h01 * end.centre[k] + h11 * end.velocity[k];
  }
  if (motion < 1) {
    const double s = motion;
    for (std::size_t k = 0; k < end.velocity.size(); ++k)
      now.velocity[k] = (1 - s) * start.velocity[k] + s * end.velocity[k];
    for (std::size_t k = 0; k < end.spin.size(); ++k) now.spin[k] = (1 - s) * start.spin[k] + s * end.spin[k];
  }
  return now;
}

Grains to_lattice(const Grains& grains, const Grid& grid, const Units& units) {
  Grains result = grains;
  const auto components = static_cast<std::size_t>(grains.dimension);
  for (std::size_t n = 0; n < grains.count(); ++n) {
    double* centre = &result.centre[components * n];
    centre[0] = grid.to_lattice_x(centre[0]);
    centre[1] = grid.to_lattice_y(centre[1]);
    if (components == 3) centre[2] = grid.to_lattice_z(centre[2]);
    result.radius[n] /= grid.spacing;
  }
  for (double& value : result.velocity) value *= units.velocity_to_lattice();
  for (double& value : result.spin) value *= units.time_step;
  return result;
}

void write_loads(const GrainLoads& loads, int dimension, const Units& units, v1::GrainForces& message) {
  const double force = units.force(dimension);
  for (const double value : loads.force) message.add_force(value * force);
  for (const double value : loads.torque) message.add_torque(value * force * units.spacing);
}

}  // namespace estuary::fluid
