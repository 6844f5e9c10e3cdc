// The sections of the [grains] table, each read by a function of its own; for grains_scene.cpp.
#pragma once

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

}  // namespace estuary::grains
