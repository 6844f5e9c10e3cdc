// Bodies that meet by impulses: the multipliers, where rows are made, and whole impacts with known outcome.
#include <gtest/gtest.h>

#include <omp.h>

#include <cmath>

#include "bodies.hpp"
#include "impulses.hpp"
#include "outline_filling.hpp"
#include "pinball.hpp"
#include "running_scene.hpp"
#include "shell_row.hpp"

namespace estuary::solid {
namespace {

// Points on a line: the left one of a pair must not run into the right one.
ContactRow row_between(std::uint32_t left, std::uint32_t right, double floor = 0) {
  ContactRow row;
  row.add(left, -1, 0);
  row.add(right, 1, 0);
  row.floor = floor;
  return row;
}

TEST(Impulses, StopTheApproachOfTwoMassesWhateverTheirRatio) {
  for (const double ratio : {1.0, 20.0, 1000.0, 1e6}) {
    ImpulseSolver solver({1, 1 / ratio});
    std::vector<double> velocity{3, -1};
    std::vector<ContactRow> rows{row_between(0, 1)};
    solver.solve(rows, 0, velocity);
    const double common = (3 - ratio) / (1 + ratio);
    EXPECT_NEAR(velocity[0], common, 1e-9);
    EXPECT_NEAR(velocity[1], common, 1e-9);
    EXPECT_NEAR(rows[0].impulse, 3 - common, 1e-9);
  }
}

TEST(Impulses, SolveAChainAtOnceNeverPullAndStandRepeatedRows) {
  const std::size_t n = 60;
  std::vector<double> inverse(n), velocity(n, 0.0);
  double momentum = 0, mass = 0;
  for (std::size_t i = 0; i < n; ++i) {
    inverse[i] = i % 7 == 3 ? 1000 : 1;
    velocity[i] = i == 0 ? 100 : 0;
    momentum += velocity[i] / inverse[i];
    mass += 1 / inverse[i];
  }
  std::vector<ContactRow> rows;
  for (std::uint32_t i = 0; i + 1 < n; ++i)
    for (int twice = 0; twice < (i == 5 ? 2 : 1); ++twice) rows.push_back(row_between(i, i + 1));
  ImpulseSolver solver(inverse);
  solver.solve(rows, 0, velocity);
  // Struck at its end, all of it moves on together.
  for (const double v : velocity) EXPECT_NEAR(v, momentum / mass, 1e-6);
  for (const ContactRow& row : rows) EXPECT_GE(row.impulse, 0);
  // Pulled at its end, none of it follows.
  std::fill(velocity.begin(), velocity.end(), 0.0);
  velocity[0] = -100;
  solver.solve(rows, 0, velocity);
  EXPECT_EQ(velocity[0], -100);
  EXPECT_EQ(velocity[1], 0);
}

TEST(Impulses, FrictionSticksOrSlidesByCoulombsLaw) {
  for (const double share : {0.1, 2.0}) {
    ContactRow row;
    row.add(0, 0, 1);
    row.add(1, 1, 0);
    std::vector<ContactRow> rows{row};
    std::vector<double> velocity{3, -4};
    ImpulseSolver solver({1, 1});
    solver.solve(rows, share, velocity);
    EXPECT_NEAR(velocity[1], 0, 1e-12);
    EXPECT_NEAR(velocity[0], std::max(0.0, 3 - share * 4), 1e-12);
  }
}

// One ball over a surface made of a polygon's contour.
std::vector<ContactRow> rows_of(const std::vector<Polygon>& loops, double x, double y, ContactMember surface,
                                double radius = 0, double correction = 0) {
  Body body = place_on_contours(loops, 0.1);
  body.fixed.assign(body.size(), 7);
  body.rigid.push_back(
      {.member = 0, .first = 0, .last = static_cast<std::uint32_t>(body.size()), .mass = 1, .inertia = 1});
  Body ball;
  ball.spacing = {0.1, 0.1};
  ball.position = {x, y};
  ball.volume = ball.energy_volume = {0.01};
  ball.mass = {10};
  ball.fixed = ball.edge = ball.member = {0};
  append(body, ball);
  surface.hardness = 1;
  Pinball pinball(
      body, {.members = {surface, {.fluid = true, .radius = radius}}, .penetration_correction = correction});
  const std::vector<double> rigid(6, 0.0);
  return pinball.find(body.position, rigid, 1e-3);
}

TEST(Pinball, MeetsFacesCornersAndBothWallsOfANook) {
  const std::vector<Polygon> square{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  auto rows = rows_of(square, 0.52, 1.02, {});
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_NEAR(rows[0].gap, 0.02, 1e-12);
  EXPECT_NEAR(rows[0].direction[1], 1, 1e-12);
  EXPECT_NEAR(rows[0].floor, -20, 1e-9);
  // Inside, near a corner: pushed out of the nearer face only.
  rows = rows_of(square, 0.95, 0.99, {});
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_NEAR(rows[0].gap, -0.01, 1e-12);
  EXPECT_NEAR(rows[0].direction[1], 1, 1e-12);
  EXPECT_EQ(rows[0].floor, 0);
  // A share of the depth is taken back in a step of 1 ms.
  rows = rows_of(square, 0.95, 0.99, {}, 0, 0.3);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_NEAR(rows[0].floor, 0.3 * 0.01 / 1e-3, 1e-9);
  // Outside of a corner: along the line of centres.
  rows = rows_of(square, 1.012, 1.016, {}, 0.01);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_NEAR(rows[0].gap, 0.02 - 0.01, 1e-12);
  EXPECT_NEAR(rows[0].direction[0], 0.6, 1e-12);
  EXPECT_NEAR(rows[0].direction[1], 0.8, 1e-12);
  // In the nook of an L both of its faces.
  const std::vector<Polygon> angle{{{0, 0}, {1, 0}, {1, 0.5}, {0.5, 0.5}, {0.5, 1}, {0, 1}}};
  rows = rows_of(angle, 0.51, 0.53, {});
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_NEAR(std::min(rows[0].gap, rows[1].gap), 0.01, 1e-12);
  EXPECT_NEAR(std::max(rows[0].gap, rows[1].gap), 0.03, 1e-12);
  // Far away, nothing.
  EXPECT_TRUE(rows_of(square, 0.5, 1.3, {}).empty());
  EXPECT_TRUE(rows_of(square, 0.5, 0.5, {}).empty());
}

TEST(Pinball, RespectsTheThicknessOfAShellOnBothSides) {
  const std::vector<Polygon> line{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  for (const double y : {1.03, 0.97}) {
    const auto rows = rows_of(line, 0.52, y, {.half_thickness = 0.02, .two_sided = true});
    ASSERT_EQ(rows.size(), 1U);
    EXPECT_NEAR(rows[0].gap, 0.01, 1e-12);
    EXPECT_NEAR(rows[0].direction[1], y > 1 ? 1 : -1, 1e-12);
  }
}

// A particle that a tear has exposed is a ball of half a spacing; a torn piece is no wall.
TEST(Pinball, ATornPieceLetsThroughAndWhatItExposedStops) {
  Body body = place_on_contours({{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}, 0.1);
  Body others;
  others.spacing = {0.1, 0.1};
  others.position = {0.55, 1.01, 0.57,
                     0.9,  0.5,  0.9};  // over the piece, beside the particle below it, and that
  others.volume = others.energy_volume = {0.01, 0.01, 0.01};
  others.mass = {10, 10, 10};
  others.fixed = others.edge = others.member = {0, 0, 0};
  const auto first = static_cast<std::uint32_t>(body.size());
  append(body, others);
  body.member[first + 2] = 0;  // inside the first body
  Pinball pinball(body, {.members = {{.hardness = 1}, {.fluid = true}}});
  const auto rows = [&] { return pinball.find(body.position, {}, 1e-3); };
  ASSERT_EQ(rows().size(), 1U);
  EXPECT_EQ(rows()[0].point, first);
  const Outline& outline = body.outlines[0];
  std::array<std::uint32_t, 2> piece{};
  for (std::size_t k = 0; k < outline.particle.size(); ++k) {
    const std::uint32_t a = outline.particle[k], b = outline.particle[(k + 1) % outline.particle.size()];
    if (body.position[2 * a + 1] > 0.99 && body.position[2 * b + 1] > 0.99 && body.position[2 * a] < 0.55 &&
        body.position[2 * b] > 0.55)
      piece = {a, b};
  }
  const std::vector<std::uint32_t> exposed{first + 2};
  pinball.tear(std::span(&piece, 1), exposed);
  ASSERT_EQ(rows().size(), 1U);
  EXPECT_EQ(rows()[0].point, first + 1);
  EXPECT_NEAR(rows()[0].gap, 0.07 - 0.05, 1e-12);
  EXPECT_NEAR(rows()[0].direction[0], 1, 1e-12);
  pinball.tear({});
  ASSERT_EQ(rows().size(), 1U);
  EXPECT_EQ(rows()[0].point, first);
}

// In front of the nearer face of something thin nothing is behind the other one.
TEST(Pinball, WhatHasPassedSomethingThinIsNotPulledBackThroughIt) {
  const std::vector<Polygon> thin{{{0, 0}, {1, 0}, {1, 0.03}, {0, 0.03}}};
  for (const double y : {-0.01, 0.04}) {
    const auto rows = rows_of(thin, 0.52, y, {});
    ASSERT_EQ(rows.size(), 1U);
    EXPECT_NEAR(rows[0].direction[1], y < 0 ? -1 : 1, 1e-12);
    EXPECT_NEAR(rows[0].gap, 0.01, 1e-12);
  }
}

TEST(Pinball, TakesTheShareOfAPenetrationBackThatItIsAskedFor) {
  const std::vector<Polygon> square{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  constexpr double kDepth = 0.02, kStep = 1e-3;
  for (const double share : {0.0, 0.25, 1.0})
    for (const double approach : {0.0, 40.0, -2.5}) {
      auto rows = rows_of(square, 0.52, 1 - kDepth, {}, 0, share);
      ASSERT_EQ(rows.size(), 1U);
      std::vector<double> inverse(2 * (rows[0].point + 1) + 3, 0.0), velocity(inverse.size(), 0.0);
      const std::size_t down = 2 * rows[0].point + 1;
      inverse[down - 1] = inverse[down] = 0.1;
      velocity[down] = -approach;
      ImpulseSolver(inverse).solve(rows, 0, velocity);
      // What leaves faster than it has to is left alone.
      const double wanted = std::max(share * kDepth / kStep, -approach);
      EXPECT_NEAR(velocity[down], wanted, 1e-9);
      EXPECT_NEAR(kDepth - kStep * velocity[down], std::min((1 - share) * kDepth, kDepth + kStep * approach),
                  1e-12);
      EXPECT_NEAR(rows[0].impulse, 10 * (wanted + approach), 1e-7);
    }
}

// The coefficient of a degree of freedom in the slip of a row.
double slip_of(const ContactRow& row, std::size_t freedom) {
  double sum = 0;
  for (std::uint32_t k = 0; k < row.count; ++k)
    if (row.freedom[k] == freedom) sum += row.tangent[k];
  return sum;
}

TEST(Pinball, FrictionTurnsTheFibresOfAShellByHalfItsThickness) {
  const ShellSection section{.thickness = 0.02, .density = 1000};
  const std::vector<std::array<double, 2>> line{{0.2, 1.01}, {0.7, 1.01}};
  // On a rigid body 0.004 below its face, each shell particle a point.
  Body body = place_on_contours({{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}, 0.1);
  const auto first = static_cast<std::uint32_t>(body.size());
  body.fixed.assign(first, 7);
  body.rigid.push_back({.member = 0, .first = 0, .last = first, .mass = 1, .inertia = 1});
  append(body, fill_row(line, false, 0.1, section));
  const std::vector<double> rigid(6, 0.0);
  for (const double depth : {0.0, 0.004}) {
    std::vector<double> position = body.position;
    for (std::size_t i = first; i < body.size(); ++i) position[2 * i + 1] -= depth;
    Pinball on_rigid(
        body, {.members = {{.hardness = 1}, {.half_thickness = 0.01, .two_sided = true, .radius = 0.01}},
               .friction = true});
    std::size_t seen = 0;
    for (const ContactRow& row : on_rigid.find(position, rigid, 1e-3)) {
      const std::size_t fibre = 2 * body.size() + 3 + row.point - first;
      EXPECT_NEAR(row.direction[1], 1, 1e-12);
      EXPECT_NEAR(slip_of(row, fibre), -0.01, 1e-15);
      // About the rigid body's centre, here the origin: from its side friction acts at the face of the shell,
      // too.
      EXPECT_NEAR(slip_of(row, 2 * body.size() + 2), depth - 1, 1e-12);
      ++seen;
    }
    EXPECT_EQ(seen, body.size() - first);
  }
}

const char* const kImpactHead = R"(
title = "impact"
dimension = 2
[coupling]
mode = "transient"
window = 1e-5
end_time = 1
[solid]
solver = "solid-sph"
[[watch]]
name = "all"
participant = "solid"
[[watch]]
name = "column"
participant = "solid"
body = "column"
)";

// A fluid column, 0.25 m long, on its way down to y = 0.
std::string column_scene(double speed, double spacing, const std::string& more) {
  return std::string(kImpactHead) + "[[solid.body]]\nname = \"column\"\nkind = \"fluid\"\n" +
         "box = { from = [0, 0], to = [0.05, 0.25] }\ndensity = 1000\nsound_speed = 1450\n" +
         "velocity = [\"0\", \"-" + std::to_string(speed) + "\"]\n" + more + "[solid.contact]\n" +
         "[[watch]]\n" + "name = \"inside\"\nparticipant = \"solid\"\npoint = [0.025, 0.1]\n" +
         "[solid_settings]\nspacing = " + std::to_string(spacing) + "\n";
}

std::string with_spacing(std::string text) {
  const auto at = text.find("[solid_settings]\n");
  const std::string settings = text.substr(at + 17);
  text.erase(at);
  text.insert(text.find("solver = \"solid-sph\"\n"), settings);
  return text;
}

const char* const kRigidPlate = R"(
[[solid.body]]
name = "plate"
kind = "rigid"
box = { from = [-0.05, -0.05], to = [0.1, 0] }
mass = 1
held = ["x", "y", "rotation"]
[[watch]]
name = "plate"
participant = "solid"
body = "plate"
)";

TEST(Impact, AColumnStopsOnARigidPlateBehindItsHugoniotPressure) {
  test::RunningScene run(with_spacing(column_scene(150, 0.0125, kRigidPlate) + "held = [\"x\"]\n"), 1e-5);
  run.run(15);
  EXPECT_NEAR(run.value("inside", "pressure"), 1000 * 1450 * 150.0, 0.03 * 1000 * 1450 * 150.0);
  EXPECT_NEAR(run.value("plate", "contact_force_y"), -1000 * 1450 * 150 * 0.05,
              0.02 * 1000 * 1450 * 150 * 0.05);
  EXPECT_NEAR(run.value("all", "total_energy"), 0.5 * 12.5 * 150 * 150, 0.01 * 0.5 * 12.5 * 150 * 150);
  run.run(25);
  EXPECT_NEAR(run.value("all", "contact_time"), 2 * 0.25 / 1450, 0.05 * 2 * 0.25 / 1450);
  // Of 20 rows the viscosity and the one that stops at once keep an eighth of the impulse back.
  EXPECT_GT(run.value("column", "velocity_y"), 0.85 * 150);
  EXPECT_LT(run.value("column", "velocity_y"), 150);
}

TEST(Impact, RiemannProblemsBetweenParticlesGiveTheSameStepAndKeepEnergy) {
  std::string text = with_spacing(column_scene(150, 0.0125, kRigidPlate) + "held = [\"x\"]\n");
  text.replace(text.find("sound_speed = 1450"), 18,
               "sound_speed = 1450\ndissipation = \"riemann\"\nriemann_limiter = 1e3");
  test::RunningScene run(text, 1e-5);
  run.run(15);
  EXPECT_NEAR(run.value("inside", "pressure"), 1000 * 1450 * 150.0, 0.05 * 1000 * 1450 * 150.0);
  EXPECT_NEAR(run.value("plate", "contact_force_y"), -1000 * 1450 * 150 * 0.05,
              0.03 * 1000 * 1450 * 150 * 0.05);
  EXPECT_NEAR(run.value("all", "total_energy"), 0.5 * 12.5 * 150 * 150, 0.01 * 0.5 * 12.5 * 150 * 150);
}

TEST(Impact, MomentumIsKeptBetweenFluidElasticAndRigidBodies) {
  const std::string bodies = R"(
[[solid.body]]
name = "block"
box = { from = [-0.025, -0.1], to = [0.075, 0] }
density = 7800
young_modulus = 2e9
poisson_ratio = 0.3
[[solid.body]]
name = "anvil"
kind = "rigid"
box = { from = [-0.05, -0.2], to = [0.1, -0.1] }
mass = 0.2
)";
  test::RunningScene run(with_spacing(column_scene(80, 0.0125, bodies)), 1e-5);
  run.run(30);
  EXPECT_NEAR(run.value("all", "momentum_y"), -12.5 * 80, 1e-9 * 12.5 * 80);
  EXPECT_NEAR(run.value("all", "momentum_x"), 0, 1e-6);
  EXPECT_NEAR(run.value("all", "total_energy"), 0.5 * 12.5 * 80 * 80, 0.02 * 0.5 * 12.5 * 80 * 80);
  EXPECT_GT(run.value("all", "contact_time"), 1e-4);
  EXPECT_GT(run.value("column", "velocity_y"), -79);
}

// Of two rigid bodies the later one's nodes meet the contour of the earlier one: the floor comes first.
TEST(Impact, ABlockSlidesSlowerByFriction) {
  test::RunningScene run(R"(
dimension = 2
[coupling]
mode = "transient"
window = 5e-3
end_time = 1
[solid]
spacing = 0.02
gravity = [0, -10]
[[solid.body]]
name = "floor"
kind = "rigid"
box = { from = [-0.2, -0.1], to = [0.6, 0] }
mass = 1
held = ["x", "y", "rotation"]
[[solid.body]]
name = "block"
kind = "rigid"
box = { from = [0, 0], to = [0.1, 0.05] }
mass = 2
velocity = ["1", "0"]
[solid.contact]
method = "pinball"
friction = 0.3
[[watch]]
name = "block"
participant = "solid"
body = "block"
)",
                         5e-3);
  run.run(20);
  EXPECT_NEAR(run.value("block", "velocity_x"), 1 - 0.3 * 10 * 0.1, 0.01);
  EXPECT_NEAR(run.value("block", "contact_force_y"), 20, 0.5);
}

// Bodies that rub in free flight: nothing outside turns them.
TEST(Impact, FrictionOnShellsKeepsAngularMomentum) {
  const std::string shell = R"(
[[solid.body]]
name = "upper"
kind = "shell"
polyline = [[-0.021, 0.0101], [0.083, 0.0121]]
thickness = 0.01
density = 2700
young_modulus = 2e9
poisson_ratio = 0.3
velocity = ["25", "-10"]
)",
                    lower_shell = R"(
[[solid.body]]
name = "lower"
kind = "shell"
polyline = [[0, 0], [0.1, 0]]
thickness = 0.01
density = 2700
young_modulus = 5e9
poisson_ratio = 0.3
)",
                    lower_rigid = R"(
[[solid.body]]
name = "lower"
kind = "rigid"
box = { from = [0, -0.045], to = [0.1, 0.005] }
mass = 4
)";
  for (const std::string& lower : {lower_shell, lower_rigid}) {
    const auto end = [&](const std::string& friction, double& before) {
      test::RunningScene run(R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-5
end_time = 1
[solid]
spacing = 0.005
)" + lower + shell + R"(
[solid.contact]
method = "pinball"
friction = )" + friction + R"(
[[watch]]
name = "all"
participant = "solid"
)",
                             1e-5);
      run.run(1);
      before = run.value("all", "angular_momentum");
      run.run(60);
      EXPECT_GT(run.value("all", "contact_time"), 1e-5);
      EXPECT_NEAR(run.value("all", "momentum_x"), 25 * 2.7 * std::hypot(1.04, 0.02), 1e-9);
      // What rubbing takes is counted, to the order of the steps.
      const double energy = 0.5 * 2.7 * std::hypot(1.04, 0.02) * (25 * 25 + 10 * 10);
      EXPECT_NEAR(run.value("all", "total_energy"), energy, 0.01 * energy);
      EXPECT_GT(run.value("all", "contact_work"), 0.01 * energy);
      return run.value("all", "angular_momentum");
    };
    double before = 0;
    const double rubbing = end("0.3", before);
    EXPECT_NEAR(rubbing, before, 1e-11);
  }
}

