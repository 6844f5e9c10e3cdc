// What a study reads, which runs it makes of it, and what it says of their results.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "richardson.hpp"
#include "slurm_array.hpp"
#include "stability_search.hpp"
#include "study_expression.hpp"
#include "study_grid.hpp"
#include "study_table.hpp"
#include "temporary_folder.hpp"

namespace estuary::coupler {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class Study : public ::testing::Test {
protected:
  Study() { std::ofstream(temporary_.path() / "scene.toml") << "title = \"a scene\"\n"; }
  StudyReading read(const std::string& text) const {
    std::ofstream(file()) << "scene = \"scene.toml\"\n" << text;
    return read_study(file());
  }
  StudyScene good(const std::string& text) const {
    auto reading = read(text);
    EXPECT_THAT(problems(reading), "");
    return reading.study;
  }
  static std::string problems(const StudyReading& reading) {
    std::string text;
    for (const auto& problem : reading.problems) text += describe("study", problem) + "\n";
    return text;
  }
  std::filesystem::path file() const { return temporary_.path() / "study.toml"; }

  TemporaryFolder temporary_;
};

TEST_F(Study, MakesARunOfEveryCombination) {
  const auto study = good(R"(
[set]
fluid.threads = 1
[[vary]]
fluid.spacing = [0.02, 0.01]
solid.particles_across = [6, 12]
[[vary]]
name = "operator"
labels = ["two rates", "one rate"]
fluid.collision = ["trt", "bgk"]
fluid.sides.left.velocity = [["1.0", 0], ["1.0", 0]]
[derive]
coupling.window = "2 * fluid_spacing"
)");
  const auto cells = study_cells(study);
  ASSERT_EQ(cells.size(), 4U);
  EXPECT_THAT(cells[1].settings,
              ElementsAre("fluid.threads=1", "fluid.spacing=0.01", "solid.particles_across=12",
                          HasSubstr("fluid.collision="), HasSubstr("fluid.sides.left.velocity=["),
                          HasSubstr("coupling.window=0.02")));
  EXPECT_EQ(cells[1].series(), "two rates");
  EXPECT_EQ(cells[2].name(), "0.02, 6; one rate");
  EXPECT_EQ(cells[0].size, 0.02) << "a spacing falls and is the size itself";
  EXPECT_EQ(cells[3].variables.at("coupling_window"), 0.02);
}

TEST_F(Study, CountsThatRiseAreInverseSizesAndLetIsNoKeyOfTheScene) {
  const auto study =
      good("[[vary]]\nsolid.particles_across = [4, 8]\na.b = [\"\", \"x\"]\nlet.exact = [1.5, 2.5]\n");
  const auto cells = study_cells(study);
  EXPECT_EQ(cells[1].size, 0.125);
  EXPECT_THAT(cells[0].settings, ElementsAre("solid.particles_across=4"))
      << "an empty text leaves the key alone";
  EXPECT_THAT(cells[1].settings, ElementsAre("a.b='x'", "solid.particles_across=8"));
  EXPECT_EQ(cells[1].variables.at("exact"), 2.5);
}

TEST_F(Study, SaysEverythingThatIsWrongWithItsPlace) {
  const auto reading = read(R"(repeat = 3
[[vary]]
fluid.spacing = []
[[vary]]
fluid.viscosity = [1, 2]
fluid.density = [1]
[[quantity]]
name = "tip.displacement"
reference = 0
[[quantity]]
name = "tip.other"
exact = "2 * fluid_viscosty"
)");
  const auto text = problems(reading);
  EXPECT_THAT(text,
              HasSubstr("study:2:1: unknown key 'repeat' at the top of the scene; did you mean 'repeats'?"));
  EXPECT_THAT(text, HasSubstr("study:4:17: the list of 'fluid.spacing' is empty"));
  EXPECT_THAT(text, Not(HasSubstr("needs a key"))) << "there is one";
  EXPECT_THAT(text, HasSubstr("study:6:19: 'fluid.viscosity' has 2 values and 'fluid.density' has 1"));
  EXPECT_THAT(text, HasSubstr("study:10:13: an error relative to 0 means nothing; give `scale`"));
}

TEST_F(Study, TriesExpressionsBeforeAnythingRuns) {
  EXPECT_THAT(
      problems(read("[[vary]]\nfluid.viscosity = [1, 2]\n[[quantity]]\nname = \"tip.x\"\n"
                    "exact = \"2 * fluid_viscosty\"\n")),
      AllOf(HasSubstr("study:6:9:"), HasSubstr("fluid_viscosty"), HasSubstr("known are fluid_viscosity")));
  EXPECT_THAT(problems(read("[[vary]]\na.b = [1]\n[derive]\nc.d = \"a_b / 0\"\n")), HasSubstr("study:5:7:"));
  EXPECT_THAT(problems(read("[[vary]]\na.b = [1]\n[derive]\na.b = 2\n")),
              HasSubstr("'a.b' is set in two places"));
  EXPECT_THAT(problems(read("")), HasSubstr("there is nothing to vary"));
  EXPECT_THAT(problems(read(
                  "mode = \"stability\"\n[[vary]]\na.b = [1]\n[bisect]\nkey = \"c.d\"\nfrom = 0\nto = 1\n")),
              HasSubstr("scale = \"linear\""));
}

TEST(StudyExpression, KnowsItsVariablesAndRefusesWhatIsNotFinite) {
  EXPECT_DOUBLE_EQ(evaluate_expression("pi * a_b^2", {{"a_b", 2.0}}), 4 * std::acos(-1.0));
  EXPECT_THROW(evaluate_expression("1 / a", {{"a", 0.0}}), std::invalid_argument);
  EXPECT_THROW(evaluate_expression("1 +", {}), std::invalid_argument);
}

TEST(Richardson, FindsLimitAndOrderForAnyRatios) {
  const std::vector<double> sizes{0.4, 0.25, 0.1};
  std::vector<double> values(sizes.size());
  std::transform(sizes.begin(), sizes.end(), values.begin(),
                 [](double h) { return 1 + 3 * std::pow(h, 1.7); });
  const auto limit = ladder_limit(sizes, values, {});
  EXPECT_TRUE(limit.extrapolated);
  EXPECT_NEAR(limit.value, 1, 1e-9);
  EXPECT_NEAR(limit.order, 1.7, 1e-9);
  EXPECT_NEAR(ladder_limit({0.25, 0.1}, {values[1], values[2]}, 1.7).value, 1, 1e-12);
}

TEST(Richardson, DoesNotExtrapolateWhatDoesNotConverge) {
  const auto limit = ladder_limit({0.4, 0.2, 0.1}, {1.0, 1.2, 1.1}, {});
  EXPECT_FALSE(limit.extrapolated);
  EXPECT_EQ(limit.value, 1.1);
  EXPECT_FALSE(ladder_limit({0.4, 0.2, 0.1}, {1.0, 1.1, 1.3}, {}).extrapolated) << "differences grow";
  EXPECT_FALSE(ladder_limit({0.4, 0.2, 0.1}, {1.0, 1.0, 1.0}, {}).extrapolated);
}

TEST(Richardson, ObservedOrderLeavesOutWhatHasNoLogarithm) {
  EXPECT_NEAR(*observed_order({0.4, 0.2, 0.1, 0.05}, {1.6, 0.4, 0.0, 0.025}), 2, 1e-12);
  EXPECT_FALSE(observed_order({0.4, 0.2}, {0.1, NAN}).has_value());
}

StudyQuantity quantity_named(const std::string& name, std::optional<double> reference) {
  StudyQuantity quantity;
  quantity.name = name;
  quantity.reference = reference;
  return quantity;
}

StudyResults two_results() {
  StudyResults all;
  all.quantities = {quantity_named("tip.x", 1.0)};
  for (std::size_t k = 0; k < 2; ++k) {
    StudyResult result;
    result.cell.steps = {k};
    result.cell.labels = {k == 0 ? "a, \"b\"" : "c"};
    result.status = "done";
    result.finished = true;
    result.quantities = {
        {.value = 1.1 - 0.05 * static_cast<double>(k), .reference = 1, .error = k == 0 ? 0.1 : 0.05}};
    result.error = result.quantities.front().error;
    result.wall_s = result.cost_s = 1.0 + static_cast<double>(k);
    result.runs = 1;
    all.results.push_back(result);
  }
  all.series = {{.name = "", .results = {0, 1}, .orders = {std::nullopt}, .order = {}}};
  return all;
}

StudyScene two_steps() {
  StudyScene study;
  study.axes = {
      {.name = "step", .keys = {"a.b"}, .values = {{"1"}, {"2"}}, .labels = {"a, \"b\"", "c"}, .size = {}}};
  study.limits = {0.2, 0.06, 0.01};
  return study;
}

TEST(StudyTable, IsReadBackAndTellsWhatGrewWorse) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "study.csv";
  auto all = two_results();
  const auto study = two_steps();
  std::ofstream(file) << study_csv(study, all);
  const auto rows = read_csv_rows(file);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].at("step"), "a, \"b\"");
  EXPECT_EQ(rows[1].at("tip.x error"), "0.05");
  EXPECT_THAT(what_grew_worse(study, all, file, 0.1), IsEmpty());
  all.results[0].quantities[0].error = 0.109;
  EXPECT_THAT(what_grew_worse(study, all, file, 0.1), IsEmpty());
  all.results[0].quantities[0].error = 0.12;
  all.results[1].finished = false;
  all.results[1].status = "diverged or not converged";
  EXPECT_THAT(what_grew_worse(study, all, file, 0.1),
              ElementsAre(AllOf(HasSubstr("tip.x was 10 % and is 12 %")),
                          HasSubstr("diverged or not converged now")));
}

