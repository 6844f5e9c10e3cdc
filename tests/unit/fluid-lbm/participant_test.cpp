// The fluid as a participant: what it refuses, its modes, going back, saving and loading.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>
#include <cmath>

#include <filesystem>
#include <numbers>

#include "fluid.hpp"

namespace estuary::fluid {
namespace {

using testing::HasSubstr;

std::string channel_scene(const std::string& mode, const std::string& more = {}) {
  return "title = \"t\"\ndimension = 2\n[coupling]\n" + mode + R"(
[fluid]
solver = "fluid-lbm"
size = [1.2, 0.4]
spacing = 0.02
density = 2.0
viscosity = 0.05
reference_velocity = 1.0
[fluid.sides.left]
type = "velocity"
velocity = ["6*y*(0.4-y)/0.16", 0]
[fluid.sides.right]
type = "pressure"
pressure = 0.0
)" + more;
}

const std::string steady = "mode = \"steady\"";
const std::string transient = "mode = \"transient\"\nwindow = 0.02\nend_time = 1.0";

std::string problems_of(const std::string& text) {
  Scene scene = Scene::parse(text, "scene.toml");
  Fluid fluid;
  fluid.configure(scene, "fluid");
  std::string all;
  for (const auto& problem : scene.problems()) all += describe("scene.toml", problem) + "\n";
  return all;
}

std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  return text.replace(place, from.size(), to);
}

TEST(Configure, AcceptsAndPlans) {
  Scene scene = Scene::parse(channel_scene(transient), "scene.toml");
  Fluid fluid;
  const Plan plan = fluid.configure(scene, "fluid");
  ASSERT_TRUE(scene.problems().empty()) << describe("scene.toml", scene.problems()[0]);
  EXPECT_EQ(plan.variant, "d2q9-trt-incompressible");
  const auto value = [&](const std::string& name) {
    for (const auto& [key, text] : plan.derived) {
      if (key == name) return text;
    }
    return std::string("missing");
  };
  EXPECT_EQ(value("grid"), "61 x 20 nodes");
  EXPECT_EQ(value("time step"), "0.001 s");
  EXPECT_EQ(value("relaxation time"), "0.6875");  // 3 nu dt / dx^2 + 1/2
  EXPECT_EQ(value("steps per window"), "20");
  EXPECT_THAT(plan.left_out, testing::Contains(HasSubstr("no solid in the scene")));
  EXPECT_THAT(plan.left_out, testing::Contains(HasSubstr("copy of the window's start")));
  EXPECT_DOUBLE_EQ(plan.expected_updates, 61 * 20 * 1000.0);
}

TEST(Configure, ShortensTheStepToFillTheWindow) {
  Scene scene = Scene::parse(channel_scene("mode = \"transient\"\nwindow = 0.0205\nend_time = 0.205"), "s");
  Fluid fluid;
  const Plan plan = fluid.configure(scene, "fluid");
  ASSERT_TRUE(scene.problems().empty());
  EXPECT_THAT(plan.derived[0].second, HasSubstr("21 (time step shortened"));
}

