// Which nodes are solid, against a brute-force test of every node.
#include <gtest/gtest.h>

#include <algorithm>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

using namespace cases;

// Winding number by summed angles: slow, and shares nothing with the code under test.
bool inside_polygon(const std::vector<double>& points, double x, double y) {
  double angle = 0;
  const std::size_t count = points.size() / 2;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t m = (n + 1) % count;
    const double ax = points[2 * n] - x, ay = points[2 * n + 1] - y;
    const double bx = points[2 * m] - x, by = points[2 * m + 1] - y;
    angle += std::atan2(ax * by - ay * bx, ax * bx + ay * by);
  }
  return std::abs(angle) > std::numbers::pi;
}

// A star-shaped polygon, clockwise, with uneven radii.
std::vector<double> random_star(std::mt19937& random, double x, double y, double smallest, double largest,
                                int count) {
  std::uniform_real_distribution<double> radius(smallest, largest);
  std::vector<double> points;
  for (int n = 0; n < count; ++n) {
    const double angle = -2 * std::numbers::pi * n / count;
    const double r = radius(random);
    points.insert(points.end(), {x + r * std::cos(angle), y + r * std::sin(angle)});
  }
  return points;
}

Cells classify(const Grid& grid, const Outline& outline) {
  Surface surface(grid, outline.nodes(), outline.connectivity);
  surface.place(outline.positions, outline.at_rest(), 0.0);
  SolidRows rows(grid);
  const auto& solid = rows.classify(surface.segments());
  Cells cells(grid);
  std::vector<Node> uncovered;
  for (int y = 0; y < grid.ny; ++y)
    cells.set_solid(y, cell_wet_solid, solid[static_cast<std::size_t>(y)], uncovered);
  return cells;
}

TEST(Classification, RandomClosedPolygons) {
  std::mt19937 random(7);
  const Grid grid{40, 30, 1, 0, 0, false, false};
  for (int n = 0; n < 50; ++n) {
    const auto points = random_star(random, 18.37, 14.61, 2, 17, 11 + n % 20);  // some reach beyond the grid
    const Cells cells = classify(grid, line(points, true));
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 40; ++x) {
        ASSERT_EQ(!cells.fluid(x, y), inside_polygon(points, x, y))
            << "polygon " << n << " node " << x << ' ' << y;
      }
    }
  }
}

// A bar fixed to an obstacle brings only the part of its contour that is wet.
TEST(Classification, LineWithBothEndsInsideIsClosed) {
  std::mt19937 random(5);
  const Grid grid{40, 30, 1, 0, 0, false, false};
  for (int n = 0; n < 20; ++n) {
    const auto points = random_star(random, 18.37, 14.61, 2, 13, 11 + n);
    const Cells cells = classify(grid, line(points, false));
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 40; ++x) {
        ASSERT_EQ(!cells.fluid(x, y), inside_polygon(points, x, y))
            << "polygon " << n << " node " << x << ' ' << y;
      }
    }
  }
}

TEST(Classification, OutlineEndingOnTheFloor) {
  std::mt19937 random(11);
  const Grid grid{50, 20, 1, 0, 0, false, false};
  std::uniform_real_distribution<double> jitter(-1.3, 1.3);
  for (int n = 0; n < 30; ++n) {
    std::vector<double> points;  // up the left face, down the right one: the fluid on the left of the walk
    for (int k = 0; k <= 8; ++k) points.insert(points.end(), {18.3 + jitter(random), -0.5 + 1.7 * k});
    for (int k = 8; k >= 0; --k) points.insert(points.end(), {24.3 + jitter(random), -0.5 + 1.7 * k});
    const Cells cells = classify(grid, line(points, false));
    for (int y = 0; y < 20; ++y) {
      for (int x = 0; x < 50; ++x) {
        ASSERT_EQ(!cells.fluid(x, y), inside_polygon(points, x, y))
            << "fin " << n << " node " << x << ' ' << y;
      }
    }
  }
}

TEST(Classification, LineAcrossPeriodicChannel) {
  const Grid grid{24, 16, 1, 0, 0, true, false};
  for (const double height : {3.0, 5.5, 9.999, 15.7, -2.0}) {
    const Cells cells = classify(grid, ceiling(24, height, 10));
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 24; ++x)
        ASSERT_EQ(cells.fluid(x, y), y < height) << height << ": " << x << ' ' << y;
    }
  }
  std::vector<double> wave;
  for (int n = 0; n <= 48; ++n) {
    const double x = 24 - 0.5 - n * 0.5;
    wave.insert(wave.end(), {x, 8.3 + 3 * std::sin(2 * std::numbers::pi * (x + 0.5) / 24)});
  }
  const Cells cells = classify(grid, line(wave, false));
  for (int x = 0; x < 24; ++x) {
    // Nodes of the line stand half-way between columns too, so the height at a column is one of its points.
    const double height = 8.3 + 3 * std::sin(2 * std::numbers::pi * (x + 0.5) / 24);
    for (int y = 0; y < 16; ++y) ASSERT_EQ(cells.fluid(x, y), y < height) << x << ' ' << y;
  }
}

