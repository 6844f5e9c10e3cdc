// Means over a box, against fields that are given.
#include "watches.hpp"

#include <gtest/gtest.h>

namespace estuary::fluid {
namespace {

// A box whose solid lies unevenly, and more of it at one end: the pressure leans by 1/64 per spacing from end
// plane to end plane and is far from that line between them.
class Box : public testing::TestWithParam<std::size_t> {
protected:
  static constexpr double slope = 0.015625;
  static Grid grid(bool periodic) {
    Grid grid{12, 11, 1.0, 0, 0, periodic, periodic};
    grid.nz = 10;
    grid.periodic_z = periodic;
    return grid;
  }
  void fill(std::size_t axis, bool periodic) {
    const Grid g = grid(periodic);
    cells.emplace(g);
    fields.excess.resize(g.size());
    fields.velocity_x.resize(g.size());
    fields.velocity_y.resize(g.size());
    fields.velocity_z.resize(g.size());
    std::vector<Node> uncovered;
    for (int z = 0; z < g.nz; ++z)
      for (int y = 0; y < g.ny; ++y) {
        const int begin = (3 * y + 2 * z) % 5, end = begin + 1 + (y * z) % 6;
        cells->set_solid(y + g.ny * z, cell_obstacle, {{begin, end}}, uncovered);
        for (int x = 0; x < g.nx; ++x) {
          const std::size_t k = g.index(x, y, z);
          const std::array<int, 3> at{x, y, z};
          const bool end_plane = at[axis] == low[axis] || at[axis] == high[axis];
          fields.excess[k] = slope * at[axis] + (end_plane ? 0 : 0.5 * x * y + z * z);
          fields.velocity_x[k] = cells->fluid(x, y, z) ? 0.25 : 0;
        }
      }
  }
  const std::array<int, 3> low{2, 1, 3}, high{9, 8, 8};
  std::optional<Cells> cells;
  Fields fields;
};
INSTANTIATE_TEST_SUITE_P(Along, Box, testing::Values(0, 1, 2));

TEST_P(Box, GradientIsThatBetweenItsEndPlanes) {
  const std::size_t axis = GetParam();
  for (const bool periodic : {false, true}) {  // a box that is a part of a period is one like any other
    fill(axis, periodic);
    const BoxMeans means = box_means(fields, *cells, low, high);
    EXPECT_NEAR(means.excess_gradient[axis], slope, 1e-15);
    EXPECT_GT(means.porosity, 0.4);
    EXPECT_LT(means.porosity, 0.9);
    EXPECT_NEAR(means.velocity[0], 0.25 * means.porosity, 1e-15);
  }
}

TEST_P(Box, OfOnePlaneHasNoGradient) {
  fill(GetParam(), false);
  auto top = high;
  top[GetParam()] = low[GetParam()];
  const BoxMeans means = box_means(fields, *cells, low, top);
  EXPECT_EQ(means.excess_gradient[GetParam()], 0);
  EXPECT_NEAR(means.excess, slope * low[GetParam()], 1e-15);
}

TEST_P(Box, OnceAroundAPeriodHasNoGradient) {
  fill(GetParam(), true);
  const std::array<int, 3> all{11, 10, 9};
  for (const double gradient : box_means(fields, *cells, {}, all).excess_gradient) EXPECT_EQ(gradient, 0);
  fill(GetParam(), false);
  for (const double gradient : box_means(fields, *cells, {}, all).excess_gradient) EXPECT_NE(gradient, 0);
}

}  // namespace
}  // namespace estuary::fluid
