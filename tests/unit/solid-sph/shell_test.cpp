// One row of particles as a shell: invariance, conservation, Timoshenko's beam, the exact circle, motion.
#include "shell.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <numbers>

#include "bodies.hpp"

namespace estuary::solid {
namespace {

using std::numbers::pi;

constexpr ShellSection kSteel{.thickness = 0.05,
                              .young_modulus = 2e5,
                              .shear_modulus = 8e4,
                              .shear_correction = 5.0 / 6.0,
                              .density = 7.8};

struct MadeShell {
  Body body;
  std::unique_ptr<ShellSolver> solver;
};

std::unique_ptr<MadeShell> row(const std::vector<std::array<double, 2>>& points, double spacing,
                               const ShellSection& section, bool closed = false) {
  auto made = std::make_unique<MadeShell>();
  made->body = fill_row(points, closed, spacing, section);
  made->solver = std::make_unique<ShellSolver>(made->body, std::vector<ShellSection>{section});
  return made;
}

std::unique_ptr<MadeShell> clamped_row(int links, const ShellSection& section, double length = 1) {
  auto made = std::make_unique<MadeShell>();
  const std::vector<std::array<double, 2>> points{{0, 0}, {length, 0}};
  made->body = fill_row(points, false, length / links, section);
  made->body.fixed[0] = 3 | kRotationFixed;
  made->solver = std::make_unique<ShellSolver>(made->body, std::vector<ShellSection>{section});
  return made;
}

double stiffness(const ShellSection& s) {
  return s.young_modulus * s.thickness * s.thickness * s.thickness / 12;
}

std::vector<std::array<double, 2>> arc(int points, double radius, double angle) {
  std::vector<std::array<double, 2>> result;
  for (int k = 0; k < points; ++k) {
    const double a = angle * k / (points - 1);
    result.push_back({radius * std::cos(a), radius * std::sin(a)});
  }
  return result;
}

TEST(Shell, MassesAndRotaryInertiaAreThoseOfTheLine) {
  const auto made = row({{0, 0}, {1, 0}, {1, 0.5}}, 0.1, kSteel);
  ASSERT_EQ(made->body.size(), 16U);
  double mass = 0;
  for (const double m : made->body.mass) mass += m;
  EXPECT_NEAR(mass, 1.5 * 0.05 * 7.8, 1e-14);
  State state = at_rest(made->body);
  state.history.assign(2 * made->body.size(), 0.0);
  for (std::size_t i = 0; i < made->body.size(); ++i) state.history[2 * i + 1] = 2;
  EXPECT_NEAR(made->solver->kinetic_energy(state), 0.5 * 4 * 1.5 * 7.8 * std::pow(0.05, 3) / 12, 1e-16);
}

TEST(Shell, MovedAndTurnedAsOneItCarriesNothing) {
  const auto made = row(arc(20, 1, 2.1), 0.1, kSteel);
  std::vector<double> u = test::affine(made->body, {0, -1, 1, 0}, 0.3, -0.7);
  std::vector<double> turned(2 * made->body.size(), 0.0);
  for (std::size_t i = 0; i < made->body.size(); ++i) turned[2 * i] = pi / 2;
  made->solver->set_history(turned);
  ASSERT_EQ(made->solver->evaluate(u), 0);
  for (const double f : made->solver->fields().force) EXPECT_NEAR(f / 1e4, 0, 1e-14);
  State state = at_rest(made->body);
  state.history = turned;
  for (std::size_t i = 0; i < made->body.size(); ++i)
    for (const auto& [name, value] : made->solver->quantities_of(i, state))
      if (name == "bending_moment") {
        EXPECT_NEAR(value / stiffness(kSteel), 0, 1e-13);
      }
  EXPECT_NEAR(made->solver->energy(u), 0, 1e-20);
}

TEST(Shell, ForcesAndMomentsAreMinusTheEnergysDerivativesAndConserveMomenta) {
  for (const bool closed : {false, true}) {
    auto points = arc(12, 1, closed ? 2 * pi * 11 / 12 : 2.5);
    const auto made = std::make_unique<MadeShell>();
    made->body = fill_row(points, closed, 0.3, kSteel);
    for (std::size_t i = 0; i < made->body.size(); ++i)
      made->body.fixed[i] = kRotationFixed;  // shows moments
    made->solver = std::make_unique<ShellSolver>(made->body, std::vector<ShellSection>{kSteel});
    const std::size_t n = made->body.size();
    std::vector<double> u = test::random_field(2 * n, 0.1, 3), turn = test::random_field(2 * n, 0.4, 4);
    made->solver->set_history(turn);
    ASSERT_EQ(made->solver->evaluate(u), 0);
    const std::vector<double> force = made->solver->fields().force;
    const double moments = -made->solver->held_moment();
    double scale = 0, fx = 0, fy = 0, moment = moments;
    for (std::size_t i = 0; i < n; ++i) {
      scale = std::max({scale, std::abs(force[2 * i]), std::abs(force[2 * i + 1])});
      fx += force[2 * i];
      fy += force[2 * i + 1];
      moment += (made->body.position[2 * i] + u[2 * i]) * force[2 * i + 1] -
                (made->body.position[2 * i + 1] + u[2 * i + 1]) * force[2 * i];
    }
    EXPECT_NEAR(fx / scale, 0, 1e-13);
    EXPECT_NEAR(fy / scale, 0, 1e-13);
    EXPECT_NEAR(moment / scale, 0, 1e-13);
    const auto energy = [&](const std::vector<double>& displacement, const std::vector<double>& rotation) {
      made->solver->set_history(rotation);
      made->solver->evaluate(displacement);
      return made->solver->energy(displacement);
    };
    const double e = 1e-6;
    for (std::size_t c = 0; c < 2 * n; ++c) {
      auto more = u, less = u;
      more[c] += e;
      less[c] -= e;
      EXPECT_NEAR(force[c], -(energy(more, turn) - energy(less, turn)) / (2 * e), 1e-6 * scale) << c;
    }
    // All rotations together: the sum of the moments.
    auto more = turn, less = turn;
    for (std::size_t i = 0; i < n; ++i) {
      more[2 * i] += e;
      less[2 * i] -= e;
    }
    EXPECT_NEAR(moments, -(energy(u, more) - energy(u, less)) / (2 * e), 1e-6 * scale);
  }
}

// Displacements, and rotations times the spacing, near the state of rest.
Eigen::MatrixXd stiffness_matrix(MadeShell& made, double spacing) {
  const std::size_t n = made.body.size();
  const double e = 1e-5 * spacing;
  const auto energy = [&](std::size_t a, double by_a, std::size_t b, double by_b) {
    std::vector<double> u(2 * n, 0.0), turn(2 * n, 0.0);
    for (const auto& [c, by] : {std::pair{a, by_a}, std::pair{b, by_b}})
      if (c < 2 * n)
        u[c] += by;
      else
        turn[2 * (c - 2 * n)] += by / spacing;
    made.solver->set_history(turn);
    EXPECT_EQ(made.solver->evaluate(u), 0);
    return made.solver->energy(u);
  };
  const auto size = static_cast<Eigen::Index>(3 * n);
  Eigen::MatrixXd k(size, size);
  for (std::size_t a = 0; a < 3 * n; ++a)
    for (std::size_t b = 0; b <= a; ++b) {
      const auto i = static_cast<Eigen::Index>(a), j = static_cast<Eigen::Index>(b);
      k(i, j) = k(j, i) =
          (energy(a, e, b, e) - energy(a, e, b, -e) - energy(a, -e, b, e) + energy(a, -e, b, -e)) /
          (4 * e * e);
    }
  return k;
}

// What hourglass control is for in a shell of particles: motions that cost nothing. A row of links has none
// but those of a rigid body, on straight and bent lines, open and closed.
TEST(Shell, NothingButRigidMotionsCostsNoEnergy) {
  const double spacing = 0.2;
  for (const double thickness : {0.05, 0.2})
    for (const int shape : {0, 1, 2}) {
      ShellSection section = kSteel;
      section.thickness = thickness;
      const auto made = row(shape == 0 ? std::vector<std::array<double, 2>>{{0, 0}, {1.4, 0}}
                                       : arc(8, 0.25, shape == 1 ? 2.5 : 2 * pi * 7 / 8),
                            spacing, section, shape == 2);
      ASSERT_GE(made->body.size(), 4U);
      const Eigen::VectorXd values =
          Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(stiffness_matrix(*made, spacing)).eigenvalues();
      // A wave along the whole length bends it by some t^2 of the stiffness against stretch.
      const double least = 1e-3 * std::pow(thickness / spacing, 2) * values.maxCoeff();
      for (Eigen::Index k = 0; k < 3; ++k) EXPECT_LT(std::abs(values[k]), 1e-3 * least) << shape << " " << k;
      EXPECT_GT(values[3], least) << shape << " " << thickness;
    }
}

// Tip deflection under a small force at the end, over Timoshenko's.
double tip_ratio(int links, double thickness) {
  ShellSection section = kSteel;
  section.thickness = thickness;
  const auto made = clamped_row(links, section);
  const auto tip = static_cast<std::uint32_t>(made->body.size() - 1);
  const double exact =
      1 / (3 * stiffness(section)) + 1 / (section.shear_correction * section.shear_modulus * thickness);
  const double force = 1e-3 / exact;
  Loading loading;
  loading.loads.push_back({{tip}, {0, force}, {0, force}, {}, {}});
  std::vector<double> u(2 * made->body.size(), 0.0);
  const auto report =
      made->solver->relax(u, loading, 0, {.tolerance = 1e-6, .maximum_steps = 1'000'000}, test::no_monitor);
  EXPECT_TRUE(report.converged);
  return u[2 * tip + 1] / (force * exact);
}

TEST(Shell, BendsAsTimoshenkosBeamHoweverThin) {
  // One integration point per link leaves 1 - 1/(4 n^2) of the bending, and nothing of the shear, to first
  // order.
  for (const double thickness : {0.2, 0.05, 0.01})
    for (const int links : {5, 10, 20}) {
      const double bending = 1 / (1 + 0.25 * thickness * thickness * 2e5 / (5.0 / 6.0 * 8e4));
      EXPECT_NEAR(tip_ratio(links, thickness), 1 - 0.25 * bending / (links * links), 2e-4)
          << links << " links, thickness " << thickness;
    }
}

// Rolls a clamped row up by an end moment; the rotation of its end over the exact one.
double rolled_up(int links, double turns) {
  ShellSection section = kSteel;
  section.thickness = 0.01;
  const auto made = clamped_row(links, section);
  const auto tip = static_cast<std::uint32_t>(made->body.size() - 1);
  const double angle = 2 * pi * turns;
  Loading loading;
  loading.moments.push_back({{tip}, angle * stiffness(section), {}});
  std::vector<double> u(2 * made->body.size(), 0.0);
  EXPECT_TRUE(
      made->solver->relax(u, loading, 0, {.tolerance = 1e-5, .maximum_steps = 1'000'000}, test::no_monitor)
          .converged);
  for (std::size_t i = 0; i < made->body.size(); ++i) {
    const double s = made->body.position[2 * i];
    EXPECT_NEAR(s + u[2 * i], std::sin(angle * s) / angle, 8.0 / (links * links));
    EXPECT_NEAR(u[2 * i + 1], (1 - std::cos(angle * s)) / angle, 8.0 / (links * links));
  }
  made->solver->evaluate(u);
  EXPECT_NEAR(made->solver->held_moment() / (-angle * stiffness(section)), 1, 1e-4);
  return made->solver->history()[2 * tip] / angle;
}

TEST(Shell, RollsUpToTheExactCircleUnderAnEndMoment) {
  // Every link bends alike and its frame turns with it: exact but for what the relaxation leaves.
  EXPECT_NEAR(rolled_up(24, 0.25), 1, 1e-4);
  EXPECT_NEAR(rolled_up(12, 1), 1, 1e-4);
}

TEST(Shell, SwingsWithItsOwnPeriodAndKeepsItsEnergy) {
  ShellSection section = kSteel;
  section.thickness = 0.02;
  const auto made = clamped_row(20, section);
  State state = at_rest(made->body);
  state.history = made->solver->history();
  // The first mode of a slender cantilever (Euler-Bernoulli).
  const double k = 1.8751040687, c = (std::cosh(k) + std::cos(k)) / (std::sinh(k) + std::sin(k));
  const double omega = k * k * std::sqrt(stiffness(section) / (section.density * section.thickness));
  for (std::size_t i = 1; i < made->body.size(); ++i) {
    const double s = k * made->body.position[2 * i];
    state.velocity[2 * i + 1] =
        1e-4 * omega * (std::cosh(s) - std::cos(s) - c * (std::sinh(s) - std::sin(s)));
    state.history[2 * i + 1] =
        1e-4 * omega * k * (std::sinh(s) + std::sin(s) - c * (std::cosh(s) - std::cos(s)));
  }
  const double before = made->solver->kinetic_energy(state),
               step = 0.8 * made->solver->reference_stable_step();
  const double quarter = pi / (2 * omega);
  const auto steps = static_cast<std::uint64_t>(std::ceil(quarter / step));
  made->solver->advance(state, {}, quarter, steps, 0, test::no_monitor);
  made->solver->evaluate(state.displacement);
  // At the turning point all energy is elastic.
  EXPECT_NEAR(state.displacement.back(), 2e-4, 2e-4 * 0.003);
  EXPECT_NEAR(made->solver->energy(state.displacement) / before, 1, 2e-3);
  EXPECT_LT(made->solver->kinetic_energy(state), 1e-3 * before);
  made->solver->advance(state, {}, 7 * quarter, 7 * steps, 0, test::no_monitor);
  made->solver->evaluate(state.displacement);
  EXPECT_NEAR((made->solver->energy(state.displacement) + made->solver->kinetic_energy(state)) / before, 1,
              1e-4);
}

TEST(Shell, FreeFlightKeepsMomentaToRoundOff) {
  const auto made = row(arc(15, 1, 2.5), 0.2, kSteel);
  State state = at_rest(made->body);
  state.history = test::random_field(2 * made->body.size(), 0.1, 8);
  for (std::size_t i = 0; i < made->body.size(); ++i) state.history[2 * i] = 0;
  state.velocity = test::random_field(2 * made->body.size(), 5, 9);
  const auto momenta = [&] {
    std::array<double, 3> sum{0, 0, made->solver->spin(state)};
    for (std::size_t i = 0; i < made->body.size(); ++i) {
      const double m = made->body.mass[i], vx = state.velocity[2 * i], vy = state.velocity[2 * i + 1];
      sum[0] += m * vx;
      sum[1] += m * vy;
      sum[2] += m * ((made->body.position[2 * i] + state.displacement[2 * i]) * vy -
                     (made->body.position[2 * i + 1] + state.displacement[2 * i + 1]) * vx);
    }
    return sum;
  };
  const auto before = momenta();
  const double step = 0.5 * made->solver->reference_stable_step();
  made->solver->advance(state, {}, 500 * step, 500, 0, test::no_monitor);
  const auto after = momenta();
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(after[c], before[c], 1e-11);
}

TEST(Shell, TheStableStepIsJustThat) {
  const auto made = clamped_row(10, kSteel);
  const auto grows = [&](double courant) {
    State state = at_rest(made->body);
    state.history = made->solver->history();
    for (double& v : state.history) v = 0;
    const auto noise = test::random_field(2 * made->body.size(), 1e-6, 11);
    for (std::size_t i = 1; i < made->body.size(); ++i) {
      state.velocity[2 * i] = noise[2 * i];
      state.history[2 * i + 1] = noise[2 * i + 1];
    }
    const double before = made->solver->kinetic_energy(state),
                 step = courant * made->solver->reference_stable_step();
    try {
      made->solver->advance(state, {}, 2000 * step, 2000, 0, test::no_monitor);
    } catch (const Breakdown&) {
      return true;
    }
    return !(made->solver->kinetic_energy(state) < 4 * before);
  };
  EXPECT_FALSE(grows(0.99));
  EXPECT_TRUE(grows(1.1));
}

TEST(Shell, ViscosityIsObjectiveKeepsMomentaAndOnlyTakesEnergy) {
  ShellSection section = kSteel;
  section.viscosity = {.linear = 0.2, .quadratic = 0.5, .shear = 0.2, .bending = 0.3};
  const Body body = fill_row(arc(12, 1, 2.5), false, 0.3, section);
  ShellRow row(body, {section});
  const std::size_t n = body.size();
  const std::vector<double> u = test::random_field(2 * n, 0.05, 3), turned = test::random_field(n, 0.3, 4),
                            spin = test::random_field(n, 2, 5);
  // What the velocity adds to forces and moments, and the power it takes.
  const auto drag = [&](const std::vector<double>& velocity, const std::vector<double>& rate) {
    std::vector<double> history(2 * n);
    for (std::size_t i = 0; i < n; ++i) {
      history[2 * i] = turned[i];
      history[2 * i + 1] = rate[i];
    }
    Fields without(n), with(n);
    row.evaluate(u, history, false, without);
    const std::vector<double> still = row.moments();
    row.turn(history, 0, 1, 1, true);
    row.evaluate(u, history, false, with, velocity);
    std::vector<double> result(3 * n);
    for (std::size_t c = 0; c < 2 * n; ++c) result[c] = with.force[c] - without.force[c];
    for (std::size_t i = 0; i < n; ++i) result[2 * n + i] = row.moments()[i] - still[i];
    return result;
  };
  std::vector<double> velocity = test::random_field(2 * n, 1, 6);
  const std::vector<double> force = drag(velocity, spin);
  double fx = 0, fy = 0, moment = 0, power = 0, size = 0;
  for (std::size_t i = 0; i < n; ++i) {
    fx += force[2 * i];
    fy += force[2 * i + 1];
    moment += (body.position[2 * i] + u[2 * i]) * force[2 * i + 1] -
              (body.position[2 * i + 1] + u[2 * i + 1]) * force[2 * i] + force[2 * n + i];
    power -=
        velocity[2 * i] * force[2 * i] + velocity[2 * i + 1] * force[2 * i + 1] + spin[i] * force[2 * n + i];
    size = std::max(size, std::abs(force[2 * i]));
  }
  EXPECT_GT(size, 1);
  EXPECT_NEAR(fx / size, 0, 1e-12);
  EXPECT_NEAR(fy / size, 0, 1e-12);
  EXPECT_NEAR(moment / size, 0, 1e-12);
  EXPECT_NEAR(power / row.viscous_power(), 1, 1e-10);
  EXPECT_GT(power, 0);
  // Turning as one about the origin.
  for (std::size_t i = 0; i < n; ++i) {
    velocity[2 * i] = -3 * (body.position[2 * i + 1] + u[2 * i + 1]);
    velocity[2 * i + 1] = 3 * (body.position[2 * i] + u[2 * i]);
  }
  for (const double f : drag(velocity, std::vector<double>(n, 3.0))) EXPECT_NEAR(f / size, 0, 1e-12);
}

TEST(Shell, ViscosityAndTheFilterOfNormalsCalmShortWavesAndBalanceTheEnergy) {
  for (const double thickness : {0.01, 0.2})
    for (const bool filter : {false, true})
      for (const double courant : {0.8, 0.1}) {  // stable; accurate
        ShellSection section = kSteel;
        section.thickness = thickness;
        if (filter)
          section.viscosity.normal_filter = 0.006;
        else
          section.viscosity = {.linear = 0.2, .shear = 0.2, .bending = 0.2};
        const auto made = clamped_row(20, section);
        State state = at_rest(made->body);
        state.history.assign(2 * made->body.size(), 0.0);
        // Fibres that turn to and fro from particle to particle.
        for (std::size_t i = 1; i < made->body.size(); ++i) state.history[2 * i + 1] = i % 2 == 0 ? 1 : -1;
        const double start = made->solver->kinetic_energy(state);
        const double step = courant * made->solver->reference_stable_step();
        made->solver->advance(state, {}, 1200 * step, 1200, 0, test::no_monitor);
        made->solver->set_history(state.history);
        made->solver->evaluate(state.displacement);
        const double left = made->solver->kinetic_energy(state) + made->solver->energy(state.displacement);
        EXPECT_LT(left, 0.3 * start) << thickness << filter;
        if (courant < 0.5) {
          EXPECT_NEAR((left + state.viscous_work) / start, 1, 0.03) << thickness << filter;
        }
      }
}

// A moment that is there at once, with all there is of viscosity: what it has done is the moment times the
// rotation of the end, and nothing that viscosity makes is taken for stored.
TEST(Shell, TheFilterBooksWhatAMomentDoesAndNothingThatViscosityMakes) {
  ShellSection section = kSteel;
  section.thickness = 0.1;
  section.viscosity = {.linear = 0.2, .quadratic = 1, .shear = 2, .bending = 2, .normal_filter = 0.01};
  const auto made = clamped_row(10, section);
  State state = at_rest(made->body);
  state.history.assign(2 * made->body.size(), 0.0);
  for (std::size_t i = 1; i < made->body.size(); ++i) state.history[2 * i + 1] = i % 2 == 0 ? 10 : -10;
  const double start = made->solver->kinetic_energy(state), moment = stiffness(section);
  Loading loading;
  loading.moments.push_back({.particle = {10}, .moment = moment, .factor = {}});
  const double step = 0.1 * made->solver->reference_stable_step();
  made->solver->advance(state, loading, 4000 * step, 4000, 0, test::no_monitor);
  EXPECT_GT(state.history[20], 0.1);
  EXPECT_NEAR(state.external_work / (moment * state.history[20]), 1, 1e-3);
  made->solver->set_history(state.history);
  made->solver->evaluate(state.displacement);
  const double left = made->solver->kinetic_energy(state) + made->solver->energy(state.displacement);
  EXPECT_NEAR((left + state.viscous_work - start) / state.external_work, 1, 0.01);
}

}  // namespace
}  // namespace estuary::solid
