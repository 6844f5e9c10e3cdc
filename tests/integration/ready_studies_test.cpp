// Every study of configs/studies can be run: its file has no mistake, its scene takes every value, and what
// it judges by is there. The solvers themselves are asked; nothing is computed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "study_result.hpp"
#include "temporary_folder.hpp"

namespace estuary::coupler {
namespace {

namespace fs = std::filesystem;

/// Each value of each axis once, with the first values of the others.
std::vector<StudyCell> cells_of_each_value(const StudyScene& study) {
  const std::optional<double> from =
      study.bisection ? std::optional<double>(study.bisection->from) : std::nullopt;
  std::vector<StudyCell> cells{study_cell(study, std::vector<std::size_t>(study.axes.size(), 0), from)};
  for (std::size_t axis = 0; axis < study.axes.size(); ++axis) {
    for (std::size_t step = 1; step < study.axes[axis].values.size(); ++step) {
      std::vector<std::size_t> steps(study.axes.size(), 0);
      steps[axis] = step;
      cells.push_back(study_cell(study, steps, from));
    }
  }
  return cells;
}

class ReadyStudy : public testing::TestWithParam<std::string> {};

TEST_P(ReadyStudy, CanBeRunWithEveryValue) {
  const fs::path programs = fs::path(COUPLER_PROGRAM).parent_path();
  const char* path = std::getenv("PATH");
  ::setenv("PATH", (programs.string() + ":" + (path == nullptr ? "" : path)).c_str(), 1);
  fs::current_path(fs::path(SCENES).parent_path());  // some scenes name files as they are found from here
  const auto reading = read_study(fs::path(SCENES) / "studies" / GetParam());
  for (const auto& problem : reading.problems) ADD_FAILURE() << describe(GetParam(), problem);
  ASSERT_TRUE(reading.problems.empty());
  const TemporaryFolder folder;
  const StudyStore store(folder.path(), reading.study);
  bool judged = false;
  for (auto& cell : cells_of_each_value(reading.study)) {
    const PreparedCell prepared = store.prepare(std::move(cell));
    // Solvers of other houses are not on every machine; what is missing then is said with how to install it.
    if (prepared.refused.find("./set-up --foreign") != std::string::npos) continue;
    if (prepared.refused.find("set-up --foreign") != std::string::npos) continue;  // not installed here
    EXPECT_EQ(prepared.refused, "") << prepared.cell.name();
    if (judged || !prepared.refused.empty()) continue;
    judged = true;
    std::vector<std::string> problems;
    EXPECT_FALSE(resolved_quantities(reading.study, prepared.scene.coupling, problems).empty());
    EXPECT_THAT(problems, testing::IsEmpty());
  }
}

std::vector<std::string> study_files() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(fs::path(SCENES) / "studies")) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  return names;
}

INSTANTIATE_TEST_SUITE_P(Configs, ReadyStudy, testing::ValuesIn(study_files()), [](const auto& file) {
  std::string name = fs::path(file.param).stem();
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace estuary::coupler
