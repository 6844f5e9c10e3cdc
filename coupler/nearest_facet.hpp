// Finds the point of a wet surface that is nearest to a given point, with a tree of bounding boxes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "estuary/v1/payload.pb.h"

namespace estuary::coupler {

enum class NearestTo { nodes, facets };

/// A point of a facet as the weights of its corners, which are not negative and add up to 1.
struct FacetPoint {
  std::size_t count = 0;
  std::array<std::uint32_t, 3> node{};
  std::array<double, 3> weight{};
  double squared_distance = 0;  // [m^2]
};

class NearestFacet {
public:
  /// `surface` must outlive the search; segments in 2D, triangles in 3D (checked by check_wet_surface).
  NearestFacet(const v1::WetSurface& surface, NearestTo kind);
  /// Of several equally near the one with the lowest number.
  [[nodiscard]] FacetPoint find(std::span<const double> point) const;

private:
  using Point = std::array<double, 3>;  // z = 0 in 2D
  struct Box {
    Point low;
    Point high;
    std::size_t first;  // of order_
    std::size_t last;   // exclusive
    std::size_t left;   // children; 0: a leaf
    std::size_t right;
  };
  [[nodiscard]] Point corner(std::uint32_t node) const;
  [[nodiscard]] std::span<const std::uint32_t> corners(std::size_t item) const;
  std::size_t build(std::size_t first, std::size_t last);
  [[nodiscard]] FacetPoint nearest_on(std::size_t item, const Point& point) const;
  static double squared_distance(const Box& box, const Point& point);

  const v1::WetSurface& surface_;
  std::size_t corners_per_item_;
  std::vector<std::uint32_t> items_;  // node numbers
  std::vector<std::size_t> order_;    // of the items in the tree
  std::vector<Box> boxes_;            // the root first
};

}  // namespace estuary::coupler
