// Changes given on the command line, and the scene as it was run.
#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "scene.hpp"

namespace estuary {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr const char* text = R"(# a comment
title = "fin"
[fluid]
viscosity = 1e-3
size = [1, 2]
[[watch]]
name = "a"
[[watch]]
name = "b"
)";

Scene with(const std::vector<std::string>& overrides) {
  return Scene::parse(text, "s.toml", overrides);
}

TEST(SceneOverride, ChangesAValueAndTakesBareWordsAsStrings) {
  auto scene = with({"fluid.viscosity=2e-3", "title=iqn-ils", "fluid.size=[3,4]", "fluid.on = true"});
  auto root = scene.root();
  EXPECT_EQ(root.table("fluid").number("viscosity"), 2e-3);
  EXPECT_EQ(root.text("title"), "iqn-ils");
  EXPECT_THAT(root.table("fluid").numbers("size", 2), ElementsAre(3.0, 4.0));
  EXPECT_TRUE(root.table("fluid").boolean_or("on", false));
  EXPECT_THAT(scene.problems(), IsEmpty());
}

TEST(SceneOverride, TakesAddressesAndQuotesAsTheyAre) {
  auto scene = with({"fluid.connect=tcp://127.0.0.1:5555", R"(title=a "b" \c)", "fluid.note='x = y'"});
  EXPECT_EQ(scene.root().table("fluid").text("connect"), "tcp://127.0.0.1:5555");
  EXPECT_EQ(scene.root().text("title"), R"(a "b" \c)");
  EXPECT_EQ(scene.root().table("fluid").text("note"), "x = y");
  EXPECT_THAT(scene.problems(), IsEmpty());
}

TEST(SceneOverride, SwitchesAParticipantOff) {
  constexpr const char* three = R"([fluid]
viscosity = 1e-3
[solid]
density = 1
[[watch]]
name = "flow"
participant = "fluid"
[[watch]]
name = "tip"
participant = "solid"
[[check]]
quantity = "flow.drag"
[[check]]
quantity = "tip.displacement"
)";
  auto scene = Scene::parse(three, "s.toml", std::vector<std::string>{"fluid=off"});
  auto root = scene.root();
  EXPECT_FALSE(root.has("fluid"));
  EXPECT_TRUE(root.has("solid"));
  auto watches = root.tables("watch");
  ASSERT_THAT(watches, SizeIs(1));
  EXPECT_EQ(watches[0].text("name"), "tip");
  auto checks = root.tables("check");
  ASSERT_THAT(checks, SizeIs(1));
  EXPECT_EQ(checks[0].text("quantity"), "tip.displacement");
}

TEST(SceneOverride, MakesMissingTables) {
  auto scene = with({"coupling.acceleration.kind=aitken", "coupling.tolerance=1e-5"});
  auto coupling = scene.root().table("coupling");
  EXPECT_EQ(coupling.table("acceleration").text("kind"), "aitken");
  EXPECT_EQ(coupling.number("tolerance"), 1e-5);
  EXPECT_THAT(scene.problems(), IsEmpty());
}

TEST(SceneOverride, ReachesIntoArrays) {
  auto scene = with({"watch.1.name=tip", "fluid.size.0=7"});
  auto watches = scene.root().tables("watch");
  ASSERT_THAT(watches, SizeIs(2));
  EXPECT_EQ(watches[0].text("name"), "a");
  EXPECT_EQ(watches[1].text("name"), "tip");
  EXPECT_THAT(scene.root().table("fluid").numbers("size", 2), ElementsAre(7.0, 2.0));
  EXPECT_THAT(scene.problems(), IsEmpty());
}

TEST(SceneOverride, ThatIsLaterWins) {
  auto scene = with({"fluid.viscosity=1", "fluid.viscosity=2"});
  EXPECT_EQ(scene.root().table("fluid").number("viscosity"), 2.0);
}

