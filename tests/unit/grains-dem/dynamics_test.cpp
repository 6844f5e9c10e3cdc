// Time integration: orders, exact motions, going back, and what stops a run.
#include <gtest/gtest.h>

#include "assemblies.hpp"

namespace estuary::grains {
namespace {

using test::add_grain;

// Overlap of two grains pressed into each other without damping: a cosine as long as they touch.
double oscillator_error(Integrator integrator, int terms, int corrections, std::uint64_t steps) {
  auto settings = test::free_space<2>(1e6, 1);
  settings.integrator = integrator;
  settings.gear_terms = terms;
  settings.gear_corrections = corrections;
  InitialGrains<2> grains;
  add_grain<2>(grains, {-0.009, 0}, {}, 0.01);
  add_grain<2>(grains, {0.009, 0}, {}, 0.01);
  const double omega = std::sqrt(1e6 / (0.5 * grains.mass[0]));
  Dynamics<2> dynamics(settings, grains, {});
  const double quarter = 0.25 * std::numbers::pi / omega;  // half the way out
  dynamics.advance(quarter, steps);
  const State<2>& s = dynamics.state();
  const double gap = std::abs(s.position[2] - s.position[0]);
  return std::abs(gap - (0.02 - 0.002 * std::cos(omega * quarter))) / 0.002;
}
TEST(Verlet, IsOfSecondOrder) {
  const double coarse = oscillator_error(Integrator::verlet, 5, 1, 10);
  const double fine = oscillator_error(Integrator::verlet, 5, 1, 20);
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.1);
}
TEST(Gear, ThreeTermsAreOfSecondOrderMoreTermsOfHigher) {
  const double order3 =
      std::log2(oscillator_error(Integrator::gear, 3, 2, 20) / oscillator_error(Integrator::gear, 3, 2, 40));
  EXPECT_GT(order3, 1.7);
  for (const int terms : {4, 5, 6}) {
    const double coarse = oscillator_error(Integrator::gear, terms, 3, 20);
    const double fine = oscillator_error(Integrator::gear, terms, 3, 40);
    EXPECT_GT(std::log2(coarse / fine), 1.9) << terms;
    EXPECT_LT(fine, oscillator_error(Integrator::verlet, 5, 1, 40)) << terms;
  }
}

TEST(FreeFall, IsExactForEveryIntegrator) {
  for (const auto integrator : {Integrator::verlet, Integrator::gear}) {
    auto settings = test::free_space<3>(1e4, 1);
    settings.integrator = integrator;
    settings.gravity = {0, 0, -9.81};
    InitialGrains<3> grains;
    add_grain<3>(grains, {0, 0, 0}, {1, 2, 3}, 0.01, 1000, {1, 2, 3});
    Dynamics<3> dynamics(settings, grains, {});
    dynamics.advance(0.5, 500);
    const Vector<3> x = dynamics.unwrapped(0);
    EXPECT_NEAR(x[0], 0.5, 1e-11);
    EXPECT_NEAR(x[2], 1.5 - 0.5 * 9.81 * 0.25, 1e-11);
    EXPECT_NEAR(dynamics.energy_error(), 0, 1e-12);
  }
}

TEST(External, ForceAndTorqueActAndAreBooked) {
  auto settings = test::free_space<2>(1e4, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {});
  dynamics.set_external(std::vector<double>{2, 0}, std::vector<double>{0.01});
  dynamics.advance(0.1, 50);
  EXPECT_NEAR(dynamics.state().velocity[0], 2 * 0.1 / grains.mass[0], 1e-12);
  EXPECT_NEAR(dynamics.state().spin[0], 0.01 * 0.1 / grains.inertia[0], 1e-9);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-12);
}

TEST(Window, CanBeRepeatedBitForBit) {
  auto settings = test::free_space<2>(1e6, 0.7, 0.3);
  InitialGrains<2> grains = test::gas<2>(12, 0.2, settings);
  Dynamics<2> dynamics(settings, grains, {});
  dynamics.advance(0.01, 300);
  const auto start = dynamics.snapshot();
  dynamics.advance(0.01, 300);
  const State<2> first = dynamics.state();
  dynamics.restore(start);
  dynamics.advance(0.01, 300);
  EXPECT_EQ(dynamics.state().position, first.position);
  EXPECT_EQ(dynamics.state().velocity, first.velocity);
  EXPECT_EQ(dynamics.state().history, first.history);
}

