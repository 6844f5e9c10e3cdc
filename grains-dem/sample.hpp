// Samples: where grains are at the start, how large they are, and files that keep a deposit for other scenes.
#pragma once

#include <filesystem>

#include "grains_scene.hpp"

namespace estuary::grains {

/// `count` radii of a grading, largest spread first to last in random order; the same seed gives the same
/// radii. The cumulative law is divided into `count` equal parts and each grain takes the middle of one, so
/// that a few hundred grains already follow the law.
std::vector<double> draw_radii(const Grading& grading, std::size_t count, std::int64_t seed, int dimension);

/// Grains of one group. Throws std::invalid_argument when they cannot be placed.
template <int D>
struct GroupGrains {
  std::vector<double> position, velocity, spin, radius;
};
template <int D>
GroupGrains<D> place_group(const GroupScene& group);

/// Number of grains of a group, without making them; a file is read.
std::size_t count_grains(const GroupScene& group, int dimension);

/// A sample file: text, one line per grain, "x,y[,z],radius" under that header, in metres.
void write_sample(const std::filesystem::path& file, int dimension, std::span<const double> position,
                  std::span<const double> radius);
void read_sample(const std::filesystem::path& file, int dimension, std::vector<double>& position,
                 std::vector<double>& radius);

}  // namespace estuary::grains
