// The rules at the sides of the grid against exact flows.
#include <gtest/gtest.h>

#include <complex>

#include "flow_cases.hpp"
#include "sampling.hpp"

namespace estuary::fluid {
namespace {

using namespace cases;

void randomise(Populations& populations, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> value(-0.01, 0.01);
  std::vector<double> values(populations.size());
  for (double& f : values) f = value(random);
  populations.copy_from(values);
}

struct OpenSide {
  SideName side;
  SideKind kind;
  EquilibriumModel equilibrium;
  Parity parity;
};

class EveryOpenSide : public testing::TestWithParam<std::tuple<int, SideKind, EquilibriumModel, Parity>> {};

// Whatever reaches the side from inside, its nodes have the given velocity or pressure to the last digit.
TEST_P(EveryOpenSide, ImposesItsValues) {
  const auto [number, kind, equilibrium, parity] = GetParam();
  auto kinds = all_walls;
  kinds[static_cast<std::size_t>(number)] = kind;
  auto settings = box(7, 6, 0.1, kinds);
  settings.equilibrium = equilibrium;
  Side& side = settings.sides[static_cast<std::size_t>(number)];
  const bool vertical = number == left || number == right;
  const int count = vertical ? 6 : 7;
  for (int k = 0; k < count; ++k) {
    side.velocity_x.push_back(0.02 - 0.011 * k);
    side.velocity_y.push_back(-0.03 + 0.007 * k);
    side.excess.push_back(0.05 - 0.013 * k);
  }
  Flow flow(settings);
  randomise(flow.populations(), 5);
  flow.populations().set_parity(parity);
  const Fields fields = fields_of(flow);
  for (int k = 0; k < count; ++k) {
    const int x = vertical ? (number == left ? 0 : 6) : k;
    const int y = vertical ? k : (number == bottom ? 0 : 5);
    const auto entry = static_cast<std::size_t>(k);
    const std::size_t n = at(flow, x, y);
    if (kind == SideKind::velocity) {
      EXPECT_NEAR(fields.velocity_x[n], side.velocity_x[entry], 1e-16 + 4e-16);
      EXPECT_NEAR(fields.velocity_y[n], side.velocity_y[entry], 1e-16 + 4e-16);
    } else {
      EXPECT_NEAR(fields.excess[n], side.excess[entry], 4e-16);
      EXPECT_NEAR(vertical ? fields.velocity_y[n] : fields.velocity_x[n], 0.0, 4e-16);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Sides, EveryOpenSide,
    testing::Combine(testing::Values(0, 1, 2, 3), testing::Values(SideKind::velocity, SideKind::pressure),
                     testing::Values(EquilibriumModel::incompressible, EquilibriumModel::compressible),
                     testing::Values(Parity::even, Parity::odd)));

TEST(Sides, ApplyingTheRulesTwiceChangesNothing) {
  for (const Parity parity : {Parity::even, Parity::odd}) {
    auto settings = box(9, 8, 0.1, channel);
    settings.sides[left].velocity_x.assign(8, 0.05);
    settings.sides[left].velocity_y.assign(8, 0.01);
    settings.sides[right].excess.assign(8, 0.02);
    // Corners of two open sides, one of which looks at what left its neighbours.
    settings.sides[top].kind = SideKind::outflow;
    settings.sides[top].excess.assign(9, 0.01);
    Flow flow(settings);
    const Outline body = disc(4.2, 3.1, 1.7, 12);
    flow.set_wet_surface(body.nodes(), body.connectivity);
    flow.move_wet_surface(body.positions, body.at_rest(), 1.0);
    randomise(flow.populations(), 6);
    flow.populations().set_parity(parity);
    flow.apply_boundaries();
    std::vector<double> once;
    flow.populations().copy_to(once);
    flow.apply_boundaries();
    const Fields fields = fields_of(flow);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 9; ++x) {
        for (int i = 0; flow.cells().fluid(x, y) && i < 9; ++i) {
          const auto& p = flow.populations();
          const auto place = p.incoming(p.parity(), i, p.node(x, y));
          ASSERT_EQ(p[place], once[static_cast<std::size_t>(place)]);
        }
      }
    }
  }
}

// With the magic parameter 3/16 half-way walls stand half-way for any viscosity, so nodal velocities lie on
// the parabola.
TEST(Sides, PoiseuilleBetweenHalfwayWallsIsExact) {
  for (const double viscosity : {0.02, 0.1667, 0.6}) {
    constexpr int ny = 8;
    auto settings =
        box(131, ny, viscosity, channel);  // long enough for what the open ends disturb to die out
    const double peak = 0.05;
    const auto parabola = [&](double y) { return peak * 4 * (y + 0.5) * (ny - 0.5 - y) / (ny * ny); };
    for (int y = 0; y < ny; ++y) {
      settings.sides[left].velocity_x.push_back(parabola(y));
      settings.sides[left].velocity_y.push_back(0.0);
      settings.sides[right].excess.push_back(0.0);
    }
    Flow flow(settings);
    flow.run(static_cast<std::size_t>(3000 + 200 / viscosity + 120000 * viscosity));
    const Fields fields = fields_of(flow);
    for (int x = 60; x <= 70; ++x) {
      for (int y = 0; y < ny; ++y) {
        EXPECT_NEAR(fields.velocity_x[at(flow, x, y)], parabola(y), 1e-12)
            << viscosity << ": " << x << ' ' << y;
        EXPECT_NEAR(fields.velocity_y[at(flow, x, y)], 0, 1e-12);
        const double slope = (fields.excess[at(flow, x + 1, y)] - fields.excess[at(flow, x, y)]) / 3;
        EXPECT_NEAR(slope, -8 * viscosity * peak / (ny * ny), 1e-12);
      }
    }
  }
}

// Between the nodes watches see cubic fields as they are; beyond the outermost nodes the wall's velocity.
TEST(Sampling, IsExactForCubicFieldsAndMeetsTheWalls) {
  auto settings = box(9, 8, 0.1, channel);
  settings.sides[left].velocity_x.assign(8, 0.0);
  settings.sides[left].velocity_y.assign(8, 0.0);
  settings.sides[right].excess.assign(8, 0.0);
  settings.sides[top].velocity_x.assign(19, 0.3);
  settings.sides[top].velocity_y.assign(19, -0.1);
  const Flow flow(settings);
  const auto value = [](double x, double y) { return 0.1 + x * y - 0.02 * x * x * x + 0.03 * x * y * y * y; };
  Fields fields;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 9; ++x) {
      fields.velocity_x.push_back(value(x, y));
      fields.velocity_y.push_back(-value(x, y));
      fields.excess.push_back(2 * value(x, y));
    }
  }
  const auto sample = [&](double x, double y) {
    return sample_at(fields, flow.cells(), flow.settings().sides, {x, y, 0});
  };
  for (const double x : {0.0, 0.3, 3.5, 4.0, 7.9, 8.0}) {
    for (const double y : {0.0, 0.1, 2.5, 6.6, 7.0}) {
      EXPECT_NEAR(sample(x, y).velocity[0], value(x, y), 1e-12) << x << ' ' << y;
      EXPECT_NEAR(sample(x, y).velocity[1], -value(x, y), 1e-12);
      EXPECT_NEAR(sample(x, y).excess, 2 * value(x, y), 1e-12);
    }
    EXPECT_NEAR(sample(x, -0.25).velocity[0], 0.5 * value(x, 0), 1e-12);
    EXPECT_NEAR(sample(x, -0.5).velocity[0], 0.0, 1e-12);
    EXPECT_NEAR(sample(x, 7.5).velocity[0], 0.3, 1e-12);
    EXPECT_NEAR(sample(x, 7.5).velocity[1], -0.1, 1e-12);
  }
}