TEST(Classification, BodyAcrossPeriodicSides) {
  std::mt19937 random(3);
  const Grid grid{30, 20, 1, 0, 0, true, true};
  for (int n = 0; n < 20; ++n) {
    const auto points = random_star(random, 1.3 + 31 * (n % 3), 18.7 - 41 * (n % 2), 2, 8, 17);
    const Cells cells = classify(grid, line(points, true));
    for (int y = 0; y < 20; ++y) {
      for (int x = 0; x < 30; ++x) {
        bool solid = false;
        for (int ky = -3; ky <= 3; ++ky) {
          for (int kx = -3; kx <= 3; ++kx) solid = solid || inside_polygon(points, x + 30 * kx, y + 20 * ky);
        }
        ASSERT_EQ(!cells.fluid(x, y), solid) << "polygon " << n << " node " << x << ' ' << y;
      }
    }
    EXPECT_EQ(cells.state(-1, 7), cells.state(29, 7));
    EXPECT_EQ(cells.state(30, 20), cells.state(0, 0));
  }
}

TEST(Classification, HoleInASolidIsFluid) {
  const Grid grid{20, 20, 1, 0, 0, false, false};
  auto outer = disc(9.6, 9.4, 8.2, 24);
  auto inner = disc(9.6, 9.4, 4.1, 24);
  std::vector<double> reversed;
  for (std::size_t n = inner.nodes(); n-- > 0;) {
    reversed.insert(reversed.end(), {inner.positions[2 * n], inner.positions[2 * n + 1]});
  }
  Outline both = outer;
  both.positions.insert(both.positions.end(), reversed.begin(), reversed.end());
  for (std::uint32_t n = 0; n < 24; ++n)
    both.connectivity.insert(both.connectivity.end(), {24 + n, 24 + (n + 1) % 24});
  const Cells cells = classify(grid, both);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) {
      const bool solid = inside_polygon(outer.positions, x, y) && !inside_polygon(inner.positions, x, y);
      ASSERT_EQ(!cells.fluid(x, y), solid) << x << ' ' << y;
    }
  }
}

// Outlines through nodes: no rule says which side such a node is on, but each row must make sense.
TEST(Classification, OutlineThroughNodesLeavesNoStray) {
  const Grid grid{12, 12, 1, 0, 0, false, false};
  const Cells cells = classify(grid, line({3, 3, 3, 7, 8, 7, 8, 3}, true));
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 12; ++x) {
      if (x < 3 || x > 8 || y < 3 || y > 7) {
        EXPECT_TRUE(cells.fluid(x, y)) << x << ' ' << y;
      }
      if (x > 3 && x < 8 && y > 3 && y < 7) {
        EXPECT_FALSE(cells.fluid(x, y)) << x << ' ' << y;
      }
    }
  }
}

TEST(Classification, ChangesAreReportedAndRunsFollow) {
  const Grid grid{10, 3, 1, 0, 0, true, false};
  Cells cells(grid);
  std::vector<Node> uncovered;
  EXPECT_EQ(cells.set_solid(1, cell_wet_solid, {{2, 5}, {8, 10}}, uncovered), 5u);
  EXPECT_TRUE(uncovered.empty());
  EXPECT_EQ(cells.row(1), (std::vector<Span>{{0, 2}, {5, 8}}));
  EXPECT_FALSE(cells.fluid(-1, 1));
  cells.set_solid(1, cell_obstacle, {{4, 7}}, uncovered);
  EXPECT_EQ(cells.row(1), (std::vector<Span>{{0, 2}, {7, 8}}));
  EXPECT_EQ(cells.set_solid(1, cell_wet_solid, {{3, 6}}, uncovered), 0u);
  EXPECT_EQ(uncovered, (std::vector<Node>{{2, 1}, {8, 1}, {9, 1}}));
  EXPECT_EQ(cells.row(1), (std::vector<Span>{{0, 3}, {7, 10}}));
  EXPECT_EQ(cells.fluid_count(), 26u);
}

}  // namespace
}  // namespace estuary::fluid