TEST(Configure, RefusesWhatCannotWork) {
  const std::string good = channel_scene(steady);
  ASSERT_EQ(problems_of(good), "");
  EXPECT_THAT(problems_of(with(good, "spacing = 0.02", "spacing = 0.021")),
              HasSubstr("the nearest that fits all directions is 0.02"));
  EXPECT_THAT(problems_of(with(good, "spacing = 0.02", "spacing = -1")), HasSubstr("spacing"));
  EXPECT_THAT(problems_of(with(good, "viscosity = 0.05", "viscosity = 0")), HasSubstr("viscosity"));
  EXPECT_THAT(problems_of(with(good, "viscosity = 0.05", "vicsosity = 0.05")), HasSubstr("viscosity"));
  EXPECT_THAT(problems_of(with(good, "dimension = 2", "dimension = 3")), HasSubstr("size"));
  EXPECT_THAT(
      problems_of(with(good, "density = 2.0", "density = 2.0\ntime_step = 1e-3\nrelaxation_time = 0.8")),
      HasSubstr("only one of"));
  EXPECT_THAT(problems_of(with(good, "density = 2.0", "density = 2.0\ncollision = \"mrt\"")),
              HasSubstr("trt"));
  EXPECT_THAT(
      problems_of(with(good, "density = 2.0", "density = 2.0\ncollision = \"bgk\"\nmagic_parameter = 0.25")),
      HasSubstr("BGK has no magic parameter"));
  EXPECT_THAT(problems_of(with(good, "6*y*(0.4-y)/0.16", "6*y*(0.4-")),
              HasSubstr("Unexpected end of expression"));
  EXPECT_THAT(problems_of(with(good, "6*y*(0.4-y)/0.16", "1/(y-y)")), HasSubstr("no finite value"));
  EXPECT_THAT(problems_of(with(good, "6*y*(0.4-y)/0.16", "20")), HasSubstr("raise `reference_velocity`"));
  EXPECT_THAT(problems_of(with(good, "type = \"pressure\"\npressure = 0.0", "type = \"periodic\"")),
              HasSubstr("has to be too"));
  EXPECT_THAT(problems_of(good + "[[fluid.obstacle]]\npolygon = [[0.3,0.1],[0.4,0.1],[0.4,0.2]]\n"),
              HasSubstr("counter-clockwise"));
  EXPECT_THAT(problems_of(good + "[[fluid.obstacle]]\npolygon = [[0.3,0.1],[0.4,0.1]]\n"),
              HasSubstr("at least three points"));
  EXPECT_THAT(problems_of(good + "[[fluid.obstacle]]\npolygon = [[0.3,0.1],[0.4,0.2],[0.4,0.1],[0.3,0.2]]\n"),
              HasSubstr("points 1 and 3 cross"));
  EXPECT_THAT(problems_of(good + "[[watch]]\nname = \"w\"\nparticipant = \"fluid\"\npoint = [5.0, 0.1]\n"),
              HasSubstr("outside"));
  EXPECT_THAT(
      problems_of(with(good, "density = 2.0", "density = 2.0\nviscous_traction = false\nmatch_force = true")),
      HasSubstr("only with viscous_traction"));
  EXPECT_THAT(problems_of(good + "[fluid.steady]\ntolerance = 5\n"), HasSubstr("tolerance"));
}

TEST(Configure, WarnsNearItsLimits) {
  Scene scene = Scene::parse(
      with(channel_scene(steady), "viscosity = 0.05", "viscosity = 0.0005\nlattice_velocity = 0.1"), "s");
  Fluid fluid;
  const Plan plan = fluid.configure(scene, "fluid");
  ASSERT_TRUE(scene.problems().empty());
  EXPECT_THAT(plan.warnings, testing::Contains(HasSubstr("below 0.51")));
  EXPECT_THAT(plan.warnings, testing::Contains(HasSubstr("compressibility")));
  EXPECT_THAT(plan.warnings, testing::Contains(HasSubstr("boundary layers")));
}

TEST(Configure, WarnsOfNarrowGaps) {
  const auto warnings_of = [](const std::string& more) {
    Scene scene = Scene::parse(channel_scene(steady) + more, "s");
    Fluid fluid;
    const Plan plan = fluid.configure(scene, "fluid");
    EXPECT_TRUE(scene.problems().empty());
    return plan.warnings;
  };
  // Spacing 0.02: gaps of 2.5 and of 5 spacings.
  const auto narrow = HasSubstr("gap between discs or spheres is 2.5 spacings");
  EXPECT_THAT(warnings_of("[[fluid.obstacle]]\ndiscs = [[0.3,0.2,0.05],[0.45,0.2,0.05]]\n"),
              testing::Contains(narrow));
  EXPECT_THAT(warnings_of("[[fluid.obstacle]]\ndiscs = [[0.3,0.2,0.05],[0.5,0.2,0.05]]\n"),
              testing::Not(testing::Contains(HasSubstr("between discs"))));
  const std::string box = "[[fluid.obstacle]]\nbox = [[0.3,0.1],[0.4,0.2]]\n[[fluid.obstacle]]\nbox = ";
  EXPECT_THAT(warnings_of(box + "[[0.44,0.1],[0.5,0.2]]\n"),
              testing::Contains(HasSubstr("gap between polygons or boxes is 2 spacings")));
  EXPECT_THAT(warnings_of(box + "[[0.52,0.1],[0.6,0.2]]\n"),
              testing::Not(testing::Contains(HasSubstr("between polygons"))));
}