TEST(Sides, CouetteUnderMovingWallIsExact) {
  for (const EquilibriumModel model : {EquilibriumModel::incompressible, EquilibriumModel::compressible}) {
    constexpr int ny = 9;
    auto settings = box(5, ny, 0.2, walls_along_x);
    settings.equilibrium = model;
    settings.sides[top].velocity_x.assign(11, 0.07);
    settings.sides[top].velocity_y.assign(11, 0.0);
    settings.sides[bottom].velocity_x.assign(11, -0.03);
    settings.sides[bottom].velocity_y.assign(11, 0.0);
    Flow flow(settings);
    flow.run(3000);
    const Fields fields = fields_of(flow);
    for (int y = 0; y < ny; ++y) {
      EXPECT_NEAR(fields.velocity_x[at(flow, 2, y)], -0.03 + 0.1 * (y + 0.5) / ny, 1e-13);
    }
  }
}

// An impulsive start excites a mode that changes sign at every node and step; an outlet must let it go.
TEST(Sides, OutletDampsTheStaggeredMode) {
  auto settings = box(60, 30, 0.1, channel);
  settings.sides[left].velocity_x.assign(30, 0.05);
  settings.sides[left].velocity_y.assign(30, 0.0);
  settings.sides[right].excess.assign(30, 0.0);
  Flow flow(settings);
  flow.run(16000);
  const Fields even = fields_of(flow);
  flow.run(1);
  const Fields odd = fields_of(flow);
  for (std::size_t k = 0; k < even.excess.size(); ++k) {
    ASSERT_NEAR(even.velocity_x[k], odd.velocity_x[k], 1e-14);
    ASSERT_NEAR(even.excess[k], odd.excess[k], 1e-14);
  }
}

// Wall at y = 0 oscillates, wall at y = 1 rests; relative error of the velocities after some periods.
double oscillating_wall_error(int ny) {
  using Complex = std::complex<double>;
  constexpr double viscosity = 0.1;
  constexpr double amplitude = 0.02;
  const double frequency = 16 * viscosity / (ny * ny);  // Womersley number 4 on the gap
  auto settings = box(3, ny, viscosity, walls_along_x);
  settings.sides[bottom].velocity_x.assign(7, amplitude);
  settings.sides[bottom].velocity_y.assign(7, 0.0);
  Flow flow(settings);
  const auto steps = static_cast<int>(std::lround(4 * 2 * std::numbers::pi / frequency));
  for (int n = 1; n <= steps; ++n) {
    flow.run(1);
    flow.sides()[bottom].velocity_x.assign(7, amplitude * std::cos(frequency * n));
  }
  const Fields fields = fields_of(flow);
  const Complex lambda = std::sqrt(Complex(0, frequency / viscosity));
  double error = 0;
  for (int y = 0; y < ny; ++y) {
    const Complex shape = std::sinh(lambda * (ny - 0.5 - y)) / std::sinh(lambda * static_cast<double>(ny));
    const double exact = amplitude * (shape * std::exp(Complex(0, frequency * steps))).real();
    error = std::max(error, std::abs(fields.velocity_x[at(flow, 1, y)] - exact));
  }
  return error / amplitude;
}

TEST(Sides, OscillatingWallIsSecondOrder) {
  const double coarse = oscillating_wall_error(10);
  const double middle = oscillating_wall_error(20);
  const double fine = oscillating_wall_error(40);
  RecordProperty("error_40", std::to_string(fine));
  EXPECT_LT(fine, 2e-3);
  EXPECT_NEAR(std::log2(coarse / middle), 2.0, 0.3);
  EXPECT_NEAR(std::log2(middle / fine), 2.0, 0.15);
}

}  // namespace
}  // namespace estuary::fluid
