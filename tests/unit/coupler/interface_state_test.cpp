#include "interface_state.hpp"

#include <gtest/gtest.h>

namespace estuary::coupler {
namespace {

// A motion of constant acceleration is predicted exactly by the quadratic predictor, windows of unequal
// length too.
TEST(Predict, KeepsMotionsOfItsDegree) {
  const auto place = [](double t) { return 1 + 2 * t + 1.5 * t * t; };
  const auto velocity = [](double t) { return 2 + 3 * t; };
  InterfaceHistory history;
  history.accepted = {.motion = {.displacement = {place(0.5)}, .velocity = {velocity(0.5)}}, .forces = {7.0}};
  history.earlier_velocity = {velocity(0.3)};
  history.earlier_duration = 0.2;
  const double duration = 0.1;
  const InterfaceState none = predict(Predictor::none, history, duration);
  EXPECT_EQ(none.motion.displacement[0], place(0.5));
  const InterfaceState linear = predict(Predictor::linear, history, duration);
  EXPECT_DOUBLE_EQ(linear.motion.displacement[0], place(0.5) + duration * velocity(0.5));
  EXPECT_EQ(linear.motion.velocity[0], velocity(0.5));
  const InterfaceState quadratic = predict(Predictor::quadratic, history, duration);
  EXPECT_DOUBLE_EQ(quadratic.motion.displacement[0], place(0.6));
  EXPECT_DOUBLE_EQ(quadratic.motion.velocity[0], velocity(0.6));
  EXPECT_EQ(quadratic.forces[0], 7.0);
  history.earlier_velocity.clear();  // the first window
  EXPECT_EQ(predict(Predictor::quadratic, history, duration).motion.displacement, linear.motion.displacement);
}

TEST(Accelerate, TakesTheVelocityAsTheDisplacementOfOneWindow) {
  ConstantRelaxation half(0.5);
  InterfaceState x{.motion = {.displacement = {1.0}, .velocity = {10.0}, .torn = {3}}, .forces = {100.0}};
  const InterfaceState answer{.motion = {.displacement = {2.0}, .velocity = {20.0}, .torn = {3, 4}},
                              .forces = {300.0}};
  AccelerationVectors vectors;
  accelerate(half, x, answer, 0.01, true, false, vectors);
  EXPECT_DOUBLE_EQ(x.motion.displacement[0], 1.5);
  EXPECT_DOUBLE_EQ(x.motion.velocity[0], 15.0);
  EXPECT_EQ(x.forces[0], 100.0);
  EXPECT_EQ(x.motion.torn, std::vector<std::uint32_t>{3});  // what tears meanwhile does so in the next window
  accelerate(half, x, answer, 0.01, false, true, vectors);
  EXPECT_DOUBLE_EQ(x.motion.velocity[0], 15.0);
  EXPECT_DOUBLE_EQ(x.forces[0], 200.0);
  x.forces.push_back(0.0);
  EXPECT_THROW(accelerate(half, x, answer, 0.01, false, true, vectors), std::logic_error);
}

}  // namespace
}  // namespace estuary::coupler
