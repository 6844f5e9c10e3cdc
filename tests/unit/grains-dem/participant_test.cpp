// The grains as a participant: scenes refused, checkpoints, forces of a fluid, the wet surface of a solid.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <numbers>

#include "deposit.hpp"
#include "grains.hpp"
#include "participant_under_test.hpp"

namespace estuary::grains {
namespace {

using testing::HasSubstr;

const char* const kHeap = R"(
title = "heap"
dimension = 2
[coupling]
mode = "transient"
window = 0.01
end_time = 1.0
[grains]
density = 2000
normal_stiffness = 1e6
restitution = 0.5
friction = 0.4
gravity = [0, -9.81]
periodic = ["x"]
walls = ["bottom"]
[grains.box]
from = [0, 0]
to = [0.2, 1]
[[grains.group]]
count = 60
from = [0, 0]
to = [0.2, 0.3]
[grains.group.grading]
law = "beta"
minimum_radius = 0.006
maximum_radius = 0.012
[[watch]]
name = "all"
participant = "grains"
[[watch]]
name = "one"
participant = "grains"
grain = 7
[[watch]]
name = "middle"
participant = "grains"
from = [0, 0.02]
to = [0.2, 0.06]
[[watch]]
name = "floor"
participant = "grains"
wall = "bottom"
[[watch]]
name = "elsewhere"
participant = "fluid"
line = [[0, 0], [1, 1]]
)";

struct Running {
  Grains grains;
  Plan plan;
  v1::Exchange brought;
  ProgressBoard board;
  std::filesystem::path folder;

  explicit Running(const std::string& text, const v1::Exchange& initial = {}) {
    Scene scene = Scene::parse(text, "scene.toml");
    plan = grains.configure(scene, "grains");
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    static int number = 0;
    folder = std::filesystem::temp_directory_path() /
             ("grains-dem-" + std::to_string(::getpid()) + "-" + std::to_string(++number));
    brought = grains.start(initial, folder);
  }
  ~Running() { std::filesystem::remove_all(folder); }