// The same of solids, whose particles do not turn: faces and a corner, and balls along the line of centres,
// which are a spacing apart.
TEST(Impact, FrictionOnSolidsKeepsAngularMomentum) {
  const std::string block = R"(
[[solid.body]]
name = "upper"
box = { from = [-0.021, 0.0003], to = [0.019, 0.0203] }
density = 2700
young_modulus = 2e9
poisson_ratio = 0.3
velocity = ["25", "-10"]
)",
                    tip = R"(
[[solid.body]]
name = "upper"
polygon = [[0.001, 0.0003], [0.02, 0.03], [-0.02, 0.03]]
density = 2700
young_modulus = 2e9
poisson_ratio = 0.3
velocity = ["25", "-10"]
)";
  for (const std::string& upper : {block, tip})
    for (const std::string normals : {"contour", "centre_line"}) {
      test::RunningScene run(R"(
dimension = 2
[coupling]
mode = "transient"
window = 2e-6
end_time = 1
[solid]
spacing = 0.005
[[solid.body]]
name = "lower"
polygon = [[-0.05, -0.041], [0.05, -0.04], [0.051, 0.002], [-0.05, 0]]
density = 2700
young_modulus = 5e9
poisson_ratio = 0.3
)" + upper + R"(
[solid.contact]
method = "pinball"
friction = 0.3
normals = ")" + normals + R"("
[[watch]]
name = "all"
participant = "solid"
[[watch]]
name = "lower"
participant = "solid"
body = "lower"
)",
                             2e-6);
      run.run(1);
      const double spin = run.value("all", "angular_momentum"), x = run.value("all", "momentum_x"),
                   y = run.value("all", "momentum_y"), energy = run.value("all", "total_energy");
      run.run(60);
      EXPECT_GT(run.value("all", "contact_time"), 1e-5) << normals << upper;
      // It has dragged the other one along.
      EXPECT_GT(run.value("lower", "momentum_x"), 0.01 * x) << normals << upper;
      EXPECT_NEAR(run.value("all", "momentum_x"), x, 1e-12 * std::abs(x)) << normals << upper;
      EXPECT_NEAR(run.value("all", "momentum_y"), y, 1e-12 * std::abs(x)) << normals << upper;
      EXPECT_NEAR(run.value("all", "angular_momentum"), spin, 1e-12 * std::abs(spin)) << normals << upper;
      EXPECT_NEAR(run.value("all", "total_energy") / energy, 1, 0.01) << normals << upper;
    }
}

