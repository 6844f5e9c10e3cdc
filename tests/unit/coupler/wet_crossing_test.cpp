#include "wet_crossing.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <vector>

namespace estuary::coupler {
namespace {

using Points = std::vector<std::array<double, 2>>;

// Adds a line of facets through these points.
void add_line(v1::WetSurface& surface, const Points& points) {
  surface.set_dimension(2);
  const auto first = static_cast<std::uint32_t>(surface.reference_positions_size() / 2);
  for (std::uint32_t k = 0; k < points.size(); ++k) {
    surface.add_reference_positions(points[k][0]);
    surface.add_reference_positions(points[k][1]);
    if (k == 0) continue;
    surface.add_connectivity(first + k - 1);
    surface.add_connectivity(first + k);
  }
}

v1::WetSurface lines(std::initializer_list<Points> all) {
  v1::WetSurface surface;
  for (const Points& points : all) add_line(surface, points);
  return surface;
}

std::optional<WetCrossing> crossing_of(const v1::WetSurface& surface) {
  return find_crossing(
      surface, std::vector<double>(static_cast<std::size_t>(surface.reference_positions_size()), 0.0));
}

// Points of a sagging line: at (x, height - 4 depth x (1 - x)).
Points sagging(int facets, double height, double depth) {
  Points points;
  for (int k = 0; k <= facets; ++k) {
    const double x = static_cast<double>(k) / facets;
    points.push_back({x, height - 4 * depth * x * (1 - x)});
  }
  return points;
}

TEST(WetCrossing, IsFoundWhereALineMovesThroughAnother) {
  for (const int facets : {3, 40, 1001}) {
    const v1::WetSurface surface = lines({sagging(facets, 0.0, 0.0), sagging(facets, 0.1, 0.0)});
    EXPECT_TRUE(bodies_can_meet(surface));
    const auto sag = [&](double depth) {
      std::vector<double> displacement(static_cast<std::size_t>(surface.reference_positions_size()), 0.0);
      for (std::size_t n = displacement.size() / 4; n < displacement.size() / 2; ++n) {
        const double x = surface.reference_positions(static_cast<int>(2 * n));
        displacement[2 * n + 1] = -4 * depth * x * (1 - x);
      }
      return find_crossing(surface, displacement);
    };
    EXPECT_FALSE(sag(0.0));
    EXPECT_FALSE(sag(0.0999));
    const auto crossing = sag(0.15);
    ASSERT_TRUE(crossing) << facets;
    EXPECT_NEAR(crossing->place[1], 0.0, 1e-15);
    // On both sides of the parabola 4 x (1 - x) = 2/3, but for its chords.
    EXPECT_NEAR(std::abs(crossing->place[0] - 0.5), std::sqrt(1.0 / 12), 0.5 / facets);
    EXPECT_NE(crossing->nodes[0] <= static_cast<std::uint32_t>(facets),
              crossing->nodes[1] <= static_cast<std::uint32_t>(facets));
  }
}

TEST(WetCrossing, WhatOnlyTouchesDoesNotCross) {
  const double a = 0.1, b = 0.3;
  // Ends that meet, an end on a facet to rounding, facets on one line, parallel ones.
  EXPECT_FALSE(crossing_of(lines({{{0, 0}, {a, b}}, {{a, b}, {1, 0}}, {{a, b}, {-1, 0.7}}})));
  for (const double off : {0.0, 1e-16, -1e-16, 1e-11, -1e-11})
    EXPECT_FALSE(crossing_of(lines({{{0, 0}, {3 * a, 3 * b}}, {{a, b + off}, {1, -1}}})));
  EXPECT_FALSE(
      crossing_of(lines({{{0, 0}, {3 * a, 3 * b}}, {{a, b}, {7 * a, 7 * b}}, {{1e-12, 0}, {a, b}}})));
  EXPECT_FALSE(crossing_of(lines({{{0, 0}, {1, 0}}, {{0.5, 1e-12}, {1.5, -1e-12}}})));
  EXPECT_TRUE(crossing_of(lines({{{0, 0}, {3 * a, 3 * b}}, {{a, b + 1e-6}, {1, -1}}})));
  // Facets at a node, and a line that goes straight back.
  EXPECT_FALSE(crossing_of(lines({{{0, 0}, {1, 0}, {0, 1e-3}}, {{5, 5}, {6, 5}, {5, 5}}})));
  // Facets without length, and without a place.
  EXPECT_FALSE(crossing_of(lines({{{0.5, 0}, {0.5, 0}}, {{0, 0}, {1, 0}}, {{NAN, 0}, {0.5, INFINITY}}})));
}

TEST(WetCrossing, IsFoundForLengthsAndPlacesOfAnySize) {
  for (const double scale : {1e-9, 1.0, 1e9}) {
    for (const double shift : {-1e3, 0.0, 1e3}) {
      const auto at = [&](double x, double y) {
        return std::array{scale * (x + shift), scale * (y - shift)};
      };
      const auto crossing = crossing_of(lines({{at(0, 0), at(4, 4)}, {at(2.9, 3.1), at(3.1, 2.9)}}));
      ASSERT_TRUE(crossing);
      EXPECT_NEAR(crossing->place[0] / scale - shift, 3, 1e-9);
      EXPECT_NEAR(crossing->place[1] / scale + shift, 3, 1e-9);
    }
  }
}

TEST(WetCrossing, BodiesCanMeetWhereThereAreTwoLinesThatDoNotCrossAtRest) {
  EXPECT_FALSE(bodies_can_meet(lines({sagging(10, 0.0, 0.0)})));
  EXPECT_TRUE(bodies_can_meet(lines({sagging(10, 0.0, 0.0), sagging(10, 0.0, -1.0)})));
  EXPECT_FALSE(bodies_can_meet(lines({sagging(10, 0.0, 0.0), sagging(10, 0.1, 0.2)})));
  v1::WetSurface solid = lines({sagging(10, 0.0, 0.0), sagging(10, 1.0, 0.0)});
  solid.set_dimension(3);
  EXPECT_FALSE(bodies_can_meet(solid));
}

// All 2e8 pairs, or the 1e12 cells along the long facet, would take minutes.
TEST(WetCrossing, OneLongFacetAmongManyShortOnesIsCheap) {
  v1::WetSurface surface = lines({sagging(10000, 0.0, 0.0), sagging(10000, 0.1, 0.0)});
  add_line(surface, {{-1e8, -1}, {1e8, -1}});
  EXPECT_FALSE(crossing_of(surface));
  add_line(surface, {{0.25, -500}, {0.75, 500}});
  EXPECT_TRUE(crossing_of(surface));
}

}  // namespace
}  // namespace estuary::coupler
