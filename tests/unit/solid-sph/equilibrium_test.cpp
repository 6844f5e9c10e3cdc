// Equilibrium by Newton's method and by dynamic relaxation, against beam theory and against each other.
#include <gtest/gtest.h>

#include <map>

#include "bodies.hpp"
#include "newton.hpp"
#include "outline_filling.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {
namespace {

using test::Case;
using test::no_monitor;

struct Cantilever {
  static constexpr double kLength = 0.1, kHeight = 0.01, kYoung = 210e9, kPoisson = 0.3;
  std::unique_ptr<test::Assembled> made;
  Loading loading;
  Transfer tip;

  Cantilever(int across, const Case& options, double force, double density = 7800, double length = kLength,
             Placement placement = Placement::on_contour) {
    Box box = test::box_of(length, kHeight, kHeight / across);
    box.placement = placement;
    box.clamped[static_cast<std::size_t>(Side::left)] = true;
    made = test::assemble(
        box, {.density = density, .young = kYoung, .poisson = kPoisson, .plane = Plane::stress}, options);
    const Side right = Side::right;
    const ContourLine line = contour_line(made->body, {&right, 1});
    const Transfer transfer = contour_transfer(made->body, line);
    ParticleLoad load;
    load.particle = transfer.touched;
    spread(transfer, uniform_traction(line, 0, force), load.end);
    load.start = load.end;
    loading.loads.push_back(load);
    const std::array<double, 2> point{length, 0.5 * kHeight};
    tip = point_transfer(made->body, point);
  }
  [[nodiscard]] std::array<double, 2> tip_displacement(const std::vector<double>& u) const {
    std::array<double, 2> value{};
    interpolate(tip, u, value);
    return value;
  }
  EquilibriumReport newton(std::vector<double>& u, double tolerance = 1e-8) const {
    NewtonSolver solver(*made->solver);
    return solver.solve(u, loading, 0, {.tolerance = tolerance, .maximum_steps = 500}, no_monitor);
  }
  EquilibriumReport relax(std::vector<double>& u, double tolerance = 1e-6) const {
    return made->solver->relax(u, loading, 0, {.tolerance = tolerance, .maximum_steps = 400000}, no_monitor);
  }
  [[nodiscard]] std::vector<double> rest() const { return std::vector<double>(2 * made->body.size(), 0.0); }

