// The step itself, against a plain implementation written from the textbook, and its conservation and
// symmetry properties.
#include <gtest/gtest.h>
#include <omp.h>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

using namespace cases;

// Two arrays, full populations, collide then stream then boundary rules; open left and right sides by the
// formulas written out side by side, walls half-way.
class PlainChannel {
public:
  PlainChannel(const FlowSettings& settings, const Fields& start)
      : s_(settings), f_(nodes() * 9), next_(nodes() * 9) {
    for (int y = 0; y < s_.grid.ny; ++y) {
      for (int x = 0; x < s_.grid.nx; ++x) {
        const auto k = static_cast<std::size_t>(y * s_.grid.nx + x);
        const double rho = 1 + start.excess[k];
        for (int i = 0; i < 9; ++i)
          f_[index(x, y, i)] = feq(i, rho, start.velocity_x[k], start.velocity_y[k]);
      }
    }
    stream();
  }

  void step() {
    for (int y = 0; y < s_.grid.ny; ++y) {
      for (int x = 0; x < s_.grid.nx; ++x) collide(x, y);
    }
    stream();
  }

  [[nodiscard]] double incoming(int x, int y, int i) const { return f_[index(x, y, i)]; }

private:
  [[nodiscard]] std::size_t nodes() const { return static_cast<std::size_t>(s_.grid.nx * s_.grid.ny); }
  [[nodiscard]] std::size_t index(int x, int y, int i) const {
    return static_cast<std::size_t>((y * s_.grid.nx + x) * 9 + i);
  }
  [[nodiscard]] double feq(int i, double rho, double ux, double uy) const {
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
    const double w = D2Q9::weight[static_cast<std::size_t>(i)];
    const double cu = c[0] * ux + c[1] * uy;
    const double flow = 3 * cu + 4.5 * cu * cu - 1.5 * (ux * ux + uy * uy);
    return s_.equilibrium == EquilibriumModel::compressible ? w * rho * (1 + flow) : w * (rho + flow);
  }
  void collide(int x, int y) {
    double rho = 0, jx = 0, jy = 0;
    std::array<double, 9> f{};
    for (int i = 0; i < 9; ++i) {
      f[static_cast<std::size_t>(i)] = f_[index(x, y, i)];
      rho += f[static_cast<std::size_t>(i)];
      jx += D2Q9::velocity[static_cast<std::size_t>(i)][0] * f[static_cast<std::size_t>(i)];
      jy += D2Q9::velocity[static_cast<std::size_t>(i)][1] * f[static_cast<std::size_t>(i)];
    }
    const double inverse = s_.equilibrium == EquilibriumModel::compressible ? 1 / rho : 1.0;
    for (int i = 0; i < 9; ++i) {
      const int o = D2Q9::opposite[static_cast<std::size_t>(i)];
      const double e = feq(i, rho, jx * inverse, jy * inverse);
      const double eo = feq(o, rho, jx * inverse, jy * inverse);
      const double fi = f[static_cast<std::size_t>(i)];
      const double fo = f[static_cast<std::size_t>(o)];
      const double odd_rate = s_.collision == CollisionModel::bgk ? s_.rates.even : s_.rates.odd;
      f_[index(x, y, i)] =
          fi - s_.rates.even * ((fi + fo) / 2 - (e + eo) / 2) - odd_rate * ((fi - fo) / 2 - (e - eo) / 2);
    }
  }
  void stream() {
    const int nx = s_.grid.nx;
    const int ny = s_.grid.ny;
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        for (int i = 0; i < 9; ++i) {
          const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
          int sx = x - c[0];
          const int sy = y - c[1];
          if (s_.grid.periodic_x) sx = (sx + nx) % nx;
          double& to = next_[index(x, y, i)];
          if (sy < 0 || sy >= ny || sx < 0 || sx >= nx) {
            const int o = D2Q9::opposite[static_cast<std::size_t>(i)];
            to = f_[index(x, y, o)];
            if (sy >= ny && !s_.sides[top].velocity_x.empty()) {
              to += 6 * D2Q9::weight[static_cast<std::size_t>(i)] * c[0] * s_.sides[top].velocity_x[0];
            }
          } else {
            to = f_[index(sx, sy, i)];
          }
        }
      }
    }
    f_.swap(next_);
    for (int y = 0; y < ny; ++y) {
      if (s_.sides[left].kind == SideKind::velocity) inlet(y);
      if (s_.sides[right].kind == SideKind::pressure) outlet(y);
    }
  }
  void inlet(int y) {
    const auto f = [&](int i) -> double& { return f_[index(0, y, i)]; };
    const double ux = s_.sides[left].velocity_x[static_cast<std::size_t>(y)];
    const double uy = s_.sides[left].velocity_y[static_cast<std::size_t>(y)];
    double rho = (f(0) + f(2) + f(4) + 2 * (f(3) + f(6) + f(7))) / (1 - ux);
    if (s_.equilibrium == EquilibriumModel::incompressible) rho = 1;
    f(1) = f(3) + 2.0 / 3 * rho * ux;
    f(5) = f(7) - (f(2) - f(4)) / 2 + rho * ux / 6 + rho * uy / 2;
    f(8) = f(6) + (f(2) - f(4)) / 2 + rho * ux / 6 - rho * uy / 2;
  }
  void outlet(int y) {
    const auto f = [&](int i) -> double& { return f_[index(s_.grid.nx - 1, y, i)]; };
    const double rho = 1 + s_.sides[right].excess[static_cast<std::size_t>(y)];
    double inner_rho = 0, jx = 0, jy = 0;
    for (int i = 0; i < 9; ++i) {
      const double inner = f_[index(s_.grid.nx - 2, y, i)];
      inner_rho += inner;
      jx += D2Q9::velocity[static_cast<std::size_t>(i)][0] * inner;
      jy += D2Q9::velocity[static_cast<std::size_t>(i)][1] * inner;
    }
    const double inverse = s_.equilibrium == EquilibriumModel::compressible ? 1 / inner_rho : 1.0;
    for (int i = 0; i < 9; ++i) {
      f(i) = feq(i, rho, jx * inverse, 0) + f_[index(s_.grid.nx - 2, y, i)] -
             feq(i, inner_rho, jx * inverse, jy * inverse);
    }
  }

  FlowSettings s_;
  std::vector<double> f_;
  std::vector<double> next_;
};

