#include "acceleration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace estuary::coupler {
namespace {

// Iterates x = a + b x for a vector of independent factors b and returns the number of updates until the
// residual is below 1e-10.
int updates_until_converged(Acceleration& acceleration, const std::vector<double>& b, int most = 500) {
  std::vector<double> x(b.size(), 0.0);
  std::vector<double> residual(b.size());
  for (int k = 0; k < most; ++k) {
    double norm = 0;
    for (std::size_t i = 0; i < b.size(); ++i) {
      residual[i] = 1.0 + b[i] * x[i] - x[i];
      norm += residual[i] * residual[i];
    }
    if (std::sqrt(norm) < 1e-10) return k;
    acceleration.update(residual, x);
  }
  return most;
}

TEST(ConstantRelaxation, AddsTheScaledResidual) {
  ConstantRelaxation relaxation(0.25);
  std::vector<double> x = {1.0, 2.0};
  relaxation.update(std::vector<double>{4.0, -8.0}, x);
  EXPECT_EQ(x, (std::vector<double>{2.0, 0.0}));
}

TEST(AitkenRelaxation, IsExactForOneModeAfterTwoUpdates) {
  for (const double factor : {-3.0, -0.6, 0.0, 0.5, 0.9}) {
    AitkenRelaxation aitken(0.4, 100.0);
    EXPECT_LE(updates_until_converged(aitken, {factor}), 3) << factor;
  }
}

TEST(AitkenRelaxation, ConvergesWhereThePlainIterationDiverges) {
  AitkenRelaxation aitken(0.3);
  EXPECT_LT(updates_until_converged(aitken, {-2.5, -1.5, -0.5, 0.1}), 100);
  ConstantRelaxation none(1.0);
  EXPECT_EQ(updates_until_converged(none, {-2.5, -1.5, -0.5, 0.1}), 500);
}

TEST(AitkenRelaxation, SurvivesZeroAndRepeatedResiduals) {
  AitkenRelaxation aitken(0.5);
  std::vector<double> x = {1.0};
  const std::vector<double> zero = {0.0};
  const std::vector<double> one = {1.0};
  aitken.update(zero, x);
  aitken.update(zero, x);
  EXPECT_EQ(x[0], 1.0);
  aitken.update(one, x);
  aitken.update(one, x);  // no change: 0/0
  EXPECT_TRUE(std::isfinite(x[0]));
  EXPECT_TRUE(std::isfinite(aitken.relaxation()));
  EXPECT_NE(aitken.relaxation(), 0.0);
}

TEST(AitkenRelaxation, KeepsAFiniteFactorWhenTheResidualIsNotANumber) {
  AitkenRelaxation aitken(0.5);
  std::vector<double> x = {0.0};
  aitken.update(std::vector<double>{1.0}, x);
  aitken.update(std::vector<double>{std::numeric_limits<double>::quiet_NaN()}, x);
  EXPECT_TRUE(std::isfinite(aitken.relaxation()));
}

TEST(AitkenRelaxation, StartsAWindowWithNoMoreThanTheInitialFactor) {
  AitkenRelaxation aitken(0.2);
  std::vector<double> x = {0.0};
  aitken.update(std::vector<double>{1.0}, x);
  aitken.update(std::vector<double>{0.9}, x);
  EXPECT_GT(aitken.relaxation(), 0.2);
  aitken.begin_window();
  x = {0.0};
  aitken.update(std::vector<double>{1.0}, x);
  EXPECT_DOUBLE_EQ(x[0], 0.2);
}

TEST(InterfaceQuasiNewton, SolvesALinearProblemInAsManyUpdatesAsItHasModes) {
  InterfaceQuasiNewton quasi_newton(0.3, 0, 100, 1e-10);
  EXPECT_LE(updates_until_converged(quasi_newton, {-28.0, -0.6, 0.4}), 6);
}

TEST(InterfaceQuasiNewton, ReusesWhatEarlierWindowsLearnt) {
  InterfaceQuasiNewton quasi_newton(0.3, 4, 100, 1e-10);
  const int first = updates_until_converged(quasi_newton, {-28.0, -0.6, 0.4, 0.1});
  quasi_newton.begin_window();
  EXPECT_LT(updates_until_converged(quasi_newton, {-28.0, -0.6, 0.4, 0.1}), first - 1);
}

TEST(InterfaceQuasiNewton, ForgetsWindowsBeyondThoseReused) {
  InterfaceQuasiNewton quasi_newton(0.3, 1);
  std::vector<double> x = {0.0, 0.0};
  for (int window = 0; window < 4; ++window) {
    quasi_newton.begin_window();
    quasi_newton.update(std::vector<double>{1.0, 0.1}, x);
    quasi_newton.update(std::vector<double>{0.4, 0.3}, x);
    quasi_newton.update(std::vector<double>{0.1, 0.05}, x);
    EXPECT_LE(quasi_newton.columns(), 4U);
  }
  EXPECT_EQ(quasi_newton.columns(), 4U);
}

TEST(InterfaceQuasiNewton, SurvivesZeroRepeatedAndDependentResiduals) {
  InterfaceQuasiNewton quasi_newton(0.5, 2);
  std::vector<double> x = {1.0, 2.0};
  quasi_newton.update(std::vector<double>{0.0, 0.0}, x);
  quasi_newton.update(std::vector<double>{0.0, 0.0}, x);
  EXPECT_EQ(x, (std::vector<double>{1.0, 2.0}));
  for (int i = 0; i < 5; ++i) quasi_newton.update(std::vector<double>{1.0 / (i + 1), 2.0 / (i + 1)}, x);
  EXPECT_TRUE(std::isfinite(x[0]) && std::isfinite(x[1]));
}

}  // namespace
}  // namespace estuary::coupler
