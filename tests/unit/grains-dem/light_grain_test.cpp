// A grain in an imitated fluid that answers its acceleration one window late with an added mass, as explicit
// exchange does: virtual mass keeps grains of any density stable and leaves their motion alone.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <numbers>

#include "grains.hpp"

namespace estuary::grains {
namespace {

constexpr double kWindow = 1e-4;

// Velocity after `windows` windows of a disc under weight, buoyancy, linear drag and the added mass of one
// displaced mass. `density` is in fluid densities.
double velocity(double density, const std::string& virtual_mass, int windows, double drag,
                const std::string& more = "", double* fastest = nullptr) {
  const std::string text = R"(
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = 1e-4
end_time = 1.0
[fluid]
[grains]
normal_stiffness = 1e4
restitution = 0.5
gravity = [0, -10]
density = )" + std::to_string(1000 * density) +
                           R"(
[grains.fluid]
density = 1000
)" + virtual_mass + R"(
[[grains.group]]
positions = [[0.0, 0.0]]
radius = 0.001
)" + more;
  Scene scene = Scene::parse(text, "scene.toml");
  Grains grains;
  grains.configure(scene, "grains");
  EXPECT_TRUE(scene.problems().empty());
  const auto folder = std::filesystem::temp_directory_path() / ("grains-light-" + std::to_string(::getpid()));
  ProgressBoard board;
  v1::Exchange states = grains.start({}, folder);
  const double displaced = 1000 * std::numbers::pi * 1e-6;
  double before = 0, now = 0;
  for (int w = 0; w < windows && std::abs(now) < 1e3; ++w) {
    v1::Exchange inputs;
    auto& forces = *inputs.mutable_grain_forces();
    forces.add_force(0);
    forces.add_force(-drag * now - displaced * (now - before) / kWindow);
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
    now = states.grain_states().velocity(1);
    if (fastest) *fastest = std::max(*fastest, std::abs(now));
  }
  std::filesystem::remove_all(folder);
  return now;
}

TEST(LightGrain, FollowsItsEquationOfMotion) {
  const double displaced = 1000 * std::numbers::pi * 1e-6, drag = 1.0;
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
    const double displaced = 1000 * std::numbers::pi * 1e-6, drag = 1.0;
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
  Scene scene = Scene::parse(R"(
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = 1e-4
end_time = 1.0
[fluid]
[grains]
normal_stiffness = 1e4
restitution = 0.5
density = 5000
[grains.fluid]
density = 1000
)" + lead + R"(
[[grains.group]]
positions = [[0.0, 0.0]]
radius = 0.001
)",
                             "scene.toml");
  Grains grains;
  grains.configure(scene, "grains");
  EXPECT_TRUE(scene.problems().empty());
  const auto folder = std::filesystem::temp_directory_path() / ("grains-lead-" + std::to_string(::getpid()));
  ProgressBoard board;
  v1::Exchange states = grains.start({}, folder);
  for (int w = 0; w < windows; ++w) {
    v1::Exchange inputs;
    auto& forces = *inputs.mutable_grain_forces();
    forces.add_force(w + 1);
    forces.add_force(0);
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
  }
  std::filesystem::remove_all(folder);
  return 5000 * std::numbers::pi * 1e-6 * states.grain_states().velocity(0);
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

// `fluid`: keys of the fluid's own table, `density` of a disc in fluid densities.
std::string warned(const std::string& fluid, double density) {
  Scene scene = Scene::parse(R"(
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-explicit"
window = 1e-4
end_time = 1.0
[fluid]
spacing = 1e-4
)" + fluid + R"(
[grains]
normal_stiffness = 1e4
restitution = 0.5
density = )" + std::to_string(1000 * density) +
                                 R"(
[grains.fluid]
density = 1000
[[grains.group]]
positions = [[0.0, 0.0]]
radius = 0.001
)",
                             "scene.toml");
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
  Scene scene = Scene::parse(R"(
dimension = 2
[coupling]
mode = "transient"
scheme = "serial-implicit"
window = 1e-4
end_time = 1.0
[fluid]
[solid]
[grains]
normal_stiffness = 1e4
restitution = 0.5
density = 5000
[grains.fluid]
density = 1000
lead = 1
[[grains.group]]
positions = [[0.0, 0.0]]
radius = 0.001
)",
                             "scene.toml");
  Grains grains;
  grains.configure(scene, "grains");
  ASSERT_EQ(scene.problems().size(), 1u);
}

}  // namespace
}  // namespace estuary::grains
