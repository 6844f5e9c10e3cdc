// Cement as the fluid sees it: volumes against geometry, and what random accretion promises.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "cement.hpp"

namespace estuary::grains {
namespace {

constexpr double pi = std::numbers::pi;

Domain<3> unit_box(bool periodic) {
  Domain<3> domain;
  domain.to.fill(1);
  domain.periodic.fill(periodic);
  return domain;
}

CementScene cement_in_unit_box(CementScene::Model model) {
  CementScene scene;
  scene.model = model;
  scene.voxel = 0.03;
  scene.from.assign(3, 0.0);
  scene.to.assign(3, 1.0);
  return scene;
}

TEST(Cement, CoatingFillsAShellAroundEveryGrain) {
  CementScene scene = cement_in_unit_box(CementScene::Model::coating);
  scene.thickness_ratio = 0.2;
  // One of the two lies across the periodic corner.
  const std::vector<double> position{0.5, 0.5, 0.5, 0, 0, 0}, radius{0.2, 0.2};
  const Cement<3> cement = make_cement<3>(scene, unit_box(true), position, radius);
  EXPECT_EQ(cement.bodies(), 0u);
  EXPECT_DOUBLE_EQ(cement.coating, 0.04);
  const double grains = 2 * 4.0 / 3 * pi * 0.008, coated = 2 * 4.0 / 3 * pi * 0.24 * 0.24 * 0.24;
  EXPECT_NEAR(cement.saturation, (coated - grains) / (1 - grains), 0.01 * (coated - grains));
  EXPECT_NEAR(cement.porosity, 1 - coated, 0.01 * coated);
}

TEST(Cement, BridgeBetweenTouchingSpheresFillsTheNeck) {
  CementScene scene = cement_in_unit_box(CementScene::Model::bridges);
  scene.voxel = 0.015;
  scene.diameter_ratio = 0.6;
  scene.distance_ratio = 0.01;
  // The third is too far from the others.
  const std::vector<double> position{0.25, 0.25, 0.5, 0.25, 0.65, 0.5, 0.75, 0.45, 0.5},
      radius{0.2, 0.2, 0.2};
  const Cement<3> cement = make_cement<3>(scene, unit_box(false), position, radius);
  EXPECT_GE(cement.bodies(), 3u);
  // A cylinder of radius rho between the two, less the caps of the spheres in it.
  const double r = 0.2, rho = 0.12, end = std::sqrt(r * r - rho * rho), cap = r - end;
  const double neck = pi * rho * rho * 2 * cap - 2 * pi * cap * cap * (r - cap / 3);
  const double pores = 1 - 3 * 4.0 / 3 * pi * 0.008;
  EXPECT_NEAR(cement.saturation, neck / pores, 0.04 * neck / pores);  // balls leave scallops
  for (std::size_t b = 0; b < cement.bodies(); ++b) {
    EXPECT_LT(cement.owner[b], 2u);
    EXPECT_NEAR(cement.centre[3 * b], 0.25, 1e-12);
    EXPECT_NEAR(cement.radius[b], rho, 1e-12);
  }
}

TEST(Cement, BridgesReachAcrossPeriodicSides) {
  CementScene scene = cement_in_unit_box(CementScene::Model::bridges);
  scene.diameter_ratio = 0.5;
  const std::vector<double> position{0.05, 0.5, 0.5, 0.65, 0.5, 0.5}, radius{0.2, 0.2};
  const Cement<3> cement = make_cement<3>(scene, unit_box(true), position, radius);
  ASSERT_GE(cement.bodies(), 2u);
  for (std::size_t b = 0; b < cement.bodies(); ++b) {
    EXPECT_GT(cement.centre[3 * b], 0.81);
    EXPECT_LT(cement.centre[3 * b], 0.89);
  }
}

TEST(Cement, RandomVoxelsGrowFromTheGrainsToTheWantedShare) {
  CementScene scene = cement_in_unit_box(CementScene::Model::random);
  scene.voxel = 0.05;
  scene.saturation = 0.3;
  const std::vector<double> position{0.5, 0.5, 0.5}, radius{0.3};
  const Cement<3> cement = make_cement<3>(scene, unit_box(true), position, radius);
  EXPECT_NEAR(cement.saturation, 0.3, 1e-4);
  EXPECT_NEAR(4.0 / 3 * pi * std::pow(cement.radius[0], 3), std::pow(0.05, 3), 1e-12);
  // In the order of growth every voxel touches the grain or an earlier one, and none comes twice.
  std::set<std::array<int, 3>> grown;
  for (std::size_t b = 0; b < cement.bodies(); ++b) {
    std::array<int, 3> at{};
    double squared = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      at[c] = static_cast<int>(std::floor(cement.centre[3 * b + c] / 0.05));
      squared += std::pow(cement.centre[3 * b + c] - 0.5, 2);
    }
    EXPECT_GE(squared, 0.09);
    bool touches = squared < std::pow(0.3 + 0.05 + 1e-9, 2);
    for (std::size_t c = 0; c < 3 && !touches; ++c)
      for (const int step : {1, 19}) {
        auto other = at;
        other[c] = (other[c] + step) % 20;
        touches = touches || grown.contains(other);
      }
    EXPECT_TRUE(touches) << b;
    EXPECT_TRUE(grown.insert(at).second) << b;
  }
  const Cement<3> again = make_cement<3>(scene, unit_box(true), position, radius);
  EXPECT_EQ(again.centre, cement.centre);
  scene.seed = 2;
  EXPECT_NE(make_cement<3>(scene, unit_box(true), position, radius).centre, cement.centre);
}

TEST(Cement, RandomVoxelsThatCannotBeReachedAreRefused) {
  CementScene scene = cement_in_unit_box(CementScene::Model::random);
  scene.saturation = 0.5;
  EXPECT_THROW(make_cement<3>(scene, unit_box(true), {}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace estuary::grains
