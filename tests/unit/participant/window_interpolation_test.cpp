#include "window_interpolation.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace estuary {
namespace {

// Each kind keeps polynomials of its degree, with windows of unequal length too.
TEST(WindowInterpolation, KeepsPolynomialsOfItsDegree) {
  const auto largest_error = [](InterpolationInTime kind, int degree) {
    const auto f = [degree](double t) { return 1 + (degree > 0 ? 2 * t : 0) + (degree > 1 ? 3 * t * t : 0); };
    WindowInterpolation values(kind, {f(0)});
    double time = 0;
    double error = 0;
    for (const double duration : {0.4, 0.4, 0.1, 0.7}) {
      values.set_end(std::vector<double>{f(time + duration)}, duration);
      for (const double s : {0.0, 0.3, 0.8, 1.0})
        if (time > 0) error = std::max(error, std::abs(values.at(0, s) - f(time + s * duration)));
      values.accept();
      time += duration;
    }
    return error;
  };
  const auto constant = InterpolationInTime::constant, linear = InterpolationInTime::linear,
             quadratic = InterpolationInTime::quadratic;
  EXPECT_LT(largest_error(constant, 0), 1e-14);
  EXPECT_GT(largest_error(constant, 1), 0.1);
  EXPECT_LT(largest_error(linear, 1), 1e-14);
  EXPECT_GT(largest_error(linear, 2), 0.1);
  EXPECT_LT(largest_error(quadratic, 2), 1e-14);
}

TEST(WindowInterpolation, HermiteKeepsCubics) {
  const auto f = [](double t) { return 1 - t + 2 * t * t - 0.5 * t * t * t; };
  const auto rate = [](double t) { return -1 + 4 * t - 1.5 * t * t; };
  for (const double s : {0.0, 0.25, 0.6, 1.0})
    EXPECT_NEAR(hermite(f(0.2), rate(0.2), f(0.9), rate(0.9), 0.7, s), f(0.2 + 0.7 * s), 1e-14);
}

TEST(WindowInterpolation, ARepeatedWindowStartsFromTheSameStart) {
  WindowInterpolation values(InterpolationInTime::linear, {1.0});
  values.set_end(std::vector<double>{9.0}, 0.1);
  values.set_end(std::vector<double>{3.0}, 0.1);
  EXPECT_DOUBLE_EQ(values.at(0, 0.5), 2.0);
  EXPECT_THROW(values.set_end(std::vector<double>{1.0, 2.0}, 0.1), std::invalid_argument);
  EXPECT_THROW(values.set_end(std::vector<double>{1.0}, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace estuary
