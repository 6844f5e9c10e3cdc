// Grains as partially saturated cells: shares, balance of momentum, drag, torque, and the way through the
// participant.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>
#include <unistd.h>

#include <filesystem>
#include <random>

#include "flow_cases.hpp"
#include "fluid.hpp"
#include "solid_fraction.hpp"

namespace estuary::fluid {
namespace {

using std::numbers::pi;

TEST(SolidFraction, DiscsCoverTheirArea) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> anywhere(-0.5, 0.5);
  for (const double radius : {0.2, 0.6, 1.5, 4.3, 20.0}) {
    const double cx = anywhere(random);
    const double cy = anywhere(random);
    double area = 0;
    const int reach = static_cast<int>(radius) + 2;
    for (int y = -reach; y <= reach; ++y) {
      for (int x = -reach; x <= reach; ++x) area += disc_fraction(x - cx, y - cy, radius);
    }
    EXPECT_NEAR(area, pi * radius * radius, 1e-11 * radius * radius + 1e-13) << radius;
  }
  // A single cell, by counting points.
  const int n = 400;
  int inside = 0;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      inside += std::hypot(2.6 + (i + 0.5) / n - 0.5, 1.9 + (j + 0.5) / n - 0.5) < 3.2 ? 1 : 0;
    }
  }
  EXPECT_NEAR(disc_fraction(2.6, 1.9, 3.2), inside / static_cast<double>(n * n), 1e-4);
}

TEST(SolidFraction, SpheresCoverTheirVolume) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> anywhere(-0.5, 0.5);
  for (const double radius : {2.0, 4.3, 9.1}) {
    const std::array<double, 3> c{anywhere(random), anywhere(random), anywhere(random)};
    double volume = 0;
    const int reach = static_cast<int>(radius) + 2;
    for (int z = -reach; z <= reach; ++z) {
      for (int y = -reach; y <= reach; ++y) {
        for (int x = -reach; x <= reach; ++x) volume += sphere_fraction(x - c[0], y - c[1], z - c[2], radius);
      }
    }
    const double exact = 4.0 / 3.0 * pi * radius * radius * radius;
    EXPECT_NEAR(volume, exact, 0.01 / (radius * radius) * exact) << radius;
  }
  const int n = 80;
  for (const auto& at : {std::array<double, 3>{3.1, 0.2, 0.1}, {2.0, 2.0, 1.6}, {0.0, 0.0, -3.3}}) {
    int inside = 0;
    for (int k = 0; k < n * n * n; ++k) {
      const double x = at[0] + (k % n + 0.5) / n - 0.5;
      const double y = at[1] + (k / n % n + 0.5) / n - 0.5;
      const double z = at[2] + (k / n / n + 0.5) / n - 0.5;
      inside += x * x + y * y + z * z < 3.2 * 3.2 ? 1 : 0;
    }
    EXPECT_NEAR(sphere_fraction(at[0], at[1], at[2], 3.2), inside / static_cast<double>(n * n * n), 0.01);
  }
}

FlowSettings periodic_box(int dimension, int n, double viscosity) {
  FlowSettings settings = cases::box(n, n, viscosity, cases::all_periodic);
  if (dimension == 3) {
    settings.grid.nz = n;
    settings.grid.periodic_z = true;
    settings.sides[back].kind = settings.sides[front].kind = SideKind::periodic;
  }
  return settings;
}

Grains some_grains(int dimension, int n) {
  Grains grains;
  grains.dimension = dimension;
  for (int g = 0; g < 4; ++g) {
    // The second and third overlap, the last lies across the corner.
    const double at = g == 3 ? 0.3 : 0.2 + 0.2 * g;
    for (int axis = 0; axis < dimension; ++axis) {
      grains.centre.push_back(g == 3 ? -0.2 * axis : n * (at + 0.03 * axis));
      grains.velocity.push_back(0.02 * (g - axis));
    }
    grains.radius.push_back(0.15 * n);
    for (int turn = 0; turn < (dimension == 3 ? 3 : 1); ++turn) grains.spin.push_back(0.004 * (turn - g));
  }
  return grains;
}