  static double inertia() { return std::pow(kHeight, 3) / 12; }
  /// Tip deflection of Timoshenko's beam with shear factor 5/6.
  static double timoshenko(double force) {
    const double shear = kYoung / (2 * (1 + kPoisson));
    return force * std::pow(kLength, 3) / (3 * kYoung * inertia()) +
           6 * force * kLength / (5 * shear * kHeight);
  }
};

const Case kQuadratic{.order = Order::quadratic, .stabilisation = 0.05};

const Case kOnContour{.stabilisation = 0.02};

double bending_ratio(int across, const Case& options, Placement placement) {
  const double force = 1000;  // small displacement: 2e-4 of the length
  const Cantilever beam(across, options, force, 7800, Cantilever::kLength, placement);
  auto u = beam.rest();
  EXPECT_TRUE(beam.newton(u).converged);
  return beam.tip_displacement(u)[1] / Cantilever::timoshenko(force);
}

// The clamp, too, holds the section from contracting, which a beam does not know: 0.2 % here.
TEST(Timoshenko, ParticlesOnTheContourAreWithinOnePercentFromFourCellsOnAndConvergeAtSecondOrder) {
  std::map<int, double> error;
  for (const int across : {4, 5, 10, 20})
    error[across] = bending_ratio(across, kOnContour, Placement::on_contour) - 0.998;
  EXPECT_NEAR(error[4], 0, 0.010);
  EXPECT_NEAR(error[5], 0, 0.007);
  EXPECT_NEAR(error[10], 0, 0.0015);
  EXPECT_NEAR(error[20], 0, 0.0005);
}

TEST(Timoshenko, QuadraticCorrectionAtCellCentresIsWithinHalfAPercentFromFiveParticlesOn) {
  for (const int across : {5, 10, 20})
    EXPECT_NEAR(bending_ratio(across, kQuadratic, Placement::cell_centres), 1, 0.005) << across;
}

TEST(Timoshenko, LinearCorrectionAtCellCentresIsSoftAndConvergesAtSecondOrder) {
  const auto error = [](int across) { return bending_ratio(across, {}, Placement::cell_centres) - 1; };
  const double five = error(5), ten = error(10), twenty = error(20);
  EXPECT_GT(five, 0.1);
  EXPECT_LT(ten, five / 3.2);
  EXPECT_LT(twenty, ten / 3.2);
}

TEST(Relaxation, AgreesWithNewtonAtLargeDisplacement) {
  const double force = 5 * Cantilever::kYoung * Cantilever::inertia() / std::pow(Cantilever::kLength, 2);
  const Cantilever beam(5, kQuadratic, force);
  auto by_newton = beam.rest(), by_relaxation = beam.rest();
  ASSERT_TRUE(beam.newton(by_newton).converged);
  const auto report = beam.relax(by_relaxation);
  ASSERT_TRUE(report.converged) << report.residual << " " << report.remaining_change << " " << report.steps;
  const auto a = beam.tip_displacement(by_newton), b = beam.tip_displacement(by_relaxation);
  EXPECT_GT(a[1], 0.06);  // of a length of 0.1
  EXPECT_NEAR(a[0], b[0], 3e-6 * 0.1);
  EXPECT_NEAR(a[1], b[1], 3e-6 * 0.1);
}

TEST(Relaxation, DoesNotDependOnDensity) {
  const Cantilever light(4, kQuadratic, 1000, 1.0, 0.04), heavy(4, kQuadratic, 1000, 7800, 0.04);
  auto u = light.rest(), v = heavy.rest();
  const auto first = light.relax(u), second = heavy.relax(v);
  EXPECT_TRUE(first.converged && second.converged);
  EXPECT_NEAR(static_cast<double>(first.steps), static_cast<double>(second.steps), 60);
  EXPECT_NEAR(light.tip_displacement(u)[1] / heavy.tip_displacement(v)[1], 1, 1e-5);
}

TEST(Relaxation, StopsUnconvergedAtTheLimitAndSaysSo) {
  const Cantilever beam(5, kQuadratic, 1000);
  auto u = beam.rest();
  const auto report =
      beam.made->solver->relax(u, beam.loading, 0, {.tolerance = 1e-6, .maximum_steps = 200}, no_monitor);
  EXPECT_FALSE(report.converged);
  EXPECT_EQ(report.steps, 200u);
  EXPECT_GT(report.residual, 1e-6);
}

TEST(Relaxation, NoLoadLeavesTheBodyAtRest) {
  Cantilever beam(4, kQuadratic, 0, 7800, 0.04);
  auto u = beam.rest();
  EXPECT_TRUE(beam.relax(u).converged);
  for (const double x : u) ASSERT_EQ(x, 0);
}

class LargeDisplacement : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Loads, LargeDisplacement, testing::Values(1.0, 2.0, 5.0, 10.0));

// The body is a tenth as thick as long, so it differs from the inextensible elastica by its shear and its
// stretch.
TEST_P(LargeDisplacement, NewtonConvergesFromRestInFewLinearSolves) {
  const double alpha = GetParam();
  const double force = alpha * Cantilever::kYoung * Cantilever::inertia() / std::pow(Cantilever::kLength, 2);
  const Cantilever beam(10, kQuadratic, force);
  auto u = beam.rest();
  const auto report = beam.newton(u);
  ASSERT_TRUE(report.converged);
  EXPECT_TRUE(report.stable);
  EXPECT_LT(report.residual, 1e-8);
  EXPECT_LT(report.steps, 60u);
  const std::map<double, double> elastica{{1.0, 0.30172}, {2.0, 0.49346}, {5.0, 0.71379}, {10.0, 0.81061}};
  EXPECT_NEAR(beam.tip_displacement(u)[1] / Cantilever::kLength / elastica.at(alpha), 1, 0.025);
}

// A beam five times as slender has no more than a fifth of that difference.
TEST(LargeDisplacement, SlenderBeamFollowsTheElastica) {
  const double length = 0.5;
  const double force = 10 * Cantilever::kYoung * Cantilever::inertia() / (length * length);
  const Cantilever beam(4, kQuadratic, force, 7800, length);
  auto u = beam.rest();
  ASSERT_TRUE(beam.newton(u).converged);
  const auto tip = beam.tip_displacement(u);
  EXPECT_NEAR(tip[1] / length, 0.81061, 0.002);
  EXPECT_NEAR(-tip[0] / length, 0.55500, 0.003);
}

