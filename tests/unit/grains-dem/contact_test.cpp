// Contact laws: restitution, sliding, rolling, cohesion, conservation.
#include <gtest/gtest.h>

#include "assemblies.hpp"

namespace estuary::grains {
namespace {

using test::add_grain;

// Relative speed after over before, of two equal grains meeting head-on.
template <int D>
double collide_head_on(DynamicsSettings<D> settings, double speed, std::uint64_t steps, double duration) {
  InitialGrains<D> grains;
  Vector<D> left{}, right{}, v{};
  left[0] = -0.01001;
  right[0] = 0.01001;
  v[0] = speed;
  add_grain<D>(grains, left, v, 0.01);
  v[0] = -speed;
  add_grain<D>(grains, right, v, 0.01);
  Dynamics<D> dynamics(settings, grains, {});
  dynamics.advance(duration, steps);
  const State<D>& s = dynamics.state();
  const std::size_t first = s.identity[0] == 0 ? 0 : 1;
  return (s.velocity[D * (1 - first)] - s.velocity[D * first]) / (2 * speed);
}

TEST(LinearContact, RestitutesTheSameAtEverySpeedAndForEveryMass) {
  for (const double e : {0.9, 0.7, 0.3}) {
    const double expected = cut_restitution(e);
    EXPECT_GT(expected, e);
    for (const double speed : {0.1, 1.0}) {
      EXPECT_NEAR(collide_head_on<2>(test::free_space<2>(1e7, e), speed, 40000, 0.004 / speed), expected,
                  2e-3);
      EXPECT_NEAR(collide_head_on<3>(test::free_space<3>(1e5, e), speed, 40000, 0.004 / speed), expected,
                  2e-3);
    }
  }
}

TEST(LinearContact, CutRestitutionHasItsPublishedValues) {
  // Of damping ratios 0.05, 0.1, 0.2, 0.4; the uncut ones are exp(-pi zeta / sqrt(1 - zeta^2)).
  const double ratio[] = {0.05, 0.1, 0.2, 0.4}, cut[] = {0.85876, 0.74408, 0.57174, 0.36353};
  for (int k = 0; k < 4; ++k) {
    const double uncut = std::exp(-std::numbers::pi * ratio[k] / std::sqrt(1 - ratio[k] * ratio[k]));
    EXPECT_NEAR(linear_damping_ratio(uncut), 2 * ratio[k], 1e-12);
    EXPECT_NEAR(cut_restitution(uncut), cut[k], 1e-5);
  }
}

TEST(LinearContact, ErrorOfRestitutionFallsWithTheStep) {
  const double expected = cut_restitution(0.7);
  const auto error = [&](std::uint64_t steps) {
    return std::abs(collide_head_on<2>(test::free_space<2>(1e7, 0.7), 1.0, steps, 0.004) - expected);
  };
  EXPECT_LT(error(16000), 0.5 * error(1000));
}

TEST(HertzContact, RestitutesAlmostTheSameAtEverySpeed) {
  auto settings = test::free_space<3>(4.0 / 3 * 1e8, 1);
  settings.law.normal = NormalLaw::hertz;
  EXPECT_NEAR(collide_head_on<3>(settings, 1.0, 20000, 0.004), 1.0, 1e-4);
  settings.constants.damping = std::sqrt(5.0 / 6) * linear_damping_ratio(0.7);
  const double slow = collide_head_on<3>(settings, 0.1, 40000, 0.04);
  const double fast = collide_head_on<3>(settings, 1.0, 40000, 0.004);
  EXPECT_NEAR(slow, fast, 2e-3);
  EXPECT_NEAR(fast, 0.7, 0.03);
}

TEST(HertzContact, IsRefusedForDiscs) {
  EXPECT_THROW(law_functions<2>({.normal = NormalLaw::hertz}), std::invalid_argument);
}

TEST(HertzContact, LastsAsLongAsTheFormulaSays) {
  // Largest overlap of an elastic impact: (15 m* v^2 / (16 E* sqrt(R*)))^(2/5).
  auto settings = test::free_space<3>(4.0 / 3 * 1e8, 1);
  settings.law.normal = NormalLaw::hertz;
  InitialGrains<3> grains;
  add_grain<3>(grains, {-0.01, 0, 0}, {1, 0, 0}, 0.01);
  add_grain<3>(grains, {0.01, 0, 0}, {-1, 0, 0}, 0.01);
  const double mass = 0.5 * grains.mass[0];
  const double time = hertz_contact_time(1e8, mass, 0.005, 2.0);
  Dynamics<3> dynamics(settings, grains, {});
  dynamics.advance(0.5 * time, 20000);
  const auto contacts = dynamics.contacts();
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_NEAR(contacts[0].kinematics.overlap, std::pow(15 * mass * 4 / (16 * 1e8 * std::sqrt(0.005)), 0.4),
              2e-6);
  EXPECT_NEAR(contacts[0].kinematics.closing, 0, 0.01);
}

ContactConstants elastic_hertz(double friction) {
  ContactConstants c;
  c.normal_stiffness = 4.0 / 3 * 1e8;
  c.friction = friction;
  c.tangential_stiffness = 3e8;
  c.inverse_tangential_stiffness = 1 / 3e8;
  return c;
}

// Sheared by x at the overlap d, pressed to 4 d, where the spring is twice as stiff, sheared back and
// released to d, without sliding. With k the stiffness at d the force is k x, still k x, k x - 2 k x, half of
// that; what goes is 1/4 k x^2 in pressing, 1/8 in releasing.
TEST(HertzContact, SpringThatStiffensLosesWhatTheLedgerSays) {
  const ContactConstants constants = elastic_hertz(100);
  const auto law = law_functions<3>({.normal = NormalLaw::hertz, .friction = FrictionLaw::spring});
  const double shallow = 1e-5, sheared = 1e-6, stiffness = 3e8 * std::sqrt(0.005 * shallow);
  const int steps = 20000;
  const double dt = 1e-6;
  std::array<double, 8> history{};
  EnergyLedger ledger;
  ContactKinematics<3> k{};
  k.normal = {1, 0, 0};
  k.radius_sum = 0.02;
  k.reduced_radius = 0.005;
  k.root_mass = 1;
  k.overlap = shallow;
  double work = 0;
  const auto go = [&](double deeper, double across) {
    k.closing = deeper / (steps * dt);
    k.sliding = {0, across / (steps * dt), 0};
    double force = 0;
    for (int n = 0; n < steps; ++n) {
      k.overlap += k.closing * dt;
      force = law.contact(constants, k, dt, history.data(), ledger).friction[1];
      work += force * k.sliding[1] * dt;
    }
    return force / (stiffness * sheared);
  };
  const double unit = stiffness * sheared * sheared;
  EXPECT_NEAR(go(0, sheared), 1, 1e-6);
  EXPECT_NEAR(ledger.tangential, 0, 1e-3 * unit);
  EXPECT_NEAR(go(3 * shallow, 0), 1, 1e-6);
  EXPECT_NEAR(ledger.tangential, 0.25 * unit, 1e-3 * unit);
  EXPECT_NEAR(go(0, -sheared), -1, 1e-6);
  EXPECT_NEAR(ledger.tangential, 0.25 * unit, 1e-3 * unit);
  EXPECT_NEAR(go(-3 * shallow, 0), -0.5, 1e-6);
  EXPECT_NEAR(ledger.tangential, 0.375 * unit, 1e-3 * unit);
  const double stored = 0.5 * stiffness * history[1] * history[1];
  EXPECT_NEAR(work, stored + ledger.tangential, 1e-3 * unit);
}

// Whatever the angle and the spin, elastic impacts with friction end with no more energy than they began
// with, and the ledger closes with the step.
TEST(HertzContact, ObliqueImpactsGainNoEnergy) {
  for (const double along : {0.02, 0.1, 0.3, 1.0, 3.0})
    for (const double spin : {-100.0, 0.0, 100.0}) {
      auto settings = test::free_space<3>(1, 1);
      settings.law.normal = NormalLaw::hertz;
      settings.law.friction = FrictionLaw::spring;
      settings.constants = elastic_hertz(0.3);
      InitialGrains<3> grains;
      add_grain<3>(grains, {-0.01, 0, 0}, {0.5, 0.5 * along, 0}, 0.01, 1000, {0, 0, spin});
      add_grain<3>(grains, {0.01, 0, 0}, {-0.5, -0.5 * along, 0}, 0.01, 1000, {0, 0, spin});
      Dynamics<3> dynamics(settings, grains, {});
      const auto moving = [&] { return dynamics.energies().translation + dynamics.energies().rotation; };
      const double before = moving();
      dynamics.advance(1.5 * hertz_contact_time(1e8, 0.5 * grains.mass[0], 0.005, 1.0), 20000);
      ASSERT_TRUE(dynamics.contacts().empty());
      EXPECT_LT(moving(), before * (1 + 1e-5)) << along << ' ' << spin;
      EXPECT_NEAR(dynamics.energy_error(), 0, 1e-4) << along << ' ' << spin;
    }
}

// A grain hits a wall obliquely and slides all the way: v_t' = v_t - mu (1 + e) v_n.
template <int D>
void slide_off(FrictionLaw friction) {
  const double mu = 0.1, e = 0.8, vt = 4, vn = 1;
  auto settings = test::free_space<D>(D == 2 ? 1e8 : 1e6, e, mu);
  settings.law.friction = friction;
  InitialGrains<D> grains;
  Vector<D> x{}, v{};
  x[1] = 0.0101;
  v[0] = vt;
  v[1] = -vn;
  add_grain<D>(grains, x, v, 0.01);
  Wall<D> floor;
  floor.normal[1] = 1;
  floor.constants = settings.constants;
  Dynamics<D> dynamics(settings, grains, {floor});
  dynamics.advance(0.001, 20000);
  const State<D>& s = dynamics.state();
  const double realised = s.velocity[1] / vn;
  EXPECT_NEAR(realised, cut_restitution(e), 2e-3);
  EXPECT_NEAR(s.velocity[0], vt - mu * (1 + realised) * vn, 2e-3);
  const double turn = (D == 2 ? 2 : 2.5) * mu * (1 + realised) * vn / 0.01;
  EXPECT_NEAR(s.spin[D == 2 ? 0 : 2], -turn, 0.005 * turn);
}
TEST(Friction, SlidingImpactLosesAndTurnsExactly) {
  slide_off<2>(FrictionLaw::spring);
  slide_off<3>(FrictionLaw::spring);
  slide_off<2>(FrictionLaw::coulomb);
  slide_off<3>(FrictionLaw::coulomb);
}

// On a slope whose tangent is below the friction coefficient a held-from-turning block would stick; a disc
// rolls with 2/3 g sin(theta), a sphere with 5/7.
template <int D>
double roll_down(double slope_degrees, double rolling_friction) {
  auto settings = test::free_space<D>(D == 2 ? 1e7 : 1e5, 0.3, 0.6);
  const double angle = slope_degrees * std::numbers::pi / 180;
  settings.gravity[0] = 10 * std::sin(angle);
  settings.gravity[1] = -10 * std::cos(angle);
  if (rolling_friction > 0) {
    settings.law.rolling = RollingLaw::spring;
    settings.constants.rolling_friction = rolling_friction;
    settings.constants.rolling_stiffness = 0.5 * settings.constants.normal_stiffness;
    settings.constants.rolling_damping = 0.3;
  }
  InitialGrains<D> grains;
  Vector<D> x{};
  x[1] = 0.01;
  add_grain<D>(grains, x, {}, 0.01);
  Wall<D> floor;
  floor.normal[1] = 1;
  floor.constants = settings.constants;
  Dynamics<D> dynamics(settings, grains, {floor});
  dynamics.advance(0.1, 20000);
  return dynamics.state().velocity[0] / (0.1 * 10 * std::sin(angle));
}
TEST(Friction, GrainsRollDownASlope) {
  EXPECT_NEAR(roll_down<2>(20, 0), 2.0 / 3, 0.005);
  EXPECT_NEAR(roll_down<3>(20, 0), 5.0 / 7, 0.005);
}
TEST(RollingResistance, SlowsBySlopeMinusItsOwnAngle) {
  // M = c 2r N cos: a = 2/3 (g sin - 2 c g cos) for a disc; below tan(theta) = 2 c it does not move.
  const double angle = 20 * std::numbers::pi / 180;
  EXPECT_NEAR(roll_down<2>(20, 0.05), 2.0 / 3 * (1 - 0.1 / std::tan(angle)), 0.01);
  EXPECT_NEAR(roll_down<2>(5, 0.05), 0, 0.02);
  EXPECT_NEAR(roll_down<3>(5, 0.05), 0, 0.02);
}

// Two spheres pressed together turn against each other about their line of centres: each slows by c 2r F / I.
double pivot(RollingLaw law) {
  constexpr double r = 0.01, stiffness = 1e5, press = 2.0, spin = 40, time = 0.01;
  auto settings = test::free_space<3>(stiffness, 0.5, 0.4);
  settings.law.rolling = law;
  settings.constants.rolling_friction = 0.2;  // has no part in it
  settings.constants.pivoting_friction = 0.01;
  settings.constants.rolling_stiffness = 0.5 * stiffness;
  settings.constants.rolling_damping = law == RollingLaw::viscous ? 1.0 : 0.3;
  InitialGrains<3> grains;
  add_grain<3>(grains, {0, 0, 0}, {}, r, 1000, {spin, 0, 0});
  add_grain<3>(grains, {2 * r - press / stiffness, 0, 0}, {}, r, 1000, {-spin, 0, 0});
  Dynamics<3> dynamics(settings, grains, {});
  dynamics.set_external(std::vector<double>{press, 0, 0, -press, 0, 0}, {});
  dynamics.advance(time, 2000);
  const State<3>& s = dynamics.state();
  EXPECT_NEAR(s.spin[0] + s.spin[3], 0, 1e-12 * spin);
  EXPECT_NEAR(dynamics.energy_error(), 0, 1e-3);
  const double slowing = 0.01 * 2 * r * press * time / grains.inertia[0];
  return (spin - std::abs(s.spin[0])) / slowing;
}
TEST(PivotingResistance, SlowsTurningAboutTheNormal) {
  EXPECT_NEAR(pivot(RollingLaw::viscous), 1, 1e-9);
  EXPECT_NEAR(pivot(RollingLaw::spring), 1, 0.01);
}

TEST(Cohesion, HoldsUpToItsForce) {
  auto settings = test::free_space<3>(1e5, 0.5);
  settings.law.cohesive = true;
  settings.constants.cohesion = 1.0;
  for (const double pull : {0.9, 1.1}) {
    InitialGrains<3> grains;
    add_grain<3>(grains, {0, 0, 0}, {}, 0.01);
    add_grain<3>(grains, {0.02 - 1e-6, 0, 0}, {}, 0.01);
    Dynamics<3> dynamics(settings, grains, {});
    // Slowly, so that the spring does not overshoot.
    for (int k = 1; k <= 100; ++k) {
      const double f = pull * k / 100;
      dynamics.set_external(std::vector<double>{-f, 0, 0, f, 0, 0}, {});
      dynamics.advance(0.005, 500);
    }
    EXPECT_EQ(dynamics.contacts().size(), pull < 1 ? 1u : 0u) << pull;
  }
}

template <int D>
void conserves(LawChoice law) {
  auto settings = test::free_space<D>(D == 2 ? 1e6 : 1e4, 0.8, 0.4);
  settings.law = law;
  settings.constants.rolling_friction = settings.constants.pivoting_friction = 0.05;
  settings.constants.rolling_stiffness = 0.5 * settings.constants.normal_stiffness;
  settings.constants.rolling_damping = law.rolling == RollingLaw::viscous ? 1e-6 : 0.3;
  settings.constants.cohesion = 0.1;
  InitialGrains<D> grains = test::gas<D>(D == 2 ? 12 : 5, 0.3, settings);
  settings.domain.periodic.fill(false);
  settings.skin = 0.003;
  Dynamics<D> dynamics(settings, grains, {});
  const auto before = test::totals(dynamics);
  // Pure sliding friction turns round at once when a contact stops: it needs smaller steps for the same
  // balance.
  dynamics.advance(0.02, law.friction == FrictionLaw::coulomb ? 2000 : 1000);
  const auto after = test::totals(dynamics);
  double mass = 0;
  for (const double m : grains.mass) mass += m;
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
    EXPECT_NEAR(after.momentum[c], before.momentum[c], 1e-12 * mass);
  for (std::size_t c = 0; c < after.angular.size(); ++c)
    EXPECT_NEAR(after.angular[c], before.angular[c], 1e-12 * mass);
  EXPECT_GT(dynamics.state().ledger.dissipated(), 0);
  EXPECT_NEAR(dynamics.energy_error(), 0, 0.02);
}
TEST(Conservation, MomentumAndAngularMomentumForEveryLaw) {
  for (const auto friction : {FrictionLaw::none, FrictionLaw::coulomb, FrictionLaw::spring})
    for (const auto rolling : {RollingLaw::none, RollingLaw::viscous, RollingLaw::spring})
      for (const bool cohesive : {false, true}) {
        SCOPED_TRACE(static_cast<int>(friction) * 100 + static_cast<int>(rolling) * 10 + cohesive);
        conserves<2>({NormalLaw::linear, friction, rolling, cohesive});
        conserves<3>({NormalLaw::linear, friction, rolling, cohesive});
      }
}

TEST(Energy, ElasticGasKeepsItsEnergy) {
  auto settings = test::free_space<2>(1e7, 1);
  InitialGrains<2> grains = test::gas<2>(15, 0.2, settings);
  Dynamics<2> dynamics(settings, grains, {});
  const double before = dynamics.energies().total();
  dynamics.advance(0.1, 20000);
  EXPECT_NEAR(dynamics.energies().total(), before, 1e-3 * before);
}

TEST(Energy, BooksBalanceBetterWithSmallerSteps) {
  const auto error = [](std::uint64_t steps) {
    auto settings = test::free_space<2>(1e7, 0.7, 0.3);
    InitialGrains<2> grains = test::gas<2>(10, 0.2, settings);
    Dynamics<2> dynamics(settings, grains, {});
    dynamics.advance(0.02, steps);
    return std::abs(dynamics.energy_error());
  };
  EXPECT_LT(error(8000), 0.02);
  EXPECT_LT(error(32000), 0.5 * error(4000));
}

}  // namespace
}  // namespace estuary::grains
