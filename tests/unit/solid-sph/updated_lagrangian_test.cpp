// The updated Lagrangian form: consistency of its rates, conservation.
#include "updated_lagrangian.hpp"

#include <gtest/gtest.h>

#include "bodies.hpp"

namespace estuary::solid {
namespace {

SolverOptions elastic_plate() {
  return {.materials = {{.constants = ElasticConstants::from(1e6, 0.3, Plane::strain),
                         .plane = Plane::strain,
                         .viscosity = {},
                         .plasticity = {}}},
          .hourglass_time = {}};
}

TEST(UpdatedLagrangian, AUniformVelocityGradientGivesItsStressRateEverywhere) {
  const Body body = fill(test::box_of(1.0, 0.4, 0.05), 1000, 1.2, false);
  UpdatedLagrangianSolver solver(body, elastic_plate());
  State state = at_rest(body);
  state.history = solver.history();
  const Tensor<double> rate{0.3, 0.5, -0.1, -0.2};
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double x = body.position[2 * i], y = body.position[2 * i + 1];
    state.velocity[2 * i] = rate.xx * x + rate.xy * y;
    state.velocity[2 * i + 1] = rate.yx * x + rate.yy * y;
  }
  const double dt = 1e-7;
  solver.advance(state, {}, dt, 1, 0, test::no_monitor);
  const auto c = elastic_plate().materials[0].constants;
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double* s = &state.history[UpdatedLagrangianSolver::kHistorySize * i];
    ASSERT_NEAR(s[0] / dt, c.lambda * 0.1 + 2 * c.mu * 0.3, 1);
    ASSERT_NEAR(s[1] / dt, c.mu * 0.4, 1);
    ASSERT_NEAR(s[2] / dt, c.lambda * 0.1 - 2 * c.mu * 0.2, 1);
    ASSERT_NEAR(s[4], 1000 * (1 - 0.1 * dt), 1e-6);
  }
}

TEST(UpdatedLagrangian, KeepsLinearMomentumAndLosesTheBarThatTotalLagrangianKeeps) {
  // A bar flying apart: ends pulled by their own velocity.
  const Body body = fill(test::box_of(1.0, 0.2, 0.05), 1000, 1.2, false);
  const auto total =
      make_solver(LawName::neo_hooke, body,
                  {.materials = elastic_plate().materials, .stabilisation = 0.02, .hourglass_time = {}});
  UpdatedLagrangianSolver updated(body, elastic_plate());
  SolverOptions repelled = elastic_plate();
  repelled.artificial_stress = 0.3;
  UpdatedLagrangianSolver repelling(body, repelled);
  const auto longest = [&](Solver& solver) {
    State state = at_rest(body);
    state.history = solver.history();
    for (std::size_t i = 0; i < body.size(); ++i) {
      const double x = body.position[2 * i] - 0.5;
      state.velocity[2 * i] = 12 * x + 0.3;
      state.velocity[2 * i + 1] = 0.01 * std::sin(40 * x);
    }
    const auto momentum = [&](std::size_t c) {
      double sum = 0;
      for (std::size_t i = 0; i < body.size(); ++i) sum += body.mass[i] * state.velocity[2 * i + c];
      return sum;
    };
    const double before[2] = {momentum(0), momentum(1)};
    solver.advance(state, {}, 0.15, 1500, 0, test::no_monitor);
    EXPECT_NEAR(momentum(0), before[0], 1e-9);
    EXPECT_NEAR(momentum(1), before[1], 1e-9);
    // The widest gap between particles that were neighbours in a row.
    double gap = 0;
    for (std::size_t i = 0; i < body.size(); ++i)
      for (std::size_t j = 0; j < body.size(); ++j)
        if (body.position[2 * i + 1] == body.position[2 * j + 1] &&
            std::abs(body.position[2 * j] - body.position[2 * i] - 0.05) < 1e-9)
          gap = std::max(gap, 0.05 + state.displacement[2 * j] - state.displacement[2 * i]);
    return gap / 0.05;
  };
  EXPECT_LT(longest(*total), 1.6);
  const double broken = longest(updated);
  EXPECT_GT(broken, 2.4);  // beyond the kernel's reach
  EXPECT_LT(longest(repelling), broken);
}

TEST(UpdatedLagrangian, SmoothingKeepsLinearMomentumAndTakesEnergy) {
  // At free edges every particle has its own sum of weights; the velocities are without symmetry.
  const Body body = fill(test::box_of(1.0, 0.4, 0.05), 1000, 1.2, false);
  SolverOptions options = elastic_plate();
  options.conservative_smoothing = 0.5;
  UpdatedLagrangianSolver solver(body, options);
  State state = at_rest(body);
  state.history = solver.history();
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double x = body.position[2 * i], y = body.position[2 * i + 1];
    state.velocity[2 * i] = 0.3 + x * x + std::sin(60 * x + 25 * y);
    state.velocity[2 * i + 1] = std::exp(x) * y;
  }
  const auto momentum = [&](std::size_t c) {
    double sum = 0;
    for (std::size_t i = 0; i < body.size(); ++i) sum += body.mass[i] * state.velocity[2 * i + c];
    return sum;
  };
  const double before[2] = {momentum(0), momentum(1)}, energy = solver.kinetic_energy(state);
  solver.advance(state, {}, 1e-4, 20, 0, test::no_monitor);
  EXPECT_NEAR(momentum(0) / before[0], 1, 1e-13);
  EXPECT_NEAR(momentum(1) / before[1], 1, 1e-13);
  EXPECT_GT(state.viscous_work, 0.1 * energy);
}

TEST(UpdatedLagrangian, SaysWhichParticleWasThrownOutAndHowFar) {
  const Body body = fill(test::box_of(1.0, 0.4, 0.05), 1000, 1.2, false);
  UpdatedLagrangianSolver solver(body, elastic_plate());
  State state = at_rest(body);
  state.history = solver.history();
  state.velocity[2 * 7] = 1e12;
  try {
    solver.advance(state, {}, 1e-3, 10, 0, test::no_monitor);
    FAIL();
  } catch (const ThrownOut& out) {
    EXPECT_EQ(out.particle, 7u);
    EXPECT_EQ(out.step, 1u);
    EXPECT_NEAR(out.displacement, 1e8, 1);
  }
}

}  // namespace
}  // namespace estuary::solid
