// The parts of the fluid's table, one function each; every one notes what is wrong and goes on.
#pragma once

#include "fluid_scene.hpp"

namespace estuary::fluid {

/// Axis names and lengths in messages.
inline constexpr std::array<const char*, 3> axis_names{"length", "height", "depth"};

std::optional<Expression> parse_expression(SceneTable& table, std::string_view key, const std::string& text);
/// `count` expressions of `key`, or none when one is wrong.
std::vector<Expression> parse_expressions(SceneTable& table, std::string_view key, int count);
/// What `wall_rule` says, or `fallback`.
WallRule read_wall_rule(SceneTable& table, WallRule fallback);

void read_sides(SceneTable& fluid, int dimension, FluidScene& result);
void read_grid(SceneTable& fluid, int dimension, FluidScene& result);
void read_time_step(SceneTable& fluid, FluidScene& result, Plan& plan);
void read_model(SceneTable& fluid, int dimension, FluidScene& result, Plan& plan);
void read_obstacles(SceneTable& fluid, FluidScene& result, Plan& plan);
/// Among how many processes the lattice is shared; after the grid and all that moves in it.
void read_ranks(SceneTable& fluid, FluidScene& result, Plan& plan);
/// Between discs and spheres, and among solid nodes.
void warn_of_narrow_gaps(const FluidScene& scene, Plan& plan);
void read_watches(SceneTable& root, const std::string& role, int dimension, FluidScene& result);
/// Speeds that the sides impose at the start, against the speed of sound.
void check_side_values(SceneTable& fluid, const FluidScene& result, Plan& plan);
void fill_plan(const FluidScene& result, Plan& plan);

}  // namespace estuary::fluid
