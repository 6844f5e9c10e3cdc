// What the scene reader gives back for each type of value, and what it says when a value cannot be used.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "scene.hpp"

namespace estuary {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// The problems of a scene as a person sees them.
std::vector<std::string> described(const Scene& scene) {
  std::vector<std::string> result;
  for (const auto& problem : scene.problems()) result.push_back(describe(scene.name(), problem));
  return result;
}

TEST(SceneValues, AreGivenBackAsWritten) {
  auto scene = Scene::parse(R"toml(
title = "fin"
dimension = 2
ratio = 0.125
whole = 3
on = true
size = [3, 0.5]
words = ["a", "b"]
outline = [[0, 1], [2.5, 3]]
inflow = "sin(pi*t)"
constant = 0.25
profile = ["4*y*(1-y)", 0]
[fluid]
viscosity = 1e-3
sides.left = { type = "wall" }
)toml",
                            "s.toml");
  auto root = scene.root();
  EXPECT_EQ(root.path(), "");
  EXPECT_EQ(root.text("title"), "fin");
  EXPECT_EQ(root.integer("dimension", 2, 3), 2);
  EXPECT_EQ(root.number("ratio"), 0.125);
  EXPECT_EQ(root.number("whole"), 3.0) << "an integer is a number";
  EXPECT_TRUE(root.boolean_or("on", false));
  EXPECT_THAT(root.numbers("size", 2), ElementsAre(3.0, 0.5));
  EXPECT_THAT(root.texts_or_empty("words"), ElementsAre("a", "b"));
  EXPECT_THAT(root.points("outline", 2), ElementsAre(0.0, 1.0, 2.5, 3.0));
  EXPECT_EQ(root.expression("inflow"), "sin(pi*t)");
  EXPECT_EQ(root.expression("constant"), "0.25");
  EXPECT_THAT(root.expressions("profile", 2), ElementsAre("4*y*(1-y)", "0"));
  auto fluid = root.table("fluid");
  EXPECT_EQ(fluid.number("viscosity", Range::positive()), 1e-3);
  EXPECT_EQ(fluid.table("sides").table("left").path(), "fluid.sides.left");
  EXPECT_EQ(fluid.table("sides").table("left").text("type"), "wall");
  root.refuse_unknown_keys();
  EXPECT_THAT(described(scene), IsEmpty());
}

TEST(SceneValues, HaveDefaultsOnlyWhenAbsent) {
  auto scene = Scene::parse("a = 2\nb = \"x\"\n", "s.toml");
  auto root = scene.root();
  constexpr std::array<std::string_view, 2> schemes{"none", "aitken"};
  EXPECT_EQ(root.number_or("a", 7.0), 2.0);
  EXPECT_EQ(root.number_or("missing", 7.0), 7.0);
  EXPECT_EQ(root.integer_or("a", 7, 0, 10), 2);
  EXPECT_EQ(root.integer_or("missing_integer", 7, 0, 10), 7);
  EXPECT_EQ(root.text_or("b", "y"), "x");
  EXPECT_EQ(root.text_or("missing_text", "y"), "y");
  EXPECT_TRUE(root.boolean_or("missing_boolean", true));
  EXPECT_EQ(root.choice("scheme", schemes), "none");
  EXPECT_FALSE(root.table_if("missing_table").has_value());
  EXPECT_THAT(root.tables("missing_tables"), IsEmpty());
  EXPECT_THAT(root.texts_or_empty("missing_texts"), IsEmpty());
  EXPECT_TRUE(root.has("a"));
  EXPECT_FALSE(root.has("c"));
  EXPECT_THAT(described(scene), IsEmpty());
}

TEST(SceneValues, OfAnArrayOfTablesComeInOrder) {
  auto scene = Scene::parse("[[watch]]\nname = \"tip\"\n[[watch]]\nname = \"root\"\n", "s.toml");
  auto watches = scene.root().tables("watch");
  ASSERT_THAT(watches, SizeIs(2));
  EXPECT_EQ(watches[0].text("name"), "tip");
  EXPECT_EQ(watches[1].text("name"), "root");
  EXPECT_EQ(watches[1].path(), "watch.1");
}