TEST(Grains, TakeWhatTheFluidLoses) {
  for (const int dimension : {2, 3}) {
    for (const CollisionModel collision : {CollisionModel::trt, CollisionModel::central_moment}) {
      constexpr int n = 20;
      FlowSettings settings = periodic_box(dimension, n, 0.03);
      settings.collision = collision;
      if (collision == CollisionModel::central_moment) settings.equilibrium = EquilibriumModel::compressible;
      Flow flow(settings);
      const auto momentum = [&] {
        flow.apply_boundaries();
        std::array<double, 4> sum{};
        for (int k = 0; k < static_cast<int>(flow.grid().size()); ++k) {
          const Moments m = incoming_moments(flow.populations(), {k % n, k / n % n, k / n / n});
          sum[0] += m.momentum_x;
          sum[1] += m.momentum_y;
          sum[2] += m.momentum_z;
          sum[3] += m.excess;
        }
        return sum;
      };
      flow.place_grains(some_grains(dimension, n));
      // Loads are means by the trapezoidal rule: they balance the mean momentum of two steps.
      const auto mean_momentum = [&](int steps) {
        flow.run(static_cast<std::size_t>(steps - 1));
        auto mean = momentum();
        flow.run(1);
        const auto last = momentum();
        for (std::size_t k = 0; k < 4; ++k) mean[k] = 0.5 * (mean[k] + last[k]);
        return mean;
      };
      const auto before = mean_momentum(5);
      flow.grains().restart_loads();
      constexpr int steps = 7;
      const auto after = mean_momentum(steps);
      const GrainLoads loads = flow.grains().mean_loads();
      for (int axis = 0; axis < dimension; ++axis) {
        double force = 0;
        for (std::size_t g = 0; g < 4; ++g) {
          force += loads.force[static_cast<std::size_t>(dimension) * g + static_cast<std::size_t>(axis)];
        }
        const auto a = static_cast<std::size_t>(axis);
        EXPECT_NEAR(after[a] - before[a], -steps * force, 1e-12);
        EXPECT_GT(std::abs(force), 1e-6);
      }
      EXPECT_NEAR(after[3], before[3], 1e-11);
    }
  }
}

// A square array of discs in a slow flow: Sangani, Acrivos, Int. J. Multiphase Flow 8 (1982), drag over
// viscosity and mean velocity.
double array_drag(double share, int across, double viscosity) {
  const int n = static_cast<int>(std::lround(across / std::sqrt(4 * share / pi)));
  const double r = n * std::sqrt(share / pi);
  FlowSettings settings = periodic_box(2, n, viscosity);
  settings.force = ForceModel::guo;
  const double push = 1e-6 * viscosity;
  settings.acceleration = {push, 0, 0};
  Flow flow(settings);
  flow.place_grains({2, {0.37 + n / 2.0, 0.21 + n / 2.0}, {r}, {0, 0}, {0}});
  double mean = 0;
  for (int k = 0; k < 100; ++k) {
    flow.run(static_cast<std::size_t>(0.1 * n * n / viscosity / 10) + 10);
    Fields fields;
    flow.compute_fields(fields);
    const double now = sum_fields(fields, flow.cells(), flow.sides()).momentum_x / (n * n);
    if (std::abs(now - mean) < 1e-7 * now) break;
    mean = now;
  }
  return push * n * n / (viscosity * mean);
}

