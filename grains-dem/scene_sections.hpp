// The sections of the [grains] table, each read by a function of its own; for grains_scene.cpp.
#pragma once

#include <cmath>
#include <stdexcept>

#include "expression.hpp"
#include "grains_scene.hpp"

namespace estuary::grains {

// sample_scene.cpp: what grains there are, how they come to rest, and what sticks them together for the
// fluid.
void read_groups(SceneTable& grains, GrainsScene& result);
void read_deposit(SceneTable& grains, GrainsScene& result);
void read_cement(SceneTable& grains, bool all_held, GrainsScene& result);

// wall_scene.cpp: the box with its periodic sides and walls, and all other walls.
void read_box(SceneTable& grains, GrainsScene& result);
void read_walls(SceneTable& grains, GrainsScene& result);

/// `size` numbers, all `fallback` when the key is absent.
inline std::vector<double> vector_or(SceneTable& table, std::string_view key, std::size_t size,
                                     double fallback) {
  if (!table.has(key)) return std::vector<double>(size, fallback);
  auto values = table.numbers(key, size);
  values.resize(size, fallback);
  return values;
}

/// Components of a velocity, a spin or an acceleration as expressions of t; empty when the key is absent.
inline std::vector<std::string> motion_of(SceneTable& table, const char* key, std::size_t size) {
  if (!table.has(key)) return {};
  std::vector<std::string> texts = table.expressions(key, size);
  for (const std::string& text : texts) {
    try {
      if (!std::isfinite(Expression(text)(0, 0, 0, 0))) table.problem(key, "is not finite at t = 0");
    } catch (const std::invalid_argument& error) {
      table.problem(key, error.what());
    }
  }
  return texts;
}

}  // namespace estuary::grains