// The first of them ended the program, inside the library that reads TOML.
TEST(SceneProblems, OfControlCharactersSayWhere) {
  using namespace std::string_literals;
  for (const std::string& text : {"x = 1\n[\0d]\n"s, "x = 1\n[\1d]\n"s, "x = 1\n \x7f\n"s})
    EXPECT_THAT(described(Scene::parse(text, "s")),
                ElementsAre(HasSubstr("s:2:2: not valid TOML: a control character")))
        << text;
  EXPECT_THAT(Scene::parse("x = 1\n\ty = 2\r\n", "s").problems(), IsEmpty());
  const std::array overrides{"x=\"\0\""s};
  EXPECT_THAT(described(Scene::parse("x = 1\n", "s", overrides)),
              ElementsAre(HasSubstr("control character")));
}

// An assertion of that library, where it would have said what is wrong.
TEST(SceneProblems, OfNamesOfTablesThatAreNoneSayWhere) {
  for (const std::string text :
       {"x = 1\n[(oli]\n", "x = 1\n[[=]]\n", "x = 1\n[.a]\n", "x = 1\n\u00e9 = 2\n", "x = 1\ny \ufef7 = 2\n"})
    EXPECT_THAT(described(Scene::parse(text, "s")), ElementsAre(HasSubstr("s:2:"))) << text;
}

TEST(SceneProblems, OfTypesSayWhatWasFoundAndExpectedAndWhere) {
  auto scene = Scene::parse(R"(title = 3
number = "abc"
integer = 1.5
boolean = 1
text = [1]
table = false
watch = 1
when = 2020-01-01
array = { x = 1 }
)",
                            "s.toml");
  auto root = scene.root();
  root.text("title");
  root.number("number");
  root.integer("integer", 0, 9);
  root.boolean_or("boolean", false);
  root.text("text");
  root.table("table");
  root.tables("watch");
  root.number("when");
  root.numbers("array", 2);
  EXPECT_THAT(
      described(scene),
      ElementsAre(
          "s.toml:1:9: 'title' at the top of the scene is the integer 3; expected a string",
          "s.toml:2:10: 'number' at the top of the scene is the string \"abc\"; expected a number",
          "s.toml:3:11: 'integer' at the top of the scene is the number 1.5; expected an integer, written "
          "without a decimal point",
          "s.toml:4:11: 'boolean' at the top of the scene is the integer 1; expected true or false",
          "s.toml:5:8: 'text' at the top of the scene is an array of 1 value; expected a string",
          "s.toml:6:9: 'table' at the top of the scene is the boolean false; expected a table",
          "s.toml:7:9: 'watch' at the top of the scene is the integer 1; expected an array of tables, "
          "written [[watch]]",
          "s.toml:8:8: 'when' at the top of the scene is a date or time; expected a number",
          "s.toml:9:9: 'array' at the top of the scene is a table; expected an array of 2 numbers"));
}

TEST(SceneProblems, OfRangesNameTheAllowedValuesAndReadingGoesOnInside) {
  auto scene =
      Scene::parse("[fluid]\ndensity = 0\nratio = 1.5\ncells = 0\nat_most = 3\nthreads = -1\n", "s.toml");
  auto fluid = scene.root().table("fluid");
  EXPECT_GT(fluid.number("density", Range::positive()), 0.0);
  const double ratio = fluid.number("ratio", {.minimum = 0.0, .maximum = 0.5, .exclusive = true});
  EXPECT_TRUE(ratio > 0.0 && ratio < 0.5);
  EXPECT_EQ(fluid.integer("cells", 4, 100), 4);
  EXPECT_LE(fluid.number("at_most", {.maximum = 2.0}), 2.0);
  EXPECT_EQ(fluid.integer_or("threads", 1, 1, std::numeric_limits<std::int64_t>::max()), 1);
  EXPECT_THAT(described(scene),
              ElementsAre("s.toml:2:11: 'density' in [fluid] is 0; must be greater than 0",
                          "s.toml:3:9: 'ratio' in [fluid] is 1.5; must be between 0 and 0.5, both excluded",
                          "s.toml:4:9: 'cells' in [fluid] is 0; must be from 4 to 100",
                          "s.toml:5:11: 'at_most' in [fluid] is 3; must be at most 2",
                          "s.toml:6:11: 'threads' in [fluid] is -1; must be at least 1"));
}