TEST(SceneOverride, ThatCannotBeAppliedIsAProblemAndTheOthersStay) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"nothing", "is not of the form key.path=value"},
      {"=3", "is not a key path"},
      {"a..b=3", "is not a key path"},
      {"a b=3", "is not a key path"},
      {"fluid.x=", "has no value"},
      {"fluid.x=[1", "not TOML"},
      {"fluid.x='", "not TOML"},
      {"fluid.x=1\ny=2", "more than one value"},
      {"fluid.x=\xff\xfe", "not TOML"},
      {"title.x=3", "'title' is the string \"fin\", so it has no key 'x'"},
      {"fluid.viscosity.x.y=3", "'fluid.viscosity' is the number 0.001, so it has no key 'x'"},
      {"watch.2.name=x", "there is no entry 2 in 'watch'; it has 2"},
      {"watch.name=x", "'watch' is an array; 'name' is not an index into it"},
      {"watch.-1.name=x", "not an index"},
      {"watch.99999999999999999999.name=x", "not an index"},
  };
  for (const auto& [override, message] : cases) {
    auto scene = with({override, "fluid.viscosity=5"});
    ASSERT_THAT(scene.problems(), SizeIs(1)) << override;
    EXPECT_THAT(scene.problems()[0].message, HasSubstr(message)) << override;
    EXPECT_THAT(scene.problems()[0].message, HasSubstr("override '")) << override;
    EXPECT_EQ(scene.problems()[0].line, 0U) << override;
    EXPECT_EQ(scene.root().table("fluid").number("viscosity"), 5.0) << override;
  }
}

TEST(SceneOverride, OfAWrongTypeIsNamedInsteadOfALine) {
  auto scene = with({"fluid.viscosity=thick"});
  scene.root().table("fluid").number("viscosity");
  ASSERT_THAT(scene.problems(), SizeIs(1));
  EXPECT_EQ(describe(scene.name(), scene.problems()[0]),
            "s.toml: 'viscosity' in [fluid] is the string \"thick\"; expected a number (set by the override "
            "'fluid.viscosity=thick')");
}

TEST(SceneOverride, OfAnUnknownKeyIsRefused) {
  auto scene = with({"fluid.viscosty=1"});
  auto fluid = scene.root().table("fluid");
  fluid.number("viscosity");
  fluid.numbers("size", 2);
  fluid.refuse_unknown_keys();
  ASSERT_THAT(scene.problems(), SizeIs(1));
  EXPECT_EQ(scene.problems()[0].message,
            "unknown key 'viscosty' in [fluid]; did you mean 'viscosity'? (set by the override "
            "'fluid.viscosty=1')");
}

TEST(SceneAsRun, IsTheOriginalTextWithoutOverrides) {
  EXPECT_EQ(with({}).as_run(), text);
}

TEST(SceneAsRun, WithOverridesReadsBackAsTheSameScene) {
  const double viscosity = 1.0000000000000002e-3;
  auto scene = with({"fluid.viscosity=1.0000000000000002e-3", "watch.0.name=a \"quoted\" one",
                     "coupling.kind=aitken", "fluid.profile=\"4*y*(1-y)\""});
  auto again = Scene::parse(scene.as_run(), "again.toml");
  auto root = again.root();
  EXPECT_EQ(root.text("title"), "fin");
  EXPECT_EQ(root.table("fluid").number("viscosity"), viscosity);
  EXPECT_EQ(root.table("fluid").expression("profile"), "4*y*(1-y)");
  EXPECT_THAT(root.table("fluid").numbers("size", 2), ElementsAre(1.0, 2.0));
  ASSERT_THAT(root.tables("watch"), SizeIs(2));
  EXPECT_EQ(root.tables("watch")[0].text("name"), "a \"quoted\" one");
  EXPECT_EQ(root.tables("watch")[1].text("name"), "b");
  EXPECT_EQ(root.table("coupling").text("kind"), "aitken");
  root.refuse_unknown_keys();
  EXPECT_THAT(again.problems(), IsEmpty());
}

TEST(SceneAsRun, KeepsLineBreaksAndQuotesOfStrings) {
  auto scene = Scene::parse("a = \"\\n'first\"\nb = \"it's \\\"so\\\"\"\nc = \"one\\n\\ntwo\\t\"\n",
                            "lines.toml", std::vector<std::string>{"d=1"});
  auto root = Scene::parse(scene.as_run(), "again.toml").root();
  EXPECT_EQ(root.text("a"), "\n'first");
  EXPECT_EQ(root.text("b"), "it's \"so\"");
  EXPECT_EQ(root.text("c"), "one\n\ntwo\t");
}

TEST(SceneAsRun, KeysThatCouldNotBeReadAgainAreRefused) {
  for (const std::string text_of_scene :
       {"[\"it's\"]\n", "a = { \"b\\tc\" = 1 }\n", "a = [{\"b\\nc\" = 1}]\n"}) {
    const auto scene = Scene::parse(text_of_scene, "keys.toml");
    ASSERT_THAT(scene.problems(), SizeIs(1)) << text_of_scene;
    EXPECT_EQ(scene.problems()[0].line, 1U);
    EXPECT_THAT(scene.problems()[0].message, testing::StartsWith("a key has no apostrophes"));
  }
}

}  // namespace
}  // namespace estuary
