// Bodies of one participant against the wet surface of another.
#include <gtest/gtest.h>

#include <omp.h>

#include "running_scene.hpp"

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

TEST(DrivenSurface, NamesThePiecesThatAreTornAndRefusesWhatCannotBe) {
  v1::WetSurface tears = floor_and_square();
  tears.set_tears(true);
  Body body;
  const DrivenSurface driven(tears, body);
  const State state = at_rest(body);
  v1::Displacements field = motion(0, 0);
  EXPECT_TRUE(driven.window(state, field, 0, 1).torn.empty());
  field.add_torn(1);
  field.add_torn(6);
  const std::vector<std::array<std::uint32_t, 2>> expected{{1, 2}, {7, 4}};
  EXPECT_EQ(driven.window(state, field, 0, 1).torn, expected);
  field.add_torn(7);
  EXPECT_THROW(static_cast<void>(driven.window(state, field, 0, 1)), std::invalid_argument);
}

constexpr double kWindow = 1e-5;

// A column, 5 cm wide, on its way down at 100 m/s to the floor, which comes up at 50 m/s.
struct DrivenColumn : test::RunningScene {
  explicit DrivenColumn(const std::string& spacing, const std::string& from = "0",
                        const std::string& to = "0.05")
      : RunningScene(R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-5
end_time = 1
[solid]
[fluid]
held = ["x"]
spacing = )" + spacing + R"(
[[fluid.body]]
name = "column"
kind = "fluid"
box = { from = [)" + from +
                         ", 0], to = [" + to + R"(, 0.25] }
density = 1000
sound_speed = 1450
velocity = ["0", "-100"]
[[watch]]
name = "all"
participant = "fluid"
)",
                     kWindow, "fluid", initial()) {
    inputs = [](std::uint64_t window) {
      v1::Exchange received;
      *received.mutable_displacements() = motion(50 * kWindow * static_cast<double>(window), 50);
      return received;
    };
  }
  static v1::Exchange initial() {
    v1::Exchange sent;
    *sent.mutable_wet_surface() = floor_and_square();
    sent.mutable_wet_surface()->set_tears(true);
    *sent.mutable_displacements() = motion(0, 50);
    return sent;
  }
  [[nodiscard]] double force() const {
    double sum = 0;
    for (int node = 0; node < 8; ++node) sum += result().outputs.forces().force(2 * node + 1);
    return sum;
  }
};

TEST(DrivenSurface, AColumnStopsOnASurfaceThatGoesTowardsItAndGivesTheImpulseBack) {
  DrivenColumn column("0.0125");
  double impulse = 0;
  for (int w = 1; w <= 15; ++w) {
    column.run(1, true);  // a repeated window counts once
    ASSERT_EQ(column.result().outputs.forces().force_size(), 16);
    EXPECT_NEAR(column.force(), column.result().surface_force[1], 1e-6);
    impulse += column.force() * kWindow;
  }
  // Down on the surface; rho c (V + the surface's speed) over 0.05 m.
  EXPECT_NEAR(column.force(), -1000 * 1450 * 150 * 0.05, 0.03 * 1000 * 1450 * 150 * 0.05);
  EXPECT_NEAR(column.value("all", "momentum_y") + 12.5 * 100, -impulse, 1e-9 * 1250);
  column.inputs = nullptr;
  EXPECT_THROW(column.run(1), BadInput);
}

TEST(DrivenSurface, AColumnFallsOnThroughAPieceThatIsTorn) {
  DrivenColumn column("0.005", "0.01", "0.04");
  column.run(10);
  EXPECT_LT(column.force(), -1000 * 1450 * 100 * 0.03);
  const auto before = column.inputs;
  column.inputs = [before](std::uint64_t window) {
    v1::Exchange received = before(window);
    received.mutable_displacements()->add_torn(1);
    return received;
  };
  column.run(1, true);
  EXPECT_EQ(column.force(), 0);
}

TEST(DrivenSurface, ARestartAndOtherThreadsGiveTheSameBits) {
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  DrivenColumn one("0.003125"), two("0.003125"), three("0.003125");
  one.run(2);
  one.save();
  two.go_on_from(one);
  one.run(2);
  two.run(2);
  omp_set_num_threads(2);
  three.run(4);
  omp_set_num_threads(threads);
  for (const DrivenColumn* other : {&two, &three}) {
    for (const char* quantity : {"kinetic_energy", "internal_energy", "total_energy", "contact_work"})
      EXPECT_EQ(one.value("all", quantity), other->value("all", quantity)) << quantity;
    EXPECT_EQ(one.force(), other->force());
  }
}

}  // namespace
}  // namespace estuary::solid