TEST(Newton, WorksForTheLawWithoutAnEnergy) {
  const double force = 2 * Cantilever::kYoung * Cantilever::inertia() / std::pow(Cantilever::kLength, 2);
  Case options = kQuadratic;
  options.law = LawName::hooke_almansi;
  const Cantilever almansi(5, options, force), other(5, kQuadratic, force);
  auto u = almansi.rest(), v = other.rest();
  ASSERT_TRUE(almansi.newton(u).converged);
  ASSERT_TRUE(other.newton(v).converged);
  EXPECT_NEAR(almansi.tip_displacement(u)[1] / other.tip_displacement(v)[1], 1, 0.01);
}

TEST(Newton, WarmStartNeedsFewSolves) {
  const double force = 8 * Cantilever::kYoung * Cantilever::inertia() / std::pow(Cantilever::kLength, 2);
  Cantilever beam(10, kQuadratic, force);
  auto u = beam.rest();
  ASSERT_TRUE(beam.newton(u, 1e-6).converged);
  for (double& f : beam.loading.loads[0].end) f *= 1.05;
  const auto report = beam.newton(u, 1e-6);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.steps, 8u);
}

// Cook's panel at finite strain and Poisson's ratio 0.4999: with pressures of their own Newton's method needs
// few solves.
TEST(NewtonSolver, FindsNearlyIncompressibleEquilibriaInFewSolves) {
  Body body = fill_outline({{{0, 0}, {48, 44}, {48, 60}, {0, 44}}}, {.spacing = 4, .density = 1});
  ParticleLoad load;
  for (std::size_t i = 0; i < body.size(); ++i) {
    if (body.position[2 * i] < 1e-9) body.fixed[i] = 3;
    if (body.position[2 * i] > 48 - 1e-9) {
      load.particle.push_back(static_cast<std::uint32_t>(i));
      const double y = body.position[2 * i + 1];
      load.end.insert(load.end.end(), {0, y < 44 + 1e-9 || y > 60 - 1e-9 ? 12.5 : 25.0});
    }
  }
  load.start = load.end;
  Loading loading;
  loading.loads.push_back(load);
  SolverOptions options;
  options.materials.push_back({.constants = ElasticConstants::from(240.5653, 0.4999, Plane::strain),
                               .viscosity = {},
                               .plasticity = {}});
  options.stabilisation = 0.02;
  const auto solver = make_solver(LawName::neo_hooke_isochoric, body, options);
  const EquilibriumSettings settings{.tolerance = 1e-8, .maximum_steps = 300};
  std::vector<double> split(2 * body.size(), 0.0), plain = split;
  NewtonSolver newton(*solver, true), without(*solver);
  const EquilibriumReport report = newton.solve(split, loading, 0, settings, no_monitor);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.steps, 8U);
  const EquilibriumReport slow = without.solve(plain, loading, 0, settings, no_monitor);
  EXPECT_TRUE(slow.converged);
  EXPECT_GT(slow.steps, 2 * report.steps);
  for (std::size_t c = 0; c < split.size(); ++c) EXPECT_NEAR(split[c], plain[c], 1e-6) << c;
}

// A block pressed between held ends far beyond where it buckles: the way there, whose matrices are shifted to
// be positive definite, may end on the symmetric saddle. Asked again from there, the method sees the tangent
// itself.
TEST(NewtonSolver, CallsNoSaddleStableThatShiftedStepsEndOn) {
  const double stretch = 0.36375;
  Box box = test::box_of(1, 1, 0.1);
  box.clamped = {true, false, true, false};
  const Body body = fill(box, 1000, 0.95, false);
  PrescribedMotion end{
      .particle = {}, .component = 0, .displacement = [=](double, double, double) { return stretch - 1; }};
  for (std::size_t i = 0; i < body.size(); ++i)
    if (body.position[2 * i] > 1 - 1e-9) end.particle.push_back(static_cast<std::uint32_t>(i));
  Loading loading;
  loading.prescribed.push_back(end);
  SolverOptions options;
  options.materials.push_back(
      {.constants = ElasticConstants::from(1e6, 0.3, Plane::strain), .viscosity = {}, .plasticity = {}});
  options.stabilisation = 0.02;
  const auto solver = make_solver(LawName::neo_hooke, body, options);
  NewtonSolver newton(*solver, true);
  const EquilibriumSettings settings{.tolerance = 1e-6, .maximum_steps = 300};
  std::vector<double> u(2 * body.size(), 0.0);
  const EquilibriumReport found = newton.solve(u, loading, 0, settings, no_monitor);
  ASSERT_TRUE(found.converged);
  const EquilibriumReport again = newton.solve(u, loading, 0, settings, no_monitor);
  EXPECT_EQ(found.stable, again.stable);
  EXPECT_FALSE(found.stable);
}

}  // namespace
}  // namespace estuary::solid
