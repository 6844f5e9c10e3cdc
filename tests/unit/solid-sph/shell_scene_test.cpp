// Shells as a participant: what a scene may ask for, its totals, a restart.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "participant_under_test.hpp"
#include "solid.hpp"

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
        Refusal{"poisson_ratio = 0.3", "poisson_ratio = 0.3\nwet = [\"left\"]", "single box"},
        Refusal{"poisson_ratio = 0.3",
                "poisson_ratio = 0.3\nwet = [\"contour\"]\nrupture = { stretch = 0.1 }", "have to open"},
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
