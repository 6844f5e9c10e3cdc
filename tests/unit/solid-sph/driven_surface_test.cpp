// Bodies of one participant against the wet surface of another.
#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>

#include "solid.hpp"

namespace estuary::solid {
namespace {

// Two lines: a floor in three segments and a square that stands apart.
v1::WetSurface floor_and_square() {
  v1::WetSurface surface;
  surface.set_identity(7);
  surface.set_dimension(2);
  for (const double x : {-0.1, 0.0, 0.05, 0.15, 3.0, 3.0, 4.0, 4.0})
    surface.add_reference_positions(x), surface.add_reference_positions(x == 3.0 || x == 4.0 ? 5.0 : 0.0);
  surface.mutable_reference_positions()->Set(11, 6.0);
  surface.mutable_reference_positions()->Set(13, 6.0);
  for (const std::uint32_t node : {0U, 1U, 1U, 2U, 2U, 3U, 4U, 5U, 5U, 6U, 6U, 7U, 7U, 4U})
    surface.add_connectivity(node);
  return surface;
}

v1::Displacements motion(double displacement, double velocity) {
  v1::Displacements field;
  field.set_surface(7);
  for (int node = 0; node < 8; ++node) {
    field.add_displacement(0);
    field.add_displacement(displacement);
    field.add_velocity(0);
    field.add_velocity(velocity);
  }
  return field;
}

TEST(DrivenSurface, BecomesLinesThatMoveOnTheCubicOfBothEnds) {
  Body body;
  const DrivenSurface driven(floor_and_square(), body);
  ASSERT_EQ(body.size(), 8U);
  ASSERT_EQ(body.outlines.size(), 2U);
  EXPECT_FALSE(body.outlines[0].closed);
  EXPECT_EQ(body.outlines[0].particle.size(), 4U);
  EXPECT_TRUE(body.outlines[1].closed);
  EXPECT_EQ(body.outlines[1].particle.size(), 4U);
  State state = at_rest(body);
  driven.place(motion(0.5, 2), state);
  EXPECT_EQ(state.displacement[1], 0.5);
  const SurfaceMotion window = driven.window(state, motion(0.75, 0), 3, 0.25);
  // Of 1/2 + 2 t - 4 t^2: the cubic is exact.
  EXPECT_NEAR(window.at(1, 3.125), 0.6875, 1e-14);
  EXPECT_EQ(window.at(1, 3.25), 0.75);
  v1::WetSurface fork = floor_and_square();
  fork.add_connectivity(1);
  fork.add_connectivity(4);
  EXPECT_THROW(DrivenSurface(fork, body), std::invalid_argument);
}

TEST(DrivenSurface, AColumnStopsOnASurfaceThatGoesTowardsItAndGivesTheImpulseBack) {
  Scene scene = Scene::parse(R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-5
end_time = 1
[solid]
[fluid]
spacing = 0.0125
held = ["x"]
[[fluid.body]]
name = "column"
kind = "fluid"
box = { from = [0, 0], to = [0.05, 0.25] }
density = 1000
sound_speed = 1450
velocity = ["0", "-100"]
[[watch]]
name = "all"
participant = "fluid"
)",
                             "scene.toml");
  Solid fluid;
  fluid.configure(scene, "fluid");
  for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
  const auto folder =
      std::filesystem::temp_directory_path() / ("solid-sph-driven-" + std::to_string(::getpid()));
  v1::Exchange initial;
  *initial.mutable_wet_surface() = floor_and_square();
  *initial.mutable_displacements() = motion(0, 50);
  fluid.start(initial, folder);
  ProgressBoard board;
  AdvanceResult result;
  const double window = 1e-5;
  double impulse = 0, force = 0;
  const auto momentum = [&] {
    for (const auto& [name, value] : result.watches[0].quantities)
      if (name == "momentum_y") return value;
    return 0.0;
  };
  for (std::uint64_t w = 1; w <= 15; ++w) {
    v1::Exchange inputs;
    *inputs.mutable_displacements() = motion(50 * window * static_cast<double>(w), 50);
    for (const std::uint64_t iteration : {1, 2})  // a repeated window counts once
      result = fluid.advance({.number = w,
                              .iteration = iteration,
                              .mode = Mode::transient,
                              .time = window * static_cast<double>(w - 1),
                              .duration = window},
                             inputs, board);
    fluid.accept();
    ASSERT_EQ(result.outputs.forces().force_size(), 16);
    force = 0;
    for (int node = 0; node < 8; ++node) force += result.outputs.forces().force(2 * node + 1);
    EXPECT_NEAR(force, result.surface_force[1], 1e-6);
    impulse += force * window;
  }
  // Down on the surface; rho c (V + the surface's speed) over 0.05 m.
  EXPECT_NEAR(force, -1000 * 1450 * 150 * 0.05, 0.03 * 1000 * 1450 * 150 * 0.05);
  EXPECT_NEAR(momentum() + 12.5 * 100, -impulse, 1e-9 * 1250);
  EXPECT_THROW(
      fluid.advance(
          {.number = 16, .iteration = 1, .mode = Mode::transient, .time = 15 * window, .duration = window},
          {}, board),
      BadInput);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace estuary::solid
