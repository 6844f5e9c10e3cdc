#include "body_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

constexpr double fastest_body = 0.5;  // [lattice units]

}  // namespace

BodyMotion::BodyMotion(const FluidScene& scene) : scene_(scene) {
  fixed_ = std::all_of(scene.round_obstacles.begin(), scene.round_obstacles.end(),
                       [](const RoundObstacle& obstacle) { return obstacle.displacement.empty(); });
}

void BodyMotion::place(double time, const Grains& grains, Flow& flow, bool fill) const {
  const Grid& grid = flow.grid();
  const auto components = static_cast<std::size_t>(grid.dimension());
  Grains bodies;
  bodies.dimension = grid.dimension();
  std::vector<WallRule> rules;
  for (const RoundObstacle& obstacle : scene_.round_obstacles) {
    std::array<double, 3> centre = obstacle.centre;
    std::array<double, 3> velocity = obstacle.surface_velocity;
    // Central difference: exact for what is quadratic in time, and enough beside the scheme's own order.
    const double h = 0.5 * scene_.units.time_step;
    for (std::size_t axis = 0; axis < obstacle.displacement.size(); ++axis) {
      const Expression& displacement = obstacle.displacement[axis];
      centre[axis] += displacement(0, 0, 0, time);
      velocity[axis] += (displacement(0, 0, 0, time + h) - displacement(0, 0, 0, time - h)) / (2 * h);
      const double speed = std::abs(velocity[axis]) * scene_.units.velocity_to_lattice();
      if (!(std::isfinite(centre[axis]) && speed < fastest_body)) {
        throw Diverged(
            "displacement",
            fmt::format("obstacle '{}' moves with {:g} m/s at t = {:g} s, {:.2g} spacings per time step",
                        obstacle.name, velocity[axis], time, speed),
            "raise fluid.reference_velocity to the largest velocity, or check the expression");
      }
    }
    const std::array<double, 3> at{grid.to_lattice_x(centre[0]), grid.to_lattice_y(centre[1]),
                                   components == 3 ? grid.to_lattice_z(centre[2]) : 0.0};
    for (std::size_t axis = 0; axis < components; ++axis) {
      bodies.centre.push_back(at[axis]);
      bodies.velocity.push_back(velocity[axis] * scene_.units.velocity_to_lattice());
    }
    bodies.radius.push_back(obstacle.radius / grid.spacing);
    for (std::size_t axis = components == 3 ? 0 : 2; axis < 3; ++axis) {
      bodies.spin.push_back(obstacle.spin[axis] * scene_.units.time_step);
    }
    rules.push_back(obstacle.rule);
  }
  bodies.centre.insert(bodies.centre.end(), grains.centre.begin(), grains.centre.end());
  bodies.radius.insert(bodies.radius.end(), grains.radius.begin(), grains.radius.end());
  bodies.velocity.insert(bodies.velocity.end(), grains.velocity.begin(), grains.velocity.end());
  bodies.spin.insert(bodies.spin.end(), grains.spin.begin(), grains.spin.end());
  rules.resize(bodies.count(), scene_.grain_rule);
  if (bodies.count() > 0) flow.place_bodies(bodies, rules, fill);
}

}  // namespace estuary::fluid