// The harder of two bodies brings the surface, shell or solid: the soft block's tip meets the plate between
// two of its particles, where these would have met nothing.
TEST(Impact, TheSoftTipOfASolidMeetsAShellBetweenItsParticles) {
  const auto deepest = [](const std::string& modulus) {
    test::RunningScene run(R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-5
end_time = 1
[solid]
spacing = 0.01
density = 1000
poisson_ratio = 0.3
[[solid.body]]
name = "tip"
polygon = [[0.005, 0.0055], [0.03, 0.06], [-0.02, 0.06]]
young_modulus = )" + modulus + R"(
velocity = ["0", "-10"]
[[solid.body]]
name = "plate"
kind = "shell"
polyline = [[-0.05, 0], [0.05, 0]]
thickness = 0.01
young_modulus = 2e8
[solid.contact]
method = "pinball"
[[watch]]
name = "tip"
participant = "solid"
body = "tip"
[[watch]]
name = "all"
participant = "solid"
)",
                           1e-5);
    run.run(30);
    EXPECT_NEAR(run.value("all", "momentum_y"), -10 * 1000 * 0.5 * 0.05 * 0.0545, 1e-3);
    return run.value("all", "contact_time");
  };
  EXPECT_GT(deepest("2e7"), 1e-4);
  EXPECT_EQ(deepest("2e9"), 0);
}

