// The list against all pairs; histories carried through reordering; size ratios; threads.
#include <gtest/gtest.h>
#include <omp.h>

#include <set>

#include "assemblies.hpp"

namespace estuary::grains {
namespace {

template <int D>
std::set<std::pair<std::uint32_t, std::uint32_t>> listed(const State<D>& s) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (std::size_t i = 0; i < s.size(); ++i)
    for (std::size_t k = s.row_start[i]; k < s.row_start[i + 1]; ++k)
      pairs.insert(std::minmax(s.identity[i], s.identity[s.partner[k]]));
  return pairs;
}

template <int D>
std::set<std::pair<std::uint32_t, std::uint32_t>> brute_force(const State<D>& s, const Domain<D>& domain,
                                                              double skin) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (std::size_t i = 0; i < s.size(); ++i)
    for (std::size_t j = i + 1; j < s.size(); ++j) {
      Vector<D> apart = load<D>(s.position.data(), j) - load<D>(s.position.data(), i);
      for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
        if (domain.periodic[c]) apart[c] -= domain.length(c) * std::round(apart[c] / domain.length(c));
      if (norm(apart) < s.radius[i] + s.radius[j] + skin)
        pairs.insert(std::minmax(s.identity[i], s.identity[j]));
    }
  return pairs;
}

template <int D>
void compare(double ratio, bool periodic) {
  auto settings = test::free_space<D>(1e6, 1);
  settings.skin = 0.004;
  settings.domain.from.fill(-0.3);
  settings.domain.to.fill(0.7);
  settings.domain.periodic.fill(periodic);
  InitialGrains<D> grains;
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int k = 0; k < 700; ++k) {
    Vector<D> x;
    // Some outside the box: they are wrapped, or the grid follows them.
    for (double& c : x) c = -0.5 + 1.4 * unit(random);
    test::add_grain<D>(grains, x, {}, k % 40 == 0 ? 0.06 : 0.06 / ratio * (0.5 + 0.5 * unit(random)));
  }
  const Dynamics<D> dynamics(settings, grains, {});
  const auto expected = brute_force(dynamics.state(), settings.domain, settings.skin);
  EXPECT_GT(expected.size(), 0u);
  EXPECT_EQ(listed(dynamics.state()), expected);
}
TEST(List, HoldsThePairsInReachAndNoOthers) {
  for (const double ratio : {1.0, 3.0, 20.0})
    for (const bool periodic : {false, true}) {
      SCOPED_TRACE(ratio);
      compare<2>(ratio, periodic);
      compare<3>(ratio, periodic);
    }
}

template <int D>
std::vector<double> run(double skin, int threads, FrictionLaw friction, int per_side,
                        std::uint64_t steps = 200) {
  omp_set_num_threads(threads);
  auto settings = test::free_space<D>(D == 2 ? 1e6 : 1e4, 0.8, 0.4);
  settings.law.friction = friction;
  settings.law.rolling = RollingLaw::spring;
  settings.constants.rolling_friction = settings.constants.pivoting_friction = 0.05;
  settings.constants.rolling_stiffness = 0.5 * settings.constants.normal_stiffness;
  settings.constants.rolling_damping = 0.3;
  InitialGrains<D> grains = test::gas<D>(per_side, 0.2, settings);
  settings.skin = skin;
  Dynamics<D> dynamics(settings, grains, {});
  dynamics.advance(5e-5 * static_cast<double>(steps), steps);
  const State<D>& s = dynamics.state();
  std::vector<double> position(D * s.size());
  for (std::size_t i = 0; i < s.size(); ++i) store<D>(position.data(), s.identity[i], dynamics.unwrapped(i));
  omp_set_num_threads(omp_get_num_procs());
  return position;
}

// A list rebuilt every few steps and one that is hardly ever rebuilt must carry the same histories.
TEST(List, RebuildingDoesNotChangeTheMotion) {
  for (const auto friction : {FrictionLaw::spring, FrictionLaw::coulomb}) {
    const auto often = run<2>(1e-4, 1, friction, 12), seldom = run<2>(5e-3, 1, friction, 12);
    for (std::size_t k = 0; k < often.size(); ++k) ASSERT_NEAR(often[k], seldom[k], 1e-9) << k;
    const auto often3 = run<3>(1e-4, 1, friction, 5), seldom3 = run<3>(5e-3, 1, friction, 5);
    for (std::size_t k = 0; k < often3.size(); ++k) ASSERT_NEAR(often3[k], seldom3[k], 1e-9) << k;
  }
}

TEST(Threads, AnyNumberGivesTheSameBits) {
  const auto one = run<2>(1e-3, 1, FrictionLaw::spring, 70, 60);
  for (const int threads : {2, 3}) EXPECT_EQ(run<2>(1e-3, threads, FrictionLaw::spring, 70, 60), one);
  EXPECT_EQ(run<3>(1e-3, 3, FrictionLaw::spring, 17, 60), run<3>(1e-3, 1, FrictionLaw::spring, 17, 60));
}

}  // namespace
}  // namespace estuary::grains
