// The wall rule that needs one fluid node only.
#include <gtest/gtest.h>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

// Two walls at rest cut the links of the outermost fluid nodes at q_low and q_high; `rows` nodes between
// them.
double poiseuille_error(double q_low, double q_high, int rows, double viscosity, double magic,
                        CollisionModel collision = CollisionModel::trt) {
  FlowSettings settings = cases::box(4, rows + 2, viscosity, cases::walls_along_x);
  settings.collision = collision;
  if (collision == CollisionModel::central_moment) settings.equilibrium = EquilibriumModel::compressible;
  settings.rates = relaxation_rates(viscosity, magic);
  settings.force = ForceModel::guo;
  constexpr double peak = 0.01;
  const double height = rows - 1 + q_low + q_high;
  settings.acceleration = {8 * viscosity * peak / (height * height), 0, 0};
  Flow flow(settings);
  const double low = 1 - q_low;
  const double high = rows + q_high;
  const cases::Outline walls{{-0.5, low, 1.5, low, 3.5, low, 3.5, high, 1.5, high, -0.5, high},
                             {0, 1, 1, 2, 3, 4, 4, 5}};
  flow.set_obstacles(walls.nodes(), walls.connectivity, walls.positions, WallRule::one_point);
  flow.run(static_cast<std::size_t>(3000 + 8 * height * height / viscosity));
  Fields fields;
  flow.compute_fields(fields);
  double largest = 0;
  for (int y = 1; y <= rows; ++y) {
    const double exact = 4 * peak * (y - low) * (high - y) / (height * height);
    largest = std::max(largest, std::abs(fields.velocity_x[cases::at(flow, 1, y)] - exact) / peak);
  }
  return largest;
}

TEST(OnePoint, PoiseuilleIsExactAtAnyPositionViscosityAndMagicParameter) {
  for (const double viscosity : {0.02, 1.0 / 6, 0.6}) {
    for (const double magic : {1.0 / 12, 3.0 / 16, 0.5}) {
      EXPECT_LT(poiseuille_error(0.1, 0.85, 5, viscosity, magic), 1e-10) << viscosity << " " << magic;
    }
  }
  EXPECT_LT(poiseuille_error(0.5, 1.0, 5, 0.1, 3.0 / 16), 1e-10);
  EXPECT_LT(poiseuille_error(0.02, 0.02, 5, 0.1, 3.0 / 16), 1e-10);
}

// Two and three fluid nodes across, where rules that look further fall back.
TEST(OnePoint, PoiseuilleIsExactInNarrowGaps) {
  EXPECT_LT(poiseuille_error(0.3, 0.45, 2, 0.1, 3.0 / 16), 1e-10);
  EXPECT_LT(poiseuille_error(0.7, 0.15, 3, 0.1, 3.0 / 16), 1e-10);
}

TEST(OnePoint, ServesEveryOperator) {
  EXPECT_LT(poiseuille_error(0.1, 0.85, 5, 0.1, 0, CollisionModel::bgk), 1e-10);
  EXPECT_LT(poiseuille_error(0.1, 0.85, 5, 0.1, 0, CollisionModel::central_moment), 2e-3);
}

// Stokes flow through a square array, 20 nodes across a disc (Sangani, Acrivos 1982): the drag does not
// depend on the relaxation time, and five nodes in the gap are enough.
TEST(OnePoint, DragInADenseArray) {
  const auto drag = [](double share, double viscosity) {
    const int n = static_cast<int>(std::lround(20 / std::sqrt(4 * share / std::numbers::pi)));
    FlowSettings settings = cases::box(n, n, viscosity, cases::all_periodic);
    settings.force = ForceModel::guo;
    settings.acceleration = {1e-6, 0, 0};
    Flow flow(settings);
    flow.place_bodies(
        {2, {n / 2.0 + 0.31, n / 2.0 + 0.12}, {n * std::sqrt(share / std::numbers::pi)}, {0, 0}, {0}},
        {WallRule::one_point}, false);
    flow.run(static_cast<std::size_t>(n * n / viscosity));
    Fields fields;
    flow.compute_fields(fields);
    EXPECT_EQ(flow.bodies().links().counts().fallbacks, 0U);
    return 1e-6 * n * n * n * n / (viscosity * sum_fields(fields, flow.cells(), flow.sides()).momentum_x);
  };
  EXPECT_NEAR(drag(0.5, 1.0 / 6), 532.548, 0.01 * 532.548);
  EXPECT_NEAR(drag(0.5, 0.5), drag(0.5, 1.0 / 6), 1e-4 * 532.548);
  EXPECT_NEAR(drag(0.3, 1.0 / 6), 102.881, 0.005 * 102.881);
}

// The changes of the last step are part of the state.
TEST(OnePoint, ARestoredStateGoesOnWithTheSameBits) {
  const auto discs = [](double x) { return Grains{2, {x, 20.2}, {6.3}, {0.01, 0.0}, {0.001}}; };
  const auto make = [&] {
    FlowSettings settings = cases::box(50, 40, 0.05, cases::channel);
    settings.sides[left].velocity_x.assign(40, 0.03);
    settings.sides[left].velocity_y.assign(40, 0.0);
    settings.sides[right].excess.assign(40, 0.0);
    Flow flow(settings);
    flow.place_bodies(discs(18.2), {WallRule::one_point}, false);
    return flow;
  };
  const auto go_on = [&](Flow& flow) {
    for (int step = 1; step <= 30; ++step) {
      flow.run(1);
      flow.place_bodies(discs(18.5 + 0.01 * step), {WallRule::one_point}, true);
    }
    std::vector<double> values;
    flow.populations().copy_to(values);
    return values;
  };
  Flow flow = make();
  for (int step = 1; step <= 30; ++step) {
    flow.run(1);
    flow.place_bodies(discs(18.2 + 0.01 * step), {WallRule::one_point}, true);
  }
  Flow::State state;
  flow.copy_to(state);
  const auto first = go_on(flow);
  Flow other = make();
  other.place_bodies(discs(18.5), {WallRule::one_point}, false);
  other.give_back(state, {}, {}, 1.0);
  EXPECT_EQ(go_on(other), first);
  for (const double value : first) ASSERT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace estuary::fluid