TEST(SceneProblems, RangeBoundsThemselvesAreAllowedUnlessExclusive) {
  auto scene = Scene::parse("a = 0\nb = 2\nc = 2\n", "s.toml");
  auto root = scene.root();
  root.number("a", Range::not_negative());
  root.number("b", {.minimum = 1.0, .maximum = 2.0});
  EXPECT_THAT(described(scene), IsEmpty());
  root.number("c", {.minimum = 1.0, .maximum = 2.0, .exclusive = true});
  EXPECT_THAT(described(scene), SizeIs(1));
}

TEST(SceneProblems, NumbersHaveToBeFinite) {
  auto scene =
      Scene::parse("a = inf\nb = nan\nc = [1, -inf]\nd = [[0, nan]]\ne = inf\nf = [\"x\", nan]\n", "s.toml");
  auto root = scene.root();
  EXPECT_TRUE(std::isfinite(root.number("a")));
  EXPECT_TRUE(std::isfinite(root.number_or("b", 1.0)));
  EXPECT_THAT(root.numbers("c", 2), ElementsAre(1.0, 0.0));
  EXPECT_THAT(root.points("d", 2), ElementsAre(0.0, 0.0));
  root.expression("e");
  root.expressions("f", 2);
  EXPECT_THAT(described(scene),
              ElementsAre("s.toml:1:5: 'a' at the top of the scene is inf; expected a finite number",
                          "s.toml:2:5: 'b' at the top of the scene is nan; expected a finite number",
                          "s.toml:3:9: 'c[1]' at the top of the scene is -inf; expected a finite number",
                          "s.toml:4:10: 'd[0][1]' at the top of the scene is nan; expected a finite number",
                          "s.toml:5:5: 'e' at the top of the scene is inf; expected a finite number",
                          "s.toml:6:11: 'f[1]' at the top of the scene is nan; expected a finite number"));
}

TEST(SceneProblems, OfArraysNameTheEntry) {
  auto scene = Scene::parse(R"(size = [1, 2]
mixed = [1, "x", 3]
points = [[0, 0], [1], 3, [1, "y"]]
words = ["a", 1]
profile = [1, ""]
)",
                            "s.toml");
  auto root = scene.root();
  EXPECT_THAT(root.numbers("size", 3), SizeIs(3)) << "a reader may index what it asked for";
  root.numbers("mixed", 0);
  EXPECT_THAT(root.points("points", 2), SizeIs(8));
  EXPECT_THAT(root.texts_or_empty("words"), ElementsAre("a"));
  root.expressions("profile", 2);
  EXPECT_THAT(
      described(scene),
      ElementsAre(
          "s.toml:1:8: 'size' at the top of the scene has 2 entries; expected an array of 3 numbers",
          "s.toml:2:13: 'mixed[1]' at the top of the scene is the string \"x\"; expected a number",
          "s.toml:3:19: 'points[1]' at the top of the scene has 1 entry; expected a point of 2 numbers",
          "s.toml:3:24: 'points[2]' at the top of the scene is the integer 3; expected a point of 2 numbers",
          "s.toml:3:31: 'points[3][1]' at the top of the scene is the string \"y\"; expected a number",
          "s.toml:4:15: 'words[1]' at the top of the scene is the integer 1; expected a string",
          "s.toml:5:15: 'profile[1]' at the top of the scene is an empty expression"));
}

TEST(SceneProblems, OfMissingKeysStandAtTheTableAndAreNotRepeatedInsideAMissingTable) {
  auto scene = Scene::parse("title = \"x\"\n[fluid]\n", "s.toml");
  auto root = scene.root();
  root.table("fluid").number("viscosity");
  auto solid = root.table("solid");
  EXPECT_GT(solid.number("density", Range::positive()), 0.0);
  EXPECT_THAT(solid.numbers("size", 2), SizeIs(2));
  EXPECT_FALSE(solid.has("density"));
  solid.table("beam").text("name");
  EXPECT_THAT(described(scene),
              ElementsAre("s.toml:2:1: missing key 'viscosity' in [fluid]; expected a number",
                          "s.toml: missing key 'solid' at the top of the scene; expected a table"));
}