  AdvanceResult step(std::uint64_t window, const v1::Exchange& inputs = {}, std::uint64_t iteration = 1) {
    return grains.advance({.number = window,
                           .iteration = iteration,
                           .mode = Mode::transient,
                           .time = 0.01 * static_cast<double>(window - 1),
                           .duration = 0.01},
                          inputs, board);
  }
};

std::vector<std::string> problems_of(const std::string& text) {
  Scene scene = Scene::parse(text, "scene.toml");
  Grains grains;
  grains.configure(scene, "grains");
  std::vector<std::string> messages;
  for (const auto& problem : scene.problems()) messages.push_back(problem.message);
  return messages;
}

TEST(Configure, PlansAGoodScene) {
  const Running run(kHeap);
  EXPECT_EQ(run.plan.variant, "discs-linear-friction-spring");
  EXPECT_TRUE(run.plan.warnings.empty()) << run.plan.warnings.front();
  EXPECT_FALSE(run.plan.left_out.empty());
  EXPECT_FALSE(run.brought.has_grain_states());
}

TEST(Configure, WarnsOfGrainsThatBeginInEachOther) {
  const Running run(
      replaced(kHeap, "[[grains.group]]",
               "[[grains.group]]\npositions = [[0.1,0.8],[0.115,0.8]]\nradius = 0.01\n[[grains.group]]"));
  ASSERT_EQ(run.plan.warnings.size(), 1u);
  EXPECT_THAT(run.plan.warnings.front(), HasSubstr("grains 0 and 1 begin with an overlap of 0.5 radii"));
}

const char* const kFilm =
    "[grains.lubrication]\nviscosity = 50\ncutoff = 1e-3\nminimum_gap = 1e-5\n[[watch]]";

std::string derived(const Plan& plan, const std::string& name) {
  for (const auto& [key, value] : plan.derived)
    if (key == name) return value;
  return "";
}

// A grain at a plane has the film's resistance of its radius and its own mass; between two of the same size
// the resistance is 2^(-3/2) of that, the reduced mass half.
TEST(Configure, StepFollowsTheFilmAtAPlane) {
  const double radius = 0.006, mass = 2000 * std::numbers::pi * radius * radius;
  const double resistance = 3 * std::numbers::sqrt2 * std::numbers::pi * 50 *
                            (std::pow(radius / 1e-5, 1.5) - std::pow(radius / 1e-3, 1.5));
  std::string scene = replaced(kHeap, "[[watch]]", kFilm);
  scene = replaced(scene,
                   "[grains.group.grading]\nlaw = \"beta\"\nminimum_radius = 0.006\nmaximum_radius = 0.012",
                   "radius = 0.006");
  EXPECT_EQ(derived(Running(scene).plan, "time step"),
            fmt::format("at most {:.3g} s, by lubrication at the smallest gap to a plane",
                        0.2 * mass / resistance));
  scene = replaced(scene, "walls = [\"bottom\"]", "");
  scene = replaced(scene, "name = \"floor\"\nparticipant = \"grains\"\nwall = \"bottom\"",
                   "name = \"floor\"\nparticipant = \"grains\"");
  EXPECT_EQ(derived(Running(scene).plan, "time step"),
            fmt::format("at most {:.3g} s, by lubrication at the smallest gap",
                        std::numbers::sqrt2 * 0.2 * mass / resistance));
}

TEST(Configure, WarnsOfWallsWithoutFilm) {
  const std::string slope = "[[grains.wall]]\nname = \"slope\"\npolyline = [[0,0],[0.2,0]]\n";
  EXPECT_TRUE(Running(replaced(kHeap, "[[watch]]", kFilm)).plan.warnings.empty());
  EXPECT_TRUE(Running(replaced(kHeap, "[[watch]]", slope + "[[watch]]")).plan.warnings.empty());
  const Running run(replaced(kHeap, "[[watch]]", slope + kFilm));
  ASSERT_EQ(run.plan.warnings.size(), 1u);
  EXPECT_THAT(run.plan.warnings.front(), HasSubstr("the wall 'slope' has none"));
}

// The weight is either reduced or carried by the fluid's pressure, and what drives the fluid drives grains.
TEST(Configure, WarnsOfBuoyancyThatIsThereTwiceOrNotAtAll) {
  const auto warned = [](const char* fluid, const char* grains) {
    const std::string tables =
        std::string("[fluid]\n") + fluid + "\n[grains.fluid]\ndensity = 1000\n" + grains + "\n[[watch]]";
    std::string all;
    for (const auto& warning : Running(replaced(kHeap, "[[watch]]", tables)).plan.warnings) all += warning;
    return all;
  };
  const char *force = "body_force = [0, -9.81]", *pressure = "buoyancy = \"pressure\"",
             *driven = "acceleration = [0, -9.81]";
  EXPECT_EQ(warned("", ""), "");
  EXPECT_EQ(warned(force, pressure), "");
  EXPECT_EQ(warned(force, driven), "");
  EXPECT_THAT(warned(force, ""), HasSubstr("does not reach the grains"));
  EXPECT_THAT(warned("", driven), HasSubstr("has no body_force"));
  EXPECT_THAT(warned("", pressure), HasSubstr("nothing carries the grains"));
  EXPECT_THAT(warned(force, (std::string(pressure) + "\n" + driven).c_str()),
              HasSubstr("carries the grains already"));
}

TEST(Configure, WarnsWhereFluidAndGrainsDoNotFitTogether) {
  const auto warned = [](const std::string& fluid, const char* what = "", const char* with = "") {
    const std::string text =
        replaced(kHeap, "[[watch]]", "[fluid]\n" + fluid + "\n[grains.fluid]\ndensity = 1000\n[[watch]]");
    std::string all;
    for (const auto& warning : Running(*what == 0 ? text : replaced(text, what, with)).plan.warnings)
      all += warning;
    return all;
  };
  const std::string periodic = "[fluid.sides.left]\ntype = \"periodic\"",
                    walls = "[fluid.sides.left]\ntype = \"wall\"";
  EXPECT_EQ(warned("density = 1000\nspacing = 0.003\n" + periodic), "");
  EXPECT_THAT(warned("density = 1100"), HasSubstr("that of [fluid] 1100"));
  EXPECT_THAT(warned("spacing = 0.004"), HasSubstr("spacings across"));
  EXPECT_THAT(warned(walls), HasSubstr("through no fluid"));
  EXPECT_THAT(warned(periodic, "periodic = [\"x\"]", ""), HasSubstr("do not touch across"));
  EXPECT_EQ(warned(walls, "[[grains.group]]", "[[grains.group]]\nheld = true"), "");
}

TEST(Configure, WarnsOfAGrainThatBeginsInAWall) {
  const Running run(
      replaced(kHeap, "[[grains.group]]",
               "[[grains.group]]\npositions = [[0.1,0.006]]\nradius = 0.008\n[[grains.group]]"));
  EXPECT_THAT(run.plan.warnings,
              testing::Contains(HasSubstr("grain 0 begins 0.25 of its radius deep in the wall 'bottom'")));
}

struct Refusal {
  const char *what, *with, *message;
};
class Refuses : public testing::TestWithParam<Refusal> {};
INSTANTIATE_TEST_SUITE_P(
    Scenes, Refuses,
    testing::Values(
        Refusal{"mode = \"transient\"", "mode = \"steady\"", "transient"},
        Refusal{"density = 2000", "density = -1", "density"}, Refusal{"density = 2000", "", "density"},
        Refusal{"restitution = 0.5", "restitution = 1.5", "restitution"},
        Refusal{"restitution = 0.5", "restitution = 0.5\nnormal_law = \"hertz\"", "spheres"},
        Refusal{"friction = 0.4", "friction = 0.4\nfrictoin_law = \"spring\"", "friction_law"},
        Refusal{"friction = 0.4", "friction = 0.4\nrolling_friction = 0.01", "rolling_law"},
        Refusal{"periodic = [\"x\"]", "periodic = [\"z\"]", "not an axis"},
        Refusal{"walls = [\"bottom\"]", "walls = [\"left\"]", "periodic direction"},
        Refusal{"walls = [\"bottom\"]", "walls = [\"below\"]", "not a side"},
        Refusal{"to = [0.2, 1]", "to = [-1, 1]", "beyond"}, Refusal{"count = 60", "", "positions"},
        Refusal{"count = 60", "count = 6000", "do not fit"},
        Refusal{"count = 60", "file = \"no such file\"", "grading"},
        Refusal{"maximum_radius = 0.012", "maximum_radius = 0.001", "smaller"},
        Refusal{"wall = \"bottom\"", "wall = \"top\"", "no wall"},
        Refusal{"grain = 7", "point = [0, 0]", "grain"},
        Refusal{"grain = 7", "grain = 60", "no grain 60: they count from 0 to 59"},
        Refusal{"[[watch]]", "[grains.bond]\nnormal_stiffness = 1\n[[watch]]", "shear_stiffness"},
        Refusal{"[[watch]]", "[grains.lubrication]\nviscosity = 1\ncutoff = 1\nminimum_gap = 2\n[[watch]]",
                "smaller"},
        Refusal{"[[watch]]", "[[grains.wall]]\nname = \"bottom\"\npoint = [0,0]\nnormal = [0,1]\n[[watch]]",
                "second wall"},
        Refusal{"[[watch]]", "[[grains.wall]]\nname = \"w\"\npoint = [0,0]\nnormal = [0,0]\n[[watch]]",
                "zero"},
        Refusal{"[[watch]]", "[[grains.wall]]\nname = \"w\"\n[[watch]]", "a wall is a plane"},
        Refusal{"[[watch]]", "[[grains.wall]]\nname = \"w\"\nmesh = \"no.stl\"\n[[watch]]", "in the plane"},
        Refusal{"[[watch]]",
                "[[grains.wall]]\nname = \"w\"\npolyline = [[0,0],[1,0]]\nspin = [\"t\"]\n[[watch]]",
                "pivot"},
        Refusal{"[[watch]]",
                "[[grains.wall]]\nname = \"w\"\npoint = [0,0]\nnormal = [0,1]\nspin = [1]\npivot = "
                "[0,0]\n[[watch]]",
                "does not turn"},
        Refusal{"[[grains.group]]",
                "[[grains.group]]\npositions = [[0.1,-0.3]]\nradius = 0.01\n[[grains.group]]",
                "behind the wall 'bottom'"},
        Refusal{"[[grains.group]]",
                "[[grains.group]]\npositions = [[0.1,0.8],[0.1,0.8]]\nradius = 0.01\n[[grains.group]]",
                "same centre"},
        Refusal{"to = [0.2, 1]", "to = [0.03, 1]", "the periodic direction x"}));
TEST_P(Refuses, WithAReason) {
  const auto messages = problems_of(replaced(kHeap, GetParam().what, GetParam().with));
  EXPECT_THAT(messages, testing::Contains(HasSubstr(GetParam().message)));
}

TEST(Heap, RestsOnItsFloorWithItsWeight) {
  std::string scene =
      replaced(kHeap, "[[watch]]",
               "[grains.deposit]\ngravity = [0, -9.81]\nend_time = 3.0\ntolerance = 2e-4\n[[watch]]");
  Running run(scene);
  AdvanceResult result;
  for (std::uint64_t window = 1; window <= 60; ++window) {
    result = run.step(window);
    run.grains.accept();
  }
  double weight = 0;
  for (const auto& [name, value] : run.plan.derived)
    if (name == "mass of the moving grains") weight = 9.81 * std::stod(value);
  EXPECT_NEAR(value_of(result, "floor", "force_y"), -weight, 0.01 * weight);
  EXPECT_LT(value_of(result, "all", "maximum_speed"), 5e-3);
  const double porosity = value_of(result, "middle", "porosity");
  EXPECT_GT(porosity, 0.1);
  EXPECT_LT(porosity, 0.25);
  // What lies above the middle presses on it, about.
  EXPECT_GT(value_of(result, "middle", "stress_yy"), 0);
  run.grains.stop();
  EXPECT_TRUE(std::filesystem::exists(run.folder / "sample.csv"));
  // The sample starts another scene.
  const std::string from_file = replaced(
      replaced(replaced(kHeap, "count = 60", "file = \"" + (run.folder / "sample.csv").string() + "\""),
               "from = [0, 0]\nto = [0.2, 0.3]", ""),
      "[grains.group.grading]\nlaw = \"beta\"\nminimum_radius = 0.006\nmaximum_radius = 0.012\n", "");
  Running again(from_file);
  EXPECT_LT(value_of(again.step(1), "all", "maximum_speed"), 0.02);
}

TEST(Deposit, FindsTheFrictionOfATargetPorosity) {
  // 300 discs: from 0.152 without friction to 0.188 with friction 1; neighbouring frictions scatter by 0.003.
  const std::string heap = replaced(replaced(kHeap, "count = 60\nfrom = [0, 0]\nto = [0.2, 0.3]",
                                             "count = 300\nfrom = [0, 0]\nto = [0.4, 0.6]"),
                                    "to = [0.2, 1]", "to = [0.4, 1]");
  struct Bed {
    double friction = 0, porosity = 0;
    std::vector<double> position;
  };
  const auto deposited = [&](const std::string& asked) {
    Scene text = Scene::parse(
        replaced(heap, "[[watch]]",
                 "[grains.deposit]\ngravity = [0, -9.81]\nend_time = 5.0\n" + asked + "\n[[watch]]"),
        "scene.toml");
    const GrainsScene scene = read_grains_scene(text, "grains");
    InitialGrains<2> grains = initial_grains<2>(scene);
    const auto settings = dynamics_settings<2>(scene, grains);
    Bed bed;
    bed.friction = deposit<2>(scene, settings, scene_walls<2>(scene), grains);
    bed.porosity = middle_porosity(Dynamics<2>(settings, grains, {}), scene.deposit.gravity, 0);
    bed.position = grains.position;
    return bed;
  };
  const double tolerance = 0.003;
  double friction = 0;
  for (const double target : {0.157, 0.167, 0.177}) {
    const Bed bed =
        deposited(fmt::format("target_porosity = {}\nporosity_tolerance = {}", target, tolerance));
    EXPECT_NEAR(bed.porosity, target, tolerance);
    EXPECT_GT(bed.friction, friction) << "a looser bed needs more friction than one of " << target;
    friction = bed.friction;
    // That friction it was, and no other state of the search.
    EXPECT_EQ(deposited(fmt::format("friction = {}", friction)).position, bed.position);
  }
}

TEST(Deposit, NamesGrainsThatGoThroughEachOther) {
  const std::string scene = replaced(
      replaced(kHeap, "normal_stiffness = 1e6", "normal_stiffness = 1000"), "[[watch]]",
      "[grains.deposit]\ngravity = [0, -9.81]\nend_time = 1.0\nfriction = 0.1\nrestitution = 0.9\n[[watch]]");
  try {
    const Running run(scene);
    FAIL() << "discs of 1 kg/m on springs of 1000 N/m";
  } catch (const Diverged& problem) {
    EXPECT_THAT(problem.what(), testing::ContainsRegex("grain [0-9]+ goes through grain [0-9]+ at"));
    EXPECT_THAT(problem.what(), HasSubstr("while grains are deposited"));
    EXPECT_THAT(problem.advice, HasSubstr("raise normal_stiffness"));
  }
}

TEST(Deposit, TellsTheFrictionItFound) {
  const std::string heap =
      replaced(kHeap, "[[watch]]",
               "[grains.deposit]\ngravity = [0, -9.81]\nend_time = 5.0\ntarget_porosity = "
               "0.18\nporosity_tolerance = 0.01\n[[watch]]");
  Running found(heap);
  const auto result = found.step(1);
  const double friction = value_of(result, "all", "deposit_friction");
  EXPECT_NEAR(value_of(result, "all", "deposit_porosity"), 0.18, 0.01);
  // Given that friction, the same grains lie at the same places.
  Running given(replaced(heap, "target_porosity = 0.18\nporosity_tolerance = 0.01",
                         fmt::format("friction = {}", friction)));
  EXPECT_EQ(value_of(given.step(1), "all", "centre_y"), value_of(result, "all", "centre_y"));
}

TEST(Audit, IsThereAtTheEndWhetherOrNotItIsWatched) {
  Running run(replaced(kHeap, "end_time = 1.0", "end_time = 0.03"));
  EXPECT_FALSE(run.step(1).work.energy_error.has_value());
  run.grains.accept();
  run.step(2);
  run.grains.accept();
  const auto last = run.step(3);
  ASSERT_TRUE(last.work.energy_error.has_value());
  EXPECT_EQ(*last.work.energy_error, value_of(last, "all", "energy_error"));
}

TEST(Checkpoint, GoesOnBitForBit) {
  Running first(kHeap);
  for (std::uint64_t window = 1; window <= 20; ++window) {
    first.step(window);
    first.grains.accept();
  }
  first.grains.save(first.folder / "checkpoint.h5");
  Running second(kHeap);
  second.grains.load(first.folder / "checkpoint.h5");
  for (std::uint64_t window = 21; window <= 40; ++window) {
    const auto a = first.step(window), b = second.step(window);
    for (const char* quantity : {"kinetic_energy", "dissipated", "centre_y", "energy_error"})
      ASSERT_EQ(value_of(a, "all", quantity), value_of(b, "all", quantity))
          << quantity << " in window " << window;
    ASSERT_EQ(value_of(a, "one", "position_x"), value_of(b, "one", "position_x"));
    first.grains.accept();
    second.grains.accept();
  }
  Running other(replaced(kHeap, "count = 60", "count = 50"));
  EXPECT_THROW(other.grains.load(first.folder / "checkpoint.h5"), std::runtime_error);
}

TEST(Frame, IsWritten) {
  Running run(kHeap);
  const auto files = run.grains.frame(0, 0.0);
  ASSERT_FALSE(files.empty());
  for (const auto& file : files) EXPECT_GT(std::filesystem::file_size(run.folder / file), 1000U) << file;
}

// In a fluid: buoyancy by reduced gravity, forces taken, states given.
TEST(Fluid, ForcesMoveGrainsAndWeightIsReduced) {
  std::string text = replaced(
      kHeap, "[[watch]]", "[fluid]\n[grains.fluid]\ndensity = 1000\nacceleration = [\"80*t\", 0]\n[[watch]]");
  text = replaced(text, "count = 60\nfrom = [0, 0]\nto = [0.2, 0.3]", "positions = [[0.1, 0.5]]");
  text =
      replaced(text, "[grains.group.grading]\nlaw = \"beta\"\nminimum_radius = 0.006\nmaximum_radius = 0.012",
               "radius = 0.01");
  text = replaced(text, "grain = 7", "grain = 0");
  Running run(text);
  ASSERT_TRUE(run.brought.has_grain_states());
  EXPECT_EQ(run.brought.grain_states().radius(0), 0.01);
  v1::Exchange inputs;
  inputs.mutable_grain_forces()->add_force(0.3);
  inputs.mutable_grain_forces()->add_force(0);
  inputs.mutable_grain_forces()->add_torque(1e-4);
  const auto result = run.step(1, inputs);
  const double mass = 2000 * 3.14159265358979 * 1e-4;
  // Half as heavy as the grain, the fluid that a body force drives adds half of its acceleration, that in the
  // middle of the window: 80 t over 10 ms.
  EXPECT_NEAR(value_of(result, "one", "velocity_x"), (0.3 / mass + 0.5 * 0.4) * 0.01, 1e-12);
  EXPECT_NEAR(value_of(result, "one", "velocity_y"), -0.5 * 9.81 * 0.01, 1e-12);
  EXPECT_NEAR(value_of(result, "one", "spin"), 1e-4 * 0.01 / (0.5 * mass * 1e-4), 1e-9);
  EXPECT_EQ(result.outputs.grain_states().velocity(0), value_of(result, "one", "velocity_x"));
  inputs.mutable_grain_forces()->add_torque(1);
  EXPECT_THROW(run.step(2, inputs), BadInput);
  inputs.mutable_grain_forces()->mutable_torque()->RemoveLast();
  inputs.mutable_grain_forces()->set_force(0, NAN);
  EXPECT_THROW(run.step(2, inputs), BadInput);
}

TEST(Margin, GrainsTouchBeforeTheirSurfacesMeet) {
  std::string text = replaced(kHeap, "friction = 0.4", "friction = 0.4\ncontact_margin = 0.001");
  text = replaced(text, "count = 60\nfrom = [0, 0]\nto = [0.2, 0.3]",
                  "positions = [[0.05, 0.5], [0.0715, 0.5], [0.15, 0.5], [0.1725, 0.5]]");
  text =
      replaced(text, "[grains.group.grading]\nlaw = \"beta\"\nminimum_radius = 0.006\nmaximum_radius = 0.012",
               "radius = 0.01");
  text = replaced(text, "grain = 7", "grain = 0");
  text = replaced(text, "gravity = [0, -9.81]", "gravity = [0, 0]");
  text = replaced(text, "from = [0, 0.02]", "from = [0, 0.48]");
  text = replaced(text, "to = [0.2, 0.06]", "to = [0.2, 0.52]");
  Running run(text);
  auto result = run.step(1);
  // True surfaces 1.5 mm apart touch with a margin of 1 mm on each; 2.5 mm apart they do not.
  EXPECT_GT(std::abs(value_of(result, "one", "velocity_x")), 0);
  EXPECT_NEAR(value_of(result, "middle", "porosity"), 1 - 4 * 3.14159265 * 1e-4 / (0.2 * 0.04), 1e-6);
}

// Beside a solid: its surface holds grains, moves them and feels them; a window can be repeated.
TEST(Solid, SurfaceActsAndFeels) {
  std::string text = replaced(kHeap, "[[watch]]", "[solid]\n[[watch]]");
  text = replaced(text, "count = 60\nfrom = [0, 0]\nto = [0.2, 0.3]", "positions = [[0.1, 0.5099]]");
  text =
      replaced(text, "[grains.group.grading]\nlaw = \"beta\"\nminimum_radius = 0.006\nmaximum_radius = 0.012",
               "radius = 0.01");
  text = replaced(text, "grain = 7", "grain = 0");
  v1::Exchange initial;
  auto* surface = initial.mutable_wet_surface();
  surface->set_identity(5);
  surface->set_dimension(2);
  for (const double x : {0.0, 0.5, 0.2, 0.5}) surface->add_reference_positions(x);
  surface->add_connectivity(0);
  surface->add_connectivity(1);
  auto* displacements = initial.mutable_displacements();
  displacements->set_surface(5);
  for (int k = 0; k < 4; ++k) {
    displacements->add_displacement(0);
    displacements->add_velocity(0);
  }
  Running run(text, initial);
  v1::Exchange inputs;
  *inputs.mutable_displacements() = initial.displacements();
  const auto first = run.step(1, inputs);
  ASSERT_EQ(first.outputs.forces().force_size(), 4);
  const double down = first.outputs.forces().force(1) + first.outputs.forces().force(3);
  EXPECT_LT(down, 0);
  EXPECT_DOUBLE_EQ(first.outputs.forces().force(1), first.outputs.forces().force(3));
  const auto again = run.step(1, inputs, 2);
  EXPECT_EQ(again.outputs.forces().force(1), first.outputs.forces().force(1));
  EXPECT_EQ(value_of(again, "one", "position_y"), value_of(first, "one", "position_y"));
}

}  // namespace
}  // namespace estuary::grains