TEST(Impact, WaterFallsThroughATornSolid) {
  for (const bool torn : {false, true}) {
    test::RunningScene run(std::string(R"(
dimension = 2
[coupling]
mode = "transient"
window = 5e-5
end_time = 1
[solid]
spacing = 0.01
[[solid.body]]
name = "plate"
box = { from = [-0.1, -0.04], to = [0.1, 0] }
density = 1000
young_modulus = 2e8
poisson_ratio = 0.3
velocity = [")") + (torn ? "x > 0.005 ? 100 : -100" : "0") +
                               R"(", "0"]
rupture = { stretch = 1000)" + (torn ? ", crack = [[0.005, -0.1], [0.005, 0.1]]" : "") +
                               R"( }
[[solid.body]]
name = "water"
kind = "fluid"
box = { from = [-0.01, 0.03], to = [0.02, 0.06] }
density = 1000
sound_speed = 100
velocity = ["0", "-40"]
[solid.contact]
[[watch]]
name = "water"
participant = "solid"
body = "water"
[[watch]]
name = "all"
participant = "solid"
)",
                           5e-5);
    run.run(60);
    if (torn) {
      EXPECT_NEAR(run.value("water", "velocity_y"), -40, 1e-9);
      EXPECT_LT(run.value("water", "top"), -0.04);
    } else {
      EXPECT_GT(run.value("water", "bottom"), -0.03);
      EXPECT_GT(run.value("all", "contact_time"), 1e-5);
    }
  }
}