TEST(SceneProblems, OfChoicesListThemAndTheNearest) {
  auto scene = Scene::parse("scheme = \"aitkn\"\nother = 3\n", "s.toml");
  constexpr std::array<std::string_view, 3> schemes{"none", "aitken", "iqn-ils"};
  EXPECT_EQ(scene.root().choice("scheme", schemes), "none");
  EXPECT_EQ(scene.root().choice("other", schemes), "none");
  EXPECT_THAT(
      described(scene),
      ElementsAre(
          "s.toml:1:10: 'scheme' at the top of the scene is the string \"aitkn\"; expected one of none, "
          "aitken, iqn-ils; did you mean \"aitken\"?",
          "s.toml:2:9: 'other' at the top of the scene is the integer 3; expected one of none, aitken, "
          "iqn-ils"));
}

TEST(SceneProblems, AreAllSeenAtOnceInTheOrderOfTheFileAndOnce) {
  auto scene = Scene::parse("b = \"x\"\na = \"y\"\n", "s.toml");
  auto root = scene.root();
  root.number("a");
  root.number("b");
  root.number("b");
  root.problem("", "about the scene");
  root.problem("a", "about a");
  EXPECT_THAT(described(scene),
              ElementsAre("s.toml:1:5: 'b' at the top of the scene is the string \"x\"; expected a number",
                          "s.toml:2:5: 'a' at the top of the scene is the string \"y\"; expected a number",
                          "s.toml:2:5: about a", "s.toml: about the scene"));
}

TEST(SceneProblems, OfAReaderStandAtTheValueOrAtItsTable) {
  auto scene = Scene::parse("[fluid]\n  cells = 4\n", "s.toml");
  auto fluid = scene.root().table("fluid");
  fluid.problem("cells", "too few");
  fluid.problem("absent", "needed here");
  EXPECT_THAT(described(scene), ElementsAre("s.toml:1:1: needed here", "s.toml:2:11: too few"));
}

TEST(SceneText, ThatIsMalformedGivesOneProblemAndAnEmptyRoot) {
  for (const std::string text :
       {"[\n", "a = \n", "a = 1\na = 2\n", "a = \"\xff\"\n", "[t]\n[t]\n", "a = [1\n"}) {
    auto scene = Scene::parse(text, "s.toml");
    ASSERT_THAT(scene.problems(), SizeIs(1)) << text;
    EXPECT_GT(scene.problems()[0].line, 0U) << text;
    EXPECT_THAT(scene.problems()[0].message, HasSubstr("not valid TOML")) << text;
    EXPECT_THAT(scene.root().keys(), IsEmpty());
  }
}

TEST(SceneText, DuplicateKeysAreRefusedWhereTheyAreRepeated) {
  auto scene = Scene::parse("[fluid]\ncells = 1\ncells = 2\n", "s.toml");
  ASSERT_THAT(scene.problems(), SizeIs(1));
  EXPECT_EQ(scene.problems()[0].line, 3U);
}

TEST(SceneText, OfAnEmptyNameStillHasPlaces) {
  auto scene = Scene::parse("a = 1\n", "");
  scene.root().text("a");
  ASSERT_THAT(scene.problems(), SizeIs(1));
  EXPECT_EQ(scene.problems()[0].line, 1U);
}

TEST(Describe, LeavesOutWhatIsZero) {
  EXPECT_EQ(describe("s.toml", {.line = 12, .column = 5, .message = "m"}), "s.toml:12:5: m");
  EXPECT_EQ(describe("s.toml", {.line = 12, .column = 0, .message = "m"}), "s.toml:12: m");
  EXPECT_EQ(describe("s.toml", {.line = 0, .column = 0, .message = "m"}), "s.toml: m");
  EXPECT_EQ(describe("", {.line = 0, .column = 0, .message = "m"}), "m");
}

}  // namespace
}  // namespace estuary
