#include "convergence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "answer_jump.hpp"
#include "window_swing.hpp"

namespace estuary::coupler {
namespace {

CouplingScene scene_with(std::vector<Measure> measures) {
  CouplingScene scene;
  scene.mode = CouplingMode::transient;
  scene.window = 0.1;
  scene.measures = std::move(measures);
  return scene;
}

Convergence started(const CouplingScene& scene) {
  Convergence convergence(scene, 1.0);
  convergence.begin_window();
  return convergence;
}

TEST(Convergence, RelativeMeasureDividesByTheAnswer) {
  auto convergence = started(scene_with({{Field::displacement, MeasureKind::relative, 1e-2}}));
  EXPECT_EQ(convergence.judge({.displacement_increment = 0.03, .displacement = 2.0}, 1), Verdict::go_on);
  EXPECT_DOUBLE_EQ(convergence.relative(Field::displacement), 0.015);
  EXPECT_EQ(convergence.judge({.displacement_increment = 0.01, .displacement = 2.0}, 2), Verdict::converged);
}

TEST(Convergence, NothingMovingIsConvergedAndDividesByNothing) {
  auto convergence = started(scene_with({{Field::displacement, MeasureKind::relative, 1e-4},
                                         {Field::velocity, MeasureKind::relative, 1e-4},
                                         {Field::force, MeasureKind::relative, 1e-4}}));
  EXPECT_EQ(convergence.judge({}, 1), Verdict::converged);
  EXPECT_EQ(convergence.relative(Field::displacement), 0.0);
}

TEST(Convergence, RoundOffOfADisplacementAndItsVelocityIsNoMotion) {
  auto convergence = started(scene_with(
      {{Field::displacement, MeasureKind::relative, 1e-4}, {Field::velocity, MeasureKind::relative, 1e-4}}));
  EXPECT_EQ(convergence.judge({.displacement_increment = 3e-17,
                               .displacement = 3e-17,
                               .velocity_increment = 2e-17,
                               .velocity = 3e-17},
                              1),
            Verdict::converged);
}

TEST(Convergence, AChangeThatPositionsCannotShowIsNone) {
  // A surface of 1 m that has moved by 1e-13 m so far: its positions are known to 1e-16 m.
  auto convergence = started(scene_with({{Field::displacement, MeasureKind::relative, 1e-4}}));
  EXPECT_EQ(convergence.judge({.displacement_increment = 2e-14, .displacement = 1.4e-13}, 1), Verdict::go_on);
  EXPECT_NEAR(convergence.relative(Field::displacement), 1.0 / 7, 1e-12);
  EXPECT_EQ(convergence.judge({.displacement_increment = 2e-15, .displacement = 1.4e-13}, 2),
            Verdict::converged);
}

TEST(Convergence, AbsoluteAndResidualRelativeMeasures) {
  auto convergence = started(scene_with({{Field::displacement, MeasureKind::absolute, 1e-3},
                                         {Field::force, MeasureKind::residual_relative, 0.1}}));
  const auto norms = [](double displacement, double force) {
    return IterationNorms{.displacement_increment = displacement,
                          .displacement = 1.0,
                          .force_increment = force,
                          .force = 100.0};
  };
  EXPECT_EQ(convergence.judge(norms(0.1, 50), 1), Verdict::go_on);
  EXPECT_EQ(convergence.judge(norms(5e-4, 10), 2), Verdict::go_on);  // the force fell to a fifth only
  EXPECT_EQ(convergence.judge(norms(5e-4, 4), 3), Verdict::converged);
}

TEST(Convergence, ASlowVelocityNeedsNoRelativeAccuracy) {
  auto convergence = started(scene_with({{Field::velocity, MeasureKind::relative, 1e-3}}));
  const IterationNorms fast{.displacement = 1.0, .velocity_increment = 1e-4, .velocity = 1.0};
  EXPECT_EQ(convergence.judge(fast, 1), Verdict::converged);
  convergence.accept(fast);
  convergence.begin_window();
  // Turning round: the velocity is nearly zero, its increment small against what it was.
  EXPECT_EQ(convergence.judge({.displacement = 1.0, .velocity_increment = 5e-6, .velocity = 1e-4}, 1),
            Verdict::converged);
}

TEST(Convergence, GrowthAndAbsurdSizeAreDivergence) {
  CouplingScene scene = scene_with({{Field::displacement, MeasureKind::relative, 1e-4}});
  scene.min_iterations = 2;
  auto convergence = started(scene);
  // The first few iterations tell what an increment is like: in a parallel scheme the very first answers no
  // load.
  EXPECT_EQ(convergence.judge({}, 1), Verdict::go_on);
  EXPECT_EQ(convergence.judge({.displacement_increment = 1e-4, .displacement = 1e-3}, 2), Verdict::go_on);
  EXPECT_EQ(convergence.judge({.displacement_increment = 1e-3, .displacement = 1e-3}, 3), Verdict::go_on);
  EXPECT_EQ(convergence.judge({.displacement_increment = 900.0, .displacement = 500.0}, 4), Verdict::go_on);
  EXPECT_EQ(convergence.judge({.displacement_increment = 2e3, .displacement = 500.0}, 5), Verdict::diverged);
  convergence.begin_window();
  EXPECT_EQ(convergence.judge({.displacement_increment = 2e3, .displacement = 2e3}, 3), Verdict::diverged);
}

TEST(Convergence, HoppingWithoutGainIsAStallAndNotConvergence) {
  auto convergence = started(scene_with({{Field::displacement, MeasureKind::relative, 1e-4}}));
  Verdict verdict = Verdict::go_on;
  std::uint64_t iteration = 0;
  while (verdict == Verdict::go_on && iteration < 100) {
    ++iteration;
    verdict = convergence.judge({.displacement_increment = 1e-2, .displacement = 1.0}, iteration);
  }
  EXPECT_EQ(verdict, Verdict::stalled);
  EXPECT_EQ(iteration, 51U);
}

TEST(Convergence, ALeastNumberOfIterationsIsKept) {
  CouplingScene scene = scene_with({{Field::displacement, MeasureKind::relative, 1e-4}});
  scene.min_iterations = 3;
  auto convergence = started(scene);
  EXPECT_EQ(convergence.judge({.displacement = 1.0}, 1), Verdict::go_on);
  EXPECT_EQ(convergence.judge({.displacement = 1.0}, 2), Verdict::go_on);
  EXPECT_EQ(convergence.judge({.displacement = 1.0}, 3), Verdict::converged);
}

// The instability of an explicit scheme alternates and grows; a splitting error is smaller than the motion,
// and a motion that turns round differs by more than itself only for a moment.
TEST(Convergence, AnExplicitSchemeRunsAwayWhenItsMismatchGrowsBeyondTheMotion) {
  const auto windows_until = [](const auto& velocity_of, int most) {
    Convergence convergence(scene_with({}), 1.0);
    double before = 0;
    for (int k = 1; k <= most; ++k) {
      const double velocity = velocity_of(k);
      if (convergence.runs_away(
              {.velocity_increment = std::abs(velocity - before), .velocity = std::abs(velocity)}))
        return k;
      before = velocity;
    }
    return 0;
  };
  EXPECT_LE(windows_until([](int k) { return std::pow(-1.5, k); }, 10), 6);
  EXPECT_NE(windows_until([](int k) { return std::pow(-1.5, k); }, 10), 0);
  EXPECT_EQ(windows_until([](int k) { return std::sin(0.2 * k); }, 500), 0);
  EXPECT_EQ(windows_until([](int k) { return std::exp(0.5 * k); }, 50), 0);
  EXPECT_EQ(windows_until([](int k) { return std::pow(-0.9, k); }, 100), 0);
}

TEST(Convergence, SaysWhichMeasureIsFurthestFromItsLimit) {
  auto convergence = started(scene_with({{Field::displacement, MeasureKind::relative, 1e-4},
                                         {Field::velocity, MeasureKind::relative, 1e-3},
                                         {Field::force, MeasureKind::absolute, 5.0}}));
  (void)convergence.judge({.displacement_increment = 2e-4,
                           .displacement = 1.0,
                           .velocity_increment = 0.5,
                           .velocity = 1.0,
                           .force_increment = 6.0,
                           .force = 1.0},
                          1);
  EXPECT_EQ(convergence.furthest(), "relative increment of the velocity 5.0e-01, limit 0.001");
}

TEST(Convergence, ForcesThatDieAwayNeedNoRelativeAccuracy) {
  auto convergence = started(scene_with({{Field::force, MeasureKind::relative, 1e-3}}));
  convergence.accept({.force = 100.0});
  EXPECT_EQ(convergence.judge({.force_increment = 5e-4, .force = 1e-6}, 1), Verdict::converged);
  EXPECT_EQ(convergence.judge({.force_increment = 5e-3, .force = 1e-6}, 2), Verdict::go_on);
}

// One wet node whose solid answers 0.3 x + a load that depends on where it is.
std::optional<AnswerJump> jump_of(const std::function<double(double)>& load) {
  const auto answer = [&](const InterfaceState& x) {
    const double force = load(x.motion.displacement[0]);
    return InterfaceState{{{0.3 * x.motion.displacement[0] + force}, {force}}, {force}};
  };
  const auto relax_by_half = [](InterfaceState& x, const InterfaceState& answer_of_x) {
    for (auto field : {&WetMotion::displacement, &WetMotion::velocity})
      (x.motion.*field)[0] = 0.5 * ((x.motion.*field)[0] + (answer_of_x.motion.*field)[0]);
  };
  return find_jump({{{0.9}, {0.0}}, {1.0}}, answer, relax_by_half);
}

TEST(AnswerJump, IsFoundWhereALoadFallsAtOnce) {
  // x = 0.3 x + 1 beyond 1.2 and 0.6 below has its fixed points at 1.43 and 0.86, both on the other side.
  const auto jump = jump_of([](double x) { return x < 1.2 ? 1.0 : 0.6; });
  ASSERT_TRUE(jump);
  EXPECT_LT(jump->distance, 1e-6);
  EXPECT_NEAR(jump->forces, 0.4, 1e-9);
  EXPECT_NEAR(jump->displacement, 0.4 / 1.36, 1e-5);
}

TEST(AnswerJump, SteepButContinuousAnswersHaveNone) {
  EXPECT_FALSE(jump_of([](double x) { return 1.0 - 0.4 * std::clamp(500 * (x - 1.2), 0.0, 1.0); }));
  EXPECT_FALSE(jump_of([](double) { return 1.0; }));
  // Rounding is steep where iterates are close together, and grows no smaller with the way.
  EXPECT_FALSE(jump_of([](double x) { return 1.0 + 1e-7 * std::sin(1e12 * x); }));
}

TEST(WindowSwing, SeesForcesThatSwingFasterThanWindowsResolve) {
  const auto share_after = [](double windows_a_period, double mean) {
    WindowSwing swing;
    for (int k = 0; k < 40; ++k)
      swing.accept(std::vector<double>{mean + std::sin(2 * M_PI * k / windows_a_period), 0.0});
    return swing.share();
  };
  EXPECT_NEAR(share_after(2.6, 0.0), 2 * std::sin(M_PI / 2.6), 0.1);
  EXPECT_NEAR(share_after(3.0, 0.0), 2 * std::sin(M_PI / 3.0), 0.1);
  EXPECT_EQ(share_after(3.0, 10.0), 0.0);  // beside a load that is steady
  EXPECT_EQ(share_after(8.0, 0.0), 0.0);
}

}  // namespace
}  // namespace estuary::coupler
