#include "coupling_scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace estuary::coupler {
namespace {

using testing::HasSubstr;

struct Read {
  CouplingScene scene;
  std::vector<SceneProblem> problems;
};

Read read(const std::string& text) {
  Scene scene = Scene::parse(text, "scene.toml");
  CouplingScene coupling = read_coupling_scene(scene);
  return {coupling, scene.problems()};
}

std::string only_problem(const std::string& text) {
  const auto problems = read(text).problems;
  EXPECT_EQ(problems.size(), 1U) << text;
  return problems.empty() ? "" : problems.front().message;
}

TEST(CouplingScene, HasTheDefaultsOfTheDesign) {
  const auto [scene, problems] = read("[coupling]\n[fluid]\n[solid]\n");
  EXPECT_TRUE(problems.empty());
  EXPECT_EQ(scene.mode, CouplingMode::steady);
  EXPECT_EQ(scene.acceleration, AccelerationKind::aitken);
  EXPECT_DOUBLE_EQ(scene.measures[0].limit, 1e-4);
  ASSERT_EQ(scene.participants.size(), 2U);
  EXPECT_EQ(scene.participants[0].command, std::vector<std::string>{"fluid-lbm"});
}

TEST(CouplingScene, CountsWindows) {
  EXPECT_EQ(read("[coupling]\nmode = \"transient\"\nwindow = 0.1\nend_time = 3.0\n[fluid]\n").scene.windows,
            30U);
  EXPECT_THAT(only_problem("[coupling]\nmode = \"transient\"\nwindow = 0.7\nend_time = 3.0\n[fluid]\n"),
              HasSubstr("whole number of windows"));
}

TEST(CouplingScene, NeedsAParticipant) {
  EXPECT_THAT(only_problem("[coupling]\n"), HasSubstr("no participant"));
}

TEST(CouplingScene, SolverIsACommandOrAConnection) {
  EXPECT_EQ(read("[coupling]\n[fluid]\nsolver = \"python3 my_fluid.py\"\n").scene.participants[0].command,
            (std::vector<std::string>{"python3", "my_fluid.py"}));
  EXPECT_THAT(only_problem("[coupling]\n[fluid]\nsolver = \"a\"\nconnect = \"tcp://127.0.0.1:1\"\n"),
              HasSubstr("not both"));
}

TEST(CouplingScene, TwoParticipantsAreNotAtOneAddress) {
  EXPECT_THAT(
      only_problem("[coupling]\n[fluid]\nconnect = \"ipc:///tmp/a\"\n[solid]\nconnect = \"ipc:///tmp/a\"\n"),
      HasSubstr("'fluid' and 'solid' are both"));
  EXPECT_TRUE(read("[coupling]\n[fluid]\nconnect = \"ipc:///tmp/a\"\n[solid]\nconnect = \"ipc:///tmp/b\"\n")
                  .problems.empty());
}

TEST(CouplingScene, RefusesUnknownKeysOutsideTheParticipantsTables) {
  EXPECT_THAT(only_problem("[coupling]\nrelaxtion = 0.5\n[fluid]\nanything = 1\n"), HasSubstr("relaxation"));
  EXPECT_THAT(only_problem("[coupling]\n[fluid]\n[colour]\n"), HasSubstr("colour"));
}

TEST(CouplingScene, ChecksNameAWatch) {
  EXPECT_THAT(
      only_problem("[coupling]\n[fluid]\n[[check]]\nquantity = \"tip.x\"\nreference = 1\ntolerance = 0.1\n"),
      HasSubstr("tip.x"));
}

TEST(CouplingScene, ACheckNeedsSomethingToHoldAgainst) {
  const std::string watch = "[[watch]]\nname = \"tip\"\nparticipant = \"fluid\"\n";
  EXPECT_THAT(
      only_problem("[coupling]\n[fluid]\n" + watch + "[[check]]\nquantity = \"tip.x\"\nreference = 1.0\n"),
      HasSubstr("tolerance"));
  EXPECT_THAT(only_problem("[coupling]\n[fluid]\n" + watch +
                           "[[check]]\nquantity = \"tip.x\"\nreference = 0.0\ntolerance = 0.1\n"),
              HasSubstr("absolute_tolerance"));
}

TEST(CouplingScene, AWatchNameBecomesAFileName) {
  EXPECT_THAT(only_problem("[coupling]\n[fluid]\n[[watch]]\nname = \"../tip\"\nparticipant = \"fluid\"\n"),
              HasSubstr("file name"));
}

TEST(CouplingScene, AParallelSchemeMeasuresTheForcesToo) {
  const std::string parallel =
      "[coupling]\nmode = \"transient\"\nwindow = 0.1\nend_time = 1.0\nscheme = "
      "\"parallel-implicit\"\ntolerance = 1e-5\n";
  const auto [scene, problems] = read(parallel + "[fluid]\n[solid]\n");
  EXPECT_TRUE(problems.empty());
  ASSERT_EQ(scene.measures.size(), 3U);
  EXPECT_EQ(scene.measures[2].field, Field::force);
  EXPECT_DOUBLE_EQ(scene.measures[2].limit, 1e-4);
  EXPECT_THAT(
      only_problem("[coupling]\nmode = \"transient\"\nwindow = 0.1\nend_time = 1.0\n"
                   "scheme = \"parallel-implicit\"\n[[coupling.convergence]]\nfield = \"displacement\"\n"
                   "measure = \"relative\"\nlimit = 1e-3\n[fluid]\n[solid]\n"),
      HasSubstr("force"));
}

TEST(CouplingScene, ReadsTheMapping) {
  const auto mapping = [](const std::string& text) {
    return "[coupling]\n[coupling.mapping]\n" + text + "[fluid]\n[solid]\n";
  };
  const auto scene =
      read(mapping("kind = \"wendland-c4\"\nsupport_radius = 0.2\nloads = \"pressures\"\n")).scene;
  EXPECT_EQ(scene.mapping.kind, MappingKind::wendland_c4);
  EXPECT_DOUBLE_EQ(scene.mapping.support_radius, 0.2);
  EXPECT_EQ(scene.mapped_loads, Loads::pressures);
  EXPECT_EQ(read(mapping("kind = \"nearest-neighbor\"\n")).scene.mapping.kind,
            MappingKind::nearest_neighbour);
  EXPECT_THAT(only_problem(mapping("kind = \"wendland-c2\"\n")), HasSubstr("support_radius"));
  EXPECT_THAT(only_problem(mapping("support_radius = 0.2\n")), HasSubstr("wendland"));
}

// Who is on another machine may be silent for longer; where it listens may not be where it is reached.
TEST(CouplingScene, ReadsHosts) {
  const std::string text =
      "[coupling]\n[fluid]\n[solid]\nconnect = \"tcp://10.0.0.1:5\"\n[grains]\nconnect = "
      "\"tcp://127.0.0.1:5\"\n"
      "[hosts.coupler]\nkey = \"k\"\n[hosts.solid]\npublic_key = \"p\"\n[hosts.fluid]\nlaunch = "
      "\"ssh\"\nhost = \"n\"\n"
      "folder = \"/f\"\naddress = \"tcp://127.0.0.1:7\"\n";
  const auto far = read(text + "bind = \"tcp://*:5\"\npublic_key = \"p\"\nlost_after = 30.0\n");
  EXPECT_DOUBLE_EQ(far.scene.find("solid")->lost_after, 5.0);
  EXPECT_DOUBLE_EQ(far.scene.find("grains")->lost_after, 1.5);
  EXPECT_DOUBLE_EQ(far.scene.find("fluid")->lost_after, 30.0);
  EXPECT_EQ(far.scene.find("fluid")->bind, "tcp://*:5");
  EXPECT_EQ(far.scene.find("fluid")->endpoint, "tcp://127.0.0.1:7");
  // An open address wants keys even when it is reached through a tunnel.
  const auto open = read(text + "bind = \"tcp://*:5\"\n").problems;
  EXPECT_TRUE(std::any_of(open.begin(), open.end(), [](const SceneProblem& problem) {
    return problem.message.find("'fluid' serves at tcp://*:5, which other machines reach") !=
           std::string::npos;
  }));
}

TEST(CouplingScene, AWatchOfTheCouplingNeedsAWetSurface) {
  const std::string watch = "[[watch]]\nname = \"all\"\nparticipant = \"coupling\"\n";
  EXPECT_TRUE(read("[coupling]\n[fluid]\n[solid]\n" + watch).problems.empty());
  EXPECT_THAT(only_problem("[coupling]\n[fluid]\n" + watch), HasSubstr("wet surface"));
}

TEST(CouplingScene, ReadsTheAdaptiveWindow) {
  const std::string transient = "[coupling]\nmode = \"transient\"\nwindow = 0.64\nend_time = 6.4\n";
  EXPECT_DOUBLE_EQ(read(transient + "adaptive_window = true\n[fluid]\n[solid]\n").scene.smallest_window,
                   0.01);
  EXPECT_THAT(only_problem(transient + "smallest_window = 0.1\n[fluid]\n[solid]\n"),
              HasSubstr("adaptive_window"));
  EXPECT_THAT(only_problem(transient + "adaptive_window = true\nsmallest_window = 1.0\n[fluid]\n[solid]\n"),
              HasSubstr("larger"));
  EXPECT_THAT(only_problem("[coupling]\nadaptive_window = true\n[fluid]\n[solid]\n"), HasSubstr("steady"));
}

}  // namespace
}  // namespace estuary::coupler
