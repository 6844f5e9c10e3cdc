// Contact between contours: forces as derivatives of an energy, balances, impacts with known outcome.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "bodies.hpp"
#include "contact.hpp"
#include "hourglass_viscosity.hpp"
#include "outline_filling.hpp"
#include "velocity_smoothing.hpp"

namespace estuary::solid {
namespace {

using test::box_of;
using test::no_monitor;

// A square, and a disc beside it that reaches `depth` into it at an angle.
struct SquareAndDisc {
  Body body;
  SquareAndDisc(double depth, double angle, double spacing = 0.05) {
    body = fill_outline({{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}, {.spacing = spacing, .density = 1000});
    const double x = 0.5 + 0.5 / std::cos(angle) * std::cos(angle) + (0.3 - depth),
                 y = 0.5 + 0.5 * std::tan(angle);
    append(body, fill_outline({circle({x, y}, 0.3, spacing)}, {.spacing = spacing, .density = 500}));
  }
};

std::vector<double> forces_of(Contact& contact, const Body& body, const std::vector<double>& u) {
  std::vector<double> force(2 * body.size(), 0.0);
  contact.add_to(u, force);
  return force;
}

TEST(Contact, TornPiecesAreNoWall) {
  const SquareAndDisc bodies(0.017, 0);
  const Body& body = bodies.body;
  Contact contact(body, {.modulus = {1e6, 2e6}});
  const std::vector<double> rest(2 * body.size(), 0.0);
  forces_of(contact, body, rest);
  ASSERT_TRUE(contact.touching());
  std::vector<std::array<std::uint32_t, 2>> right;
  const auto& outline = body.outlines[0].particle;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const std::uint32_t a = outline[k], b = outline[(k + 1) % outline.size()];
    if (body.position[2 * a] > 0.99 && body.position[2 * b] > 0.99) right.push_back({a, b});
  }
  ASSERT_GT(right.size(), 5U);
  contact.tear(right);
  for (const double f : forces_of(contact, body, rest)) EXPECT_EQ(f, 0);
  EXPECT_FALSE(contact.touching());
  contact.tear({});
  forces_of(contact, body, rest);
  EXPECT_TRUE(contact.touching());
}

TEST(Contact, ForceIsMinusTheEnergysDerivativeAndBalances) {
  const SquareAndDisc bodies(0.017, 0.3);
  const Body& body = bodies.body;
  Contact contact(body, {.modulus = {1e6, 2e6}});
  const std::vector<double> u = test::random_field(2 * body.size(), 5e-4, 3);
  const std::vector<double> force = forces_of(contact, body, u);
  ASSERT_TRUE(contact.touching());
  EXPECT_GT(contact.energy(), 0);
  double fx = 0, fy = 0, moment = 0, size = 0;
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double x = body.position[2 * i] + u[2 * i], y = body.position[2 * i + 1] + u[2 * i + 1];
    fx += force[2 * i];
    fy += force[2 * i + 1];
    moment += x * force[2 * i + 1] - y * force[2 * i];
    size += std::abs(force[2 * i]) + std::abs(force[2 * i + 1]);
  }
  EXPECT_NEAR(fx, 0, 1e-14 * size);
  EXPECT_NEAR(fy, 0, 1e-14 * size);
  EXPECT_NEAR(moment, 0, 1e-14 * size);
  EXPECT_NEAR(contact.body_force()[0], -contact.body_force()[2], 1e-14 * size);
  EXPECT_LT(contact.body_force()[0], 0);
  const std::vector<double> direction = test::random_field(2 * body.size(), 1, 4);
  const double step = 1e-8;
  std::vector<double> there = u;
  double power = 0;
  for (std::size_t c = 0; c < u.size(); ++c) {
    there[c] = u[c] + step * direction[c];
    power += force[c] * direction[c];
  }
  forces_of(contact, body, there);
  const double ahead = contact.energy();
  for (std::size_t c = 0; c < u.size(); ++c) there[c] = u[c] - step * direction[c];
  forces_of(contact, body, there);
  EXPECT_NEAR((contact.energy() - ahead) / (2 * step), power, 1e-5 * std::abs(power));
}

// Under even depth the pressure is even: corners carry their share, as a rigid punch of the same length
// wants.
TEST(Contact, OfFacingSidesIsEvenAndGoesThroughCorners) {
  Body body = fill(box_of(1, 0.4, 0.1), 1000, 0.95, false);
  Body other = fill(box_of(0.5, 0.4, 0.1), 1000, 0.95, false);
  for (std::size_t i = 0; i < other.size(); ++i) other.position[2 * i] += 1 - 0.004;
  append(body, other);
  Contact contact(body, {.modulus = {5e5, 5e5}});
  const std::vector<double> force = forces_of(contact, body, std::vector<double>(2 * body.size(), 0.0));
  const double pressure = 5e5 * 0.004 / 0.1;
  EXPECT_NEAR(contact.body_force()[2], pressure * 0.4, 1e-9);
  EXPECT_NEAR(contact.body_force()[3], 0, 1e-9);
  for (std::size_t i = 0; i < body.size(); ++i) {
    const bool right_side = body.member[i] == 0 && std::abs(body.position[2 * i] - 1) < 1e-9;
    if (!right_side) continue;
    const double y = body.position[2 * i + 1];
    const bool corner = y < 1e-9 || y > 0.4 - 1e-9;
    EXPECT_NEAR(force[2 * i], -pressure * 0.1 * (corner ? 0.5 : 1), 1e-9) << y;
  }
}

TEST(Contact, IsSilentWhileApartAndLoudWhenLost) {
  const SquareAndDisc apart(-0.01, 0.2);
  Contact contact(apart.body, {.modulus = {1e6, 1e6}});
  for (const double f : forces_of(contact, apart.body, std::vector<double>(2 * apart.body.size(), 0.0)))
    EXPECT_EQ(f, 0);
  EXPECT_FALSE(contact.touching());
  const SquareAndDisc deep(0.06, 0.2);
  Contact too_deep(deep.body, {.modulus = {1e6, 1e6}});
  EXPECT_THROW(forces_of(too_deep, deep.body, std::vector<double>(2 * deep.body.size(), 0.0)), ContactLost);
}

struct Pair {
  Body body;
  std::unique_ptr<Solver> solver;
  Loading loading;
  State state;
};

// Two bodies of unit wave speed; contact with the wave modulus.
std::unique_ptr<Pair> pair_of(Body first, const Body& second, double viscosity = 0) {
  auto pair = std::make_unique<Pair>();
  pair->body = std::move(first);
  append(pair->body, second);
  SolverOptions options;
  for (int k = 0; k < 2; ++k) {
    Material material{
        .constants = ElasticConstants::from(1.0, 0.0, Plane::strain), .viscosity = {}, .plasticity = {}};
    material.viscosity = {.linear = viscosity,
                          .quadratic = 0,
                          .sound_speed = 1,
                          .smoothing_length = pair->body.smoothing_length,
                          .density = 1};
    options.materials.push_back(material);
  }
  options.stabilisation = 0.02;
  pair->solver = make_solver(LawName::saint_venant_kirchhoff, pair->body, options);
  pair->loading.contact = {.modulus = {1.0, 1.0}};
  pair->state = at_rest(pair->body);
  return pair;
}

TEST(Contact, OfCollidingBarsLastsTwoTransitsAtThePressureOfTheWave) {
  const double d = 0.02, speed = 1e-3;
  Body left = fill(box_of(1, 0.1, d), 1, 0.95, false);
  for (std::size_t i = 0; i < left.size(); ++i) left.position[2 * i] -= 1;
  const auto bars = pair_of(left, fill(box_of(1, 0.1, d), 1, 0.95, false), 0.2);
  for (std::size_t i = 0; i < bars->body.size(); ++i)
    bars->state.velocity[2 * i] = bars->body.member[i] == 0 ? speed : -speed;
  Contact contact(bars->body, bars->loading.contact);
  double plateau = 0;
  for (int window = 1; window <= 240; ++window) {
    bars->solver->advance(bars->state, bars->loading, 0.01, 2, 0, no_monitor);
    std::vector<double> force(2 * bars->body.size());
    contact.add_to(bars->state.displacement, force);
    if (window > 50 && window <= 150) plateau += contact.body_force()[0] / 100;
  }
  EXPECT_NEAR(plateau, -speed * 0.1, 0.01 * speed * 0.1);
  EXPECT_NEAR(bars->state.contact_time, 2, 0.06);
  EXPECT_FALSE(contact.touching());
  double momentum = 0, left_momentum = 0;
  for (std::size_t i = 0; i < bars->body.size(); ++i) {
    const double p = bars->body.mass[i] * bars->state.velocity[2 * i];
    momentum += p;
    if (bars->body.member[i] == 0) left_momentum += p;
  }
  EXPECT_NEAR(momentum, 0, 1e-17);
  EXPECT_NEAR(left_momentum, -0.1 * speed, 0.035 * 0.1 * speed);
}

// A rigid disc thrown at a held rigid wall bounces as an undamped spring does, with its energy and its spin.
TEST(Contact, LetsARigidDiscBounceWithItsEnergy) {
  const auto rigid = [](std::vector<Polygon> loops, double mass, double inertia, bool held) {
    Body body = place_on_contours(loops, 0.02);
    body.smoothing_length = 0.019;
    body.fixed.assign(body.size(), 7);
    const AreaMoments area = area_moments(loops);
    body.rigid.push_back({.last = static_cast<std::uint32_t>(body.size()),
                          .centre = area.centroid,
                          .mass = mass,
                          .inertia = inertia,
                          .held = {held, held, held}});
    return body;
  };
  Body body = rigid({circle({0, 0}, 0.2, 0.02)}, 2, 0.04, false);
  append(body, rigid({{{0.201, -1}, {0.4, -1}, {0.4, 1}, {0.201, 1}}}, 1, 1, true));
  SolverOptions options;
  options.materials.push_back(
      {.constants = ElasticConstants::from(1.0, 0.0, Plane::strain), .viscosity = {}, .plasticity = {}});
  const auto solver = make_solver(LawName::saint_venant_kirchhoff, body, options);
  Loading loading;
  loading.contact = {.modulus = {0, 0}, .rigid_modulus = 1e4};
  State state = at_rest(body);
  state.rigid[3] = 0.5;
  state.rigid[4] = 0.1;
  for (int window = 0; window < 40 && state.rigid[3] > -0.499; ++window)
    solver->advance(state, loading, 0.02, 400, 0, no_monitor);
  EXPECT_NEAR(state.rigid[3], -0.5, 2e-3);
  // Smooth but for the facets, which are turned by up to pi / 63 from the tangent: a tenth of what one could
  // do.
  EXPECT_NEAR(state.rigid[4], 0.1, 0.1 * 2 * 0.5 * std::numbers::pi / 63);
  const double energy = 0.5 * 2 * (state.rigid[3] * state.rigid[3] + state.rigid[4] * state.rigid[4]) +
                        0.5 * 0.04 * state.rigid[5] * state.rigid[5];
  EXPECT_NEAR(energy, 0.26, 2e-4 * 0.26);
  EXPECT_GT(state.contact_time, 0);
}

TEST(VelocitySmoothing, KeepsMomentumAndUniformMotionAndTakesEnergy) {
  const auto made = test::assemble(box_of(1, 0.4, 0.1), {}, {.order = Order::quadratic});
  VelocitySmoothing smoothing(made->body, made->solver->pairs(), Kernel::cubic_spline, 0.3);
  std::vector<double> uniform(2 * made->body.size(), 3.0);
  EXPECT_NEAR(smoothing.apply(uniform), 0, 1e-12);
  for (const double v : uniform) EXPECT_NEAR(v, 3, 1e-13);
  std::vector<double> velocity = test::random_field(2 * made->body.size(), 1, 9);
  const auto sums = [&] {
    std::array<double, 2> s{};
    for (std::size_t i = 0; i < made->body.size(); ++i) {
      s[0] += made->body.mass[i] * velocity[2 * i];
      s[1] += made->body.mass[i] * (std::pow(velocity[2 * i], 2) + std::pow(velocity[2 * i + 1], 2)) / 2;
    }
    return s;
  };
  const auto before = sums();
  const double taken = smoothing.apply(velocity);
  const auto after = sums();
  EXPECT_NEAR(after[0], before[0], 1e-13 * 400);
  EXPECT_GT(taken, 0.1 * before[1]);
  EXPECT_NEAR(after[1] + taken, before[1], 1e-12 * before[1]);
}

TEST(HourglassViscosity, ResistsOnlyWhatHasFlowedAndIsNotAffine) {
  const auto made =
      test::assemble(box_of(1, 0.4, 0.1), {.plasticity = {.strain = {0, 1}, .yield = {1e3, 1e3}}},
                     {.stabilisation = 0.1, .law = LawName::j2_plasticity});
  const Body& body = made->body;
  HourglassViscosity viscosity(body, made->solver->pairs(), {0.01});
  Fields fields(body.size());
  fields.spring_share.assign(body.size(), 1.0);
  std::vector<double> velocity = test::random_field(2 * body.size(), 1, 5);
  EXPECT_EQ(viscosity.add_to(velocity, fields), 0);
  for (std::size_t i = 0; i < body.size(); i += 2) fields.spring_share[i] = kFlowedShare;
  const double power = viscosity.add_to(velocity, fields);
  EXPECT_GT(power, 0);
  double fx = 0, moment = 0, work = 0, size = 0;
  for (std::size_t i = 0; i < body.size(); ++i) {
    fx += fields.force[2 * i];
    moment += body.position[2 * i] * fields.force[2 * i + 1] - body.position[2 * i + 1] * fields.force[2 * i];
    work += velocity[2 * i] * fields.force[2 * i] + velocity[2 * i + 1] * fields.force[2 * i + 1];
    size += std::abs(fields.force[2 * i]);
  }
  EXPECT_NEAR(fx, 0, 1e-13 * size);
  EXPECT_NEAR(moment, 0, 1e-13 * size);
  EXPECT_NEAR(work, -power, 1e-12 * power);
  for (std::size_t i = 0; i < body.size(); ++i) {
    velocity[2 * i] = 2 - 0.3 * body.position[2 * i] + 0.9 * body.position[2 * i + 1];
    velocity[2 * i + 1] = 1 + 0.4 * body.position[2 * i];
  }
  fields.force.assign(fields.force.size(), 0.0);
  EXPECT_NEAR(viscosity.add_to(velocity, fields), 0, 1e-15 * power);
  for (const double f : fields.force) EXPECT_NEAR(f, 0, 1e-12 * size);
}

}  // namespace
}  // namespace estuary::solid
