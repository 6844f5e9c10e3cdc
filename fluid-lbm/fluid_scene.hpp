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

/// A profile along a side or in the domain: the components of a velocity, or one scalar.
struct SideProfile {
  std::vector<Expression> velocity;  // one per dimension, or none
  std::optional<Expression> pressure;
  [[nodiscard]] bool constant_in_time() const;
};

/// A disc or sphere that is no grain.
struct RoundObstacle {
  std::string name;
  std::array<double, 3> centre{};  // [m]
  double radius = 0;               // [m]
  WallRule rule = WallRule::linear;
  std::vector<Expression> displacement;      // of the centre over time [m]; empty when fixed
  std::array<double, 3> surface_velocity{};  // of a wall that slides on the spot [m/s]
  std::array<double, 3> spin{};              // [rad/s]; the last alone in two dimensions
};

/// What watches need to know about a polygon, box or image.
struct FixedObstacle {
  std::string name;
  std::array<double, 3> centre{};  // torques count about it [m]
};

struct WatchRequest {
  enum class Kind { integral, point, line, box, obstacle };
  std::string name;
  Kind kind = Kind::integral;
  std::vector<double> points;  // one, or two (ends of a line, corners of a box), interleaved [m]
  int samples = 0;             // of a line
  std::string obstacle;
  double reference_length = 0;  // obstacle: for coefficients; 0 without
  double reference_velocity = 0;
  std::vector<Expression> exact_velocity;  // integral: to compare with
};

enum class GrainMethod { partially_saturated, interpolated };

struct FluidScene {
  Units units;
  FlowSettings flow;  // kinds of the sides are set, their values are not
  double reference_velocity = 0;
  std::array<SideProfile, 6> profiles;
  std::vector<Expression> initial_velocity;  // one per dimension, or none
  std::optional<Expression> initial_pressure;
  std::vector<Expression> body_force;      // [m/s2], one per dimension, or none
  std::vector<double> obstacle_positions;  // of all polygons [m]
  std::vector<std::uint32_t> obstacle_connectivity;
  std::optional<WallRule> outline_rule;  // of all polygons, when one of them names it
  std::vector<RoundObstacle> round_obstacles;
  std::vector<std::uint32_t> obstacle_of_point;
  // From images and boxes, one per node: one more than the obstacle's number, 0 in the fluid; empty without.
  std::vector<std::uint16_t> solid_nodes;
  std::vector<FixedObstacle> fixed_obstacles;  // by number; discs and spheres without a name
  GrainMethod grain_method = GrainMethod::partially_saturated;
  WallRule grain_rule = WallRule::linear;
  bool viscous_traction = true;
  bool match_force = false;       // complete the loads to the force by momentum exchange
  bool close_everywhere = false;  // links of the wet surface close gradually, not at edges alone
  bool exchange_loads = false;    // loads are the links' momentum exchange, node by node
  bool has_solid = false;
  bool has_grains = false;
  bool has_partner = false;      // the scene has other participants
  bool repeats_windows = false;  // iterations with a solid go back to the window's start
  bool writes_frames = true;
  bool writes_checkpoints = false;
  int ranks = 1;  // processes that share the lattice
  Mode mode = Mode::transient;
  double window = 0;    // [s]; 0 in steady mode
  double end_time = 0;  // [s]; 0 when unknown
  std::uint64_t steps_per_window = 0;
  double steady_tolerance = 1e-6;
  std::uint64_t steady_maximum_steps = 0;
  std::vector<WatchRequest> watches;

  [[nodiscard]] int dimension() const { return flow.grid.dimension(); }
};

/// Notes all problems in the scene; what it gives back counts only when there are none. Fills the plan.
FluidScene read_fluid_scene(Scene& scene, const std::string& role, Plan& plan);

/// Evaluates the profiles of the sides at time t [s] into lattice units.
void evaluate_sides(const FluidScene& scene, double time, Sides& sides);
/// The body force at time t, lattice units.
[[nodiscard]] std::array<double, 3> evaluate_body_force(const FluidScene& scene, double time);

}  // namespace estuary::fluid
