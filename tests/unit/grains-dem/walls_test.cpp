// Planes and polylines: rest, corners, thin walls, motion, and what they feel.
#include <gtest/gtest.h>

#include "assemblies.hpp"

namespace estuary::grains {
namespace {

using test::add_grain;

Wall<2> polyline(const std::vector<double>& nodes, const ContactConstants& constants, bool closed = false) {
  Wall<2> wall;
  wall.node = nodes;
  wall.constants = constants;
  const auto count = static_cast<std::uint32_t>(nodes.size() / 2);
  for (std::uint32_t k = 0; k + 1 < count; ++k) wall.segment.insert(wall.segment.end(), {k, k + 1});
  if (closed) wall.segment.insert(wall.segment.end(), {count - 1, 0});
  return wall;
}

TEST(Polyline, CarriesTheWeightAtItsNodes) {
  auto settings = test::free_space<2>(1e6, 0.3);
  settings.gravity = {0, -10};
  InitialGrains<2> grains;
  // Walked from left to right, the grains' side is above; a quarter of the way along the segment.
  add_grain<2>(grains, {0.25, 0.01}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {polyline({0, 0, 1, 0}, settings.constants)});
  dynamics.advance(0.2, 4000);
  dynamics.advance(0.1, 2000);
  const double weight = 10 * grains.mass[0];
  EXPECT_NEAR(dynamics.wall_force(0)[1], -weight, 1e-6 * weight);
  EXPECT_NEAR(dynamics.node_force(0)[1], -0.75 * weight, 1e-5 * weight);
  EXPECT_NEAR(dynamics.node_force(0)[3], -0.25 * weight, 1e-5 * weight);
}

TEST(Polyline, GrainGoesRoundACornerThatSticksOut) {
  // Frictionless: a grain pushed along the top falls past the corner and is never pushed into the box.
  auto settings = test::free_space<2>(1e7, 0.5);
  settings.gravity = {0, -10};
  InitialGrains<2> grains;
  add_grain<2>(grains, {-0.02, 0.01}, {0.2, 0}, 0.01);
  Dynamics<2> dynamics(settings, grains, {polyline({-1, 0, 0, 0, 0, -1}, settings.constants)});
  const double energy = dynamics.energies().total();
  double nearest = 1;
  for (int k = 0; k < 200; ++k) {
    dynamics.advance(0.002, 200);
    const Vector<2> x = dynamics.unwrapped(0);
    const double to_box = x[0] < 0 ? x[1] : x[1] < 0 ? x[0] : std::hypot(x[0], x[1]);
    nearest = std::min(nearest, to_box);
  }
  EXPECT_GT(nearest, 0.0099);
  EXPECT_LT(dynamics.unwrapped(0)[1], -0.1);
  const State<2>& s = dynamics.state();
  EXPECT_LE(dynamics.energies().total(), energy + s.external_work + 1e-9);
  EXPECT_NEAR(dynamics.energy_error(), 0, 0.01);
}

TEST(Polyline, ThinWallHoldsGrainsOnBothSides) {
  // A closed sliver 2 mm thick, walked clockwise: grains of 10 mm radius outside on both sides.
  auto settings = test::free_space<2>(1e6, 0.5);
  InitialGrains<2> grains;
  add_grain<2>(grains, {-0.0121, 0}, {0.1, 0}, 0.01);
  add_grain<2>(grains, {0.0121, 0.05}, {-0.1, 0}, 0.01);
  Dynamics<2> dynamics(
      settings, grains,
      {polyline({-0.001, -0.3, -0.001, 0.3, 0.001, 0.3, 0.001, -0.3}, settings.constants, true)});
  dynamics.advance(0.1, 2000);
  const State<2>& s = dynamics.state();
  for (std::size_t i = 0; i < 2; ++i) {
    const bool left = s.identity[i] == 0;
    EXPECT_NEAR(s.velocity[2 * i], (left ? -0.1 : 0.1) * cut_restitution(0.5), 2e-3);
    EXPECT_NEAR(s.velocity[2 * i + 1], 0, 1e-12);
  }
}

TEST(Plane, MovingPistonPushesAndItsWorkIsBooked) {
  auto settings = test::free_space<2>(1e7, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0.03, 0}, {}, 0.01);
  Wall<2> piston;
  piston.normal = {1, 0};
  piston.constants = settings.constants;
  Dynamics<2> dynamics(settings, grains, {piston});
  dynamics.wall_velocity = [](std::size_t, double) { return Vector<2>{0.5, 0}; };
  dynamics.advance(0.1, 20000);
  // An elastic bounce off a wall that moves: twice its speed.
  EXPECT_NEAR(dynamics.state().velocity[0], 1.0, 1e-3);
  EXPECT_NEAR(dynamics.state().ledger.given, 0.5 * grains.mass[0], 1e-3 * grains.mass[0]);
  EXPECT_NEAR(dynamics.walls()[0].point[0], 0.05, 1e-12);
}

TEST(Polyline, NodesGoToTheirTargetsAndPush) {
  auto settings = test::free_space<2>(1e7, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0.5, 0.012}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {polyline({0, 0, 1, 0}, settings.constants)});
  dynamics.set_wall_target(0, std::vector<double>{0, 0.01, 1, 0.01});
  dynamics.advance(0.02, 4000);
  EXPECT_NEAR(dynamics.state().velocity[1], 1.0, 0.01);
  EXPECT_EQ(dynamics.walls()[0].node[1], 0.01);
  // What the wall feels is the momentum it gave, over the time.
  double sum = 0;
  for (const std::size_t k : {1u, 3u}) sum += dynamics.node_force(0)[k];
  EXPECT_NEAR(sum, -grains.mass[0] * dynamics.state().velocity[1] / 0.02, 1e-6);
}

TEST(Walls, FrictionBringsABlockToRollNotThrough) {
  // Energy never grows at grazing incidence on a rough plane.
  auto settings = test::free_space<2>(1e6, 0.9, 0.5);
  for (const double angle : {1.0, 5.0, 30.0, 80.0}) {
    InitialGrains<2> grains;
    const double a = angle * std::numbers::pi / 180;
    add_grain<2>(grains, {0, 0.0101}, {std::cos(a), -std::sin(a)}, 0.01, 1000, {30});
    Wall<2> floor;
    floor.normal = {0, 1};
    floor.constants = settings.constants;
    Dynamics<2> dynamics(settings, grains, {floor});
    const double before = dynamics.energies().total();
    dynamics.advance(0.05, 20000);
    EXPECT_LT(dynamics.energies().total(), before) << angle;
    EXPECT_NEAR(dynamics.energy_error(), 0, 2e-3) << angle;
  }
}

}  // namespace
}  // namespace estuary::grains
