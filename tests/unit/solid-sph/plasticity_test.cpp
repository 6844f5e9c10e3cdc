// J2 plasticity against exact solutions in principal logarithmic strains.
#include "plasticity.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "bodies.hpp"

namespace estuary::solid {
namespace {

constexpr double kYoung = 70e9, kPoisson = 0.3, kYield = 200e6, kHardening = 2e9;

struct Metal {
  Plasticity plasticity;
  J2Plasticity law;

  explicit Metal(Plane plane = Plane::strain) {
    plasticity.strain = {0, 0.02, 1};
    plasticity.yield = {kYield, kYield + 0.02 * kHardening, kYield + 0.02 * kHardening};  // then level
    const auto constants = ElasticConstants::from(kYoung, kPoisson, Plane::strain);
    law.mu = constants.mu;
    law.bulk = constants.lambda + 2 * constants.mu / 3;
    law.plane = plane;
    law.plasticity = &plasticity;
  }
  [[nodiscard]] std::vector<double> rest() const {
    return {J2Plasticity::kRest.begin(), J2Plasticity::kRest.end()};
  }
};

Tensor<double> rotated(const Tensor<double>& f, double angle) {
  return product(Tensor<double>{std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle)}, f);
}

double von_mises(const Tensor<double>& sigma, double zz) {
  const double a = sigma.xx - sigma.yy, b = sigma.yy - zz, c = zz - sigma.xx;
  return std::sqrt(0.5 * (a * a + b * b + c * c) + 3 * sigma.xy * sigma.xy);
}

TEST(J2, PureShearFollowsTheHardeningTableExactlyInOneIncrementAndInMany) {
  const Metal metal;
  // e = (ln l, -ln l, 0): q = 2 sqrt(3) mu (ln l) elastic; plastic part sqrt(3) / 2 alpha each way.
  const double stretch = 1.01, strain = std::log(stretch);
  const double compliance = 1 / (2 * std::sqrt(3.0) * metal.law.mu);
  const double alpha = (strain - kYield * compliance) / (kHardening * compliance + std::sqrt(3.0) / 2);
  ASSERT_LT(alpha, 0.02);
  for (const int increments : {1, 7, 100}) {
    auto history = metal.rest();
    for (int k = 1; k <= increments; ++k) {
      const double l = std::exp(strain * k / increments);
      metal.law.update({l, 0, 0, 1 / l}, history.data(), history.data());
    }
    EXPECT_NEAR(history[4] / alpha, 1, 1e-10) << increments;
    const Tensor<double> f{stretch, 0, 0, 1 / stretch};
    const auto end = metal.law.update(f, history.data(), nullptr);
    EXPECT_NEAR(von_mises(product(end.stress, transposed(f)), end.across) / (kYield + kHardening * alpha), 1,
                1e-10);
    EXPECT_NEAR(history[6] / (kYield * alpha + 0.5 * kHardening * alpha * alpha), 1, 1e-10) << increments;
    // Plastic flow keeps the volume.
    EXPECT_NEAR((history[0] * history[2] - history[1] * history[1]) * history[3], 1, 1e-12);
  }
}

TEST(J2, TableIsFollowedRoundItsCorner) {
  const Metal metal;
  auto history = metal.rest();
  const double l = 1.1;
  metal.law.update({l, 0, 0, 1 / l}, history.data(), history.data());
  EXPECT_GT(history[4], 0.02);
  const auto end = metal.law.update({l, 0, 0, 1 / l}, history.data(), nullptr);
  const Tensor<double> f{l, 0, 0, 1 / l};
  EXPECT_NEAR(von_mises(product(end.stress, transposed(f)), end.across) / (kYield + 0.02 * kHardening), 1,
              1e-10);
  const double level = kYield + 0.02 * kHardening;
  EXPECT_NEAR(history[6] / (0.01 * (kYield + level) + (history[4] - 0.02) * level), 1, 1e-12);
}

TEST(J2, StressOfALargeIncrementIsTheDerivativeOfWhatItStoresAndDissipates) {
  for (const Plane plane : {Plane::strain, Plane::stress}) {
    const Metal metal(plane);
    const auto history = metal.rest();
    const Tensor<double> f{1.08, 0.05, -0.02, 0.97};
    const auto end = metal.law.update(f, history.data(), nullptr);
    ASSERT_GT(end.dissipated, 0.03 * kYield);  // well round the table's corner
    const auto at = [&](double xx, double xy) {
      return metal.law.energy_density({f.xx + xx, f.xy + xy, f.yx, f.yy}, history.data());
    };
    EXPECT_NEAR((at(1e-6, 0) - at(-1e-6, 0)) / 2e-6 / end.stress.xx, 1, 1e-6);
    EXPECT_NEAR((at(0, 1e-6) - at(0, -1e-6)) / 2e-6 / end.stress.xy, 1, 1e-5);
  }
}

TEST(J2, DissipationIsTheIntegralOverYieldAndDamage) {
  Plasticity p;
  p.strain = {0, 0.1, 0.2};
  p.yield = {1, 3, 3};
  EXPECT_NEAR(p.dissipation(0.05, 0.25), 0.05 * 2.5 + 0.15 * 3, 1e-15);
  p.damage_from = 0.1;
  p.damage_to = 0.2;
  p.damage_limit = 0.5;
  EXPECT_NEAR(p.dissipation(0.05, 0.25), 0.05 * 2.5 + 0.1 * 3 * 0.75 + 0.05 * 3 * 0.5, 1e-15);
  p.yield = {1, 2, 3};
  EXPECT_NEAR(p.dissipation(0.1, 0.2), 0.1 * (2.5 - 0.5 * (2.0 / 2 + 1.0 / 3)),
              1e-15);  // (1 - s / 2) (2 + s)
}

TEST(J2, IsObjectiveAfterFlow) {
  const Metal metal;
  auto history = metal.rest();
  const Tensor<double> f{1.05, 0.1, 0.02, 0.97};
  metal.law.update(f, history.data(), history.data());
  ASSERT_GT(history[4], 0.01);
  const auto straight = metal.law.update(f, history.data(), nullptr);
  const auto turned = metal.law.update(rotated(f, 1.3), history.data(), nullptr);
  const Tensor<double> expected = rotated(straight.stress, 1.3);
  EXPECT_NEAR(turned.stress.xx, expected.xx, 1e-6 * kYield);
  EXPECT_NEAR(turned.stress.xy, expected.xy, 1e-6 * kYield);
  EXPECT_NEAR(turned.stress.yx, expected.yx, 1e-6 * kYield);
  EXPECT_NEAR(turned.stored / straight.stored, 1, 1e-9);
}

TEST(J2, BelowYieldItIsElasticAndForgetsNothing) {
  const Metal metal;
  const auto history = metal.rest();
  auto next = history;
  const Tensor<double> f{1.0001, 0.00005, -0.00002, 0.99995};
  const auto result = metal.law.update(f, history.data(), next.data());
  EXPECT_EQ(next, history);
  EXPECT_FALSE(result.plastic);
  // Small strain: the same as any other isotropic law, up to the square of the strain.
  const SaintVenantKirchhoff other{ElasticConstants::from(kYoung, kPoisson, Plane::strain)};
  EXPECT_NEAR(result.stress.xx, other.first_piola_kirchhoff(f).xx, 5e-4 * std::abs(result.stress.xx));
}

TEST(J2, StressIsTheDerivativeOfTheIncrementsPotential) {
  for (const Plane plane : {Plane::strain, Plane::stress}) {
    const Metal metal(plane);
    auto history = metal.rest();
    metal.law.update({1.02, 0.03, 0, 0.99}, history.data(), history.data());
    const Tensor<double> f{1.03, 0.05, 0.01, 0.985};
    const Tensor<double> stress = metal.law.first_piola_kirchhoff(f, history.data());
    const double e = 1e-6;
    const double above = metal.law.energy_density({f.xx + e, f.xy, f.yx, f.yy}, history.data());
    const double below = metal.law.energy_density({f.xx - e, f.xy, f.yx, f.yy}, history.data());
    EXPECT_NEAR((above - below) / (2 * e) / stress.xx, 1, 1e-4);
    const double right = metal.law.energy_density({f.xx, f.xy + e, f.yx, f.yy}, history.data());
    const double left = metal.law.energy_density({f.xx, f.xy - e, f.yx, f.yy}, history.data());
    EXPECT_NEAR((right - left) / (2 * e) / stress.xy, 1, 1e-4);
  }
}

TEST(J2, RateRaisesTheYieldStressByCowperAndSymonds) {
  Metal metal;
  metal.plasticity.strain = {0, 1};
  metal.plasticity.yield = {kYield, kYield};
  metal.plasticity.reference_rate = 40;
  metal.plasticity.rate_exponent = 5;
  // A steady rate of pure shear: alpha' = 2 / sqrt(3) times that of ln l once flow is steady.
  const double rate = 100, dt = 1e-6;
  metal.law.time_step = dt;
  auto history = metal.rest();
  double l = 1;
  for (int k = 0; k < 2000; ++k) {
    l *= std::exp(rate * dt);
    metal.law.update({l, 0, 0, 1 / l}, history.data(), history.data());
  }
  metal.law.time_step = 1e-290;  // no time to flow: the stress as it is
  const Tensor<double> f{l, 0, 0, 1 / l};
  const auto end = metal.law.update(f, history.data(), nullptr);
  const double expected = kYield * (1 + std::pow(2 / std::sqrt(3.0) * rate / 40, 0.2));
  EXPECT_NEAR(von_mises(product(end.stress, transposed(f)), end.across) / expected, 1, 1e-6);
}

TEST(J2, DamageTakesTheStressAwayBetweenItsTwoStrains) {
  Metal metal;
  metal.plasticity.damage_from = 0.1;
  metal.plasticity.damage_to = 0.3;
  metal.plasticity.damage_limit = 0.9;
  auto history = metal.rest();
  double dissipated = 0;
  for (int k = 1; k <= 400; ++k) {
    const double l = std::exp(0.001 * k);
    const Tensor<double> f{l, 0, 0, 1 / l};
    metal.law.update(f, history.data(), history.data());
    EXPECT_GE(history[6], dissipated);
    dissipated = history[6];
    const auto now = metal.law.update(f, history.data(), nullptr);
    const double stress = von_mises(product(now.stress, transposed(f)), now.across);
    const double whole = 1 - 0.9 * std::min(1.0, std::max(0.0, history[4] - 0.1) / 0.2);
    if (history[4] > 0.02) {
      ASSERT_NEAR(stress / (whole * (kYield + 0.02 * kHardening)), 1, 1e-9) << k;
    }
  }
  EXPECT_NEAR(history[5], 0.9, 1e-12);
}

TEST(J2, PlaneStressFlowHasNoStressAcross) {
  const Metal metal(Plane::stress);
  auto history = metal.rest();
  // Equal stretch both ways: sigma_1 = sigma_2 = q; e_3 = -2 nu q / E - alpha, e_1 = (1 - nu) q / E + alpha
  // / 2.
  const double stretch = 1.008, strain = std::log(stretch);
  metal.law.update({stretch, 0, 0, stretch}, history.data(), history.data());
  const double alpha =
      (strain - (1 - kPoisson) * kYield / kYoung) / ((1 - kPoisson) * kHardening / kYoung + 0.5);
  EXPECT_NEAR(history[4] / alpha, 1, 1e-9);
  const auto end = metal.law.update({stretch, 0, 0, stretch}, history.data(), nullptr);
  EXPECT_NEAR(end.stress.xx * stretch / (kYield + kHardening * alpha), 1, 1e-9);
  EXPECT_NEAR(std::log(end.stretch) / (-2 * kPoisson * (kYield + kHardening * alpha) / kYoung - alpha), 1,
              1e-8);
}

TEST(J2, WorkOfAMovedEdgeIsStoredAndDissipated) {
  Box box = test::box_of(1.0, 0.5, 0.1);
  test::Material material{.density = 1000, .young = 1e6};
  material.plasticity.strain = {0, 1};
  material.plasticity.yield = {1e4, 2e4};
  auto made = std::make_unique<test::Assembled>();
  Body body = fill(box, 1000, 0.95, false);
  PrescribedMotion motion{.particle = {}, .component = 0, .displacement = [](double, double, double t) {
                            return 0.1 * (1 - std::cos(20 * t));
                          }};
  for (std::size_t i = 0; i < body.size(); ++i) {
    if (body.position[2 * i] == 0) body.fixed[i] = 3;
    if (body.position[2 * i] == 1.0) {
      body.fixed[i] = 1;
      motion.particle.push_back(static_cast<std::uint32_t>(i));
    }
  }
  SolverOptions options{.materials = {{.constants = ElasticConstants::from(1e6, 0.3, Plane::strain),
                                       .plane = Plane::strain,
                                       .viscosity = {},
                                       .plasticity = material.plasticity}},
                        .stabilisation = 0.02,
                        .hourglass_time = {}};
  const auto solver = make_solver(LawName::j2_plasticity, body, options);
  State state = at_rest(body);
  state.history = solver->history();
  Loading loading;
  loading.prescribed.push_back(motion);
  solver->advance(state, loading, 0.1, 4000, 0, test::no_monitor);
  solver->evaluate(state.displacement);
  const double plastic = solver->plastic_work();
  EXPECT_GT(plastic, 0.5 * state.external_work);
  const double stored = solver->energy(state.displacement) + solver->kinetic_energy(state) + plastic;
  // The stabilisation of a particle falls when it flows; what it held then is lost.
  EXPECT_NEAR(stored / state.external_work, 1, 0.01);
}

}  // namespace
}  // namespace estuary::solid