// Where the column's rows of particles stand over the block's nodes must not matter to normals of the
// contour; along lines of centres it does, and the uneven push takes more energy (Maurel 2008, ch. 3).
TEST(Impact, NormalsOfTheContourDoNotSeeWhereTheLatticeLies) {
  const std::string block = R"(
[[solid.body]]
name = "block"
box = { from = [-0.05, -0.05], to = [0.1, 0] }
density = 7800
young_modulus = 2e11
poisson_ratio = 0.3
)";
  const auto left = [&](bool shifted, const std::string& normals) {
    std::string text = with_spacing(column_scene(150, 0.0125, block));
    text = replaced(text, "[solid.contact]\n", "[solid.contact]\nnormals = \"" + normals + "\"\n");
    if (shifted)
      text = replaced(text, "from = [0, 0], to = [0.05, 0.25]", "from = [0.00625, 0], to = [0.05625, 0.25]");
    test::RunningScene run(text, 2e-5);
    run.run(15);
    return run.value("column", "kinetic_energy");
  };
  const double contour = left(false, "contour"), centres = left(false, "centre_line");
  EXPECT_NEAR(left(true, "contour") / contour, 1, 0.005);
  EXPECT_LT(centres, 0.95 * contour);
}

class RepeatedWindowsAndARestart : public testing::TestWithParam<const char*> {};

