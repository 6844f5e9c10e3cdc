// Planes and polylines: rest, corners, thin walls, motion, and what they feel.
#include <gmock/gmock.h>
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
  for (std::uint32_t k = 0; k + 1 < count; ++k) wall.facet.insert(wall.facet.end(), {k, k + 1});
  if (closed) wall.facet.insert(wall.facet.end(), {count - 1, 0});
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

// Thrown through, it would have twice its radius of overlap at once: energy from nowhere.
TEST(Polyline, GrainThatComesFromBehindEndsTheRun) {
  auto settings = test::free_space<2>(1e6, 0.5);
  settings.gravity = {0, -9.81};
  const auto fall_on = [&](const std::vector<double>& nodes) {
    InitialGrains<2> grains;
    add_grain<2>(grains, {0, 0.02}, {0, 0}, 0.01);
    Dynamics<2> dynamics(settings, grains, {polyline(nodes, settings.constants)});
    dynamics.advance(0.3, 6000);
    return dynamics.state().position[1];
  };
  EXPECT_NEAR(fall_on({-1, 0, 1, 0}), 0.01, 1e-4);
  try {
    fall_on({1, 0, -1, 0});
    ADD_FAILURE() << "nothing was said";
  } catch (const Breakdown& breakdown) {
    EXPECT_EQ(breakdown.grain, 0u);
    EXPECT_THAT(breakdown.what(), testing::HasSubstr("from behind"));
    EXPECT_THAT(breakdown.advice, testing::HasSubstr("in the other order"));
  }
}

// Elastic force of all pieces on a grain at x, per stiffness.
Vector<2> elastic_force(const Wall<2>& wall, const Vector<2>& x, double r) {
  std::vector<std::uint32_t> near(wall.facets());
  for (std::uint32_t s = 0; s < near.size(); ++s) near[s] = s;
  Vector<2> force{};
  const std::array<std::uint32_t, kWallContacts> none{kNoElement, kNoElement, kNoElement, kNoElement};
  for (const WallTouch<2>& touch : find_touches(wall, near, x, r, none).slot)
    force = force - touch.overlap * touch.normal;
  return force;
}

TEST(Polyline, ForceHasNoJumpWhereverTheLineBends) {
  // Gentle and sharp, hollow and sticking out, with segments shorter than the grain. Bound: the force changes
  // by the way times the sum of what the points touched can change.
  const double r = 0.01;
  for (const std::vector<double>& nodes :
       {std::vector<double>{-1, 0.02, 0, 0, 1, 0.02},
        {-1, -0.5, 0, 0, 1, -0.5},
        {-1, 1, 0, 0, 1, 1},
        {-1, 0, 0, 0, 0, 1},
        {-1, 0.1, -0.004, 0.0003, -0.001, 0, 0.002, 0, 0.003, 0.0002, 1, 0.3}}) {
    Wall<2> wall = polyline(nodes, {});
    link_facets(wall);
    wall.node_velocity.assign(wall.node.size(), 0.0);
    const double step = 2e-6;
    double worst = 0;
    for (const double height : {0.3, 0.9, 0.99, 0.9999}) {
      Vector<2> before{};
      for (int k = 0; k < 20000; ++k) {
        const double x = -0.02 + step * k;
        // Along the line that is `height` radii above the left branch, then the right one.
        double y = -1;
        for (std::size_t s = 0; s < wall.facets(); ++s) {
          const Vector<2> a{nodes[2 * s], nodes[2 * s + 1]}, b{nodes[2 * s + 2], nodes[2 * s + 3]};
          if (x < a[0] || x > b[0] || a[0] == b[0]) continue;
          y = a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]) + height * r;
        }
        if (y == -1) break;
        const Vector<2> force = elastic_force(wall, {x, y}, r);
        if (k > 0) worst = std::max(worst, norm(force - before) / step);
        before = force;
      }
    }
    EXPECT_LT(worst, 20) << nodes.size();
  }
}

TEST(Polyline, ForceIsAGradientRoundABend) {
  // No work on a closed way through the places where feet appear and vanish.
  Wall<2> wall = polyline({-1, 0.3, 0, 0, 0.003, 0.0002, 1, 0.4}, {});
  link_facets(wall);
  wall.node_velocity.assign(wall.node.size(), 0.0);
  double work = 0, way = 0;
  const int parts = 20000;
  for (int k = 0; k < parts; ++k) {
    const auto at = [&](double p) {
      const double a = 2 * std::numbers::pi * p / parts;
      return Vector<2>{0.003 * std::cos(a), 0.0095 + 0.003 * std::sin(a)};
    };
    const Vector<2> step = at(k + 1) - at(k);
    const double part = dot(elastic_force(wall, at(k + 0.5), 0.01), step);
    work += part;
    way += std::abs(part);
  }
  EXPECT_LT(std::abs(work), 1e-6 * way);
}

