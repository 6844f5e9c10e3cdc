// A key that nobody read is refused, with the name that was probably meant.
#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "scene.hpp"

namespace estuary {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::string> problems_of(const Scene& scene) {
  std::vector<std::string> result;
  for (const auto& problem : scene.problems()) result.push_back(describe(scene.name(), problem));
  return result;
}

TEST(UnknownKeys, AreRefusedAtTheKeyWithTheNearestName) {
  auto scene = Scene::parse("[fluid]\nviscosity = 1\n  viscosty = 2\nzzz = 3\n", "s.toml");
  auto fluid = scene.root().table("fluid");
  fluid.number("viscosity");
  fluid.number_or("density", 1.0);
  scene.root().refuse_unknown_keys();
  EXPECT_THAT(problems_of(scene),
              ElementsAre("s.toml:3:3: unknown key 'viscosty' in [fluid]; did you mean 'viscosity'?",
                          "s.toml:4:1: unknown key 'zzz' in [fluid]; known here: viscosity, density"));
}

TEST(UnknownKeys, AreFoundInEveryTableBelow) {
  auto scene = Scene::parse(R"([fluid.sides.left]
type = "wall"
tpye = "wall"
[[watch]]
name = "a"
[[watch]]
nam = "b"
[sollid]
)",
                            "s.toml");
  auto root = scene.root();
  root.table("fluid").table("sides").table("left").text("type");
  for (auto& watch : root.tables("watch")) watch.text_or("name", "");
  root.table_if("solid");
  root.refuse_unknown_keys();
  EXPECT_THAT(problems_of(scene),
              ElementsAre("s.toml:3:1: unknown key 'tpye' in [fluid.sides.left]; did you mean 'type'?",
                          "s.toml:7:1: unknown key 'nam' in [watch.1]; did you mean 'name'?",
                          "s.toml:8:2: unknown key 'sollid' at the top of the scene; did you mean 'solid'?"));
}

TEST(UnknownKeys, LeftToOtherReadersAreTheirs) {
  auto scene =
      Scene::parse("[fluid]\nsolver = \"fluid-lbm\"\nviscosity = 1\n[solid]\nanything = 1\n", "s.toml");
  auto root = scene.root();
  root.leave_to_others({"fluid", "solid"});
  auto fluid = root.table("fluid");
  fluid.text("solver");
  root.refuse_unknown_keys();
  EXPECT_THAT(problems_of(scene), IsEmpty()) << "what lies below a table left to others is not looked at";
  fluid.refuse_unknown_keys();
  EXPECT_THAT(problems_of(scene),
              ElementsAre("s.toml:3:1: unknown key 'viscosity' in [fluid]; known here: solver"));
}

TEST(UnknownKeys, AreKnownToAllCopiesOfATable) {
  auto scene = Scene::parse("[fluid]\na = 1\nb = 2\n", "s.toml");
  scene.root().table("fluid").number("a");
  scene.root().table("fluid").number("b");
  scene.root().table("fluid").refuse_unknown_keys();
  EXPECT_THAT(problems_of(scene), IsEmpty());
}

TEST(NearestName, FindsSlipsAndNothingElse) {
  const std::vector<std::string> known{"viscosity", "density", "time_step", "dx", "max_iterations"};
  EXPECT_EQ(nearest_name("viscosty", known), "viscosity");
  EXPECT_EQ(nearest_name("desnity", known), "density");
  EXPECT_EQ(nearest_name("time-step", known), "time_step");
  EXPECT_EQ(nearest_name("Time_Step", known), "time_step");
  EXPECT_EQ(nearest_name("MAX_ITERATIONS", known), "max_iterations");
  EXPECT_EQ(nearest_name("dt", known), std::nullopt) << "two letters are too few to guess";
  EXPECT_EQ(nearest_name("colour", known), std::nullopt);
  EXPECT_EQ(nearest_name("", known), std::nullopt);
  EXPECT_EQ(nearest_name("viscosity", {}), std::nullopt);
}

TEST(NearestName, CountsASwapOfNeighboursAsOneSlip) {
  const std::vector<std::string> known{"abcd"};
  EXPECT_EQ(nearest_name("abdc", known), "abcd");
  EXPECT_EQ(nearest_name("badc", known), std::nullopt);
}

}  // namespace
}  // namespace estuary
