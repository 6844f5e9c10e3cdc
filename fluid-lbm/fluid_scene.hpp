// What a scene says about the fluid, read and checked. Keys: see the README of this folder.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "expression.hpp"
#include "flow.hpp"
#include "participant.hpp"
#include "scene.hpp"
#include "units.hpp"

namespace estuary::fluid {

/// A profile along a side or in the domain: x and y component, or one scalar.
struct SideProfile {
  std::vector<Expression> velocity;  // two, or none
  std::optional<Expression> pressure;
  [[nodiscard]] bool constant_in_time() const;
};

struct WatchRequest {
  enum class Kind { integral, point, line };
  std::string name;
  Kind kind = Kind::integral;
  std::vector<double> points;  // one or two, interleaved [m]
  int samples = 0;             // of a line
};

struct FluidScene {
  Units units;
  FlowSettings flow;  // kinds of the sides are set, their values are not
  double magic_parameter = 3.0 / 16.0;
  double reference_velocity = 0;
  std::array<SideProfile, 4> profiles;
  std::vector<Expression> initial_velocity;  // two, or none
  std::vector<double> obstacle_positions;    // of all obstacles [m]
  std::vector<std::uint32_t> obstacle_connectivity;
  bool viscous_traction = true;
  bool match_force = false;  // complete the loads to the force by momentum exchange
  bool has_partner = false;  // the scene has other participants
  Mode mode = Mode::transient;
  double window = 0;    // [s]; 0 in steady mode
  double end_time = 0;  // [s]; 0 when unknown
  std::uint64_t steps_per_window = 0;
  double steady_tolerance = 1e-6;
  std::uint64_t steady_maximum_steps = 0;
  std::vector<WatchRequest> watches;
};

/// Notes all problems in the scene; what it gives back counts only when there are none. Fills the plan.
FluidScene read_fluid_scene(Scene& scene, const std::string& role, Plan& plan);

/// Evaluates the profiles of the sides at time t [s] into lattice units.
void evaluate_sides(const FluidScene& scene, double time, Sides& sides);

}  // namespace estuary::fluid