TEST(Polyline, RollsOverManyNodesAsOnAPlane) {
  // Friction and rolling resistance with their memories: the nodes must not be felt, at one of which the
  // grain starts exactly.
  auto settings = test::free_space<2>(1e6, 0.5, 0.4);
  settings.gravity = {2, -10};
  settings.law.rolling = RollingLaw::spring;
  settings.constants.rolling_friction = 0.01;
  settings.constants.rolling_stiffness = 1e6;
  settings.constants.rolling_damping = 0.3;
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0.01}, {0.1, 0}, 0.01);
  std::vector<double> nodes;
  for (int k = -40; k <= 400; ++k) nodes.insert(nodes.end(), {0.0015 * k, 0.0});
  Wall<2> plane;
  plane.normal = {0, 1};
  plane.constants = settings.constants;
  Dynamics<2> on_plane(settings, grains, {plane});
  Dynamics<2> on_nodes(settings, grains, {polyline(nodes, settings.constants)});
  Vector<2> before = load<2>(grains.velocity.data(), 0);
  for (int part = 0; part < 20; ++part) {
    on_plane.advance(0.02, 1000);
    on_nodes.advance(0.02, 1000);
    ASSERT_NEAR(on_nodes.unwrapped(0)[0], on_plane.unwrapped(0)[0], 1e-9);
    ASSERT_NEAR(on_nodes.state().spin[0], on_plane.state().spin[0], 1e-7);
    ASSERT_NEAR(on_nodes.wall_force(0)[0], on_plane.wall_force(0)[0], 1e-6);
    // Action and reaction: what the nodes got is what the grain lost.
    Vector<2> sum{};
    for (std::size_t k = 0; k < nodes.size(); ++k) sum[k % 2] += 0.02 * on_nodes.node_force(0)[k];
    const Vector<2> gained = grains.mass[0] * (load<2>(on_nodes.state().velocity.data(), 0) - before);
    before = load<2>(on_nodes.state().velocity.data(), 0);
    const double weight = 0.02 * 10 * grains.mass[0];
    EXPECT_NEAR(sum[0] + gained[0], 0.2 * weight, 2e-3 * weight);
    EXPECT_NEAR(sum[1] + gained[1], -weight, 2e-3 * weight);
  }
  EXPECT_GT(on_plane.unwrapped(0)[0], 0.1);
}

TEST(Polyline, GrainOverANodeLoadsThatNodeAlone) {
  auto settings = test::free_space<2>(1e6, 0.3);
  settings.gravity = {0, -10};
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0.01}, {}, 0.01);
  // Straight, and bent by a hair towards the grain and away from it, as the surface of a plate that sags.
  for (const double bend : {0.0, 1e-6, -1e-6, 1e-3}) {
    Dynamics<2> dynamics(settings, grains, {polyline({-0.1, bend, 0, 0, 0.1, bend}, settings.constants)});
    dynamics.advance(0.3, 6000);
    dynamics.advance(0.1, 2000);
    const double weight = 10 * grains.mass[0];
    const std::vector<double>& force = dynamics.node_force(0);
    EXPECT_NEAR(dynamics.wall_force(0)[1], -weight, 1e-6 * weight) << bend;
    EXPECT_NEAR(force[3], -weight, 2e-3 * weight) << bend;
    EXPECT_NEAR(force[1] + force[3] + force[5], -weight, 1e-5 * weight) << bend;
    // As deep as on a plane, once the stiffness and not twice; in a hollow the exact balance of its two feet
    // and the node, 2 (r - y c) c - (r - y) = weight / k with c the cosine of the slope.
    const double depth = weight / 1e6, c = bend > 0 ? std::cos(std::atan(bend / 0.1)) : 1;
    EXPECT_NEAR(dynamics.unwrapped(0)[1], (0.01 * (2 * c - 1) - depth) / (2 * c * c - 1), 1e-4 * depth)
        << bend;
  }
}

TEST(Polyline, NotchHoldsAGrainByTwoContacts) {
  auto settings = test::free_space<2>(1e6, 0.3);
  settings.gravity = {0, -10};
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0.0142}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {polyline({-0.1, 0.1, 0, 0, 0.1, 0.1}, settings.constants)});
  dynamics.advance(0.3, 12000);
  const auto contacts = dynamics.contacts();
  ASSERT_EQ(contacts.size(), 2u);
  const double weight = 10 * grains.mass[0];
  for (const auto& contact : contacts)
    EXPECT_NEAR(-contact.force.along, weight / std::sqrt(2.0), 1e-3 * weight);
}

TEST(Polyline, GrainSlidesThroughAHollowPolygonWithoutLosingEnergy) {
  // Frictionless and elastic, in the lower half of a 48-sided ring.
  auto settings = test::free_space<2>(1e7, 1);
  settings.gravity = {0, -10};
  std::vector<double> nodes;
  for (int k = 0; k < 48; ++k) {
    const double a = 2 * std::numbers::pi * k / 48;
    nodes.insert(nodes.end(), {0.1 * std::cos(a), 0.1 * std::sin(a)});
  }
  InitialGrains<2> grains;
  add_grain<2>(grains, {0.0885, 0}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {polyline(nodes, settings.constants, true)});
  const double energy = dynamics.energies().total();
  dynamics.advance(0.5, 100000);
  const double scale = 10 * grains.mass[0] * 0.09;
  EXPECT_NEAR(dynamics.energies().total() - dynamics.state().external_work, energy, 2e-3 * scale);
  EXPECT_NEAR(dynamics.energy_error(), 0, 2e-3);
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
