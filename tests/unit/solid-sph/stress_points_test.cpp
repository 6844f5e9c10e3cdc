// Stress between the particles: consistency, conservation, the alternating mode, and bending.
#include <gtest/gtest.h>

#include <tuple>

#include "bodies.hpp"
#include "newton.hpp"
#include "outline_filling.hpp"
#include "stress_points.hpp"

namespace estuary::solid {
namespace {

struct Made {
  Body body;
  std::unique_ptr<Solver> solver;
};

std::unique_ptr<Made> made_of(Body body, const Box* box, int per_cell, Order order, LawName law) {
  auto made = std::make_unique<Made>();
  made->body = std::move(body);
  add_stress_points(made->body, {&box, 1}, per_cell);
  SolverOptions options;
  options.order = order;
  options.materials.push_back({.constants = ElasticConstants::from(1e6, 0.3, Plane::strain),
                               .plane = Plane::strain,
                               .viscosity = {},
                               .plasticity = {}});
  made->solver = make_solver(law, made->body, options);
  return made;
}

std::unique_ptr<Made> make(const Box& box, int per_cell, Order order, LawName law, double ratio = 0.95) {
  return made_of(fill(box, 1000, ratio, false), &box, per_cell, order, law);
}

// An affine motion: one deformation gradient at every stress point, `area` carried by them, and forces on the
// contour only, those of its tractions.
void expect_patch(const Made& m, double area) {
  const Tensor<double> a{1.15, 0.2, -0.1, 0.93};
  std::vector<double> u = test::affine(m.body, a, 3, -2);
  for (std::size_t c = 2 * m.body.particles(); c < u.size(); ++c) u[c] = 0;  // theirs does not count
  ASSERT_EQ(m.solver->evaluate(u), 0);
  double volume = 0;
  for (std::size_t i = 0; i < m.body.size(); ++i) {
    const Tensor<double> f = tensor_at(m.solver->fields().deformation_gradient, i);
    ASSERT_NEAR(f.xx, a.xx, 1e-11);
    ASSERT_NEAR(f.xy, a.xy, 1e-11);
    ASSERT_NEAR(f.yx, a.yx, 1e-11);
    ASSERT_NEAR(f.yy, a.yy, 1e-11);
    volume += m.body.energy_volume[i];
  }
  EXPECT_NEAR(volume / area, 1, 1e-12);
  const Tensor<double> p = m.solver->first_piola_kirchhoff_at(m.body.size() - 1);
  // Half the outward normals of both segments at a contour particle; nothing elsewhere.
  std::vector<double> wanted(2 * m.body.size(), 0.0);
  for (const Outline& outline : m.body.outlines)
    for (std::size_t k = 0; k < outline.particle.size(); ++k) {
      const std::size_t i = outline.particle[k], j = outline.particle[(k + 1) % outline.particle.size()];
      const double nx = -0.5 * (m.body.position[2 * j + 1] - m.body.position[2 * i + 1]),
                   ny = 0.5 * (m.body.position[2 * j] - m.body.position[2 * i]);
      for (const std::size_t end : {i, j}) {
        wanted[2 * end] -= p.xx * nx + p.xy * ny;
        wanted[2 * end + 1] -= p.yx * nx + p.yy * ny;
      }
    }
  double size = 0;
  for (const double w : wanted) size = std::max(size, std::abs(w));
  for (std::size_t c = 0; c < wanted.size(); ++c)
    ASSERT_NEAR(m.solver->fields().force[c] / size, wanted[c] / size, 1e-10) << "component " << c;
}

// Points per cell, exactness of the weights, support.
using Choice = std::tuple<int, Order, double>;

class StressPoints : public testing::TestWithParam<Choice> {
protected:
  static std::unique_ptr<Made> made(const Box& box, LawName law) {
    const auto [per_cell, order, ratio] = GetParam();
    return make(box, per_cell, order, law, ratio);
  }
};

INSTANTIATE_TEST_SUITE_P(Variants, StressPoints,
                         testing::Values(Choice{1, Order::linear, 0.95}, Choice{2, Order::linear, 0.95},
                                         Choice{2, Order::linear, 0.75}, Choice{1, Order::linear, 0.75},
                                         Choice{2, Order::quadratic, 0.95}));

TEST_P(StressPoints, OneStressIsInEquilibriumWithItsTractions) {
  expect_patch(*made(test::box_of(1.0, 0.43, 0.05), LawName::neo_hooke), 0.43);
}

TEST(StressPoints, TrianglesFillAnyOutlineAndHoldThePatchTest) {
  const Polygon angle{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  const Polygon plate{{0, 0}, {2, 0}, {2, 1}, {0, 1}}, hole{{0.8, 0.3}, {1.2, 0.3}, {1.2, 0.7}, {0.8, 0.7}};
  const Polygon disc = circle({0.3, -0.2}, 1, 0.2);
  struct NamedOutline {
    std::vector<Polygon> loops;
    double area, spacing;
  };
  const std::vector<NamedOutline> shapes{
      {{angle}, 3, 0.2}, {{plate, hole}, 2 - 0.16, 0.13}, {{disc}, std::abs(signed_area(disc)), 0.2}};
  for (const auto& [loops, area, spacing] : shapes) {
    SCOPED_TRACE(area);
    expect_patch(*made_of(fill_outline(loops, {.spacing = spacing, .density = 1000}), nullptr, 1,
                          Order::linear, LawName::neo_hooke),
                 area);
  }
}

TEST_P(StressPoints, QuarterTurnGivesNoForce) {
  const auto m = made(test::box_of(1.0, 0.4, 0.05), LawName::saint_venant_kirchhoff);
  ASSERT_EQ(m->solver->evaluate(test::affine(m->body, {0, -1, 1, 0}, 0.3, 0.2)), 0);
  for (const double f : m->solver->fields().force) ASSERT_NEAR(f / 1e6, 0, 1e-11);
}

TEST_P(StressPoints, ForceIsMinusTheEnergysDerivativeAndConservesMomenta) {
  const auto m = made(test::box_of(0.5, 0.3, 0.05), LawName::neo_hooke);
  auto u = test::affine(m->body, {1.1, 0.1, -0.3, 0.95}, 0, 0);
  const auto noise = test::random_field(u.size(), 0.004, 7);
  for (std::size_t c = 0; c < u.size(); ++c) u[c] += noise[c];
  ASSERT_EQ(m->solver->evaluate(u), 0);
  const std::vector<double> force = m->solver->fields().force;
  double scale = 0, fx = 0, fy = 0, moment = 0;
  for (std::size_t i = 0; i < m->body.particles(); ++i) {
    scale = std::max({scale, std::abs(force[2 * i]), std::abs(force[2 * i + 1])});
    fx += force[2 * i];
    fy += force[2 * i + 1];
    moment += (m->body.position[2 * i] + u[2 * i]) * force[2 * i + 1] -
              (m->body.position[2 * i + 1] + u[2 * i + 1]) * force[2 * i];
  }
  EXPECT_NEAR(fx / scale, 0, 1e-11);
  EXPECT_NEAR(fy / scale, 0, 1e-11);
  EXPECT_NEAR(moment / scale, 0, 1e-11);
  for (std::size_t c = 0; c < 2 * m->body.particles(); c += 7) {
    auto shifted = u;
    shifted[c] += 1e-6;
    m->solver->evaluate(shifted);
    const double above = m->solver->energy(shifted);
    shifted[c] -= 2e-6;
    m->solver->evaluate(shifted);
    ASSERT_NEAR(force[c], -(above - m->solver->energy(shifted)) / 2e-6, 1e-6 * scale) << "component " << c;
  }
}

double energy_of_alternation(Made& m) {
  std::vector<double> u(2 * m.body.size(), 0.0);
  const double d = m.body.spacing[0];
  for (std::size_t i = 0; i < m.body.particles(); ++i)
    u[2 * i] = std::lround((m.body.position[2 * i] + m.body.position[2 * i + 1]) / d) % 2 == 0 ? 1e-6 : -1e-6;
  m.solver->evaluate(u);
  return m.solver->energy(u);
}

TEST(StressPoints, TwoPerCellSeeTheAlternatingModeThatOneDoesNot) {
  const Box box = test::box_of(0.5, 0.5, 0.05);
  // A strain of the mode's size over the whole body.
  const double scale = 0.5 * 1e6 * 0.25 * 4e-4 * 4e-6;
  const auto one = make(box, 1, Order::linear, LawName::saint_venant_kirchhoff, 0.75);
  EXPECT_LT(energy_of_alternation(*one), 1e-12 * scale);
  const auto two = make(box, 2, Order::linear, LawName::saint_venant_kirchhoff);
  EXPECT_GT(energy_of_alternation(*two), 0.02 * scale);
}

// The tip of a 10:1 cantilever under a small load, over Timoshenko's.
double tip_ratio(int across, int per_cell) {
  Box box = test::box_of(1, 0.1, 0.1 / across);
  box.clamped[static_cast<std::size_t>(Side::left)] = true;
  const auto m = make(box, per_cell, Order::linear, LawName::saint_venant_kirchhoff);
  const double modulus = 1e6 / 0.91, shear = 1e6 / 2.6, force = 1e-6 * modulus;
  ParticleLoad load;
  for (std::uint32_t i = 0; i < m->body.particles(); ++i)
    if (m->body.position[2 * i] > 1 - 1e-9) {
      const double y = m->body.position[2 * i + 1];
      load.particle.push_back(i);
      load.end.insert(load.end.end(), {0, force * (y < 1e-9 || y > 0.1 - 1e-9 ? 0.5 : 1.0) / across});
    }
  load.start = load.end;
  Loading loading;
  loading.loads.push_back(load);
  NewtonSolver newton(*m->solver);
  std::vector<double> u(2 * m->body.size(), 0.0);
  EXPECT_TRUE(
      newton.solve(u, loading, 0, {.tolerance = 1e-8, .maximum_steps = 50}, test::no_monitor).converged);
  for (std::size_t c = 2 * m->body.particles(); c < u.size(); ++c) EXPECT_EQ(u[c], 0);
  return u[2 * load.particle.back() + 1] / (4 * force / (modulus * 1e-3) + 1.2 * force / (shear * 0.1));
}

TEST(StressPoints, BendingIsOfSecondOrder) {
  for (const int per_cell : {1, 2}) {
    const double coarse = tip_ratio(3, per_cell), middle = tip_ratio(6, per_cell),
                 fine = tip_ratio(12, per_cell);
    EXPECT_GT((coarse - middle) / (middle - fine), 3.0) << per_cell;  // 4 at second order
    EXPECT_NEAR(fine, 1, 0.008) << per_cell;
  }
}

}  // namespace
}  // namespace estuary::solid
