// Bonds: stiffness, strength, conservation.
#include <gtest/gtest.h>

#include "assemblies.hpp"

namespace estuary::grains {
namespace {

using test::add_grain;

template <int D>
DynamicsSettings<D> bonded(double damping = 0.2) {
  auto settings = test::free_space<D>(1e5, 0.5);
  settings.bond_law = {.active = true,
                       .distance = 1e-4,
                       .normal_stiffness = 1e9,
                       .shear_stiffness = 4e8,
                       .radius_ratio = 1,
                       .tensile_strength = 1e300,
                       .shear_strength = 1e300,
                       .damping = damping};
  return settings;
}

TEST(Bond, StretchesByItsStiffness) {
  auto settings = bonded<3>(0.5);
  InitialGrains<3> grains;
  add_grain<3>(grains, {0, 0, 0}, {}, 0.01);
  add_grain<3>(grains, {0.02, 0, 0}, {}, 0.01);
  Dynamics<3> dynamics(settings, grains, {});
  ASSERT_EQ(dynamics.bonds().size(), 1u);
  dynamics.set_external(std::vector<double>{-100, 0, 0, 100, 0, 0}, {});
  dynamics.advance(0.02, 20000);
  const double stiffness = 1e9 * std::numbers::pi * 1e-4;
  const State<3>& s = dynamics.state();
  EXPECT_NEAR(std::abs(s.position[3] - s.position[0]) - 0.02, 100 / stiffness, 1e-3 * 100 / stiffness);
  EXPECT_NEAR(dynamics.energy_error(), 0, 0.01);
}

TEST(Bond, BreaksAtItsTensileStrength) {
  for (const double strength : {2.9e5, 3.5e5}) {
    auto settings = bonded<3>(0.5);
    settings.bond_law.tensile_strength = strength;
    InitialGrains<3> grains;
    add_grain<3>(grains, {0, 0, 0}, {}, 0.01);
    add_grain<3>(grains, {0.02, 0, 0}, {}, 0.01);
    Dynamics<3> dynamics(settings, grains, {});
    // 100 N over 3.14e-4 m2 are 3.18e5 Pa; loaded slowly.
    for (int k = 1; k <= 50; ++k) {
      dynamics.set_external(std::vector<double>{-2.0 * k, 0, 0, 2.0 * k, 0, 0}, {});
      dynamics.advance(0.001, 1000);
    }
    EXPECT_EQ(dynamics.bonds().broken[0] != 0, strength < 3.18e5);
  }
}

template <int D>
void chain_conserves() {
  auto settings = bonded<D>();
  InitialGrains<D> grains;
  for (int k = 0; k < 6; ++k) {
    Vector<D> x{}, v{};
    x[0] = 0.02 * k;
    v[1] = k == 0 ? 1.0 : 0.0;
    if constexpr (D == 3) v[2] = k == 5 ? 0.5 : 0;
    Spin<D> w{};
    w[0] = k == 2 ? 20 : 0;
    add_grain<D>(grains, x, v, 0.01, 1000, w);
  }
  Dynamics<D> dynamics(settings, grains, {});
  EXPECT_EQ(dynamics.bonds().size(), 5u);
  const auto before = test::totals(dynamics);
  dynamics.advance(0.05, 20000);
  const auto after = test::totals(dynamics);
  double mass = grains.mass[0];
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
    EXPECT_NEAR(after.momentum[c], before.momentum[c], 1e-11 * mass);
  for (std::size_t c = 0; c < after.angular.size(); ++c)
    EXPECT_NEAR(after.angular[c], before.angular[c], 1e-11 * mass);
  EXPECT_NEAR(dynamics.energy_error(), 0, 0.02);
}
TEST(Bond, ChainKeepsMomentumAndAngularMomentum) {
  chain_conserves<2>();
  chain_conserves<3>();
}

TEST(Bond, BeamOfBondedDiscsBendsLikeABeam) {
  // A row of discs held at one end, a small force across at the other: bonds of full width make a beam of
  // depth 2 r whose bending stiffness is k_n I l per bond length l and whose shear stiffness is k_s A l.
  auto settings = bonded<2>(0.6);
  InitialGrains<2> grains;
  constexpr int kGrains = 5;
  for (int k = 0; k < kGrains; ++k) add_grain<2>(grains, {0.02 * k, 0}, {}, 0.01, 1000, {}, k == 0);
  Dynamics<2> dynamics(settings, grains, {});
  std::vector<double> force(2 * kGrains, 0.0);
  const double load = 100;
  force.back() = load;
  dynamics.set_external(force, {});
  for (int k = 0; k < 40; ++k) dynamics.advance(0.05, 4000);
  const State<2>& s = dynamics.state();
  double tip = 0;
  for (std::size_t i = 0; i < s.size(); ++i)
    if (s.identity[i] == kGrains - 1) tip = s.position[2 * i + 1];
  // Each bond between k and k+1 is a hinge at its middle: moment load (L - (k + 1/2) l), plus the slip of its
  // shear spring.
  const double l = 0.02, inertia = 2.0 / 3 * 1e-6, area = 0.02;
  double expected = 0;
  for (int k = 0; k < kGrains - 1; ++k) {
    const double arm = l * (kGrains - 1 - k - 0.5);
    expected += load * arm * arm / (1e9 * inertia) + load / (4e8 * area);
  }
  EXPECT_NEAR(tip, expected, 0.01 * expected);
}

}  // namespace
}  // namespace estuary::grains