TEST_P(RepeatedWindowsAndARestart, GiveTheSameBits) {
  const std::string text = replaced(with_spacing(column_scene(80, 0.0125, kRigidPlate)), "[solid]\n",
                                    std::string("[solid]\ncorrection = \"") + GetParam() + "\"\n");
  test::RunningScene one(text, 1e-5), two(text, 1e-5), three(text, 1e-5);
  one.run(6);
  two.run(6, true);
  EXPECT_EQ(one.value("all", "kinetic_energy"), two.value("all", "kinetic_energy"));
  one.save();
  three.run(1);  // the file replaces all of it
  three.go_on_from(one);
  one.run(4);
  three.run(4);
  for (const char* quantity : {"kinetic_energy", "internal_energy", "total_energy", "contact_work"})
    EXPECT_EQ(one.value("all", quantity), three.value("all", quantity)) << quantity;
}

INSTANTIATE_TEST_SUITE_P(Gradients, RepeatedWindowsAndARestart, testing::Values("linear", "mls_quadratic"),
                         [](const auto& each) { return std::string(each.param); });

// A window goes on with the forces that the one before ended with: where the windows end does not matter to a
// motion without contact.
TEST(Impact, WindowsDoNotChangeTheMotionOfAFluid) {
  std::string text = replaced(with_spacing(column_scene(0, 0.0125, kRigidPlate)),
                              "velocity = [\"0\", \"-0.000000\"]", "velocity = [\"300 * x\", \"800 * y\"]");
  test::RunningScene one(text, 4e-6), four(text, 16e-6);
  one.run(20);
  four.run(5);
  ASSERT_EQ(one.result().work.steps, four.result().work.steps);
  EXPECT_GT(one.value("all", "viscous_work"), 1e-3 * one.value("all", "total_energy"));
  for (const char* quantity : {"kinetic_energy", "internal_energy", "viscous_work"})
    EXPECT_NEAR(one.value("all", quantity) / four.value("all", quantity), 1, 1e-10) << quantity;
}

