// Resultant plasticity of a shell's section, its rupture, and exact answers of plastic beams.
#include <gtest/gtest.h>

#include <cmath>

#include "bodies.hpp"
#include "shell.hpp"

namespace estuary::solid {
namespace {

ShellSection plastic_section(Hinge hinge = Hinge::growing, double hardening = 0) {
  ShellSection section{.thickness = 0.05, .young_modulus = 2e5, .shear_modulus = 8e4, .density = 7.8};
  section.plasticity.strain = {0, 1};
  section.plasticity.yield = {200, 200 + hardening};
  section.plane_factor = 2 / std::sqrt(3.0);
  section.hinge = hinge;
  return section;
}

using Memory = std::array<double, kSectionHistory>;

// Strains from 0 to `strain` in equal increments.
SectionAnswer load(const ShellSection& section, const SectionVector& strain, int increments, Memory& memory) {
  SectionAnswer answer;
  for (int k = 1; k <= increments; ++k) {
    const double s = static_cast<double>(k) / increments;
    answer = flow(section, {s * strain.membrane, s * strain.shear, s * strain.bending}, memory.data(),
                  memory.data());
  }
  return answer;
}

TEST(ShellSection, InPureBendingFollowsTheExactMomentOfARectangularSection) {
  const ShellSection section = plastic_section();
  const double limit = section.plane_factor * 200 * 0.05 * 0.05 / 4, first = limit / 1.5 / section.bending();
  EXPECT_NEAR(limit_moment(section), limit, 1e-12 * limit);
  for (const double k : {0.5, 1.2, 3.0, 20.0})
    for (const int increments : {1, 50}) {
      Memory memory{};
      const SectionAnswer answer = load(section, {0, 0, k * first}, increments, memory);
      const double exact = k < 1 ? k / 1.5 : 1 - 1 / (3 * k * k);
      EXPECT_NEAR(answer.resultant.bending / limit, exact, 1e-9) << k << ", " << increments;
      EXPECT_EQ(memory[0], 0);
      // Work done is stored and dissipated: the area under the exact curve.
      const double area = k < 1 ? k * k / 3 : 1.0 / 3 + (k - 1) - (1 - 1 / k) / 3;
      if (increments > 1) {
        EXPECT_NEAR((answer.stored + memory[5]) / (limit * first) / area, 1, 2e-3) << k;
      }
    }
}

TEST(ShellSection, StretchesAtTheYieldForceWithItsHardening) {
  const ShellSection section = plastic_section(Hinge::growing, 5e3);
  Memory memory{};
  const double strain = 0.02;
  const SectionAnswer answer = load(section, {strain, 0, 0}, 1, memory);
  // N = c h (yield + H p), p = c (plastic strain).
  const double c = section.plane_factor, h = section.thickness;
  const double plastic = (strain - c * 200 / 2e5) / (1 + c * c * 5e3 / 2e5);
  EXPECT_NEAR(memory[0] / plastic, 1, 1e-10);
  EXPECT_NEAR(memory[3] / (c * plastic), 1, 1e-10);
  EXPECT_NEAR(answer.resultant.membrane / (c * h * (200 + 5e3 * c * plastic)), 1, 1e-10);
}

TEST(ShellSection, EndsOnItsYieldSurfaceAndReturnsToItsCorners) {
  for (const Hinge hinge : {Hinge::skin, Hinge::section}) {
    const ShellSection section = plastic_section(hinge);
    const double psi = hinge == Hinge::skin ? 1 : 1.5, c = section.plane_factor, h = section.thickness;
    for (const SectionVector& strain :
         {SectionVector{0.01, 0.002, 0.3}, SectionVector{-0.003, 0.01, 0.5}, SectionVector{1e-9, 0, 0.5},
          SectionVector{0.01, 0, -1e-9}, SectionVector{0, 0.01, 0}}) {
      Memory memory{};
      const SectionVector s = load(section, strain, 3, memory).resultant;
      const double n = s.membrane / (c * h * 200), m = 6 * s.bending / (c * psi * h * h * 200),
                   t = std::sqrt(3.0) * s.shear / (h * 200);
      EXPECT_NEAR(n * n + m * m + std::abs(n * m) / std::sqrt(3.0) + t * t, 1, 1e-9);
      EXPECT_NEAR(std::abs(strain.membrane) < 1e-8 ? n : 0, 0, 1e-12);
      EXPECT_NEAR(std::abs(strain.bending) < 1e-8 ? m : 0, 0, 1e-12);
    }
  }
}

TEST(ShellSection, StoresAndDissipatesTheWorkDone) {
  const ShellSection section = plastic_section(Hinge::growing, 2e3);
  Memory memory{};
  SectionVector before{};
  double work = 0, stored = 0;
  SectionVector force{};
  constexpr int kSteps = 400;
  for (int k = 1; k <= kSteps; ++k) {
    const double s = static_cast<double>(k) / kSteps;
    const SectionVector now{0.01 * s * s, 0.004 * std::sin(3 * s), 0.4 * std::sin(5 * s)};
    const SectionAnswer answer = flow(section, now, memory.data(), memory.data());
    const SectionVector& f = answer.resultant;
    work += 0.5 * ((force.membrane + f.membrane) * (now.membrane - before.membrane) +
                   (force.shear + f.shear) * (now.shear - before.shear) +
                   (force.bending + f.bending) * (now.bending - before.bending));
    force = f;
    before = now;
    stored = answer.stored;
  }
  EXPECT_GT(memory[5], 0.5 * work);
  EXPECT_NEAR((stored + memory[5]) / work, 1, 1e-3);
}

struct Beam {
  Body body;
  std::unique_ptr<ShellSolver> solver;
  Beam(int links, const ShellSection& section, double length = 1) {
    const std::vector<std::array<double, 2>> points{{0, 0}, {length, 0}};
    body = fill_row(points, false, length / links, section);
    body.fixed[0] = 3 | kRotationFixed;
    solver = std::make_unique<ShellSolver>(body, std::vector<ShellSection>{section});
  }
};

TEST(ShellSection, CantileverBeyondYieldBendsAsPragerAndHodgeSay) {
  ShellSection section = plastic_section();
  section.plasticity.yield = {50, 50};               // deflections of a hundredth of the length
  const double first = limit_moment(section) / 1.5;  // force at the tip of a cantilever of length 1
  double error[2];
  for (int k = 0; k < 2; ++k) {
    Beam beam(8 << k, section);
    const auto tip = static_cast<std::uint32_t>(beam.body.size() - 1);
    Loading loading;
    loading.loads.push_back({{tip}, {0, 1.4 * first}, {0, 1.4 * first}, {}, {}});
    std::vector<double> u(2 * beam.body.size(), 0.0);
    ASSERT_TRUE(
        beam.solver->relax(u, loading, 0, {.tolerance = 1e-6, .maximum_steps = 1'000'000}, test::no_monitor)
            .converged);
    const double at_yield = first / (3 * section.bending());
    const double exact = at_yield / 1.96 * (5 - 4.4 * std::sqrt(0.2)) + 1.4 * first / section.shear();
    error[k] = u[2 * tip + 1] / exact - 1;
  }
  EXPECT_NEAR(error[1], 0, 0.01);
  EXPECT_LT(std::abs(error[1]), 0.5 * std::abs(error[0]));
}

// Pulls a strip apart at its end and returns what its broken links have taken up.
double torn(int links, const RuptureLimits& rupture, double& broken, double& balance) {
  ShellSection section = plastic_section(Hinge::growing, 20);
  section.rupture = rupture;
  Beam beam(links, section);
  const auto tip = static_cast<std::uint32_t>(beam.body.size() - 1);
  beam.body.fixed[tip] = 1;
  const double speed = 2;
  Loading loading;
  loading.prescribed.push_back({{tip}, 0, [&](double, double, double t) { return speed * t; }});
  State state = at_rest(beam.body);
  state.history = beam.solver->history();
  const double step = 0.5 * beam.solver->reference_stable_step();
  const auto steps = static_cast<std::uint64_t>(0.2 / step);
  beam.solver->advance(state, loading, 0.2, steps, 0, test::no_monitor);
  beam.solver->evaluate(state.displacement);
  const NamedValues totals = beam.solver->totals(state);
  broken = totals[0].second;
  balance = (beam.solver->energy(state.displacement) + beam.solver->kinetic_energy(state) +
             beam.solver->plastic_work() + beam.solver->fracture_work()) /
                state.external_work -
            1;
  return totals[3].second;
}

TEST(ShellSection, TearsAtAnEnergyThatDoesNotDependOnTheGrid) {
  double broken = 0, balance = 0;
  for (const int links : {10, 20, 40}) {
    const double energy = torn(links, {.energy = 5}, broken, balance);
    EXPECT_EQ(broken, 1) << links;
    EXPECT_NEAR(energy / (5 * 0.05), 1, 0.03) << links;
    EXPECT_NEAR(balance, 0, 0.01) << links;
  }
  // A limit of stretch takes half the energy with links half as long.
  const double coarse = torn(10, {.stretch = 0.1}, broken, balance),
               fine = torn(20, {.stretch = 0.1}, broken, balance);
  EXPECT_NEAR(coarse / fine, 2, 0.1);
}

TEST(ShellSection, WhatFliesOffBehindATornLinkDoesNotShortenTheStep) {
  ShellSection section = plastic_section(Hinge::growing, 0);
  section.plasticity = {};
  section.thickness = 0.2;  // thick, so that stretch sets the step before shear does
  section.rupture = {.stretch = 0.1};
  Beam beam(10, section);
  State state = at_rest(beam.body);
  state.history = beam.solver->history();
  beam.solver->evaluate(state.displacement);
  const double rest = beam.solver->longest_step(state, 0.5);
  state.displacement[2 * 10] = 0.05;  // half a link
  beam.solver->evaluate(state.displacement);
  const double step = beam.solver->longest_step(state, 0.5);
  EXPECT_LT(step, rest / 1.2);
  beam.solver->advance(state, {}, 0.1 * step, 1, 0, test::no_monitor);
  ASSERT_EQ(beam.solver->totals(state)[0].second, 1);  // broken links
  state.displacement[2 * 10] = 5;
  beam.solver->evaluate(state.displacement);
  EXPECT_NEAR(beam.solver->longest_step(state, 0.5) / rest, 1, 0.01);
}

}  // namespace
}  // namespace estuary::solid
