// Bodies of any outline: exact areas, the patch test with loads on the contour, wet contours.
#include "outline_filling.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "bodies.hpp"
#include "newton.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {
namespace {

struct Shaped {
  const char* name;
  std::vector<Polygon> loops;
  double spacing, area;
};

const Polygon kPanel{{0, 0}, {48, 44}, {48, 60}, {0, 44}};
const Polygon kAngle{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
const Polygon kPlate{{0, 0}, {2, 0}, {2, 1}, {0, 1}};

std::vector<Shaped> shapes() {
  const Polygon hole{{0.8, 0.3}, {1.2, 0.3}, {1.2, 0.7}, {0.8, 0.7}};
  return {{"disc", {circle({0.3, -0.2}, 1, 0.1)}, 0.1, std::numbers::pi},
          {"panel", {kPanel}, 2.0, 1440},
          {"angle", {kAngle}, 0.1, 3},
          {"hole", {kPlate, hole}, 0.1, 2 - 0.16}};
}

SolverOptions elastic() {
  return {.materials = {{.constants = ElasticConstants::from(1e6, 0.3, Plane::strain),
                         .plane = Plane::strain,
                         .viscosity = {},
                         .plasticity = {}}},
          .stabilisation = 0.02,
          .hourglass_time = {}};
}

class Outlines : public testing::TestWithParam<Shaped> {};
INSTANTIATE_TEST_SUITE_P(Shapes, Outlines, testing::ValuesIn(shapes()),
                         [](const auto& shaped) { return std::string(shaped.param.name); });

TEST_P(Outlines, VolumesAddUpToTheArea) {
  const Body body = fill_outline(GetParam().loops, {.spacing = GetParam().spacing, .density = 2});
  double area = 0, mass = 0;
  for (std::size_t i = 0; i < body.size(); ++i) {
    area += body.volume[i];
    mass += body.mass[i];
  }
  EXPECT_NEAR(area / GetParam().area, 1, 1e-12);
  EXPECT_NEAR(mass / GetParam().area, 2, 1e-12);
}

TEST_P(Outlines, ConstantStressIsInBalanceWithItsTractionOnTheContour) {
  for (const double ratio : {0.95, 1.3}) {
    const Body body = fill_outline(
        GetParam().loops, {.spacing = GetParam().spacing, .density = 1000, .smoothing_ratio = ratio});
    const auto solver = make_solver(LawName::saint_venant_kirchhoff, body, elastic());
    ASSERT_EQ(solver->evaluate(test::affine(body, {1.2, 0.1, -0.05, 0.9}, 0.3, 0)), 0);
    const Tensor<double> p = solver->first_piola_kirchhoff_at(0);
    std::vector<double> expected(2 * body.size(), 0.0);
    for (const Outline& outline : body.outlines)
      for (std::size_t k = 0; k < outline.particle.size(); ++k) {
        const std::size_t a = outline.particle[k], b = outline.particle[(k + 1) % outline.particle.size()];
        const double nx = -(body.position[2 * b + 1] - body.position[2 * a + 1]),
                     ny = body.position[2 * b] - body.position[2 * a];
        for (const std::size_t end : {a, b}) {
          expected[2 * end] -= 0.5 * (p.xx * nx + p.xy * ny);
          expected[2 * end + 1] -= 0.5 * (p.yx * nx + p.yy * ny);
        }
      }
    const double size = std::abs(p.xx) * GetParam().spacing;
    for (std::size_t c = 0; c < expected.size(); ++c)
      ASSERT_NEAR(solver->fields().force[c] / size, expected[c] / size, 1e-11) << "particle " << c / 2;
  }
}

TEST_P(Outlines, WetContourConservesForceMomentAndWork) {
  const Body body = fill_outline(GetParam().loops, {.spacing = GetParam().spacing, .density = 1});
  const auto lines = free_contours(body);
  ASSERT_EQ(lines.size(), GetParam().loops.size());
  const Transfer transfer = contour_transfer(body, lines);
  std::vector<double> position;
  for (const ContourLine& line : lines) {
    EXPECT_TRUE(line.closed);
    position.insert(position.end(), line.position.begin(), line.position.end());
  }
  const std::size_t nodes = position.size() / 2;
  ASSERT_EQ(transfer.points(), nodes);
  const auto u = test::random_field(2 * body.size(), 0.01 * GetParam().spacing, 3);
  const auto force = test::random_field(2 * nodes, 1.0, 4);
  std::vector<double> moved(2 * nodes), spread_forces;
  interpolate(transfer, u, moved);
  spread(transfer, force, spread_forces);
  std::array<double, 4> difference{};
  double size = 0;
  const auto add = [&](double sign, double x, double y, double ux, double uy, double fx, double fy) {
    difference[0] += sign * fx;
    difference[1] += sign * fy;
    difference[2] += sign * ((x + ux) * fy - (y + uy) * fx);
    difference[3] += sign * (ux * fx + uy * fy);
    size += std::abs(x * fy) + std::abs(y * fx);
  };
  for (std::size_t k = 0; k < nodes; ++k)
    add(1, position[2 * k], position[2 * k + 1], moved[2 * k], moved[2 * k + 1], force[2 * k],
        force[2 * k + 1]);
  for (std::size_t k = 0; k < transfer.touched.size(); ++k) {
    const std::size_t j = transfer.touched[k];
    add(-1, body.position[2 * j], body.position[2 * j + 1], u[2 * j], u[2 * j + 1], spread_forces[2 * k],
        spread_forces[2 * k + 1]);
  }
  for (const double d : difference) EXPECT_NEAR(d / size, 0, 1e-13);
}

TEST(Outlines, RefusesWhatCannotBeFilled) {
  EXPECT_THROW(fill_outline({{{0, 0}, {1, 0}}}, {.spacing = 0.1, .density = 1}), std::invalid_argument);
  EXPECT_THROW(fill_outline({{{0, 0}, {1, 0}, {2, 0}}}, {.spacing = 0.1, .density = 1}),
               std::invalid_argument);
}

TEST(FreeContours, LeaveOutWhatIsHeld) {
  Body body = fill_outline({kPlate}, {.spacing = 0.1, .density = 1});
  for (std::size_t i = 0; i < body.size(); ++i)
    if (body.position[2 * i] == 0) body.fixed[i] = 3;
  const auto lines = free_contours(body);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(lines[0].closed);
  EXPECT_EQ(lines[0].position[0], 0.0);
  EXPECT_EQ(lines[0].position[1], 1.0);  // clockwise: over the top first
  EXPECT_EQ(lines[0].position[lines[0].position.size() - 2], 0.0);
  EXPECT_EQ(lines[0].position.back(), 0.0);
}

TEST(Pressure, OnAClosedContourHasNoResultantHoweverTheBodyIsDeformed) {
  const Body body = fill_outline({circle({0, 0}, 1, 0.1)}, {.spacing = 0.1, .density = 1});
  Loading loading;
  PressureLoad load;
  const auto& particle = body.outlines[0].particle;
  for (std::size_t k = 0; k < particle.size(); ++k)
    load.segment.push_back({particle[k], particle[(k + 1) % particle.size()]});
  load.pressure = [](double, double, double) { return 3.0; };
  loading.pressures.push_back(load);
  ExternalForces external(body, loading);
  const auto u = test::random_field(2 * body.size(), 0.03, 5);
  external.set(1, 0, u);
  std::vector<double> force(2 * body.size(), 0.0);
  external.add_to(force);
  double fx = 0, fy = 0, inward = 0, moment = 0;
  for (std::size_t i = 0; i < body.size(); ++i) {
    fx += force[2 * i];
    fy += force[2 * i + 1];
    inward -= force[2 * i] * body.position[2 * i] + force[2 * i + 1] * body.position[2 * i + 1];
    moment += (body.position[2 * i] + u[2 * i]) * force[2 * i + 1] -
              (body.position[2 * i + 1] + u[2 * i + 1]) * force[2 * i];
  }
  EXPECT_NEAR(fx, 0, 1e-13);
  EXPECT_NEAR(fy, 0, 1e-13);
  EXPECT_NEAR(moment, 0, 1e-12);
  EXPECT_NEAR(inward, 3.0 * 2 * std::numbers::pi, 0.5);
}

TEST(Pressure, SqueezesADiscUniformly) {
  // Plane strain under all-round pressure, small strain: u_r = -p r (1 + nu) (1 - 2 nu) / E.
  Body body = fill_outline({circle({0, 0}, 1, 0.1)}, {.spacing = 0.1, .density = 1000});
  const auto solver = make_solver(LawName::saint_venant_kirchhoff, body, elastic());
  Loading loading;
  PressureLoad load;
  const auto& particle = body.outlines[0].particle;
  for (std::size_t k = 0; k < particle.size(); ++k)
    load.segment.push_back({particle[k], particle[(k + 1) % particle.size()]});
  load.pressure = [](double, double, double) { return 10.0; };
  loading.pressures.push_back(load);
  std::vector<double> u(2 * body.size(), 0.0);
  const auto report =
      solver->relax(u, loading, 0, {.tolerance = 1e-9, .maximum_steps = 100000}, test::no_monitor);
  ASSERT_TRUE(report.converged);
  const double strain = -10.0 * 1.3 * 0.4 / 1e6;
  for (std::size_t i = 0; i < body.size(); ++i) {
    // Up to a rigid motion, of which a free disc has three; none was excited.
    EXPECT_NEAR(u[2 * i] / strain, body.position[2 * i], 2e-4);
    EXPECT_NEAR(u[2 * i + 1] / strain, body.position[2 * i + 1], 2e-4);
  }
}

TEST(Newton, FollowsPrescribedMotionWithSingleComponentsHeld) {
  Body body = fill(test::box_of(1.0, 0.4, 0.1), 1000, 0.95, false);
  PrescribedMotion motion{
      .particle = {}, .component = 0, .displacement = [](double, double, double t) { return 0.3 * t; }};
  for (std::size_t i = 0; i < body.size(); ++i) {
    if (body.position[2 * i] == 0) body.fixed[i] |= 1;
    if (body.position[2 * i + 1] == 0) body.fixed[i] |= 2;
    if (body.position[2 * i] == 1.0) {
      body.fixed[i] |= 1;
      motion.particle.push_back(static_cast<std::uint32_t>(i));
    }
  }
  const auto solver = make_solver(LawName::saint_venant_kirchhoff, body, elastic());
  NewtonSolver newton(*solver);
  Loading loading;
  loading.prescribed.push_back(motion);
  std::vector<double> u(2 * body.size(), 0.0);
  const auto report =
      newton.solve(u, loading, 1.0, {.tolerance = 1e-11, .maximum_steps = 200}, test::no_monitor);
  ASSERT_TRUE(report.converged);
  // Uniaxial stress in plane strain: E_yy = -nu / (1 - nu) E_xx, exact for Saint-Venant-Kirchhoff.
  const double exx = 0.5 * (1.3 * 1.3 - 1), stretch = std::sqrt(1 - 2 * 0.3 / 0.7 * exx);
  for (std::size_t i = 0; i < body.size(); ++i) {
    EXPECT_NEAR(u[2 * i], 0.3 * body.position[2 * i], 1e-9);
    EXPECT_NEAR(u[2 * i + 1], (stretch - 1) * body.position[2 * i + 1], 1e-9);
  }
}

}  // namespace
}  // namespace estuary::solid