TEST(Grains, DragInASquareArrayConverges) {
  const double coarse = std::abs(array_drag(0.1, 8, 0.05) / 24.8317 - 1);
  const double fine = std::abs(array_drag(0.1, 16, 0.05) / 24.8317 - 1);
  EXPECT_LT(coarse, 0.02);
  EXPECT_LT(fine, 0.005);
  EXPECT_LT(fine, 0.35 * coarse);
  // Nothing leaks through the discs where the pores are narrow and the viscosity is high.
  EXPECT_LT(std::abs(array_drag(0.3, 16, 0.5) / 102.881 - 1), 0.03);
  EXPECT_LT(std::abs(array_drag(0.5, 16, 0.5) / 532.548 - 1), 0.11);
}

// Two discs bar the whole width of a channel between two pressures.
TEST(Grains, CoveredCellsLetLittleThrough) {
  constexpr int n = 24;
  FlowSettings settings = cases::box(
      2 * n, n, 0.3, {SideKind::pressure, SideKind::pressure, SideKind::periodic, SideKind::periodic});
  settings.sides[left].excess.assign(n, 0.01);
  settings.sides[right].excess.assign(n, 0.0);
  Flow flow(settings);
  flow.place_grains({2, {n, 0.1 * n, n, 0.6 * n}, {0.35 * n, 0.35 * n}, {0, 0, 0, 0}, {0, 0}});
  flow.run(3000);
  Fields fields;
  flow.compute_fields(fields);
  double largest = 0;
  for (const double v : fields.velocity_x) largest = std::max(largest, std::abs(v));
  EXPECT_LT(largest, 2.4e-5);  // a fifth of what diffusion through the discs would carry
  EXPECT_NEAR(fields.excess[static_cast<std::size_t>(n / 2 * 2 * n + 2)], 0.01, 1e-7);
}

// A disc that turns in a larger ring of fluid at rest far away: torque per length 4 pi mu w R^2 / (1 -
// (R/L)^2) between concentric cylinders; here the outer one is made of grains too.
TEST(Grains, TorqueOnATurningDisc) {
  constexpr double inner = 10;
  constexpr double outer = 25;
  FlowSettings settings = cases::box(64, 64, 0.1, cases::all_periodic);
  Flow flow(settings);
  Grains grains{2, {31.7, 31.4}, {inner}, {0, 0}, {1e-3}};
  // Small discs along the outer circle; their own circle is the wall, roughly.
  constexpr int count = 240;
  constexpr double small = 2.0;
  for (int n = 0; n < count; ++n) {
    const double angle = 2 * pi * n / count;
    grains.centre.insert(grains.centre.end(), {31.7 + (outer + small) * std::cos(angle),
                                               31.4 + (outer + small) * std::sin(angle)});
    grains.radius.push_back(small);
    grains.velocity.insert(grains.velocity.end(), {0, 0});
    grains.spin.push_back(0);
  }
  flow.place_grains(grains);
  flow.run(12000);
  flow.grains().restart_loads();
  flow.run(2);
  const double torque = flow.grains().mean_loads().torque[0];
  const double exact = -4 * pi * 0.1 * 1e-3 * inner * inner / (1 - inner * inner / (outer * outer));
  EXPECT_NEAR(torque, exact, 0.05 * std::abs(exact));
}

TEST(Grains, AnyNumberOfThreadsGivesTheSameBits) {
  const auto run = [](int threads) {
    omp_set_num_threads(threads);
    Flow flow(periodic_box(3, 32, 0.03));
    Grains grains = some_grains(3, 32);
    for (int step = 0; step < 6; ++step) {
      flow.place_grains(grains);
      flow.run(1);
      for (std::size_t k = 0; k < grains.centre.size(); ++k) grains.centre[k] += grains.velocity[k];
    }
    GrainLoads loads = flow.grains().mean_loads();
    loads.force.insert(loads.force.end(), loads.torque.begin(), loads.torque.end());
    return loads.force;
  };
  const auto one = run(1);
  const auto three = run(3);
  omp_set_num_threads(omp_get_num_procs());
  EXPECT_EQ(one, three);
}

}  // namespace
}  // namespace estuary::fluid
