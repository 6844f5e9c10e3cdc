#include "edge_links.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

// A channel 24 nodes high with a fin on its floor, 2.5 nodes thick.
double drag_of_fin(double height) {
  FlowSettings settings = cases::box(81, 24, 0.3, cases::channel);
  settings.sides[left].velocity_x.assign(24, 0.02);
  settings.sides[left].velocity_y.assign(24, 0.0);
  settings.sides[right].excess.assign(24, 0.0);
  Flow flow(settings);
  const double foot = -0.5;
  flow.set_obstacles(4, {0, 1, 1, 2, 2, 3, 3, 0},
                     std::vector<double>{30.2, foot, 30.2, foot + height, 32.7, foot + height, 32.7, foot});
  flow.run(6000);
  flow.apply_boundaries();
  return flow.obstacle_force().x;
}

TEST(EdgeLinks, DragOfAFinGrowsSmoothlyWhileItsTipPassesANode) {
  // Nodes lie at heights 11.5 and 12.5 above the floor.
  std::vector<double> drag;
  for (double height = 11.4; height < 12.65; height += 0.1) drag.push_back(drag_of_fin(height));
  const double mean_growth = (drag.back() - drag.front()) / static_cast<double>(drag.size() - 1);
  EXPECT_GT(mean_growth, 0);
  for (std::size_t i = 1; i < drag.size(); ++i) {
    // Without closing, the drag stays nearly the same and then grows by ten times the mean at once.
    EXPECT_LT(drag[i] - drag[i - 1], 3 * mean_growth)
        << "from height " << 11.4 + 0.1 * static_cast<double>(i - 1);
    EXPECT_GT(drag[i] - drag[i - 1], -0.5 * mean_growth);
  }
}

// Drags of a fin that leans over by 55 degrees, so that its corners cut links between two fluid nodes, while
// it grows from `first` times the step beyond 15 spacings.
std::vector<double> drags_of_a_leaning_fin(EdgeLinks::Extent extent, int first, int last) {
  FlowSettings settings = cases::box(81, 24, 0.3, cases::channel);
  settings.sides[left].velocity_x.assign(24, 0.02);
  settings.sides[left].velocity_y.assign(24, 0.0);
  settings.sides[right].excess.assign(24, 0.0);
  Flow flow(settings);
  flow.set_wet_surface(4, {0, 1, 1, 2, 2, 3, 3, 0}, extent);
  const double sine = std::sin(55 * std::numbers::pi / 180);
  const double cosine = std::cos(55 * std::numbers::pi / 180);
  std::vector<double> drags;
  for (int i = first; i <= last; ++i) {
    const double length = 15 + 0.01 * i;
    std::vector<double> positions;
    for (const auto& [along, across] : {std::array{0.0, 0.0}, {length, 0.0}, {length, 2.5}, {0.0, 2.5}}) {
      positions.push_back(30.2 + across * cosine + along * sine);
      positions.push_back(2.0 + along * cosine - across * sine);
    }
    flow.move_wet_surface(positions, std::vector<double>(8, 0.0), 0.0);
    flow.run(i == first ? 5000 : 1500);
    flow.apply_boundaries();
    drags.push_back(flow.wet_force().x);
  }
  return drags;
}

// Largest step of a series over its mean one.
double unevenness(const std::vector<double>& series) {
  double largest = 0;
  for (std::size_t i = 1; i < series.size(); ++i)
    largest = std::max(largest, std::abs(series[i] - series[i - 1]));
  return largest * static_cast<double>(series.size() - 1) / std::abs(series.back() - series.front());
}

TEST(EdgeLinks, DragOfAFinGrowsSmoothlyWhileItsCornersCutLinks) {
  // Where corners come to cut a link between two fluid nodes; without a share for those links one step is 4.3
  // and 3.5 times the mean.
  EXPECT_LT(unevenness(drags_of_a_leaning_fin(EdgeLinks::Extent::edges, 0, 15)), 1.7);
  EXPECT_LT(unevenness(drags_of_a_leaning_fin(EdgeLinks::Extent::everywhere, 135, 150)), 1.5);
}

