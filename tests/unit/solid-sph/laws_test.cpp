// The kernel function and the elastic laws, each against what defines it.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "kernel_function.hpp"
#include "laws.hpp"

namespace estuary::solid {
namespace {

TEST(CubicSpline, IntegratesToOne) {
  const double h = 0.37;
  const int n = 200000;
  double sum = 0;
  for (int k = 0; k < n; ++k) {
    const double r = 2 * h * (k + 0.5) / n;
    sum += 2 * std::numbers::pi * r * cubic_spline(r, h) * 2 * h / n;
  }
  EXPECT_NEAR(sum, 1.0, 1e-9);
}

TEST(CubicSpline, SlopeIsTheDerivative) {
  const double h = 0.8, e = 1e-6;
  for (int k = 0; k < 24; ++k) {
    const double r = 0.05 + 0.0711 * k;
    EXPECT_NEAR(cubic_spline_slope(r, h), (cubic_spline(r + e, h) - cubic_spline(r - e, h)) / (2 * e), 1e-8);
  }
  EXPECT_EQ(cubic_spline(1.6, h), 0);
  EXPECT_EQ(cubic_spline_slope(1.6, h), 0);
}

template <class Law>
class LawTest : public testing::Test {};
using Laws = testing::Types<SaintVenantKirchhoff, HookeAlmansi, NeoHooke, NeoHookeIsochoric>;
TYPED_TEST_SUITE(LawTest, Laws);

const Tensor<double> kDeformed{1.2, 0.3, -0.15, 0.9};

Tensor<double> rotation(double angle) {
  return {std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle)};
}

TYPED_TEST(LawTest, SmallStrainLimitIsHooke) {
  const TypeParam law{ElasticConstants::from(3.0, 0.3, Plane::strain)};
  const double e = 1e-6, lambda = law.constants.lambda, mu = law.constants.mu;
  const Tensor<double> p = law.first_piola_kirchhoff(Tensor<double>{1 + 2 * e, 0.5 * e, 1.5 * e, 1 - e});
  EXPECT_NEAR(p.xx / e, lambda + 2 * mu * 2, 1e-4);
  EXPECT_NEAR(p.yy / e, lambda - 2 * mu, 1e-4);
  EXPECT_NEAR(p.xy / e, 2 * mu, 1e-4);
  EXPECT_NEAR(p.yx / e, 2 * mu, 1e-4);
}

TYPED_TEST(LawTest, IsObjective) {
  const TypeParam law{ElasticConstants::from(3.0, 0.3, Plane::strain)};
  const Tensor<double> q = rotation(1.1);
  const Tensor<double> turned = law.first_piola_kirchhoff(product(q, kDeformed));
  const Tensor<double> expected = product(q, law.first_piola_kirchhoff(kDeformed));
  for (const Tensor<double> d{turned - expected}; const double v : {d.xx, d.xy, d.yx, d.yy})
    EXPECT_NEAR(v, 0, 1e-14);
  const Tensor<double> rigid = law.first_piola_kirchhoff(q);
  for (const double v : {rigid.xx, rigid.xy, rigid.yx, rigid.yy}) EXPECT_NEAR(v, 0, 1e-14);
}

TYPED_TEST(LawTest, CauchyStressIsSymmetric) {
  const TypeParam law{ElasticConstants::from(3.0, 0.3, Plane::strain)};
  const Tensor<double> cauchy = product(law.first_piola_kirchhoff(kDeformed), transposed(kDeformed));
  EXPECT_NEAR(cauchy.xy, cauchy.yx, 1e-14);
}

TYPED_TEST(LawTest, StressIsTheDerivativeOfTheEnergy) {
  if (!TypeParam::hyperelastic) GTEST_SKIP() << "this law has no energy";
  for (const Plane plane : {Plane::strain, Plane::stress}) {
    const TypeParam law{ElasticConstants::from(3.0, 0.3, plane)};
    const double e = 1e-6;
    const Tensor<double> p = law.first_piola_kirchhoff(kDeformed);
    const auto slope = [&](const Tensor<double>& direction) {
      return (law.energy_density(kDeformed + scaled(direction, e)) -
              law.energy_density(kDeformed - scaled(direction, e))) /
             (2 * e);
    };
    EXPECT_NEAR(slope({1, 0, 0, 0}), p.xx, 1e-8);
    EXPECT_NEAR(slope({0, 1, 0, 0}), p.xy, 1e-8);
    EXPECT_NEAR(slope({0, 0, 1, 0}), p.yx, 1e-8);
    EXPECT_NEAR(slope({0, 0, 0, 1}), p.yy, 1e-8);
  }
}

TYPED_TEST(LawTest, TangentIsTheDerivativeOfTheStress) {
  const TypeParam law{ElasticConstants::from(3.0, 0.3, Plane::stress)};
  const auto a = tangent(law, kDeformed);
  const double e = 1e-6;
  for (std::size_t c = 0; c < 4; ++c) {
    Tensor<double> d;
    (c == 0 ? d.xx : c == 1 ? d.xy : c == 2 ? d.yx : d.yy) = e;
    const Tensor<double> slope = scaled(
        law.first_piola_kirchhoff(kDeformed + d) - law.first_piola_kirchhoff(kDeformed - d), 1 / (2 * e));
    EXPECT_NEAR(a[c], slope.xx, 1e-8);
    EXPECT_NEAR(a[4 + c], slope.xy, 1e-8);
    EXPECT_NEAR(a[8 + c], slope.yx, 1e-8);
    EXPECT_NEAR(a[12 + c], slope.yy, 1e-8);
  }
}

TEST(Plane, StressStretchesByYoungModulus) {
  const double e = 1e-7, young = 5.0, nu = 0.3;
  const SaintVenantKirchhoff law{ElasticConstants::from(young, nu, Plane::stress)};
  const Tensor<double> p = law.first_piola_kirchhoff(Tensor<double>{1 + e, 0, 0, 1 - nu * e});
  EXPECT_NEAR(p.xx / e, young, 1e-5);
  EXPECT_NEAR(p.yy / e, 0, 1e-5);
  EXPECT_EQ(law.stress_across(Tensor<double>{1.1, 0, 0, 0.9}), 0);
}

// Stretched along x and free in both other directions: the two directions behave alike.
TEST(NeoHooke, SheetInPlaneStressContractsAcrossAsInItsPlane) {
  for (const double ratio : {0.3, 0.499999}) {
    const ElasticConstants solid = ElasticConstants::from(3.0, ratio, Plane::strain);
    const double stretch = 1.7;
    // mu (b^2 - 1) + lambda ln (stretch b^2) = 0, by bisection.
    double low = 0.1, high = 1;
    for (int k = 0; k < 100; ++k) {
      const double b = 0.5 * (low + high);
      (solid.mu * (b * b - 1) + solid.lambda * std::log(stretch * b * b) > 0 ? high : low) = b;
    }
    const NeoHooke law{ElasticConstants::from(3.0, ratio, Plane::stress)};
    const Tensor<double> f{stretch, 0, 0, low}, p = law.first_piola_kirchhoff(f);
    EXPECT_NEAR(law.stretch_across(f), low, 1e-9);
    EXPECT_NEAR(p.xx, solid.mu * (stretch - low * low / stretch), 1e-9);
    EXPECT_NEAR(p.yy, 0, 1e-8);
  }
}

TEST(NeoHookeIsochoric, IncompressibleSheetInPlaneStressHasTheTextbooksStress) {
  const NeoHookeIsochoric law{ElasticConstants::from(3.0, 0.49999, Plane::stress)};
  const Tensor<double> f{2, 0, 0, 0.6}, p = law.first_piola_kirchhoff(f);
  EXPECT_NEAR(law.stretch_across(f), 1 / 1.2, 1e-4);
  EXPECT_NEAR(p.xx / law.constants.mu, 2 - 1 / (2.0 * 2 * 2 * 0.36), 1e-4);
  EXPECT_NEAR(p.yy / law.constants.mu, 0.6 - 1 / (0.6 * 0.6 * 0.6 * 4), 2e-4);
}

// Its bulk modulus, 2 mu / 3, is not lambda: at finite strain the volume resists without Poisson's effect
// too.
TEST(NeoHookeIsochoric, SheetWithoutPoissonsEffectCarriesNoStressAcross) {
  const ElasticConstants of_sheet = ElasticConstants::from(3.0, 0, Plane::stress);
  const NeoHookeIsochoric sheet{of_sheet}, solid{ElasticConstants::from(3.0, 0, Plane::strain)};
  const double mu = of_sheet.mu, bulk = 2 * mu / 3;
  const Tensor<double> f{1.6, 0.2, -0.1, 1.3};
  const double across = sheet.stretch_across(f), j = determinant(f) * across;
  const double stress =
      mu * std::pow(j, -5.0 / 3) * (across * across - (contraction(f, f) + across * across) / 3) +
      0.5 * bulk * (j - 1 / j);
  EXPECT_NEAR(stress, 0, 1e-12);
  EXPECT_EQ(sheet.stress_across(f), 0);
  EXPECT_GT(std::abs(across - 1), 0.01);
  EXPECT_GT(std::abs(solid.stress_across(f)), 0.1);
  const double e = 1e-6;
  const Tensor<double> d{e, 0, 0, 0}, p = sheet.first_piola_kirchhoff(f);
  EXPECT_NEAR((sheet.energy_density(f + d) - sheet.energy_density(f - d)) / (2 * e), p.xx, 1e-8);
}

TEST(NeoHooke, SimpleShearIsLinear) {
  const NeoHooke law{ElasticConstants::from(2.6, 0.3, Plane::strain)};
  for (const double gamma : {0.1, 0.7, 3.0})
    EXPECT_NEAR(law.first_piola_kirchhoff(Tensor<double>{1, gamma, 0, 1}).xy, law.constants.mu * gamma,
                1e-13);
}

}  // namespace
}  // namespace estuary::solid
