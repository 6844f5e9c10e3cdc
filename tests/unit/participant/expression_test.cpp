// Expressions of a scene: what they know, what they refuse, and whether they depend on time.
#include "expression.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <vector>

namespace estuary {
namespace {

using ::testing::HasSubstr;

TEST(Expression, KnowsCoordinatesTimeAndPi) {
  EXPECT_EQ(Expression("x + 10*y + 100*z + 1000*t")(1, 2, 3, 4), 4321.0);
  EXPECT_EQ(Expression("pi")(0, 0, 0, 0), std::numbers::pi);
  EXPECT_EQ(Expression("4*y*(1-y)")(0, 0.25, 0, 0), 0.75);
  EXPECT_EQ(Expression("sin(pi*t)")(0, 0, 0, 0.3), std::sin(std::numbers::pi * 0.3));
  EXPECT_EQ(Expression("t < 1 ? t : 1")(0, 0, 0, 0.25), 0.25);
  EXPECT_EQ(Expression("t >= 1 ? 1 : 0")(0, 0, 0, 2), 1.0);
}

TEST(Expression, ReadsNumbersAsASceneWritesThem) {
  EXPECT_EQ(Expression("1e-05")(0, 0, 0, 0), 1e-5);
  EXPECT_EQ(Expression("-0.1")(0, 0, 0, 0), -0.1);
  EXPECT_EQ(Expression("1.2345678901234567e+20")(0, 0, 0, 0), 1.2345678901234567e20);
}

TEST(Expression, TellsWhetherItDependsOnTime) {
  EXPECT_TRUE(Expression("x*y + tan(z)").constant_in_time());
  EXPECT_FALSE(Expression("x*t").constant_in_time());
  EXPECT_FALSE(Expression("x > 0 ? 1 : t").constant_in_time());
}

TEST(Expression, CanBeMoved) {
  Expression first("x + 1");
  Expression second = std::move(first);
  EXPECT_EQ(second(1, 0, 0, 0), 2.0);
  first = Expression("t");
  EXPECT_EQ(first(0, 0, 0, 5), 5.0);
  EXPECT_EQ(second.text(), "x + 1");
}

std::string refusal(const std::string& text) {
  try {
    const Expression expression(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST(Expression, RefusesUnknownNamesWithTheirPlace) {
  EXPECT_THAT(refusal("1 + speed"), HasSubstr("expression \"1 + speed\""));
  EXPECT_THAT(refusal("1 + speed"), HasSubstr("\"speed\""));
  EXPECT_THAT(refusal("1 + speed"), HasSubstr("at character 5"));
  EXPECT_THAT(refusal("1 + speed"), HasSubstr("known are x, y, z, t, pi"));
}

TEST(Expression, RefusesWhatIsNotOneValue) {
  for (const std::string text :
       {"", "   ", "1 +", "(1", "1)", "sin()", "1 2", "x y", "sin", "1, 2", "\"a\"", "2x", "#"}) {
    EXPECT_NE(refusal(text), "") << text;
  }
}

TEST(Expression, RefusesAssignments) {
  EXPECT_THAT(refusal("x = 3"), HasSubstr("compare with '=='"));
  EXPECT_THAT(refusal("x = 3"), HasSubstr("at character 3"));
  EXPECT_NE(refusal("y += 3"), "");
  EXPECT_EQ(refusal("x == 3 ? 1 : 0"), "");
  EXPECT_EQ(refusal("x != 3 && y <= 2 && z >= 1"), "");
}

TEST(Expression, GivesTheSameFromOnePerThread) {
  std::vector<double> results(4, 0.0);
  {
    std::vector<std::jthread> threads;
    for (double& result : results) {
      threads.emplace_back([&result] {
        const Expression expression("sin(x) + t");
        for (int i = 0; i < 1000; ++i) result += expression(0.001 * i, 0, 0, 1);
      });
    }
  }
  for (const double result : results) EXPECT_EQ(result, results[0]);
}

}  // namespace
}  // namespace estuary
