// Gradings, placing, sample files, regions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <numeric>

#include "assemblies.hpp"
#include "region.hpp"
#include "sample.hpp"

namespace estuary::grains {
namespace {

double mean_power(const std::vector<double>& values, int power) {
  double sum = 0;
  for (const double v : values) sum += std::pow(v, power);
  return sum / static_cast<double>(values.size());
}

TEST(Grading, BetaLawHasItsMoments) {
  // a = b = 2, d from 0.4 to 0.8 mm: mean d^3 is 0.230 mm^3 for a law of the number, 0.188 for a law of the
  // volume.
  Grading grading{
      .law = Grading::Law::beta, .minimum = 0.2, .maximum = 0.4, .a = 2, .b = 2, .by_volume = false};
  auto diameters = draw_radii(grading, 2000, 1, 3);
  for (double& d : diameters) d *= 2;
  EXPECT_NEAR(mean_power(diameters, 1), 0.6, 1e-4);
  EXPECT_NEAR(mean_power(diameters, 3), 0.2304, 5e-4);
  grading.by_volume = true;
  diameters = draw_radii(grading, 2000, 1, 3);
  for (double& d : diameters) d *= 2;
  EXPECT_NEAR(mean_power(diameters, 3), 0.188, 1e-3);
  grading.a = 4;
  grading.b = 1;
  grading.by_volume = false;
  EXPECT_NEAR(mean_power(draw_radii(grading, 2000, 1, 3), 1), 0.2 + 0.2 * 4 / 5, 1e-4);
}

TEST(Grading, SameSeedSameRadiiOtherSeedOtherOrder) {
  const Grading grading{
      .law = Grading::Law::uniform, .minimum = 1, .maximum = 2, .a = 2, .b = 2, .by_volume = false};
  EXPECT_EQ(draw_radii(grading, 50, 3, 2), draw_radii(grading, 50, 3, 2));
  auto other = draw_radii(grading, 50, 4, 2), same = draw_radii(grading, 50, 3, 2);
  EXPECT_NE(other, same);
  std::sort(other.begin(), other.end());
  std::sort(same.begin(), same.end());
  EXPECT_EQ(other, same);
}

TEST(Spread, GrainsDoNotOverlapAndStayInTheBox) {
  GroupScene group;
  group.kind = GroupScene::Kind::spread;
  group.count = 200;
  group.from = {0, 0, 0};
  group.to = {1, 2, 3};
  group.grading = {
      .law = Grading::Law::uniform, .minimum = 0.05, .maximum = 0.1, .a = 2, .b = 2, .by_volume = false};
  group.velocity = {0, 0, 0};
  group.spin = {0, 0, 0};
  group.random_velocity = 2;
  const auto grains = place_group<3>(group);
  for (std::size_t i = 0; i < 200; ++i) {
    const auto x = load<3>(grains.position.data(), i);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_GE(x[c], group.from[c] + grains.radius[i] - 1e-12);
      EXPECT_LE(x[c], group.to[c] - grains.radius[i] + 1e-12);
    }
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GT(norm(load<3>(grains.position.data(), j) - x), grains.radius[i] + grains.radius[j]);
  }
  EXPECT_NEAR(mean_power(grains.velocity, 2), 4, 1e-12);
  group.to = {0.3, 0.3, 0.3};
  EXPECT_THROW(place_group<3>(group), std::invalid_argument);
}

TEST(SampleFile, ComesBackBitForBit) {
  const auto file =
      std::filesystem::temp_directory_path() / ("sample-" + std::to_string(::getpid()) + ".csv");
  const std::vector<double> position{0.1, 1.0 / 3, -2e-7, 5}, radius{0.25, 1.0 / 7};
  write_sample(file, 2, position, radius);
  std::vector<double> x, r;
  read_sample(file, 2, x, r);
  EXPECT_EQ(x, position);
  EXPECT_EQ(r, radius);
  for (const char* line : {"1,2\n", "1,2,-1\n", "1,nan,1\n", "1,2,1,4\n", "a,b,c\n"}) {
    std::ofstream(file) << "x,y,radius\n" << line;
    EXPECT_THROW(read_sample(file, 2, x, r), std::invalid_argument) << line;
  }
  std::filesystem::remove(file);
  EXPECT_THROW(read_sample(file, 2, x, r), std::invalid_argument);
}

TEST(Region, ShareBelowIsExact) {
  for (const int d : {2, 3}) {
    EXPECT_DOUBLE_EQ(share_below(d, 2, 0), 0.5);
    EXPECT_DOUBLE_EQ(share_below(d, 2, 3), 1);
    EXPECT_DOUBLE_EQ(share_below(d, 2, -3), 0);
  }
  EXPECT_NEAR(share_below(3, 1, 0.5), 27.0 / 32, 1e-15);
  EXPECT_NEAR(surface_share_below(2, 2, 1), 2.0 / 3, 1e-15);
  EXPECT_NEAR(surface_share_below(3, 2, 1), 0.75, 1e-15);
}

TEST(Region, StressOfAColumnIsItsWeight) {
  auto settings = test::free_space<2>(1e6, 0.3);
  settings.gravity = {0, -10};
  settings.domain.from = {0, 0};
  settings.domain.to = {0.02, 1};
  InitialGrains<2> grains;
  for (int k = 0; k < 10; ++k) test::add_grain<2>(grains, {0.01, 0.01 + 0.02 * k}, {}, 0.01);
  Wall<2> floor;
  floor.normal = {0, 1};
  floor.constants = settings.constants;
  Dynamics<2> dynamics(settings, grains, {floor});
  for (int k = 0; k < 20; ++k) dynamics.advance(0.2, 4000);
  const double weight = 10 * grains.mass[0];
  // Between the centres of grains 3 and 4, six grains lie above.
  const double low = dynamics.unwrapped(0)[1];
  (void)low;
  const auto measure = measure_region<2>(dynamics, {0, 0.072}, {0.02, 0.088}, 0);
  EXPECT_NEAR(measure.stress[1][1], 6 * weight / 0.02, 0.01 * weight / 0.02);
  EXPECT_NEAR(measure.stress[0][1], 0, 1e-9);
}

}  // namespace
}  // namespace estuary::grains
