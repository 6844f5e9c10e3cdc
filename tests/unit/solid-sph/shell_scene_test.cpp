// Shells as a participant: what a scene may ask for, its totals, a restart.
#include <gtest/gtest.h>

#include <omp.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "running_scene.hpp"

namespace estuary::solid {
namespace {

const char* const kRing = R"(
title = "ring"
dimension = 2
[coupling]
mode = "transient"
window = 1e-3
end_time = 1e-2
[solid]
solver = "solid-sph"
kind = "shell"
polyline = [[1, 0], [0.5, 0.866], [-0.5, 0.866], [-1, 0], [-0.5, -0.866], [0.5, -0.866]]
closed = true
thickness = 0.05
spacing = 0.1
density = 1000
young_modulus = 1e6
poisson_ratio = 0.3
gravity = [0, -1]
[[solid.hold]]
region = [[-0.5, -0.866], [0.5, -0.866]]
components = ["y", "rotation"]
[[solid.load]]
region = [[-0.1, 0.8], [0.1, 0.9]]
moment = 0.5
ramp = "t"
[[watch]]
name = "top"
participant = "solid"
point = [0.2, 0.866]
[[watch]]
name = "totals"
participant = "solid"
)";

struct RunningShell {
  Solid solid;
  Plan plan;
  ProgressBoard board;
  std::filesystem::path folder;

  explicit RunningShell(const std::string& text) {
    Scene scene = Scene::parse(text, "scene.toml");
    plan = solid.configure(scene, "solid");
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    static int number = 0;
    folder = std::filesystem::temp_directory_path() /
             ("solid-sph-shell-" + std::to_string(::getpid()) + "-" + std::to_string(++number));
    solid.start({}, folder);
  }
  ~RunningShell() { std::filesystem::remove_all(folder); }
  AdvanceResult step(std::uint64_t window) {
    auto result = solid.advance({.number = window,
                                 .iteration = 1,
                                 .mode = Mode::transient,
                                 .time = 1e-3 * static_cast<double>(window - 1),
                                 .duration = 1e-3},
                                {}, board);
    solid.accept();
    return result;
  }
};

TEST(ShellScene, RunsWithItsEnergyInBalanceAndGoesOnBitForBitAfterALoad) {
  RunningShell one(kRing), two(kRing);
  EXPECT_EQ(one.plan.variant, "2d-shell-plane-strain");
  for (std::uint64_t w = 1; w <= 5; ++w) one.step(w);
  one.solid.save(one.folder / "state.h5");
  two.solid.load(one.folder / "state.h5");
  const auto straight = one.step(6), resumed = two.step(6);
  for (const char* quantity : {"displacement_y", "rotation", "angular_velocity"}) {
    EXPECT_NE(value_of(straight, "top", quantity), 0) << quantity;
    EXPECT_EQ(value_of(straight, "top", quantity), value_of(resumed, "top", quantity)) << quantity;
  }
  const double work = value_of(straight, "totals", "external_work");
  EXPECT_GT(work, 0);
  EXPECT_NEAR(value_of(straight, "totals", "total_energy") / work, 0, 1e-3);
  EXPECT_FALSE(one.solid.frame(1, 6e-3).empty());
}

// A hair outside a rigid body is still that body, but not where a shell is clamped at its side.
TEST(ShellScene, APointOfItBesideAWallIsWatchedInTheShell) {
  const std::string text = R"(dimension = 2
[coupling]
mode = "transient"
window = 1e-3
end_time = 1e-2
[solid]
solver = "solid-sph"
spacing = 0.1
[[solid.body]]
name = "wall"
kind = "rigid"
box = { from = [-0.5, -0.5], to = [0.0, 0.5] }
mass = 1.0
held = ["x", "y", "rotation"]
[[solid.body]]
name = "plate"
kind = "shell"
polyline = [[0, 0], [1, 0]]
thickness = 0.05
density = 1000
young_modulus = 1e6
poisson_ratio = 0.3
velocity = ["0", "-0.1 * x"]
[[solid.hold]]
body = "plate"
region = [[-0.01, -0.01], [0.01, 0.01]]
[solid.contact]
method = "pinball"
[[watch]]
name = "edge"
participant = "solid"
point = [0.001, 0.0]
)";
  RunningShell clamped(text);
  AdvanceResult result;
  for (std::uint64_t window = 1; window <= 10; ++window) result = clamped.step(window);
  EXPECT_LT(value_of(result, "edge", "shear_force"), -1e-3);
}

