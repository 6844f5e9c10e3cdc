#include "acceleration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "fixed_point.hpp"

namespace estuary::coupler {
namespace {

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

}  // namespace
}  // namespace estuary::coupler