double largest_difference(const Flow& flow, const PlainChannel& plain) {
  double largest = 0;
  const auto& p = flow.populations();
  for (int y = 0; y < p.ny(); ++y) {
    for (int x = 0; x < p.nx(); ++x) {
      for (int i = 0; i < 9; ++i) {
        const double stored =
            p[p.incoming(p.parity(), i, p.node(x, y))] + D2Q9::weight[static_cast<std::size_t>(i)];
        largest = std::max(largest, std::abs(stored - plain.incoming(x, y, i)));
      }
    }
  }
  return largest;
}

struct Variant {
  CollisionModel collision;
  EquilibriumModel equilibrium;
};

class EveryVariant : public testing::TestWithParam<Variant> {};

TEST_P(EveryVariant, InPlaceStepsEqualTwoArraysStepByStep) {
  for (const bool periodic : {true, false}) {
    auto settings = box(13, 9, 0.04, periodic ? walls_along_x : channel);
    settings.collision = GetParam().collision;
    settings.equilibrium = GetParam().equilibrium;
    settings.sides[top].velocity_x.assign(2 * 13 + 1, periodic ? 0.05 : 0.0);
    settings.sides[top].velocity_y.assign(2 * 13 + 1, 0.0);
    for (int y = 0; y < 9; ++y) {
      settings.sides[left].velocity_x.push_back(0.03 + 0.001 * y);
      settings.sides[left].velocity_y.push_back(0.004 - 0.001 * y);
      settings.sides[right].excess.push_back(0.002 * y);
    }
    const Fields fields = uneven_fields(13, 9, 0.05);
    Flow flow(settings);
    start(flow, fields);
    PlainChannel plain(settings, fields);
    ASSERT_LT(largest_difference(flow, plain), 1e-14);
    for (int n = 1; n <= 40; ++n) {
      flow.run(1);
      flow.apply_boundaries();
      plain.step();
      ASSERT_LT(largest_difference(flow, plain), 2e-14)
          << "step " << n << (periodic ? " periodic" : " channel");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Stepping, EveryVariant,
                         testing::Values(Variant{CollisionModel::trt, EquilibriumModel::incompressible},
                                         Variant{CollisionModel::trt, EquilibriumModel::compressible},
                                         Variant{CollisionModel::bgk, EquilibriumModel::incompressible},
                                         Variant{CollisionModel::bgk, EquilibriumModel::compressible}));

TEST(Stepping, PeriodicBoxKeepsMassAndMomentum) {
  auto settings = box(16, 12, 0.02, all_periodic);
  settings.equilibrium = EquilibriumModel::compressible;
  Flow flow(settings);
  start(flow, uneven_fields(16, 12, 0.08));
  const auto totals = [&] {
    Moments sum;
    flow.apply_boundaries();
    for (int y = 0; y < 12; ++y) {
      for (int x = 0; x < 16; ++x) {
        const Moments m = incoming_moments(flow.populations(), {x, y});
        sum.excess += m.excess;
        sum.momentum_x += m.momentum_x;
        sum.momentum_y += m.momentum_y;
      }
    }
    return sum;
  };
  const Moments before = totals();
  flow.run(501);
  const Moments after = totals();
  EXPECT_NEAR(after.excess, before.excess, 1e-13);
  EXPECT_NEAR(after.momentum_x, before.momentum_x, 1e-12);
  EXPECT_NEAR(after.momentum_y, before.momentum_y, 1e-12);
}

TEST(Stepping, ClosedBoxWithMovingLidKeepsMass) {
  auto settings = box(15, 15, 0.02, all_walls);
  settings.sides[top].velocity_x.assign(31, 0.08);
  settings.sides[top].velocity_y.assign(31, 0.0);
  Flow flow(settings);
  start(flow, uneven_fields(15, 15, 0.03));
  const double before = sum_fields(fields_of(flow), flow.cells(), flow.sides()).excess;
  flow.run(500);
  EXPECT_NEAR(sum_fields(fields_of(flow), flow.cells(), flow.sides()).excess, before, 1e-13);
}

TEST(Stepping, SameBitsForAnyNumberOfThreads) {
  const int threads_before = omp_get_max_threads();
  std::vector<std::vector<double>> results;
  for (const int threads : {1, 2, 3}) {
    omp_set_num_threads(threads);
    auto settings = box(311, 93, 0.01, channel);
    settings.sides[left].velocity_x.assign(93, 0.05);
    settings.sides[left].velocity_y.assign(93, 0.0);
    settings.sides[right].excess.assign(93, 0.0);
    Flow flow(settings);
    const Outline body = disc(60.3, 41.2, 14.1, 90);
    flow.set_wet_surface(body.nodes(), body.connectivity);
    flow.move_wet_surface(body.positions, body.at_rest(), 1.0);
    start(flow, uneven_fields(311, 93, 0.05));
    flow.run(101);
    results.emplace_back();
    flow.populations().copy_to(results.back());
    const auto sums = sum_fields(fields_of(flow), flow.cells(), flow.sides());
    results.back().push_back(sums.kinetic_energy);
    results.back().push_back(flow.wet_links().force(flow.populations()).x);
  }
  omp_set_num_threads(threads_before);
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

// Error of the decaying vortices after a fixed physical time, with time step proportional to the spacing
// squared.
double taylor_green_error(int n) {
  auto settings = box(n, n, 0.05, all_periodic);
  const double k = 2 * std::numbers::pi / n;
  const double speed = 0.4 / n;
  const auto exact = [&](double t) {
    Fields fields;
    const double decay = std::exp(-2 * 0.05 * k * k * t);
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        fields.velocity_x.push_back(-speed * decay * std::cos(k * x) * std::sin(k * y));
        fields.velocity_y.push_back(speed * decay * std::sin(k * x) * std::cos(k * y));
        fields.excess.push_back(-0.75 * speed * speed * decay * decay *
                                (std::cos(2 * k * x) + std::cos(2 * k * y)));
      }
    }
    return fields;
  };
  Flow flow(settings);
  start(flow, exact(0));
  const std::size_t steps = static_cast<std::size_t>(n) * static_cast<std::size_t>(n) / 4;
  flow.run(steps);
  const Fields now = fields_of(flow);
  const Fields reference = exact(static_cast<double>(steps));
  double error = 0;
  double norm = 0;
  for (std::size_t m = 0; m < now.excess.size(); ++m) {
    error += std::pow(now.velocity_x[m] - reference.velocity_x[m], 2) +
             std::pow(now.velocity_y[m] - reference.velocity_y[m], 2);
    norm += std::pow(reference.velocity_x[m], 2) + std::pow(reference.velocity_y[m], 2);
  }
  return std::sqrt(error / norm);
}

TEST(Stepping, TaylorGreenVorticesAreSecondOrder) {
  const double coarse = taylor_green_error(16);
  const double middle = taylor_green_error(32);
  const double fine = taylor_green_error(64);
  RecordProperty("error_64", std::to_string(fine));
  EXPECT_LT(fine, 2e-3);
  EXPECT_NEAR(std::log2(coarse / middle), 2.0, 0.2);
  EXPECT_NEAR(std::log2(middle / fine), 2.0, 0.1);
}

}  // namespace
}  // namespace estuary::fluid