TEST(Held, GrainsDoNotFeelForcesAndTheirWorkIsBooked) {
  auto settings = test::free_space<2>(1e6, 0.8);
  settings.gravity = {0, -10};
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {0, 0.5}, 0.01, 1000, {}, true);
  add_grain<2>(grains, {0, 0.025}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {});
  dynamics.advance(0.1, 20000);
  const State<2>& s = dynamics.state();
  const std::size_t held = s.identity[0] == 0 ? 0 : 1;
  EXPECT_NEAR(s.position[2 * held + 1], 0.05, 1e-12);
  EXPECT_GT(s.position[2 * (1 - held) + 1], 0.06);
  EXPECT_GT(s.ledger.given, 0);
  EXPECT_NEAR(dynamics.energy_error(), 0, 0.003);
}

TEST(Breakdown, NamesTheGrainThatFlewOff) {
  auto settings = test::free_space<2>(1e9, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {}, 0.01);
  add_grain<2>(grains, {0.01, 0}, {}, 0.01);
  add_grain<2>(grains, {1, 0}, {}, 0.01);
  Dynamics<2> dynamics(settings, grains, {});
  try {
    dynamics.advance(1, 10);
    FAIL();
  } catch (const Breakdown& breakdown) {
    EXPECT_LT(breakdown.grain, 2u);
  }
}

TEST(HalfOverlap, FliesApartWithTheEnergyStored) {
  auto settings = test::free_space<2>(1e6, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0, 0}, {}, 0.01);
  add_grain<2>(grains, {0.01, 0}, {}, 0.01);  // half the diameter
  Dynamics<2> dynamics(settings, grains, {});
  const double stored = dynamics.energies().contacts;
  EXPECT_NEAR(stored, 0.5 * 1e6 * 1e-4, 1e-9);
  dynamics.advance(0.01, 2000);
  EXPECT_NEAR(dynamics.energies().translation, stored, 1e-3 * stored);
}

TEST(Lubrication, OfDiscsIsThatOfCylindersFromTheCutOffDownToTheRoughness) {
  const double viscosity = 0.1, cutoff = 1e-3, roughness = 1e-4, reduced = 0.01 * 0.02 / 0.03, approach = 0.3;
  const auto law = [&](double gap) {
    const auto part = [&](double h) { return std::pow(reduced / h, 1.5); };
    return 3 * std::numbers::sqrt2 * std::numbers::pi * viscosity * approach * (part(gap) - part(cutoff));
  };
  for (const auto& [gap, force] :
       {std::pair{5e-4, law(5e-4)}, {2e-4, law(2e-4)}, {1e-5, law(roughness)}, {1.1e-3, 0.0}}) {
    auto settings = test::free_space<2>(1e4, 1);
    settings.lubrication = {.viscosity = viscosity, .cutoff = cutoff, .minimum_gap = roughness, .margin = 0};
    InitialGrains<2> grains;
    add_grain<2>(grains, {0, 0}, {0.1, 0.5}, 0.01);  // what goes across does not count
    add_grain<2>(grains, {0.03 + gap, 0}, {-0.2, 0}, 0.02);
    Dynamics<2> dynamics(settings, grains, {});
    const std::size_t first = dynamics.state().identity[0] == 0 ? 0 : 1;
    EXPECT_NEAR(dynamics.state().force[2 * first], -force, 1e-9 * law(1e-4)) << gap;
    EXPECT_NEAR(dynamics.state().force[2 * (1 - first)], force, 1e-9 * law(1e-4)) << gap;
    EXPECT_NEAR(dynamics.state().force[2 * first + 1], 0, 1e-9 * law(1e-4)) << gap;
  }
}

TEST(Lubrication, SlowsAnApproachByReynoldsLaw) {
  // No inertia matters in the force itself: compare it with the formula at the first step.
  auto settings = test::free_space<3>(1e4, 1);
  settings.lubrication = {.viscosity = 0.1, .cutoff = 1e-3, .minimum_gap = 1e-5, .margin = 0};
  InitialGrains<3> grains;
  add_grain<3>(grains, {0, 0, 0}, {0.1, 0, 0}, 0.01);
  add_grain<3>(grains, {0.0202, 0, 0}, {-0.1, 0, 0}, 0.01);
  Dynamics<3> dynamics(settings, grains, {});
  const double force = 6 * std::numbers::pi * 0.1 * 0.2 * 0.005 * 0.005 * (1 / 2e-4 - 1 / 1e-3);
  const std::size_t first = dynamics.state().identity[0] == 0 ? 0 : 1;
  EXPECT_NEAR(dynamics.state().force[3 * first], -force, 1e-9);
  EXPECT_NEAR(dynamics.state().force[3 * (1 - first)], force, 1e-9);
  dynamics.advance(0.01, 20000);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-3);
}

}  // namespace
}  // namespace estuary::grains
