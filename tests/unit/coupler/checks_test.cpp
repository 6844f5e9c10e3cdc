#include "checks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "temporary_folder.hpp"

namespace estuary::coupler {
namespace {

WatchSeries cosine(double amplitude, double phase_degrees, double mean, double frequency, double end,
                   int samples) {
  WatchSeries series;
  for (int i = 1; i <= samples; ++i) {
    const double t = end * i / samples;
    series.time.push_back(t);
    series.value.push_back(mean +
                           amplitude * std::cos(frequency * t + phase_degrees * std::numbers::pi / 180));
  }
  return series;
}

TEST(FitHarmonic, RecoversAmplitudeAndPhase) {
  for (const double phase : {-170.0, -42.8, 0.0, 42.8, 120.0}) {
    const auto harmonic = fit_harmonic(cosine(0.594653, phase, 0.1, 3.0, 20.0, 400), 3.0, 5.0);
    EXPECT_NEAR(harmonic.amplitude, 0.594653, 1e-12);
    EXPECT_NEAR(harmonic.phase, phase, 1e-9);
  }
}

TEST(FitHarmonic, LeavesTheTransientOut) {
  auto series = cosine(1.0, 30.0, 0.0, 2 * std::numbers::pi, 10.0, 1000);
  for (std::size_t i = 0; i < 300; ++i) series.value[i] += 50;
  EXPECT_NEAR(fit_harmonic(series, 2 * std::numbers::pi, 3.0).amplitude, 1.0, 1e-10);
}

TEST(Frequency, CountsRisesAndNotNoise) {
  // cosine(amplitude, phase, mean, angular frequency, end, samples): 1.7 Hz, with a small fast ripple.
  WatchSeries series = cosine(2.0, 30, 5.0, 2 * std::numbers::pi * 1.7, 10.0, 4000);
  EXPECT_NEAR(frequency_of(series, 2.0), 1.7, 1e-4);
  for (std::size_t n = 0; n < series.value.size(); ++n) series.value[n] += n % 2 == 0 ? 0.2 : -0.2;
  EXPECT_NEAR(frequency_of(series, 2.0), 1.7, 0.01);
  EXPECT_TRUE(std::isnan(frequency_of(series, 9.8)));
  EXPECT_TRUE(std::isnan(frequency_of(series, 11.0)));
}

TEST(Frequency, DoesNotShiftWhenTheOscillationDiesOut) {
  WatchSeries series = cosine(2.0, 0, 0.0, 2 * std::numbers::pi * 0.1, 45.0, 4500);
  for (std::size_t n = 0; n < series.value.size(); ++n)
    series.value[n] = 3.0 + series.value[n] * std::exp(-0.1 * series.time[n]);
  EXPECT_NEAR(frequency_of(series, 0.0), 0.1, 1e-5);
  EXPECT_NEAR(frequency_of(series, 12.0), 0.1, 1e-5);
}

TEST(FitHarmonic, NeedsAWholePeriod) {
  EXPECT_TRUE(std::isnan(fit_harmonic(cosine(1, 0, 0, 1.0, 3.0, 100), 1.0, 0.0).amplitude));
}

class Checks : public testing::Test {
protected:
  void SetUp() override {
    scene_.watches.push_back(
        {.name = "tip", .participant = "solid", .angular_frequency = {}, .level = {}, .from_time = 0});
  }
  CheckResult evaluate(CheckScene check) {
    scene_.checks = {std::move(check)};
    RunRecord record(folder_.path(), scene_);
    for (const double value : {1.0, 4.0, 2.0}) {
      v1::WatchSample sample;
      sample.set_name("tip");
      sample.add_quantity("x");
      sample.add_value(value);
      record.add(sample, 1, 1, value);
    }
    WindowRow row;
    row.iterations = 7;
    row.verdict = "converged";
    record.add(row);
    return evaluate_checks(scene_, record.read(), {.wall_s = 3.0, .total_iterations = 7}).front();
  }
  estuary::TemporaryFolder folder_;
  CouplingScene scene_;
};

CheckScene compare(std::string quantity, double reference, double tolerance) {
  CheckScene check;
  check.quantity = std::move(quantity);
  check.reference = reference;
  check.relative_tolerance = tolerance;
  return check;
}

TEST_F(Checks, TakesTheLastValueUnlessAnotherStatisticIsNamed) {
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x", 2, 0)).value, 2);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.max", 4, 0)).value, 4);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.min", 1, 0)).value, 1);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.mean", 7.0 / 3, 1e-12)).value, 7.0 / 3);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.mid_range", 2.5, 0)).value, 2.5);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.half_range", 1.5, 0)).value, 1.5);
  EXPECT_DOUBLE_EQ(evaluate(compare("coupling.iterations", 7, 0)).value, 7);
}

TEST_F(Checks, LeavesOutWhatComesAfterToTime) {
  scene_.watches[0].to_time = 1.5;
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x", 1, 0)).value, 1);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.max", 1, 0)).value, 1);
  // The times of windows are products, which differ by round-off from what somebody writes.
  scene_.watches[0].to_time = std::nextafter(1.0, 0.0);
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x", 1, 0)).value, 1);
  scene_.watches[0].to_time = 0.5;
  EXPECT_TRUE(std::isnan(evaluate(compare("tip.x", 1, 0)).value));
}

TEST_F(Checks, TellsWhenAValueIsFirstAboveALevel) {
  // 1, 4 and 2 at these very times: above 2 from a third of the way on.
  EXPECT_TRUE(std::isnan(evaluate(compare("tip.x.time_above", 2, 0)).value));
  scene_.watches[0].level = 2.0;
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.time_above", 2, 1e-12)).value, 2);
  scene_.watches[0].level = 0.5;
  EXPECT_DOUBLE_EQ(evaluate(compare("tip.x.time_above", 1, 0)).value, 1);
  scene_.watches[0].level = 4.0;
  EXPECT_TRUE(std::isnan(evaluate(compare("tip.x.time_above", 2, 0)).value));
}

TEST_F(Checks, HoldsTheRelativeErrorAgainstTheTolerance) {
  EXPECT_TRUE(evaluate(compare("tip.x", 2.1, 0.05)).pass);
  EXPECT_FALSE(evaluate(compare("tip.x", 2.2, 0.05)).pass);
  EXPECT_FALSE(evaluate(compare("tip.x", -2.0, 0.05)).pass);
}

TEST_F(Checks, AMissingQuantityFails) {
  EXPECT_FALSE(evaluate(compare("tip.y", 2, 1e9)).pass);
  CheckScene bound;
  bound.quantity = "tip.y";
  bound.at_most = 1e300;
  EXPECT_FALSE(evaluate(bound).pass);
}

TEST_F(Checks, BoundsHoldOnTheirSide) {
  CheckScene bound;
  bound.quantity = "coupling.iterations";
  bound.at_most = 7;
  EXPECT_TRUE(evaluate(bound).pass);
  bound.at_most = 6;
  EXPECT_FALSE(evaluate(bound).pass);
  bound.at_most.reset();
  bound.at_least = 8;
  EXPECT_FALSE(evaluate(bound).pass);
}

}  // namespace
}  // namespace estuary::coupler