TEST(ShellScene, ViscousOnesGiveTheSameBitsInRepeatedWindowsAfterALoadAndWithOtherThreads) {
  // Enough particles for several threads.
  std::string text = replaced(kRing, "spacing = 0.1", "spacing = 0.005");
  text = replaced(text, "closed = true",
                  "closed = true\nviscosity = { linear = 0.2, quadratic = 1, shear = 0.2, bending = 0.2, "
                  "normal_filter = 0.01 }\nvelocity = [\"0\", \"-1\"]");
  text = replaced(text, "point = [0.2, 0.866]", "point = [0.05, 0.866]");  // where the moment is
  const double window = 2e-4;
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  test::RunningScene one(text, window), two(text, window), three(text, window), four(text, window);
  one.run(2);
  one.save();
  three.run(1);
  three.go_on_from(one);
  one.run(1);
  two.run(3, true);
  three.run(1);
  omp_set_num_threads(2);
  four.run(3);
  omp_set_num_threads(threads);
  for (const test::RunningScene* other : {&two, &three, &four}) {
    for (const char* quantity : {"displacement_y", "rotation", "angular_velocity"}) {
      EXPECT_NE(one.value("top", quantity), 0) << quantity;
      EXPECT_EQ(one.value("top", quantity), other->value("top", quantity)) << quantity;
    }
    for (const char* quantity : {"external_work", "viscous_work", "total_energy"})
      EXPECT_EQ(one.value("totals", quantity), other->value("totals", quantity)) << quantity;
  }
  EXPECT_GT(one.value("totals", "viscous_work"), 0);
}

TEST(ShellScene, StrongQuadraticViscosityIsStableInAStrongShock) {
  const std::string text = R"(
dimension = 2
[coupling]
mode = "transient"
window = 5e-6
end_time = 1
[solid]
kind = "shell"
polyline = [[0.0, 0.0], [0.2, 0.0]]
thickness = 0.01
spacing = 0.01
density = 7800.0
young_modulus = 2e11
poisson_ratio = 0.0
viscosity = { quadratic = 10 }
velocity = ["-1500", "0"]
[[solid.hold]]
region = [[0.0, 0.0], [0.0, 0.0]]
components = ["x"]
[[watch]]
name = "all"
participant = "solid"
)";
  test::RunningScene strip(text, 5e-6);
  strip.run(1);
  const double before = strip.value("all", "total_energy");
  strip.run(4);
  EXPECT_NEAR(strip.value("all", "total_energy") / before, 1, 0.05);
  EXPECT_GT(strip.value("all", "viscous_work"), 0.1 * before);
}

TEST(ShellScene, RefusesWhatShellsDoNotHave) {
  struct Refusal {
    const char *what, *with, *message;
  };
  for (const auto& [what, with, message] :
       {Refusal{"thickness = 0.05", "", "thickness"},
        Refusal{"spacing = 0.1", "particles_across = 4", "spacing"},
        Refusal{"kind = \"shell\"", "", "kind = \"shell\""},
        Refusal{"poisson_ratio = 0.3", "poisson_ratio = 0.3\nlaw = \"neo_hooke\"", "a shell is elastic"},
        Refusal{"poisson_ratio = 0.3", "poisson_ratio = 0.3\nrupture = { plastic_strain = 0.1 }",
                "`yield_stress`"},
        Refusal{"poisson_ratio = 0.3", "poisson_ratio = 0.3\nrupture = {}", "at least one of"},
        Refusal{"closed = true", "closed = true\nviscosity = {}", "`normal_filter`"},
        Refusal{"mode = \"transient\"\nwindow = 1e-3\nend_time = 1e-2\n[solid]",
                "mode = \"steady\"\n[solid]\nviscosity = { shear = 0.2 }", "transient runs"},
        Refusal{"poisson_ratio = 0.3", "poisson_ratio = 0.3\nwet = [\"left\"]", "single box"},
        Refusal{"poisson_ratio = 0.3", "poisson_ratio = 0.3\nisolated_particles = \"remove\"",
                "is of bodies with `rupture`"},
        Refusal{"\"rotation\"]", "\"spin\"]", "can be held"},
        Refusal{"moment = 0.5", "moment = 0.5\nforce = [1, 0]", "give one of"},
        Refusal{"mode = \"transient\"\nwindow = 1e-3\nend_time = 1e-2",
                "mode = \"steady\"\n[solid.steady]\nmethod = \"newton\"", "relaxation"},
        Refusal{"point = [0.2, 0.866]", "point = [0.2, 0.2]", "outside"}}) {
    const std::string text = replaced(kRing, what, with);
    Scene scene = Scene::parse(text, "scene.toml");
    Solid solid;
    solid.configure(scene, "solid");
    bool said = false;
    for (const auto& problem : scene.problems())
      said = said || describe("", problem).find(message) != std::string::npos;
    EXPECT_TRUE(said) << with << ": "
                      << (scene.problems().empty() ? "no problem" : scene.problems().front().message);
  }
}

}  // namespace
}  // namespace estuary::solid