TEST(Configure, WarnsOfWhatCannotBeMeant) {
  const auto warnings_of = [](const std::string& text) {
    Scene scene = Scene::parse(text, "s");
    Fluid fluid;
    const Plan plan = fluid.configure(scene, "fluid");
    EXPECT_TRUE(scene.problems().empty());
    return plan.warnings;
  };
  const std::string good = channel_scene(steady);
  EXPECT_THAT(warnings_of(good + "[[fluid.obstacle]]\ndisc = [9.0,0.2,0.05]\n"),
              testing::Contains(HasSubstr("wholly beyond the right side")));
  EXPECT_THAT(warnings_of(with(good, "type = \"pressure\"\npressure = 0.0",
                               "type = \"velocity\"\nvelocity = [\"3*y*(0.4-y)/0.16\", 0]")),
              testing::Contains(HasSubstr("33.3 % of what passes them in beyond")));
  EXPECT_THAT(warnings_of(with(good, "type = \"pressure\"\npressure = 0.0",
                               "type = \"velocity\"\nvelocity = [\"6*y*(0.4-y)/0.16\", 0]")),
              testing::Not(testing::Contains(HasSubstr("beyond"))));
}

TEST(Configure, WarnsWhenRoundingMayKeepAFlowFromBeingSteady) {
  Scene scene =
      Scene::parse(with(channel_scene(steady), "density = 2.0", "density = 2.0\nstorage = \"float\""), "s");
  Fluid fluid;
  EXPECT_THAT(fluid.configure(scene, "fluid").warnings,
              testing::Contains(HasSubstr("never counts as steady")));
}

