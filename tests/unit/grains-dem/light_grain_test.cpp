// A grain in an imitated fluid that answers its acceleration one window late with an added mass, as explicit
// exchange does: virtual mass keeps grains of any density stable and leaves their motion alone.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "grains.hpp"

namespace estuary::grains {
namespace {

constexpr double kWindow = 1e-4;

constexpr double kDisplaced = 1000 * std::numbers::pi * 1e-6;  // kg/m

// A disc of `density` [fluid densities]; keys of [coupling] and of the tables that differ.
std::string disc(double density, const std::string& of_fluid, const std::string& of_grains_fluid,
                 const std::string& gravity = "[0, 0]", const std::string& more = "",
                 const std::string& scheme = "serial-explicit") {
  return "dimension = 2\n[coupling]\nmode = \"transient\"\nscheme = \"" + scheme +
         "\"\nwindow = 1e-4\nend_time = 1.0\n[fluid]\n" + of_fluid +
         "\n[grains]\nnormal_stiffness = 1e4\nrestitution = 0.5\ngravity = " + gravity +
         "\ndensity = " + std::to_string(1000 * density) + "\n[grains.fluid]\ndensity = 1000\n" +
         of_grains_fluid + "\n[[grains.group]]\npositions = [[0.0, 0.0]]\nradius = 0.001\n" + more;
}

// Velocities after each of `windows` windows under `force`, which is told of the last two of them.
template <class Force>
std::vector<std::array<double, 2>> velocities(const std::string& text, int windows, const Force& force) {
  Scene scene = Scene::parse(text, "scene.toml");
  Grains grains;
  grains.configure(scene, "grains");
  EXPECT_TRUE(scene.problems().empty());
  const auto folder = std::filesystem::temp_directory_path() / ("grains-light-" + std::to_string(::getpid()));
  ProgressBoard board;
  v1::Exchange states = grains.start({}, folder);
  std::vector<std::array<double, 2>> found;
  std::array<double, 2> before{}, now{};
  for (int w = 0; w < windows && std::abs(now[1]) < 1e3; ++w) {
    v1::Exchange inputs;
    auto& forces = *inputs.mutable_grain_forces();
    for (const double part : force(w, before, now)) forces.add_force(part);
    forces.add_torque(0);
    states = grains
                 .advance({.number = static_cast<std::uint64_t>(w + 1),
                           .iteration = 1,
                           .mode = Mode::transient,
                           .time = w * kWindow,
                           .duration = kWindow},
                          inputs, board)
                 .outputs;
    grains.accept();
    before = now;
    now = {states.grain_states().velocity(0), states.grain_states().velocity(1)};
    found.push_back(now);
  }
  std::filesystem::remove_all(folder);
  return found;
}

// Velocity after `windows` windows of a disc under weight, buoyancy, linear drag and the added mass of one
// displaced mass. `density` is in fluid densities.
double velocity(double density, const std::string& virtual_mass, int windows, double drag,
                const std::string& more = "", double* fastest = nullptr) {
  const auto found =
      velocities(disc(density, "", virtual_mass, "[0, -10]", more), windows,
                 [&](int, const std::array<double, 2>& before, const std::array<double, 2>& now) {
                   return std::array{0.0, -drag * now[1] - kDisplaced * (now[1] - before[1]) / kWindow};
                 });
  if (fastest)
    for (const auto& v : found) *fastest = std::max(*fastest, std::abs(v[1]));
  return found.back()[1];
}

TEST(LightGrain, FollowsItsEquationOfMotion) {
  const double displaced = kDisplaced, drag = 1.0;
  for (const double density : {0.01, 0.1, 0.5, 0.9, 1.1}) {
    // (m + m_f) dv/dt = (m_f - m) g - drag v.
    const double rate = drag / ((density + 1) * displaced);
    const double last = (1 - density) * displaced * 10 / drag;
    for (const int windows : {30, 100, 2000}) {
      const double exact = last * (1 - std::exp(-rate * windows * kWindow));
      EXPECT_NEAR(velocity(density, "", windows, drag), exact, 0.03 * std::abs(last))
          << density << ' ' << windows;
    }
    EXPECT_NEAR(velocity(density, "", 2000, drag), last, 1e-6 * std::abs(last)) << density;
  }
}

TEST(LightGrain, IsNotThrownBackFasterThanItCame) {
  // Rises against a lid and comes to rest there.
  for (const double density : {0.1, 0.5, 0.9}) {
    const double displaced = kDisplaced, drag = 1.0;
    const double last = (1 - density) * displaced * 10 / drag;
    double fastest = 0;
    const double end =
        velocity(density, "", 6000, drag,
                 "[[grains.wall]]\nname = \"lid\"\npoint = [0, 0.0015]\nnormal = [0, -1]\n", &fastest);
    EXPECT_LT(fastest, 1.02 * last) << density;
    EXPECT_NEAR(end, 0, 0.02 * last) << density;
  }
}

TEST(LightGrain, GrowsWithoutVirtualMass) {
  EXPECT_THROW(velocity(0.5, "virtual_mass = 0", 200, 1.0), Diverged);
}

TEST(LightGrain, HeavyGrainsAreLeftAlone) {
  EXPECT_EQ(velocity(2.5, "", 50, 0.1), velocity(2.5, "virtual_mass = 0", 50, 0.1));
  EXPECT_NE(velocity(2.5, "virtual_mass = 1", 50, 0.1), velocity(2.5, "virtual_mass = 0", 50, 0.1));
}

// Without weight, under forces 1, 2, 3, ... N of window after window: momentum after the last.
double momentum(const std::string& lead, int windows) {
  const auto force = [](int w, const auto&, const auto&) { return std::array{w + 1.0, 0.0}; };
  return 5 * kDisplaced * velocities(disc(5, "", lead), windows, force).back()[0];
}

TEST(Lead, CarriesForcesOnByWindows) {
  // The first has none before it; F_n + lead (F_n - F_(n-1)) = n + lead after it.
  for (const int windows : {1, 2, 7}) {
    const double sum = 0.5 * windows * (windows + 1);
    EXPECT_NEAR(momentum("", windows), sum * kWindow, 1e-12);
    EXPECT_NEAR(momentum("lead = 0.5", windows), (sum + 0.5 * (windows - 1)) * kWindow, 1e-12);
    EXPECT_NEAR(momentum("lead = 1", windows), (sum + windows - 1) * kWindow, 1e-12);
  }
}

std::string warned(const std::string& of_fluid, double density) {
  Scene scene = Scene::parse(disc(density, "spacing = 1e-4\n" + of_fluid, ""), "scene.toml");
  Grains grains;
  const Plan plan = grains.configure(scene, "grains");
  EXPECT_TRUE(scene.problems().empty());
  std::string all;
  for (const std::string& warning : plan.warnings) all += warning;
  return all;
}

TEST(Lead, WarnsWhereSoundMayGrow) {
  const std::string every = "time_step = 1e-4\n", fifth = "time_step = 2e-5\n",
                    links = "grains = \"interpolated\"\n";
  for (const double density : {0.5, 1.0, 2.5}) EXPECT_EQ(warned(every + links, density), "");
  EXPECT_EQ(warned(every, 1.0), "");
  EXPECT_NE(warned(every, 0.5).find("lighter than 0.9 of the fluid"), std::string::npos);
  for (const std::string& rule : {std::string(), links}) {
    EXPECT_NE(warned(fifth + rule, 1.0).find("5 steps of the fluid between exchanges"), std::string::npos);
    EXPECT_EQ(warned(fifth + rule, 2.5), "");
  }
}

TEST(Lead, IsNotForWindowsThatAreRepeated) {
  Scene scene = Scene::parse(disc(5, "", "lead = 1", "[0, 0]", "[solid]\n", "serial-implicit"), "scene.toml");
  Grains grains;
  grains.configure(scene, "grains");
  ASSERT_EQ(scene.problems().size(), 1u);
  EXPECT_NE(scene.problems().front().message.find("leave it out"), std::string::npos);
}

}  // namespace
}  // namespace estuary::grains