TEST(Impact, ThreadsDoNotChangeABitOfRiemannProblemsNorOfMovingLeastSquares) {
  const std::string column = with_spacing(column_scene(150, 0.003125, kRigidPlate) + "held = [\"x\"]\n");
  for (const auto& [from, to] :
       {std::pair{"sound_speed = 1450", "sound_speed = 1450\ndissipation = \"riemann\""},
        std::pair{"solver = \"solid-sph\"", "correction = \"mls_quadratic\""}}) {
    const std::string text = replaced(column, from, to);
    const int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    test::RunningScene one(text, 2e-6), two(text, 2e-6);
    one.run(3);
    omp_set_num_threads(2);
    two.run(3);
    omp_set_num_threads(threads);
    for (const char* quantity : {"kinetic_energy", "internal_energy", "total_energy", "viscous_work"})
      EXPECT_EQ(one.value("all", quantity), two.value("all", quantity)) << quantity;
  }
}

// Every key of contact and rupture: the ends of its range are read, what lies beyond is refused with the
// range and its line.
struct Limit {
  const char *what, *with, *message;  // no message: it is read
};
class ContactAndRupture : public testing::TestWithParam<Limit> {};

TEST_P(ContactAndRupture, AreReadWithinTheirRanges) {
  const std::string bodies = R"(title = "limits"
dimension = 2
[coupling]
mode = "transient"
window = 1e-4
end_time = 1
[solid]
solver = "solid-sph"
spacing = 0.1
density = 1000
young_modulus = 1e6
poisson_ratio = 0.3
# more
[[solid.body]]
name = "lower"
box = { from = [0, 0], to = [0.4, 0.4] }
# lower
[[solid.body]]
name = "upper"
box = { from = [0, 1], to = [0.4, 1.4] }
[[solid.body]]
name = "strip"
kind = "shell"
polyline = [[0, 2], [0.4, 2]]
thickness = 0.02
# strip
[solid.contact]
method = "pinball"
)";
  const auto [what, with, message] = GetParam();
  std::string text = replaced(bodies, what, with);
  if (text.find("penalty") != std::string::npos) {
    const std::size_t strip = text.find("[[solid.body]]\nname = \"strip\"");
    text.erase(strip, text.find("[solid.contact]") - strip);
  }
  Scene scene = Scene::parse(text, "scene.toml");
  Solid solid;
  solid.configure(scene, "solid");
  if (message == nullptr) {
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    return;
  }
  std::string said;
  for (const auto& problem : scene.problems()) said += describe("scene.toml", problem) + "\n";
  EXPECT_NE(said.find(message), std::string::npos) << said;
  EXPECT_EQ(said.find("scene.toml:"), 0U) << said;
}