class Running : public testing::Test {
protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("fluid-participant-" + std::to_string(getpid()) + "-" +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<Fluid> start(const std::string& text, const v1::Exchange& initial = {}) {
    Scene scene = Scene::parse(text, "scene.toml");
    auto fluid = std::make_unique<Fluid>();
    fluid->configure(scene, "fluid");
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    fluid->start(initial, folder_);
    return fluid;
  }

  std::filesystem::path folder_;
  ProgressBoard board_;
};

constexpr double window_length = 0.02;

// A flap on the floor, its outline up the left face, over the tip and down.
v1::Exchange flap() {
  v1::Exchange exchange;
  auto& surface = *exchange.mutable_wet_surface();
  surface.set_identity(7);
  surface.set_dimension(2);
  std::vector<double> points;
  for (int n = 0; n <= 8; ++n) points.insert(points.end(), {0.4, 0.02 * n});
  for (int n = 8; n >= 0; --n) points.insert(points.end(), {0.47, 0.02 * n});
  for (const double p : points) surface.add_reference_positions(p);
  for (std::uint32_t n = 0; n + 1 < points.size() / 2; ++n) {
    surface.add_connectivity(n);
    surface.add_connectivity(n + 1);
  }
  return exchange;
}

// The flap leaning over with time.
v1::Exchange leaning(double time, double amplitude) {
  const v1::Exchange flap_exchange = flap();
  const auto& surface = flap_exchange.wet_surface();
  v1::Exchange inputs;
  auto& field = *inputs.mutable_displacements();
  field.set_surface(7);
  for (int n = 0; n < surface.reference_positions_size(); n += 2) {
    const double height = surface.reference_positions(n + 1);
    field.add_displacement(amplitude * (1 - std::cos(3 * time)) * height * height / 0.0256);
    field.add_displacement(0);
    field.add_velocity(amplitude * 3 * std::sin(3 * time) * height * height / 0.0256);
    field.add_velocity(0);
  }
  return inputs;
}

Window window_number(std::uint64_t number, std::uint64_t iteration) {
  return {number, iteration, Mode::transient, window_length * static_cast<double>(number - 1), window_length};
}

std::string loads_of(const AdvanceResult& result) {
  return result.outputs.pressures().SerializeAsString();
}

const std::string with_solid = channel_scene(transient, "[solid]\nsolver = \"x\"\n");

TEST_F(Running, RepeatedWindowsGiveTheSameBits) {
  auto straight = start(with_solid, flap());
  auto repeated = start(with_solid, flap());
  for (std::uint64_t n = 1; n <= 12; ++n) {
    const double end = window_length * static_cast<double>(n);
    const auto expected = straight->advance(window_number(n, 1), leaning(end, 0.05), board_);
    straight->accept();
    repeated->advance(window_number(n, 1), leaning(end, 0.09), board_);  // some other motion, not accepted
    repeated->advance(window_number(n, 2), leaning(end, 0.02), board_);
    const auto result = repeated->advance(window_number(n, 3), leaning(end, 0.05), board_);
    repeated->accept();
    ASSERT_EQ(loads_of(result), loads_of(expected)) << "window " << n;
    ASSERT_EQ(result.surface_force, expected.surface_force);
  }
}

TEST_F(Running, SaveAndLoadGiveTheSameBits) {
  auto straight = start(with_solid, flap());
  AdvanceResult expected;
  for (std::uint64_t n = 1; n <= 20; ++n) {
    expected =
        straight->advance(window_number(n, 1), leaning(window_length * static_cast<double>(n), 0.05), board_);
    straight->accept();
    if (n == 9) straight->save(folder_ / "state.h5");
  }
  auto resumed = start(with_solid, flap());
  resumed->advance(window_number(1, 1), leaning(window_length, 0.08),
                   board_);  // what it did before must not matter
  resumed->accept();
  resumed->load(folder_ / "state.h5");
  AdvanceResult result;
  for (std::uint64_t n = 10; n <= 20; ++n) {
    result =
        resumed->advance(window_number(n, 1), leaning(window_length * static_cast<double>(n), 0.05), board_);
    resumed->accept();
  }
  EXPECT_EQ(loads_of(result), loads_of(expected));
  EXPECT_EQ(result.work.steps, expected.work.steps);
}

TEST_F(Running, SteadyFlowIsFoundAndStaysFound) {
  const std::string watches =
      "[[watch]]\nname = \"p\"\nparticipant = \"fluid\"\npoint = [0.6, 0.2]\n"
      "[[watch]]\nname = \"all\"\nparticipant = \"fluid\"\n"
      "[[watch]]\nname = \"cut\"\nparticipant = \"fluid\"\nline = [[0.6, 0.0], [0.6, 0.4]]\n"
      "[[watch]]\nname = \"box\"\nparticipant = \"fluid\"\nfrom = [0.4, 0.0]\nto = [0.8, 0.4]\n"
      "[[watch]]\nname = \"other\"\nparticipant = \"solid\"\npoint = [99.0, 0.1]\n";
  auto fluid = start(channel_scene(steady, watches));
  const Window window{1, 1, Mode::steady, 0, 0};
  const auto result = fluid->advance(window, {}, board_);
  EXPECT_LT(result.remaining_error, 1e-6);
  ASSERT_EQ(result.watches.size(), 4u);
  const auto& box = result.watches[3].quantities;
  ASSERT_EQ(box[4].first, "permeability_x");
  EXPECT_EQ(box[1].second, 1.0);                             // porosity
  EXPECT_NEAR(box[3].second, -12 * 0.05 / 0.16, 0.02);       // pressure gradient
  EXPECT_NEAR(box[4].second, 0.16 / 12, 0.005 * 0.16 / 12);  // H^2 / 12 between plates
  const auto& point = result.watches[0].quantities;
  // Between the nodes at y = 0.19 and 0.21, where the parabola is 1.49625.
  EXPECT_NEAR(point[0].second, 1.5, 1e-6);
  EXPECT_NEAR(point[3].second, 12 * 0.05 / 0.16 * 0.6, 0.01);  // pressure: 12 mu U / H^2 to the outlet
  const auto& all = result.watches[1].quantities;
  EXPECT_NEAR(all[0].second, 0.5 * 2 * 1.2 * 1.2 * 0.4, 3e-3);  // 6/5 U^2 over the parabola
  EXPECT_NEAR(all[1].second, 2 * 1.2 * 0.4, 0.02);
  EXPECT_NEAR(result.watches[2].quantities[1].second, 0.4, 1e-3);
  const auto again = fluid->advance({1, 2, Mode::steady, 0, 0}, {}, board_);
  EXPECT_LT(again.work.steps - result.work.steps, result.work.steps / 3);
  EXPECT_NEAR(again.watches[0].quantities[0].second, point[0].second, 2e-6);
}

TEST_F(Running, SteadyFlowGivesUpAtItsLimit) {
  auto fluid = start(channel_scene(steady, "[fluid.steady]\nmaximum_steps = 100\n"));
  EXPECT_THROW(fluid->advance({1, 1, Mode::steady, 0, 0}, {}, board_), NotConverged);
}

TEST_F(Running, TheSurfaceFeelsTheForceItsLoadsAddUpTo) {
  for (const bool matched : {true, false}) {
    auto fluid = start(with(channel_scene(steady, "[solid]\nsolver = \"x\"\n"), "density = 2.0",
                            matched ? "density = 2.0" : "density = 2.0\nmatch_force = false"),
                       flap());
    const auto result = fluid->advance({1, 1, Mode::steady, 0, 0}, leaning(0, 0), board_);
    const auto& field = result.outputs.pressures();
    ASSERT_EQ(field.surface(), 7u);
    ASSERT_EQ(field.pressure_size(), 18);
    ASSERT_EQ(field.viscous_traction_size(), 36);
    const v1::Exchange initial = flap();
    const auto& x = initial.wet_surface().reference_positions();
    double drag = 0;
    double lift = 0;
    double moment = 0;
    for (int n = 0; n + 1 < 18; ++n) {
      const double tx = x[2 * n + 2] - x[2 * n];
      const double ty = x[2 * n + 3] - x[2 * n + 1];
      const double length = std::hypot(tx, ty);
      // Consistent load at the two ends: - p n with n = (-ty, tx), and the traction.
      for (int end = 0; end < 2; ++end) {
        const double near = end == 0 ? 2.0 / 6 : 1.0 / 6;
        const double far = end == 0 ? 1.0 / 6 : 2.0 / 6;
        const double pressure = near * field.pressure(n) + far * field.pressure(n + 1);
        const double fx = pressure * ty + length * (near * field.viscous_traction(2 * n) +
                                                    far * field.viscous_traction(2 * n + 2));
        const double fy = -pressure * tx + length * (near * field.viscous_traction(2 * n + 1) +
                                                     far * field.viscous_traction(2 * n + 3));
        drag += fx;
        lift += fy;
        moment += x[2 * (n + end)] * fy - x[2 * (n + end) + 1] * fx;
      }
    }
    EXPECT_GT(drag, 0);
    if (matched) {
      EXPECT_NEAR(drag, result.surface_force[0], 1e-12 * drag);
      EXPECT_NEAR(lift, result.surface_force[1], 1e-12 * drag);
      EXPECT_NEAR(moment, result.surface_moment, 1e-12 * drag);
    } else {
      EXPECT_NEAR(drag / result.surface_force[0], 1.0, 0.15);  // pressure peaks at the corners are missing
    }
  }
}

TEST_F(Running, DivergenceIsNamedAndTheLastFieldsAreKept) {
  auto fluid = start(with(channel_scene("mode = \"transient\"\nwindow = 10\nend_time = 10"),
                          "viscosity = 0.05", "viscosity = 1e-7\nlattice_velocity = 0.15"));
  try {
    fluid->advance({1, 1, Mode::transient, 0, 10}, {}, board_);
    FAIL() << "no divergence noticed";
  } catch (const Diverged& error) {
    EXPECT_EQ(error.field, "velocity");
    EXPECT_THAT(error.what(), HasSubstr("at cell ("));
    EXPECT_THAT(error.advice, HasSubstr("relaxation time"));
    EXPECT_TRUE(std::filesystem::exists(folder_ / "diverged.hdf"));
  }
}

TEST_F(Running, BadInputsAreNamed) {
  auto fluid = start(with_solid, flap());
  EXPECT_THROW(fluid->advance(window_number(1, 1), {}, board_), BadInput);
  auto other = leaning(window_length, 0.05);
  other.mutable_displacements()->set_surface(8);
  EXPECT_THROW(fluid->advance(window_number(1, 1), other, board_), std::invalid_argument);
  auto fast = leaning(window_length, 0.05);
  fast.mutable_displacements()->set_velocity(0, 500.0);
  EXPECT_THROW(fluid->advance(window_number(1, 1), fast, board_), Diverged);
  Window odd = window_number(1, 1);
  odd.duration = 0.0203;
  EXPECT_THROW(fluid->advance(odd, leaning(window_length, 0.05), board_), BadInput);
  // And after all that it still works.
  EXPECT_NO_THROW(fluid->advance(window_number(1, 1), leaning(window_length, 0.05), board_));
}

TEST_F(Running, StopsWhenAsked) {
  auto fluid = start(channel_scene(steady));
  board_.request_stop();
  EXPECT_THROW(fluid->advance({1, 1, Mode::steady, 0, 0}, {}, board_), Interrupted);
}

TEST_F(Running, FramesAreWritten) {
  auto fluid = start(with_solid, flap());
  const auto files = fluid->frame(3, 0.5);
  ASSERT_EQ(files.size(), 2u);
  for (const auto& file : files) EXPECT_TRUE(std::filesystem::exists(folder_ / file)) << file;
}

}  // namespace
}  // namespace estuary::fluid
