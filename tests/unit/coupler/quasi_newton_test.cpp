#include "quasi_newton.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "fixed_point.hpp"
#include "reading_team.hpp"

namespace estuary::coupler {
namespace {

QuasiNewtonSettings settings(double relaxation, std::size_t windows_reused, double filter_limit = 1e-6) {
  return {.relaxation = relaxation,
          .windows_reused = windows_reused,
          .most_columns = 100,
          .filter = ColumnFilter::qr2,
          .filter_limit = filter_limit,
          .remainder = 1.0,
          .fields = {}};
}

template <typename Method>
class QuasiNewton : public testing::Test {};
using Methods = testing::Types<InterfaceQuasiNewton, MultiVectorQuasiNewton>;
TYPED_TEST_SUITE(QuasiNewton, Methods);

TYPED_TEST(QuasiNewton, SolvesALinearProblemInAsManyUpdatesAsItHasModes) {
  TypeParam method(settings(0.3, 0));
  EXPECT_LE(updates_until_converged(method, {-28.0, -0.6, 0.4}), 6);
}

TYPED_TEST(QuasiNewton, EveryFilterConverges) {
  for (const ColumnFilter filter :
       {ColumnFilter::none, ColumnFilter::qr1, ColumnFilter::qr2, ColumnFilter::qr3}) {
    auto with_filter = settings(0.3, 4, 1e-3);
    with_filter.filter = filter;
    TypeParam method(with_filter);
    for (int window = 0; window < 5; ++window) {
      method.begin_window();
      EXPECT_LE(updates_until_converged(method, {-8.0, -0.6, 0.4, 0.9}, 500, 1.0 + window), 25);
    }
  }
}

TYPED_TEST(QuasiNewton, ReusesWhatEarlierWindowsLearnt) {
  TypeParam method(settings(0.3, 4));
  const int first = updates_until_converged(method, {-28.0, -0.6, 0.4, 0.1});
  method.begin_window();
  EXPECT_LT(updates_until_converged(method, {-28.0, -0.6, 0.4, 0.1}, 500, 1.7), first - 1);
}

TYPED_TEST(QuasiNewton, ForgetsWhenAsked) {
  TypeParam method(settings(0.3, 4));
  const int first = updates_until_converged(method, {-28.0, -0.6, 0.4, 0.1});
  method.forget();
  EXPECT_EQ(updates_until_converged(method, {-28.0, -0.6, 0.4, 0.1}), first);
}

TYPED_TEST(QuasiNewton, ForgetsWindowsBeyondThoseReused) {
  TypeParam method(settings(0.3, 1, 1e-2));
  std::vector<double> x(8, 0.0);
  for (int window = 0; window < 4; ++window) {
    method.begin_window();
    for (int k = 0; k < 3; ++k) {
      std::vector<double> residual(8, 0.1);
      residual[static_cast<std::size_t>((2 * window + k) % 8)] = 1.0;
      residual[static_cast<std::size_t>((3 * k + window) % 8)] += 0.4;
      method.update(residual, x);
    }
  }
  EXPECT_LE(method.columns(), 4U);
  EXPECT_GE(method.columns(), 3U);
}

TYPED_TEST(QuasiNewton, SurvivesZeroRepeatedAndDependentResiduals) {
  TypeParam method(settings(0.5, 2, 1e-2));
  std::vector<double> x = {1.0, 2.0};
  method.update(std::vector<double>{0.0, 0.0}, x);
  method.update(std::vector<double>{0.0, 0.0}, x);
  EXPECT_EQ(x, (std::vector<double>{1.0, 2.0}));
  for (int i = 0; i < 5; ++i) method.update(std::vector<double>{1.0 / (i + 1), 2.0 / (i + 1)}, x);
  EXPECT_TRUE(std::isfinite(x[0]) && std::isfinite(x[1]));
}

TYPED_TEST(QuasiNewton, PreconditionerMakesUnitsOfFieldsUnimportant) {
  // Displacements of micrometres beside forces of kilonewtons.
  auto weighted = settings(0.3, 0);
  weighted.fields = {2, 2};
  const std::vector<double> factors = {-5.0, 0.5, -2.0, 0.7};
  TypeParam one_unit(weighted);
  const int wanted = updates_until_converged(one_unit, factors, 60);
  TypeParam mixed(weighted);
  EXPECT_LE(updates_until_converged(mixed, factors, 60, 1.0, {1e-6, 1e-6, 1e3, 1e3}), wanted + 2);
}

// What six windows of four iterations make of an iterate long enough for a team.
template <typename Method>
std::vector<double> iterate_after(int threads) {
  auto with_team = settings(0.3, 4);
  with_team.threads = threads;
  Method method(with_team);
  std::vector<double> iterate(ReadingTeam::least_values / 3 + 77), residual(iterate.size());
  unsigned number = 1;
  for (int window = 0; window < 6; ++window) {
    method.begin_window();
    for (int k = 0; k < 4; ++k) {
      for (std::size_t i = 0; i < iterate.size(); ++i) {
        number = number * 1664525U + 1013904223U;
        residual[i] = (1.0 + 0.1 * static_cast<double>(i % 7)) * (window - iterate[i]) +
                      1e-3 * (static_cast<double>(number) * 0x1p-31 - 1);
      }
      method.update(residual, iterate);
    }
  }
  EXPECT_GT(method.columns(), 12U);
  return iterate;
}

TYPED_TEST(QuasiNewton, GivesTheSameBitsWithAnyNumberOfThreads) {
  const auto alone = iterate_after<TypeParam>(1);
  EXPECT_EQ(iterate_after<TypeParam>(2), alone);
  EXPECT_EQ(iterate_after<TypeParam>(3), alone);
}

TEST(ReadingTeam, DoesEverythingOnceAndIsDoneWhenItReturns) {
  ReadingTeam team(3);
  std::vector<int> done(64);
  for (int call = 1; call <= 2000; ++call) {
    team.for_each(done.size(), ReadingTeam::least_values, [&](std::size_t k) { ++done[k]; });
    ASSERT_EQ(done, std::vector<int>(done.size(), call));
  }
}

// Which threads take part, when each job lasts until others had time to come.
std::size_t threads_of(std::size_t values) {
  ReadingTeam team(3);
  std::mutex mutex;
  std::set<std::thread::id> threads;
  for (int call = 0; call < 50 && threads.size() < 3; ++call)
    team.for_each(6, values, [&](std::size_t) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      const std::lock_guard lock(mutex);
      threads.insert(std::this_thread::get_id());
    });
  return threads.size();
}

TEST(ReadingTeam, ReadsMuchTogetherAndLittleAlone) {
  EXPECT_EQ(threads_of(ReadingTeam::least_values), 3U);
  EXPECT_EQ(threads_of(ReadingTeam::least_values - 1), 1U);
}

TEST(MultiVectorQuasiNewton, LooksInOlderWindowsForWhatThisOneHasNotSeen) {
  // Every window excites one more mode; the older ones need not be learnt again.
  MultiVectorQuasiNewton method(settings(0.3, 8));
  const std::vector<double> factors = {-9.0, -4.0, 0.5, 0.8};
  updates_until_converged(method, factors);
  method.begin_window();
  std::vector<double> x(4, 0.0);
  std::vector<double> residual(4);
  for (int k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < 4; ++i) residual[i] = 2.0 + factors[i] * x[i] - x[i];
    method.update(residual, x);
  }
  // After one update the answer is the solution already.
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(x[i], 2.0 / (1 - factors[i]), 1e-6);
}

}  // namespace
}  // namespace estuary::coupler