TEST(StudyTable, CheapestCountsWhatStaysBelowOnFinerSteps) {
  auto all = two_results();
  const auto study = two_steps();
  auto cheapest = cheapest_cells(study, all);
  EXPECT_EQ(cheapest[0], &all.results[0]);
  EXPECT_EQ(cheapest[1], &all.results[1]);
  EXPECT_EQ(cheapest[2], nullptr);
  all.results[0].error = 0.001;  // by chance, as the finer step shows
  cheapest = cheapest_cells(study, all);
  EXPECT_EQ(cheapest[1], &all.results[0]);
  EXPECT_EQ(cheapest[2], nullptr);
}

StabilityVerdict verdict(const StudyResult& result, const StudyQuantity& quantity) {
  CouplingScene scene;
  scene.mode = CouplingMode::transient;
  scene.window = 0.5;
  return stability_verdict({quantity}, result, scene);
}

TEST(StabilityVerdict, NamesTheSymptomAndItsTime) {
  StudyResult result;
  result.status = "diverged or not converged";
  result.message = "the coupling diverged: window 7, iteration 3, displacement";
  const auto diverged = verdict(result, {});
  EXPECT_EQ(diverged.kind, StabilityClass::diverged);
  EXPECT_EQ(diverged.window, 7U);
  EXPECT_EQ(diverged.time, 3.5);
  result.message = "the coupling stalled: window 2, iteration 60";
  EXPECT_EQ(verdict(result, {}).kind, StabilityClass::stalled);
  result.message = "the coupling did not converge: window 2, 50 iterations";
  EXPECT_EQ(verdict(result, {}).kind, StabilityClass::stalled);
  result.status = "participant lost";
  EXPECT_EQ(verdict(result, {}).kind, StabilityClass::lost);
  result.status = "wrong scene";
  EXPECT_EQ(verdict(result, {}).kind, StabilityClass::refused);
  result.status = "time limit";
  EXPECT_EQ(verdict(result, {}).kind, StabilityClass::stalled);
}

