#include "window_clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace estuary::coupler {
namespace {

TEST(WindowClock, CountsWindowsOfOneLength) {
  WindowClock clock(0.1, 3);
  for (int k = 0; k < 3; ++k) {
    ASSERT_FALSE(clock.at_end());
    EXPECT_EQ(clock.span().begin, k * 0.1);
    EXPECT_EQ(clock.span().duration, 0.1);
    EXPECT_EQ(clock.end_of_span(), (k + 1) * 0.1);
    clock.accept();
  }
  EXPECT_TRUE(clock.at_end());
  EXPECT_FALSE(WindowClock(0.1, 3).shorten());
}

TEST(WindowClock, HalvesAndGrowsBack) {
  WindowClock clock(0.8, 2);
  clock.allow_shorter(0.1, 0);
  EXPECT_EQ(clock.span().duration, 0.8);
  ASSERT_TRUE(clock.shorten());
  EXPECT_EQ(clock.span().duration, 0.4);
  ASSERT_TRUE(clock.shorten());
  ASSERT_TRUE(clock.shorten());
  EXPECT_EQ(clock.span().duration, 0.1);
  EXPECT_FALSE(clock.shorten());
  for (int k = 0; k < 4; ++k) clock.accept();
  EXPECT_EQ(clock.span().begin, 0.4);
  EXPECT_EQ(clock.span().duration, 0.2);
  for (int k = 0; k < 4; ++k) clock.accept();
  EXPECT_EQ(clock.span().duration, 0.4);
  EXPECT_EQ(clock.end_of_span(), 1.6);
  clock.accept();
  EXPECT_TRUE(clock.at_end());
}

// A fluid of 12 steps a window: 12, 6, 3, 1 steps; whatever happens, windows are whole steps, follow each
// other and end at the end.
TEST(WindowClock, KeepsToWholeStepsAndMeetsTheEndExactly) {
  std::mt19937 random(1);
  for (int run = 0; run < 50; ++run) {
    WindowClock clock(1.2, 7);
    clock.allow_shorter(1e-9, 0.1);
    double end = 0;
    int windows = 0;
    while (!clock.at_end()) {
      if (random() % 3 == 0) clock.shorten();
      const WindowSpan span = clock.span();
      EXPECT_DOUBLE_EQ(span.begin, end);
      const double steps = span.duration / 0.1;
      EXPECT_NEAR(steps, std::round(steps), 1e-9);
      EXPECT_GE(steps, 0.99);
      end = clock.end_of_span();
      EXPECT_NEAR(end, span.begin + span.duration, 1e-12);
      clock.accept();
      ASSERT_LT(++windows, 100);
    }
    EXPECT_EQ(end, 7 * 1.2);
  }
}

}  // namespace
}  // namespace estuary::coupler
