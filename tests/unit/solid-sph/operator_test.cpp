// The discrete operator: consistency, conservation, and forces as minus the derivative of the energy.
#include <gtest/gtest.h>
#include <omp.h>

#include "bodies.hpp"
#include "moving_least_squares.hpp"

namespace estuary::solid {
namespace {

using test::Case;

class Operator : public testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(
    Variants, Operator,
    testing::Values(Case{}, Case{.stabilisation = 0.1}, Case{.order = Order::quadratic},
                    Case{.order = Order::quadratic, .stabilisation = 0.05},
                    Case{.order = Order::quadratic, .stabilisation = 0.05, .smoothing_ratio = 1.3},
                    Case{.law = LawName::neo_hooke}, Case{.law = LawName::hooke_almansi},
                    Case{.order = Order::mls_linear}, Case{.order = Order::mls_quadratic},
                    Case{.order = Order::mls_linear_diffuse}, Case{.order = Order::mls_quadratic_diffuse}));

// Half the divergence of the position by plain differences, without a correction, in the middle of a side and
// at a corner: sums over the part of a square lattice that is there (worked out by hand with the kernel).
TEST(PlainOperator, MissesAtEdgesAndCornersWhatTheLatticeSays) {
  for (const auto& [ratio, edge, corner] : std::initializer_list<std::array<double, 3>>{
           {0.8, 0.613, 0.400}, {1.2, 0.641, 0.393}, {1.5, 0.616, 0.364}}) {
    Box box = test::box_of(1.1, 1.1, 0.1);
    box.placement = Placement::cell_centres;
    const Body body = fill(box, 1000, ratio, false);
    const Neighbourhood pairs =
        build_neighbourhood(body, {.order = Order::none, .spring_modulus = {}, .viscous = false});
    double at_edge = 0, at_corner = 0;
    for (std::size_t i = 0; i < body.size(); ++i) {
      const double x = body.position[2 * i], y = body.position[2 * i + 1];
      double half = 0;
      for (std::uint32_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k)
        half += 0.5 * (pairs.offset[2 * k] * pairs.gradient[2 * k] +
                       pairs.offset[2 * k + 1] * pairs.gradient[2 * k + 1]);
      if (std::hypot(x - 0.55, y - 0.05) < 1e-9) at_edge = half;
      if (std::hypot(x - 0.05, y - 0.05) < 1e-9) at_corner = half;
    }
    EXPECT_NEAR(at_edge, edge, 6e-4) << ratio;
    EXPECT_NEAR(at_corner, corner, 6e-4) << ratio;
  }
}

// The gradient that leaves the particle's own value in, sum_j V_j f_j grad W_ij, is that of differences and
// its value times the sum of the gradients, which is zero inside alone: at a side, a constant field of 1 has
// a slope of about 1 per two spacings. That is why the solid takes differences.
TEST(PlainOperator, WithItsOwnValueLeftInMissesConstantsAtSides) {
  Box box = test::box_of(1.1, 1.1, 0.1);
  box.placement = Placement::cell_centres;
  const Body body = fill(box, 1000, 1.2, false);
  const Neighbourhood pairs =
      build_neighbourhood(body, {.order = Order::none, .spring_modulus = {}, .viscous = false});
  // A sum over whole rows of the lattice behind the missing ones, as long as the kernel reaches two spacings.
  double missing = 0;
  for (int across = 1; across <= 2; ++across)
    for (int along = -2; along <= 2; ++along) {
      const double r = 0.1 * std::hypot(across, along);
      missing -= 0.01 * kernel_slope(Kernel::cubic_spline, r, 0.12) * 0.1 * across / r;
    }
  ASSERT_GT(missing * 0.1, 0.3);
  for (std::size_t i = 0; i < body.size(); ++i) {
    double raw = 0;
    for (std::uint32_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k) raw += pairs.gradient[2 * k] * 1.0;
    EXPECT_NEAR(raw, pairs.gradient_sum[2 * i], 1e-12);
    const double x = body.position[2 * i], y = body.position[2 * i + 1];
    if (std::abs(y - 0.55) > 1e-9) continue;
    if (std::abs(x - 0.55) < 1e-9) {
      EXPECT_NEAR(raw, 0, 1e-11);
    } else if (std::abs(x - 0.05) < 1e-9) {
      EXPECT_NEAR(raw, missing, 1e-9);
    }
  }
}

TEST_P(Operator, AffineMotionGivesOneStress) {
  const auto made = test::assemble(test::box_of(1.0, 0.43, 0.05), {}, GetParam());
  const Tensor<double> a{1.15, 0.2, -0.1, 0.93};
  ASSERT_EQ(made->solver->evaluate(test::affine(made->body, a, 3, -2)), 0);
  const Tensor<double> reference = made->solver->first_piola_kirchhoff_at(0);
  const Fields& fields = made->solver->fields();
  const double size = 1e6;
  for (std::size_t i = 0; i < made->body.size(); ++i) {
    const Tensor<double> f = tensor_at(fields.deformation_gradient, i);
    ASSERT_NEAR(f.xx, a.xx, 2e-13);
    ASSERT_NEAR(f.xy, a.xy, 2e-13);
    ASSERT_NEAR(f.yx, a.yx, 2e-13);
    ASSERT_NEAR(f.yy, a.yy, 2e-13);
    // The stabilisation, too, must see nothing.
    const double v = made->body.energy_volume[i];
    ASSERT_NEAR(fields.stress[4 * i] / v, reference.xx, 1e-11 * size);
    ASSERT_NEAR(fields.stress[4 * i + 1] / v, reference.xy, 1e-11 * size);
  }
}

TEST_P(Operator, QuarterTurnGivesNoForce) {
  const auto made = test::assemble(test::box_of(1.0, 0.4, 0.05), {}, GetParam());
  ASSERT_EQ(made->solver->evaluate(test::affine(made->body, {0, -1, 1, 0}, 0.3, 0.2)), 0);
  for (const double f : made->solver->fields().force) ASSERT_NEAR(f / 1e6, 0, 1e-14);
  for (const double s : made->solver->fields().stress) ASSERT_NEAR(s / 1e6, 0, 1e-14);
}

TEST_P(Operator, ForceIsMinusTheEnergysDerivative) {
  if (GetParam().law == LawName::hooke_almansi) GTEST_SKIP() << "this law has no energy";
  const auto made = test::assemble(test::box_of(0.5, 0.3, 0.05), {}, GetParam());
  auto u = test::affine(made->body, {1.1, 0.1, -0.3, 0.95}, 0, 0);
  const auto noise = test::random_field(u.size(), 0.004, 7);
  for (std::size_t c = 0; c < u.size(); ++c) u[c] += noise[c];
  ASSERT_EQ(made->solver->evaluate(u), 0);
  const std::vector<double> force = made->solver->fields().force;
  double scale = 0;
  for (const double f : force) scale = std::max(scale, std::abs(f));
  const double e = 1e-6;
  for (std::size_t c = 0; c < u.size(); c += 5) {
    auto shifted = u;
    shifted[c] += e;
    made->solver->evaluate(shifted);
    const double above = made->solver->energy(shifted);
    shifted[c] -= 2 * e;
    made->solver->evaluate(shifted);
    const double below = made->solver->energy(shifted);
    ASSERT_NEAR(force[c], -(above - below) / (2 * e), 1e-6 * scale) << "component " << c;
  }
}

TEST_P(Operator, ForcesHaveNoResultantAndNoMoment) {
  const auto made = test::assemble(test::box_of(1.0, 0.4, 0.05), {}, GetParam());
  auto u = test::affine(made->body, {0.2, -0.9, 1.0, 0.3}, 0, 0);
  const auto noise = test::random_field(u.size(), 0.005, 3);
  for (std::size_t c = 0; c < u.size(); ++c) u[c] += noise[c];
  ASSERT_EQ(made->solver->evaluate(u), 0);
  const auto& force = made->solver->fields().force;
  double fx = 0, fy = 0, moment = 0, size = 0, moment_size = 0;
  for (std::size_t i = 0; i < made->body.size(); ++i) {
    const double x = made->body.position[2 * i] + u[2 * i], y = made->body.position[2 * i + 1] + u[2 * i + 1];
    fx += force[2 * i];
    fy += force[2 * i + 1];
    moment += x * force[2 * i + 1] - y * force[2 * i];
    size += std::abs(force[2 * i]) + std::abs(force[2 * i + 1]);
    moment_size += std::abs(x * force[2 * i + 1]) + std::abs(y * force[2 * i]);
  }
  EXPECT_NEAR(fx / size, 0, 1e-14);
  EXPECT_NEAR(fy / size, 0, 1e-14);
  EXPECT_NEAR(moment / moment_size, 0, 1e-14);
}

TEST(Neighbourhood, QuadraticCorrectionIsExactForQuadraticFieldsUpToTheCorners) {
  Box box = test::box_of(1.0, 0.4, 0.05);
  box.placement = Placement::cell_centres;
  const auto made = test::assemble(box, {}, {.order = Order::quadratic});
  std::vector<double> u(2 * made->body.size());
  const auto& x = made->body.position;
  for (std::size_t i = 0; i < made->body.size(); ++i) {
    u[2 * i] = 0.1 * x[2 * i] * x[2 * i + 1] - 0.2 * x[2 * i + 1] * x[2 * i + 1];
    u[2 * i + 1] = 0.3 * x[2 * i] * x[2 * i];
  }
  made->solver->evaluate(u);
  EXPECT_EQ(made->solver->pairs().incomplete, 0u);
  for (std::size_t i = 0; i < made->body.size(); ++i) {
    const Tensor<double> f = tensor_at(made->solver->fields().deformation_gradient, i);
    ASSERT_NEAR(f.xx - 1, 0.1 * x[2 * i + 1], 1e-12);
    ASSERT_NEAR(f.xy, 0.1 * x[2 * i] - 0.4 * x[2 * i + 1], 1e-12);
    ASSERT_NEAR(f.yx, 0.6 * x[2 * i], 1e-12);
    ASSERT_NEAR(f.yy - 1, 0, 1e-12);
  }
}

// Between the points, too: the gradient is the derivative of the interpolation.
TEST(MovingLeastSquares, ReproducesItsMonomialsAndIsTheDerivativeOfItself) {
  std::vector<Offset> points;
  for (int k = 0; k < 25; ++k)
    points.push_back(
        {0.8 * (k % 5 - 2) + 0.1 * std::sin(3.0 * k), 0.8 * (k / 5 - 2) + 0.1 * std::cos(5.0 * k)});
  const auto seen_from = [&](double x, double y) {
    std::vector<Offset> offsets;
    for (const Offset& p : points) offsets.push_back({p.x - x, p.y - y});
    return offsets;
  };
  for (const int degree : {0, 1, 2}) {
    const ShapeFunctions shape =
        moving_least_squares(seen_from(0.1, -0.2), Kernel::cubic_spline, 1.2, degree);
    const auto value = [&](double x, double y) {
      return moving_least_squares(seen_from(0.1 + x, -0.2 + y), Kernel::cubic_spline, 1.2, degree).value;
    };
    const double e = 1e-6;
    const auto right = value(e, 0), left = value(-e, 0), up = value(0, e), down = value(0, -e);
    double sum = 0, slope = 0, curved = 0;
    for (std::size_t j = 0; j < points.size(); ++j) {
      ASSERT_NEAR(shape.gradient[j][0], (right[j] - left[j]) / (2 * e), 1e-8);
      ASSERT_NEAR(shape.gradient[j][1], (up[j] - down[j]) / (2 * e), 1e-8);
      sum += shape.value[j];
      slope += shape.gradient[j][0] * points[j].x;
      curved += shape.gradient[j][0] * points[j].x * points[j].y;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_NEAR(slope, degree > 0 ? 1 : slope, 1e-12);
    EXPECT_NEAR(curved, degree > 1 ? -0.2 : curved, 1e-12);
    const ShapeFunctions diffuse =
        moving_least_squares(seen_from(0.1, -0.2), Kernel::cubic_spline, 1.2, degree, Derivative::diffuse);
    EXPECT_EQ(diffuse.value, shape.value);
    sum = slope = curved = 0;
    double apart = 0;
    for (std::size_t j = 0; j < points.size(); ++j) {
      sum += diffuse.gradient[j][0];
      slope += diffuse.gradient[j][0] * points[j].x;
      curved += diffuse.gradient[j][0] * points[j].x * points[j].y;
      apart = std::max(apart, std::abs(diffuse.gradient[j][0] - shape.gradient[j][0]));
    }
    EXPECT_NEAR(sum, 0, 1e-12);
    EXPECT_NEAR(slope, degree > 0 ? 1 : 0, 1e-12);
    EXPECT_NEAR(curved, degree > 1 ? -0.2 : curved, 1e-12);
    EXPECT_GT(apart, 0.01);  // of a field beyond the monomials they make two gradients
  }
}

TEST(Neighbourhood, AnInnerParticleHasEightNeighboursAtTheDefaultRatio) {
  const auto made = test::assemble(test::box_of(1.0, 1.0, 0.1), {}, {});
  const auto& pairs = made->solver->pairs();
  EXPECT_EQ(pairs.first[46] - pairs.first[45], 8u);
  EXPECT_EQ(pairs.first[1] - pairs.first[0], 3u);  // a corner
}

TEST(Neighbourhood, PeriodicBodyIsTheSameEverywhereAlongX) {
  Box box = test::box_of(1.0, 0.3, 0.05);
  box.periodic = true;
  const auto made = test::assemble(box, {}, {.order = Order::quadratic, .stabilisation = 0.05});
  std::vector<double> u(2 * made->body.size());
  for (std::size_t i = 0; i < made->body.size(); ++i)
    u[2 * i] = 0.4 * std::sin(7 * made->body.position[2 * i + 1]);
  ASSERT_EQ(made->solver->evaluate(u), 0);
  const std::size_t rows = made->body.columns[1];
  for (std::size_t i = 0; i < made->body.size(); ++i)
    ASSERT_NEAR(made->solver->fields().force[2 * i] / 1e6, made->solver->fields().force[2 * (i % rows)] / 1e6,
                1e-13);
}

TEST(Neighbourhood, NarrowPeriodicBodyActsAsAWideOne) {
  std::vector<std::vector<double>> forces;
  for (const double width : {0.1, 0.2, 2.0}) {  // 2, 4 and 40 particles
    Box box = test::box_of(width, 0.3, 0.05);
    box.periodic = true;
    box.clamped[static_cast<std::size_t>(Side::top)] = true;
    const auto made = test::assemble(box, {}, {.order = Order::quadratic, .stabilisation = 0.05});
    std::vector<double> u(2 * made->body.size());
    for (std::size_t i = 0; i < made->body.size(); ++i) {
      u[2 * i] = 0.4 * std::sin(7 * made->body.position[2 * i + 1]);
      u[2 * i + 1] = 0.02 * std::cos(9 * made->body.position[2 * i + 1]);
    }
    ASSERT_EQ(made->solver->evaluate(u), 0);
    std::vector<double> profile;  // of the particles of the first column, upwards
    for (std::size_t i = 0; i < made->body.size(); ++i)
      if (made->body.position[2 * i] < 0.05)
        for (std::size_t c = 0; c < 2; ++c) profile.push_back(made->solver->fields().force[2 * i + c] / 1e6);
    forces.push_back(profile);
  }
  ASSERT_EQ(forces[0].size(), forces[2].size());
  for (std::size_t k : {0u, 1u})
    for (std::size_t c = 0; c < forces[2].size(); ++c) ASSERT_NEAR(forces[k][c], forces[2][c], 1e-13);
}

TEST(Body, EnergyVolumesIntegrateBendingExactly) {
  for (const int across : {3, 4, 5, 10}) {
    Box box = test::box_of(1.0, 0.1, 0.1 / across);
    box.placement = Placement::cell_centres;
    const Body body = fill(box, 1, 0.95, true);
    double sum = 0;
    for (std::size_t i = 0; i < body.size(); ++i)
      sum += body.energy_volume[i] * std::pow(body.position[2 * i + 1] - 0.05, 2);
    EXPECT_NEAR(sum, std::pow(0.1, 3) / 12, 1e-15) << across;
  }
}

TEST(Body, RowsOnTheContourShareTheAreaExactly) {
  const Body body = fill(test::box_of(1.0, 0.4, 0.1), 3.0, 0.95, false);
  ASSERT_EQ(body.columns[0], 11u);
  ASSERT_EQ(body.columns[1], 5u);
  EXPECT_EQ(body.position[0], 0.0);
  EXPECT_EQ(body.position[body.position.size() - 1], 0.4);
  double volume = 0;
  for (const double v : body.volume) volume += v;
  EXPECT_NEAR(volume, 0.4, 1e-15);
  EXPECT_NEAR(body.volume[0], 0.25 * body.volume[6], 1e-16);  // a corner
  EXPECT_NEAR(body.volume[1], 0.5 * body.volume[6], 1e-16);
}

// Summation by parts: under one stress the particles of a straight side carry exactly their share of its
// traction and the others nothing, so a load on the side meets no compliance but the material's.
TEST(Operator, OneStressLoadsOnlyTheRowOnTheSide) {
  for (const bool periodic : {false, true}) {
    Box box = test::box_of(1.0, 0.6, 0.05);
    box.periodic = periodic;
    const auto made = test::assemble(box, {}, {.stabilisation = 0.02});
    auto u = test::affine(made->body, {1.0, 0.2, 0, 1.1}, 0, 0);
    ASSERT_EQ(made->solver->evaluate(u), 0);
    const Tensor<double> p = made->solver->first_piola_kirchhoff_at(made->body.size() / 2);
    const double dx = made->body.spacing[0];
    for (std::size_t i = 0; i < made->body.size(); ++i) {
      const double x = made->body.position[2 * i], y = made->body.position[2 * i + 1];
      if (!periodic && (x < 2.5 * dx || x > 1 - 2.5 * dx)) continue;  // sides across and their corners
      const double share = y < 1e-9 ? 1 : y > 0.6 - 1e-9 ? -1 : 0;
      EXPECT_NEAR(made->solver->fields().force[2 * i], share * p.xy * dx, 1e-9) << x << " " << y;
      EXPECT_NEAR(made->solver->fields().force[2 * i + 1], share * p.yy * dx, 1e-9) << x << " " << y;
    }
  }
}

TEST(Body, ClampedRowsLieWhereTheClampSays) {
  Box box = test::box_of(0.1, 1.0, 0.02);
  box.clamped[static_cast<std::size_t>(Side::bottom)] = true;
  box.placement = Placement::cell_centres;
  const Body line = fill(box, 2.0, 0.95, false);
  EXPECT_EQ(line.position[1], 0.0);
  EXPECT_TRUE(line.fixed[0]);
  double volume = 0;
  for (const double v : line.volume) volume += v;
  EXPECT_NEAR(volume, 0.1, 1e-14);
  EXPECT_NEAR(line.position.back(), 1.0 - 0.5 * line.spacing[1], 1e-14);
  box.clamp = Clamp::extra_rows;
  const Body rows = fill(box, 2.0, 0.95, false);
  EXPECT_NEAR(rows.position[1], -0.5 * rows.spacing[1], 1e-15);
  EXPECT_TRUE(rows.fixed[0]);
}

TEST(Operator, NumberOfThreadsDoesNotChangeABit) {
  const auto made =
      test::assemble(test::box_of(1.0, 0.41, 0.01), {}, {.order = Order::quadratic, .stabilisation = 0.05});
  ASSERT_GT(made->body.size(), 4096u);  // sums are shared by threads only above this, sweeps above less
  const auto u = test::random_field(2 * made->body.size(), 0.0005, 11);
  omp_set_num_threads(1);
  made->solver->evaluate(u);
  const auto force = made->solver->fields().force;
  const double energy = made->solver->energy(u);
  auto broken = u;
  broken[made->body.size()] = std::nan("");
  const auto bad = made->solver->evaluate(broken);
  EXPECT_GT(bad, 1);
  omp_set_num_threads(3);
  EXPECT_EQ(made->solver->evaluate(broken), bad);
  made->solver->evaluate(u);
  EXPECT_EQ(made->solver->fields().force, force);
  EXPECT_EQ(made->solver->energy(u), energy);
  omp_set_num_threads(1);
}

}  // namespace
}  // namespace estuary::solid
