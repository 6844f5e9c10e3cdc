// Steps and balances of shells in motion: the bound of the step against the tangent's own eigenvalues, what
// viscosity takes in any state, and the work of a moment against what is stored, dissipated and moving.
#include <gtest/gtest.h>
#include <omp.h>

#include <limits>
#include <numbers>

#include "bodies.hpp"
#include "shell.hpp"

namespace estuary::solid {
namespace {

ShellSection steel(double thickness, bool plastic = false) {
  ShellSection section{.thickness = thickness, .young_modulus = 2e5, .shear_modulus = 8e4, .density = 7.8};
  if (plastic) {
    section.plasticity.strain = {0, 1};
    section.plasticity.yield = {50, 50 + 2e3};
    section.plane_factor = 2 / std::sqrt(3.0);
  }
  return section;
}

// Largest eigenvalue of the masses' inverse times minus the forces' derivative at a state of a free row, by
// the power method on the tangent shifted to be positive.
double largest_squared_frequency(ShellRow& row, const Body& body, const ShellSection& section,
                                 const std::vector<double>& u, const std::vector<double>& turned) {
  const std::size_t n = body.size(), size = 3 * n;
  const double inertia = section.thickness * section.thickness / 12;
  const auto root_mass = [&](std::size_t c) {
    return std::sqrt(c < 2 * n ? body.mass[c / 2] : body.mass[c - 2 * n] * inertia);
  };
  const auto forces = [&](std::size_t which, double change) {
    std::vector<double> displacement = u, history(2 * n, 0.0);
    for (std::size_t i = 0; i < n; ++i) history[2 * i] = turned[i];
    (which < 2 * n ? displacement[which] : history[2 * (which - 2 * n)]) += change;
    Fields fields(n);
    row.evaluate(displacement, history, false, fields);
    std::vector<double> result(fields.force.begin(), fields.force.end());
    result.insert(result.end(), row.moments().begin(), row.moments().end());
    return result;
  };
  std::vector<double> matrix(size * size);
  double shift = 0;
  for (std::size_t c = 0; c < size; ++c) {
    const double e = 1e-6 / root_mass(c);
    const std::vector<double> more = forces(c, e), less = forces(c, -e);
    for (std::size_t r = 0; r < size; ++r)
      matrix[r * size + c] = (less[r] - more[r]) / (2 * e * root_mass(r) * root_mass(c));
  }
  for (std::size_t r = 0; r < size; ++r) {
    double sum = 0;
    for (std::size_t c = 0; c < size; ++c) sum += std::abs(matrix[r * size + c]);
    shift = std::max(shift, sum);
  }
  std::vector<double> v = test::random_field(size, 1, 17), next(size);
  double value = 0;
  for (int iteration = 0; iteration < 500; ++iteration) {
    value = 0;
    for (std::size_t r = 0; r < size; ++r) {
      next[r] = shift * v[r];
      for (std::size_t c = 0; c < size; ++c) next[r] += matrix[r * size + c] * v[c];
      value += next[r] * next[r];
    }
    value = std::sqrt(value);
    for (std::size_t r = 0; r < size; ++r) v[r] = next[r] / value;
  }
  return value - shift;
}

TEST(ShellStep, IsBoundedByTheTangentsLargestEigenvalueInAnyState) {
  double slackest = 0;
  for (const double thickness : {0.01, 0.1, 0.4}) {
    const ShellSection section = steel(thickness);
    const Body body = fill_row(std::vector<std::array<double, 2>>{{0, 0}, {0.4, 0}}, false, 0.1, section);
    ShellRow row(body, {section});
    const std::size_t n = body.size();
    const std::vector<double> still(2 * n, 0.0), turned = test::random_field(n, 0.2, 6);
    const double at_rest = largest_squared_frequency(row, body, section, still, still);
    for (const double stretch : {0.6, 1.0, 1.6})
      for (const double slide : {0.0, 0.7}) {
        std::vector<double> u = test::random_field(2 * n, 0.01, 1), history(2 * n, 0.0);
        for (std::size_t i = 0; i < n; ++i) {
          u[2 * i] += (stretch - 1) * body.position[2 * i];
          u[2 * i + 1] += slide * body.position[2 * i];
          history[2 * i] = turned[i];
        }
        const double exact = largest_squared_frequency(row, body, section, u, turned);
        Fields fields(n);
        row.evaluate(u, history, false, fields);
        const double bound = row.squared_frequency(still, history);
        EXPECT_LE(exact, 1.0001 * bound) << thickness << " " << stretch << " " << slide;
        slackest = std::max(slackest, bound / std::max(exact, at_rest));
      }
  }
  // Not by much: the stiffest link alone is stiffer than among its neighbours. (It is at least that of rest.)
  EXPECT_LT(slackest, 2.5);
}

TEST(ShellStep, ViscosityTakesEnergyFromEveryMotionOfEveryState) {
  for (const double thickness : {0.01, 0.3}) {
    ShellSection section = steel(thickness);
    section.viscosity = {.linear = 0.5, .quadratic = 2, .shear = 0.4, .bending = 0.6};
    const Body body = fill_row({{{0, 0}, {1, 0}, {1.5, 1}}}, false, 0.2, section);
    ShellRow row(body, {section});
    const std::size_t n = body.size();
    for (unsigned seed = 1; seed <= 200; ++seed) {
      // From small strains to links that lie across or along their fibres, and turned end for end.
      const double much = std::pow(10.0, -3 + 0.02 * seed);
      const std::vector<double> u = test::random_field(2 * n, 0.2 * much, seed),
                                turned = test::random_field(2 * n, much, seed + 1000),
                                velocity = test::random_field(2 * n, 10, seed + 2000);
      std::vector<double> history = turned;
      Fields fields(n);
      row.turn(history, 0, 1, 1, true);
      row.evaluate(u, history, false, fields, velocity);
      ASSERT_GT(row.viscous_power(), 0) << seed;
    }
  }
}

TEST(ShellStep, ALinkThatFoldsIsNamedOrBreaks) {
  for (const bool breaks : {false, true})
    for (const bool flows : {false, true}) {
      ShellSection section = steel(0.05, flows);
      if (breaks) section.rupture = {.stretch = 10};
      const std::vector<std::array<double, 2>> points{{0, 0}, {1, 0}};
      const Body body = fill_row(points, false, 0.1, section);
      ShellSolver solver(body, {section});
      State state = at_rest(body);
      state.history = solver.history();
      state.history[2 * 9] = state.history[2 * 10] = 2;  // fibres beyond a right angle: x'.t = cos 2
      const double step = 1e-3 * solver.reference_stable_step();
      const auto advance = [&] { solver.advance(state, {}, step, 1, 0, test::no_monitor); };
      if (breaks) {
        advance();
        EXPECT_EQ(solver.totals(state)[0].second, 1);  // broken links
        continue;
      }
      try {
        advance();
        FAIL() << flows;
      } catch (const Breakdown& breakdown) {
        EXPECT_EQ(breakdown.particle, 9U);
        EXPECT_NE(std::string(breakdown.what()).find("folded"), std::string::npos);
        EXPECT_FALSE(breakdown.advice.empty());
      }
    }
}

TEST(ShellStep, ARelaxationThatEndsBesideItsEquilibriumNamesTheLinkThatFolded) {
  const ShellSection section = steel(0.05);
  const Body body = fill_row({{{0, 0}, {1, 0}}}, false, 0.1, section);
  ShellSolver solver(body, {section});
  std::vector<double> history = solver.history();
  history[2 * 4] = history[2 * 5] = 2;  // fibres beyond a right angle: x'.t = cos 2
  solver.set_history(history);
  std::vector<double> displacement(2 * body.size(), 0.0);
  EquilibriumSettings settings;
  settings.maximum_steps = 0;
  try {
    solver.relax(displacement, {}, 0, settings, test::no_monitor);
    FAIL();
  } catch (const Breakdown& breakdown) {
    EXPECT_EQ(breakdown.particle, 4U);
    EXPECT_NE(std::string(breakdown.what()).find("folded"), std::string::npos);
  }
}

TEST(ShellStep, ATeamCountsAndNamesWhatOneThreadDoes) {
  // Enough particles for a team; what is wrong lies in the share of one of its threads alone.
  const std::size_t n = 2 * kSerialBelow;
  const ShellSection section = steel(0.05);
  const Body body = fill_row({{{0, 0}, {1, 0}}}, false, 1.0 / static_cast<double>(n - 1), section);
  ASSERT_EQ(body.size(), n);
  const int threads = omp_get_max_threads();
  for (const int team : {1, 2, 3})
    for (const std::size_t at : {std::size_t{10}, n - 10}) {
      omp_set_num_threads(team);
      ShellRow row(body, {section});
      Fields fields(n), fresh(n);
      std::vector<double> displacement(2 * n, 0.0), history = row.rest_history();
      displacement[2 * at] = std::numeric_limits<double>::quiet_NaN();
      // Its own forces and those of both its neighbours.
      EXPECT_EQ(row.evaluate(displacement, history, false, fields), 3) << team << ' ' << at;
      displacement[2 * at] = 0;
      history[2 * at] = history[2 * (at + 1)] = 2;
      EXPECT_EQ(row.evaluate(displacement, history, false, fresh), 0);
      try {
        row.refuse_folded(7);
        ADD_FAILURE() << "with " << team << " threads nothing has folded";
      } catch (const Breakdown& breakdown) {
        EXPECT_EQ(breakdown.particle, at);
        EXPECT_EQ(breakdown.step, 7U);
      }
    }
  omp_set_num_threads(threads);
}

// A moment put at once on the end of a clamped strip for a given time: by how much what is stored, dissipated
// and moving differs from its work, as a share of that.
double imbalance(const ShellSection& section, double moment, double steps_per_limit, double& dissipated) {
  Body body = fill_row({{{0, 0}, {1, 0}}}, false, 0.1, section);
  body.fixed[0] = 3 | kRotationFixed;
  ShellSolver solver(body, {section});
  State state = at_rest(body);
  state.history = solver.history();
  Loading loading;
  loading.moments.push_back({{static_cast<std::uint32_t>(body.size() - 1)}, moment, {}});
  const double step = solver.reference_stable_step() / steps_per_limit, time = 0.1;
  const auto steps = static_cast<std::uint64_t>(std::ceil(time / step));
  solver.advance(state, loading, time, steps, 0, test::no_monitor);
  solver.set_history(state.history);
  solver.evaluate(state.displacement);
  dissipated = solver.plastic_work() / state.external_work;
  return (solver.kinetic_energy(state) + solver.energy(state.displacement) + solver.plastic_work()) /
             state.external_work -
         1;
}

TEST(ShellStep, AMomentsWorkIsStoredDissipatedAndMoves) {
  const ShellSection elastic = steel(0.05), plastic = steel(0.05, true);
  double none = 0, share = 0;
  double error[2][2];
  for (int k = 0; k < 2; ++k) {
    const double steps = 2 << (2 * k);
    error[0][k] = imbalance(elastic, 0.3 * elastic.bending(), steps, none);
    error[1][k] = imbalance(plastic, 1.2 * limit_moment(plastic), steps, share);
  }
  EXPECT_EQ(none, 0);
  EXPECT_GT(share, 0.5);
  EXPECT_LT(std::abs(error[0][0]), 3e-3);
  EXPECT_LT(std::abs(error[1][0]), 2e-4);
  // Of second order: a sixteenth with a quarter of the step.
  for (const auto& of : error) EXPECT_LT(std::abs(of[1]), std::abs(of[0]) / 8);
}

}  // namespace
}  // namespace estuary::solid
