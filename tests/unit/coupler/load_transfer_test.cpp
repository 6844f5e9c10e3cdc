#include "load_transfer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace estuary::coupler {
namespace {

v1::WetSurface polyline(const std::vector<double>& positions, bool closed) {
  v1::WetSurface surface;
  surface.set_identity(5);
  surface.set_dimension(2);
  surface.set_closed(closed);
  surface.mutable_reference_positions()->Assign(positions.begin(), positions.end());
  const auto nodes = static_cast<std::uint32_t>(positions.size() / 2);
  for (std::uint32_t i = 0; i + 1 < nodes + (closed ? 1 : 0); ++i) {
    surface.add_connectivity(i);
    surface.add_connectivity((i + 1) % nodes);
  }
  return surface;
}

// A closed outline of random radii walked clockwise, so that the fluid is outside.
v1::WetSurface random_blob(int nodes) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> radius(0.5, 1.5);
  std::vector<double> positions;
  for (int i = 0; i < nodes; ++i) {
    const double angle = -2 * std::numbers::pi * i / nodes;
    const double r = radius(random);
    positions.push_back(3 + r * std::cos(angle));
    positions.push_back(1 + r * std::sin(angle));
  }
  return polyline(positions, true);
}

TEST(ConsistentNodalForces, UniformPressureOnAClosedContourBalances) {
  const auto surface = random_blob(37);
  const std::vector<double> zero(74, 0.0);
  v1::WetSurfacePressures load;
  load.set_surface(5);
  for (int i = 0; i < 37; ++i) load.add_pressure(1e5);
  const auto forces = consistent_nodal_forces(surface, zero, load);
  const std::vector<double> force(forces.force().begin(), forces.force().end());
  const auto sums = sum_load(surface, zero, {}, force);
  EXPECT_NEAR(sums.force[0], 0, 1e-9);
  EXPECT_NEAR(sums.force[1], 0, 1e-9);
  EXPECT_NEAR(sums.moment, 0, 1e-9);
}

TEST(ConsistentNodalForces, HydrostaticPressureGivesTheWeightOfTheDisplacedFluidAtItsCentroid) {
  const auto surface = random_blob(50);
  const std::vector<double> zero(100, 0.0);
  const auto& x = surface.reference_positions();
  double area = 0;
  double first_moment = 0;
  v1::WetSurfacePressures load;
  load.set_surface(5);
  constexpr double specific_weight = 9810;
  for (int i = 0; i < 50; ++i) {
    const int j = (i + 1) % 50;
    const double cross = x[2 * j] * x[2 * i + 1] - x[2 * i] * x[2 * j + 1];  // clockwise: positive
    area += cross / 2;
    first_moment += cross * (x[2 * i] + x[2 * j]) / 6;
    load.add_pressure(-specific_weight * x[2 * i + 1]);
  }
  const auto forces = consistent_nodal_forces(surface, zero, load);
  const std::vector<double> force(forces.force().begin(), forces.force().end());
  const auto sums = sum_load(surface, zero, {}, force);
  EXPECT_NEAR(sums.force[0], 0, 1e-7);
  EXPECT_NEAR(sums.force[1] / (specific_weight * area), 1, 1e-12);
  EXPECT_NEAR(sums.moment / (specific_weight * first_moment), 1, 1e-12);
}

TEST(ConsistentNodalForces, PressurePushesAwayFromTheFluidAndTractionPullsAlong) {
  const auto surface = polyline({0, 0, 2, 0}, false);  // walked towards +x: fluid above
  v1::WetSurfacePressures load;
  load.set_surface(5);
  load.add_pressure(3);
  load.add_pressure(6);
  for (const double t : {0.5, 0.0, 0.5, 0.0}) load.add_viscous_traction(t);
  const auto forces = consistent_nodal_forces(surface, std::vector<double>(4, 0.0), load);
  EXPECT_DOUBLE_EQ(forces.force(1), -2.0 / 6 * (2 * 3 + 6));
  EXPECT_DOUBLE_EQ(forces.force(3), -2.0 / 6 * (3 + 2 * 6));
  EXPECT_DOUBLE_EQ(forces.force(0), 0.5);
  EXPECT_DOUBLE_EQ(forces.force(2), 0.5);
}

TEST(ConsistentNodalForces, FollowsTheDisplacedSurface) {
  const auto surface = polyline({0, 0, 1, 0}, false);
  v1::WetSurfacePressures load;
  load.set_surface(5);
  load.add_pressure(1);
  load.add_pressure(1);
  // The second node moves so that the segment points to +y: the fluid then lies towards -x.
  const auto forces = consistent_nodal_forces(surface, std::vector<double>{0, 0, -1, 1}, load);
  EXPECT_DOUBLE_EQ(forces.force(0) + forces.force(2), 1.0);
  EXPECT_DOUBLE_EQ(forces.force(1) + forces.force(3), 0.0);
}

TEST(SumLoad, PowerIsForceTimesVelocity) {
  const auto surface = polyline({0, 0, 1, 0}, false);
  const auto sums = sum_load(surface, std::vector<double>(4, 0.0), std::vector<double>{1, 2, 3, 4},
                             std::vector<double>{5, 6, 7, 8});
  EXPECT_DOUBLE_EQ(sums.power, 5 + 12 + 21 + 32);
}

}  // namespace
}  // namespace estuary::coupler
