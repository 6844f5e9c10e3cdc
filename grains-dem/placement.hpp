// Whether the grains of a scene can begin where they are placed.
#pragma once

#include "deposit.hpp"

namespace estuary::grains {

/// Throws std::invalid_argument when a periodic direction is shorter than two of the largest grains, two
/// grains have the same centre (no direction to push each other), or the centre of one that moves lies behind
/// a plane (which would throw it out with the energy of an overlap of more than its radius).
template <int D>
void check_placement(const DynamicsSettings<D>& settings, const std::vector<Wall<D>>& walls,
                     const InitialGrains<D>& grains);

/// The deepest overlap of two grains, one of which moves, in radii of the smaller.
struct DeepestOverlap {
  std::size_t first = 0, second = 0;  // in the scene's order
  double depth = 0;
};
template <int D>
DeepestOverlap deepest_overlap(const DynamicsSettings<D>& settings, const InitialGrains<D>& grains);

/// The deepest overlap of a grain that moves with a plane, in its radii.
struct DeepestInWall {
  std::size_t grain = 0;
  std::string wall;
  double depth = 0;
};
template <int D>
DeepestInWall deepest_in_wall(const std::vector<Wall<D>>& walls, const InitialGrains<D>& grains);

}  // namespace estuary::grains
