// Bodies of any outline: particles on the contour and, inside, at the centroids of their own cells.
//
// A particle's volume is its Voronoi cell cut by the contour, so the volumes add up to the body's area to
// round-off. Inner particles start on a square grid and are moved to the centroids of their cells (Lloyd
// 1982), which evens them out next to slanted and curved contours.
#pragma once

#include <array>
#include <vector>

#include "particles.hpp"

namespace estuary::solid {

/// A closed polygon [m]; the last point is joined to the first.
using Polygon = std::vector<std::array<double, 2>>;

/// Positive when walked counter-clockwise.
double signed_area(const Polygon& polygon);
/// Polygon of a circle whose area is that of the circle.
Polygon circle(std::array<double, 2> centre, double radius, double spacing);
bool contains(const std::vector<Polygon>& loops, double x, double y);

/// Particles on the contours of the area between `loops` only: corners, and points about one spacing apart
/// between them. No masses. Throws std::invalid_argument when a loop is degenerate.
Body place_on_contours(const std::vector<Polygon>& loops, double spacing);

/// Area [m2], centroid [m] and polar second moment of area about it [m4] of the area between `loops`.
struct AreaMoments {
  double area = 0;
  std::array<double, 2> centroid{};
  double polar = 0;
};
AreaMoments area_moments(const std::vector<Polygon>& loops);

struct FillingOptions {
  double spacing = 0;
  double density = 0;
  double smoothing_ratio = 0.95;
  int evening_steps = 30;  // moves to the centroids
};

/// The area between `loops` by the even-odd rule, its outer loop first, holes after it. Corners stay,
/// stretches between them are divided into equal parts of about one spacing. Throws std::invalid_argument
/// when a loop is degenerate or no particle finds place inside.
Body fill_outline(const std::vector<Polygon>& loops, const FillingOptions& options);

}  // namespace estuary::solid