TEST(StabilityVerdict, AWrongRunWithoutAWarningIsALie) {
  StudyQuantity quantity = quantity_named("tip.x", 1.0);
  quantity.tolerance = 0.05;
  quantity.lie = 0.5;
  auto all = two_results();
  EXPECT_EQ(verdict(all.results[1], quantity).kind, StabilityClass::stable);
  EXPECT_EQ(verdict(all.results[0], quantity).kind, StabilityClass::inaccurate);
  EXPECT_FALSE(verdict(all.results[0], quantity).lie);
  all.results[0].quantities[0].error = 0.7;
  EXPECT_TRUE(verdict(all.results[0], quantity).lie);
  all.results[0].status = "check failed";
  EXPECT_TRUE(verdict(all.results[0], quantity).lie)
      << "that check is about the scene without the study's settings";
  all.results[0].warnings = {"relaxation time 0.5001"};
  EXPECT_FALSE(verdict(all.results[0], quantity).lie);
  all.results[1].quantities[0].value = NAN;
  EXPECT_TRUE(verdict(all.results[1], quantity).lie);
}

TEST(StabilityVerdict, BoundsCountLikeReferences) {
  StudyQuantity quantity = quantity_named("tip.x", {});
  quantity.at_most = 1.0;
  quantity.lie = 0.2;
  auto all = two_results();
  EXPECT_EQ(verdict(all.results[0], quantity).kind, StabilityClass::inaccurate);
  EXPECT_FALSE(verdict(all.results[0], quantity).lie);
  quantity.lie = 0.05;
  EXPECT_TRUE(verdict(all.results[0], quantity).lie) << "beyond by a tenth of the bound";
  quantity.at_most = 2.0;
  EXPECT_EQ(verdict(all.results[0], quantity).kind, StabilityClass::stable);
  quantity.at_least = 1.2;
  EXPECT_EQ(verdict(all.results[0], quantity).kind, StabilityClass::inaccurate);
}

TEST(Bisection, HalvesOnItsScaleUntilTheLimitIsKnown) {
  StudyBisection bisection{.key = "a.b", .from = 1, .to = 100};
  EXPECT_DOUBLE_EQ(middle_of(bisection, 1, 100), 10);
  EXPECT_FALSE(resolved(bisection, 1, 1.2));
  EXPECT_TRUE(resolved(bisection, 1, 1.1));
  bisection.whole = true;
  EXPECT_TRUE(resolved(bisection, 3, 4));
  bisection.logarithmic = false;
  EXPECT_DOUBLE_EQ(middle_of(bisection, 1, 4), 3);
}

TEST(SlurmArray, IsATaskForEachSettingAndAJobThatCollects) {
  StudyScene study;
  study.file = "it's.toml";
  study.slurm_options = {"--time=01:00:00"};
  const SlurmArray array{.coupler = "/opt/coupler", .folder = "/data/out", .tasks = 12, .at_once = 4};
  EXPECT_THAT(slurm_array_script(study, array),
              AllOf(HasSubstr("#SBATCH --array=0-11%4\n"), HasSubstr("#SBATCH --time=01:00:00\n"),
                    HasSubstr("exec '/opt/coupler' study 'it'\\''s.toml' --out '/data/out' --cell "
                              "\"$SLURM_ARRAY_TASK_ID\"")));
  EXPECT_THAT(slurm_collect_script(study, array), AllOf(HasSubstr("--collect"), Not(HasSubstr("--array"))));
}

}  // namespace
}  // namespace estuary::coupler