const char* const kPinball = "method = \"pinball\"\n";
INSTANTIATE_TEST_SUITE_P(
    Keys, ContactAndRupture,
    testing::Values(
        Limit{kPinball, "method = \"pinball\"\npenetration_correction = 0\nfriction = 0\n", nullptr},
        Limit{kPinball, "method = \"pinball\"\npenetration_correction = 1\nfriction = 10\n", nullptr},
        Limit{kPinball, "method = \"pinball\"\npenetration_correction = -0.01\n",
              "'penetration_correction' in [solid.contact] is -0.01; must be from 0 to 1"},
        Limit{kPinball, "method = \"pinball\"\npenetration_correction = 1.01\n",
              "'penetration_correction' in [solid.contact] is 1.01; must be from 0 to 1"},
        Limit{kPinball, "method = \"pinball\"\nfriction = -0.1\n",
              "'friction' in [solid.contact] is -0.1; must be from 0 to 10"},
        Limit{kPinball, "method = \"pinball\"\nfriction = 10.1\n",
              "'friction' in [solid.contact] is 10.1; must be from 0 to 10"},
        Limit{kPinball, "method = \"pinball\"\nnormals = \"balls\"\n",
              "expected one of contour, centre_line"},
        Limit{kPinball, "method = \"pinball\"\nstiffness = 1\n", "is of method = \"penalty\""},
        Limit{kPinball, "method = \"pinball\"\nrigid_modulus = 1\n", "is of method = \"penalty\""},
        Limit{kPinball, "method = \"magnets\"\n", "expected one of penalty, pinball"},
        Limit{kPinball, "method = \"penalty\"\nstiffness = 1e-3\nrigid_modulus = 1\n", nullptr},
        Limit{kPinball, "method = \"penalty\"\nstiffness = 1e3\n", nullptr},
        Limit{kPinball, "method = \"penalty\"\nstiffness = 0.9e-3\n", "must be from 0.001 to 1000"},
        Limit{kPinball, "method = \"penalty\"\nstiffness = 1001\n", "must be from 0.001 to 1000"},
        Limit{kPinball, "method = \"penalty\"\nrigid_modulus = 0\n", "'rigid_modulus'"},
        Limit{kPinball, "method = \"penalty\"\nfriction = 0.1\n", "friction"},
        Limit{kPinball, "method = \"penalty\"\npenetration_correction = 0.1\n", "penetration_correction"},
        Limit{"# lower\n", "rupture = { stretch = 1, energy = 1, crack = [[0, 0.25], [0.4, 0.25]] }\n",
              nullptr},
        Limit{"# lower\n", "rupture = { stretch = -1, energy = 1 }\n",
              "'stretch' in [solid.body.0.rupture] is -1; must be at least 0"},
        Limit{"# lower\n", "rupture = { stretch = 1, energy = -1 }\n",
              "'energy' in [solid.body.0.rupture] is -1; must be at least 0"},
        Limit{"# lower\n", "rupture = { stretch = 1, plastic_strain = -1 }\n",
              "'plastic_strain' in [solid.body.0.rupture] is -1; must be at least 0"},
        Limit{"# lower\n", "rupture = { plastic_strain = 1 }\n", "`yield_stress`"},
        Limit{"# lower\n", "rupture = { shear = 0.1 }\n", "is of shells, whose links"},
        Limit{"# lower\n", "rupture = { stretch = 0, energy = 0 }\n", "give at least one of"},
        Limit{"# lower\n", "rupture = { stretch = 1, crack = [[0, 0.25]] }\n", "at least two points"},
        Limit{"# lower\n", "rupture = { stretch = 1, streching = 1 }\n", "streching"},
        Limit{"# strip\n", "rupture = { shear = 0.1 }\n", nullptr},
        Limit{"# strip\n", "rupture = { shear = -0.1, energy = 1 }\n",
              "'shear' in [solid.body.2.rupture] is -0.1; must be at least 0"},
        Limit{"# strip\n", "rupture = { shear = 0.1, crack = [[0.1, 1], [0.1, 3]] }\n",
              "a line that no link crosses"},
        Limit{"# more\n", "isolated_particles = \"remove\"\n", "is of bodies with `rupture`"}));

TEST(Impact, SaysWhatAFluidDoesNotHave) {
  const std::string text = with_spacing(column_scene(1, 0.0125, kRigidPlate) + "stress_points = 1\n") + R"(
[[solid.hold]]
body = "column"
region = [[0, 0], [1, 1]]
[[solid.load]]
body = "column"
force = [1, 0]
)";
  Scene scene = Scene::parse(text, "scene.toml");
  Solid solid;
  solid.configure(scene, "solid");
  std::string all;
  for (const auto& problem : scene.problems()) all += problem.message + "\n";
  EXPECT_NE(all.find("does not go with"), std::string::npos) << all;
  EXPECT_NE(all.find("of solids, not of a fluid"), std::string::npos) << all;
  EXPECT_NE(all.find("push a fluid with one of those"), std::string::npos) << all;
}

}  // namespace
}  // namespace estuary::solid