TEST(EdgeLinks, SmoothOutlinesHaveNone) {
  const Grid grid{40, 40, 1.0, 0.0, 0.0, false, false};
  std::vector<std::uint32_t> connectivity;
  std::vector<double> positions;
  constexpr std::uint32_t nodes = 60;
  for (std::uint32_t i = 0; i < nodes; ++i) {
    const double angle = -2 * std::numbers::pi * i / nodes;
    positions.push_back(20 + 8 * std::cos(angle));
    positions.push_back(20 + 8 * std::sin(angle));
    connectivity.insert(connectivity.end(), {i, (i + 1) % nodes});
  }
  Surface surface(grid, nodes, connectivity);
  surface.place(positions, std::vector<double>(2 * nodes, 0.0), 0.0);
  EdgeLinks links;
  links.build(surface, Cells(grid), Populations(40, 40));
  EXPECT_EQ(links.count(), 0U);
}

// Share by which the links to a row of nodes close at `distance` [spacings] from a wall, by the force on
// them in a stream along it: the force's other factors are the same but for the rule's 1 / (2 q).
double share_closed(double distance, double relaxation_time) {
  const Grid grid{12, 10, 1.0, 0.0, 0.0, false, false};
  Populations populations(12, 10);
  Fields fields;
  fields.velocity_x.assign(120, 0.03);
  fields.velocity_y.assign(120, 0.0);
  fields.excess.assign(120, 0.0);
  set_equilibrium(populations, fields, FlowSettings().equilibrium);
  Surface surface(grid, 4, {0, 1, 1, 2, 2, 3, 3, 0});
  const double wall = 4 - distance;
  surface.place(std::vector<double>{-30, -30, -30, wall, 42, wall, 42, -30}, std::vector<double>(8, 0.0), 0);
  Cells cells(grid);
  std::vector<Node> uncovered;
  for (int y = 0; y < 4; ++y) cells.set_solid(y, cell_wet_solid, {{0, 12}}, uncovered);
  EdgeLinks links(EdgeLinks::Extent::everywhere, relaxation_time);
  links.build(surface, cells, populations);
  EXPECT_EQ(links.count(), 12U + 2 * 11U);  // down and both diagonals
  links.close(populations, Parity::odd, false);
  // Each diagonal's populations differ by 6 w u, w = 1/36, at equilibrium.
  const double full = 22 * 6 * 0.03 / 36;
  return links.force().x * 2 * (1 + distance) / full;
}

TEST(EdgeLinks, SmallSharesCloseLessTheSmallerTheViscosity) {
  // Noble and Torczynski's form, with c = 1 / (tau - 1/2) - 1 between 0 and 4.
  for (const auto& [tau, c] :
       {std::array{3.0, 0.0}, {1.5, 0.0}, {1.0, 1.0}, {0.9, 1.5}, {0.7, 4.0}, {0.55, 4.0}}) {
    for (const double b : {0.01, 0.25, 0.5, 0.8, 1.0})
      EXPECT_NEAR(share_closed(1 - b, tau), b / (1 + (1 - b) * c), 1e-9) << "b " << b << ", tau " << tau;
  }
}

// At an edge of a plate in uniform motion nothing may be disturbed: fluid and body move together.
TEST(EdgeLinks, KeepUniformMotion) {
  FlowSettings settings = cases::box(40, 40, 0.1, cases::all_periodic);
  Flow flow(settings);
  Fields fields;
  fields.velocity_x.assign(1600, 0.03);
  fields.velocity_y.assign(1600, -0.02);
  fields.excess.assign(1600, 0.0);
  set_equilibrium(flow.populations(), fields, settings.equilibrium);
  flow.set_wet_surface(4, {0, 1, 1, 2, 2, 3, 3, 0});
  const std::vector<double> positions{10.3, 10.1, 10.3, 20.6, 13.1, 20.6, 13.1, 10.1};
  const std::vector<double> velocities{0.03, -0.02, 0.03, -0.02, 0.03, -0.02, 0.03, -0.02};
  flow.move_wet_surface(positions, velocities, 1.0);
  flow.run(200);
  const Fields after = cases::fields_of(flow);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 40; ++x) {
      if (!flow.cells().fluid(x, y)) continue;
      EXPECT_NEAR(after.velocity_x[cases::at(flow, x, y)], 0.03, 1e-12);
      EXPECT_NEAR(after.velocity_y[cases::at(flow, x, y)], -0.02, 1e-12);
    }
  }
}

}  // namespace
}  // namespace estuary::fluid
