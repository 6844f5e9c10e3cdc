// Motion in time: conservation, energy balance, order of accuracy, an exact wave.
#include <gtest/gtest.h>
#include <omp.h>

#include <numbers>

#include "bodies.hpp"

namespace estuary::solid {
namespace {

using test::Case;
using test::no_monitor;

Box clamped_beam(double length, double height, double spacing) {
  Box box = test::box_of(length, height, spacing);
  box.clamped[static_cast<std::size_t>(Side::left)] = true;
  return box;
}

// A downward load on the particles of the last column, growing from 0 over the window.
Loading end_load(const Body& body, double total) {
  ParticleLoad load;
  for (std::size_t i = 0; i < body.size(); ++i)
    if (body.position[2 * i] > body.box.to[0] - 0.6 * body.spacing[0])
      load.particle.push_back(static_cast<std::uint32_t>(i));
  load.start.assign(2 * load.particle.size(), 0.0);
  load.end = load.start;
  for (std::size_t k = 0; k < load.particle.size(); ++k)
    load.end[2 * k + 1] = -total / static_cast<double>(load.particle.size());
  Loading loading;
  loading.loads.push_back(std::move(load));
  return loading;
}

class Dynamics : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Variants, Dynamics,
                         testing::Values(Case{}, Case{.order = Order::quadratic, .stabilisation = 0.05},
                                         Case{.viscosity_linear = 0.2, .viscosity_quadratic = 0.4},
                                         Case{.order = Order::quadratic,
                                              .stabilisation = 0.05,
                                              .viscosity_linear = 0.2,
                                              .viscosity_quadratic = 0.4},
                                         Case{.law = LawName::neo_hooke}));

TEST_P(Dynamics, FreeBodyKeepsItsMomenta) {
  const auto made = test::assemble(test::box_of(1.0, 0.3, 0.05), {}, GetParam());
  State state = at_rest(made->body);
  state.velocity = test::random_field(2 * made->body.size(), 0.5, 5);
  for (std::size_t i = 0; i < made->body.size(); ++i) {  // and a spin, so that it turns over
    state.velocity[2 * i] -= 3 * made->body.position[2 * i + 1];
    state.velocity[2 * i + 1] += 3 * made->body.position[2 * i];
  }
  const auto momenta = [&] {
    std::array<double, 3> sum{};
    for (std::size_t i = 0; i < made->body.size(); ++i) {
      const double m = made->body.mass[i], vx = state.velocity[2 * i], vy = state.velocity[2 * i + 1];
      const double x = made->body.position[2 * i] + state.displacement[2 * i];
      const double y = made->body.position[2 * i + 1] + state.displacement[2 * i + 1];
      sum[0] += m * vx;
      sum[1] += m * vy;
      sum[2] += m * (x * vy - y * vx);
    }
    return sum;
  };
  const auto before = momenta();
  made->solver->advance(state, {}, 0.25, 1000, 0.0, no_monitor);
  const auto after = momenta();
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(after[c], before[c], 1e-11 * 1000) << c;
}

double energy_error(std::uint64_t steps, double viscosity) {
  const auto made =
      test::assemble(clamped_beam(1.0, 0.2, 0.04), {},
                     {.order = Order::quadratic, .stabilisation = 0.05, .viscosity_linear = viscosity});
  State state = at_rest(made->body);
  const Loading loading = end_load(made->body, 400);
  made->solver->advance(state, loading, 0.05, steps, 0.0, no_monitor);
  made->solver->evaluate(state.displacement);
  const double stored = made->solver->energy(state.displacement) + made->solver->kinetic_energy(state);
  EXPECT_GT(state.external_work, 0.1);
  return (stored - state.external_work) / state.external_work;
}

TEST(Energy, IsBalancedToSecondOrderInTheStep) {
  const double coarse = std::abs(energy_error(400, 0)), fine = std::abs(energy_error(800, 0));
  EXPECT_LT(coarse, 1e-4);
  EXPECT_NEAR(coarse / fine, 4, 1.0);
}

TEST(Energy, ArtificialViscosityOnlyTakes) {
  EXPECT_LT(energy_error(800, 1.0), -1e-6);
}

TEST(Trajectory, IsSecondOrderInTime) {
  for (const double damping : {0.0, 20.0}) {
    std::vector<std::vector<double>> end;
    const auto made =
        test::assemble(clamped_beam(1.0, 0.2, 0.05), {}, {.order = Order::quadratic, .stabilisation = 0.05});
    for (const std::uint64_t steps : {400u, 800u, 1600u}) {
      State state = at_rest(made->body);
      made->solver->advance(state, end_load(made->body, 300), 0.06, steps, damping, no_monitor);
      end.push_back(state.displacement);
    }
    double coarse = 0, fine = 0;
    for (std::size_t c = 0; c < end[0].size(); ++c) {
      coarse += std::pow(end[0][c] - end[1][c], 2);
      fine += std::pow(end[1][c] - end[2][c], 2);
    }
    EXPECT_NEAR(std::sqrt(coarse / fine), 4, 0.4) << "damping " << damping;
  }
}

// A standing shear wave of a layer clamped below and free above: u = sin(pi y / 2H) cos(w t), w = pi / (2H)
// sqrt(G / rho), exact at any amplitude for the neo-Hookean law.
double shear_wave_error(std::size_t rows, std::uint64_t steps) {
  Box box = test::box_of(1.0, 1.0, 1.0 / static_cast<double>(rows));
  box.periodic = true;
  box.clamped[static_cast<std::size_t>(Side::bottom)] = true;
  const test::Material material{.density = 1.0, .young = 5.2, .poisson = 0.3};
  const auto made = test::assemble(box, material, {.stabilisation = 0.02, .law = LawName::neo_hooke});
  State state = at_rest(made->body);
  const double amplitude = 0.3, wave_number = 0.5 * std::numbers::pi,
               frequency = wave_number * std::sqrt(2.0);
  for (std::size_t i = 0; i < made->body.size(); ++i)
    state.displacement[2 * i] = amplitude * std::sin(wave_number * made->body.position[2 * i + 1]);
  const double duration = 0.7 * 2 * std::numbers::pi / frequency;
  made->solver->advance(state, {}, duration, steps, 0.0, no_monitor);
  double error = 0;
  for (std::size_t i = 0; i < made->body.size(); ++i)
    error = std::max(error, std::abs(state.displacement[2 * i] -
                                     amplitude * std::sin(wave_number * made->body.position[2 * i + 1]) *
                                         std::cos(frequency * duration)));
  return error / amplitude;
}

TEST(ShearWave, ConvergesToTheExactOneAtSecondOrder) {
  const double coarse = shear_wave_error(10, 200), fine = shear_wave_error(20, 400);
  EXPECT_LT(coarse, 0.03);
  EXPECT_LT(fine, coarse / 3.2);
}

TEST(Solver, ReferenceStableStepIsTheStabilityLimit) {
  const auto made =
      test::assemble(clamped_beam(0.6, 0.3, 0.05), {}, {.order = Order::quadratic, .stabilisation = 0.05});
  const double stable = made->solver->reference_stable_step();
  const auto growth = [&](double factor) {
    State state = at_rest(made->body);
    state.velocity = test::random_field(2 * made->body.size(), 1e-6, 9);
    for (std::size_t c = 0; c < state.velocity.size(); ++c)
      if (made->body.fixed[c / 2]) state.velocity[c] = 0;
    const double before = made->solver->kinetic_energy(state);
    try {
      made->solver->advance(state, {}, 300 * factor * stable, 300, 0.0, no_monitor);
    } catch (const Breakdown&) {
      return 1e30;
    }
    return made->solver->kinetic_energy(state) / before;
  };
  EXPECT_LT(growth(0.98), 10);
  EXPECT_GT(growth(1.08), 1e3);
}

TEST(Solver, NamesTheParticleThatBreaks) {
  const auto made = test::assemble(test::box_of(1.0, 0.3, 0.05), {}, {});
  State state = at_rest(made->body);
  state.velocity[2 * 40] = -1e6;
  try {
    made->solver->advance(state, {}, 0.01, 50, 0.0, no_monitor);
    FAIL() << "nothing was reported";
  } catch (const Breakdown& breakdown) {
    EXPECT_LE(breakdown.step, 50u);
    EXPECT_FALSE(breakdown.j > 0);
  }
  State bad = at_rest(made->body);
  bad.displacement[3] = std::nan("");
  EXPECT_THROW(made->solver->advance(bad, {}, 0.01, 50, 0.0, no_monitor), Breakdown);
}

TEST(Solver, NumberOfThreadsDoesNotChangeABitOfTheMotion) {
  const auto made =
      test::assemble(clamped_beam(1.0, 0.2, 0.2 / 29), {},
                     {.order = Order::quadratic, .stabilisation = 0.05, .viscosity_linear = 0.2});
  ASSERT_GT(made->body.size(), 4096u);  // sums are shared by threads only above this, sweeps above less
  std::vector<State> ends;
  for (const int threads : {1, 2, 3}) {
    omp_set_num_threads(threads);
    State state = at_rest(made->body);
    made->solver->advance(state, end_load(made->body, 400), 6e-4, 20, 1.0, no_monitor);
    ends.push_back(state);
  }
  omp_set_num_threads(1);
  EXPECT_GT(ends[0].external_work, 0);
  for (std::size_t k : {1u, 2u}) {
    EXPECT_EQ(ends[k].displacement, ends[0].displacement);
    EXPECT_EQ(ends[k].velocity, ends[0].velocity);
    EXPECT_EQ(ends[k].external_work, ends[0].external_work);
  }
}

}  // namespace
}  // namespace estuary::solid
