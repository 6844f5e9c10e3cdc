// Studies run as a person runs them, on the participant whose fixed point is known (linear_participant.cpp).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <thread>

#include "coupler_run.hpp"
#include "folder_lock.hpp"
#include "study_table.hpp"
#include "whole_file.hpp"

namespace {

using estuary::coupler::ChildProcess;
using estuary::coupler::Finished;
using estuary::coupler::FolderLock;
using estuary::coupler::read_csv_rows;
using estuary::coupler::read_whole;
using estuary::coupler::run_program;
using testing::AllOf;
using testing::HasSubstr;

class StudyRun : public estuary::test::CouplerRun {
protected:
  void SetUp() override {
    static_cast<void>(write_two_springs("pressure = 3.0\nslope = 0.6", "stiffness = 1.0",
                                        "mode = \"steady\"\nacceleration = \"constant\"\nrelaxation = 0.5"));
  }
  Finished study(const std::string& text, const std::vector<std::string>& more = {}) const {
    std::ofstream(folder_ / "study.toml") << "scene = \"scene.toml\"\n" << text;
    std::vector<std::string> words = {COUPLER_PROGRAM, "study", (folder_ / "study.toml").string(), "--out",
                                      (folder_ / "out").string()};
    words.insert(words.end(), more.begin(), more.end());
    return run_program(words, "", 60);
  }
  auto rows() const { return read_csv_rows(folder_ / "out" / "study.csv"); }
  std::size_t runs_kept() const {
    std::size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "out" / "cells"))
      count += std::filesystem::exists(entry.path() / "run" / "summary.json") ? 1 : 0;
    return count;
  }
};

const std::string ladder =
    "[[vary]]\ncoupling.tolerance = [1e-1, 1e-2, 1e-3]\n[[quantity]]\nname = \"tip.displacement\"\n"
    "exact = \"3 / (1 - 0.6)\"\n";

TEST_F(StudyRun, WritesErrorAgainstRunTime) {
  const Finished finished = study("repeats = 2\n" + ladder);
  EXPECT_EQ(finished.status, 0) << finished.errors << finished.output;
  const auto table = rows();
  ASSERT_EQ(table.size(), 3U);
  const auto error = [&](std::size_t k) { return std::stod(table[k].at("tip.displacement error")); };
  EXPECT_GT(error(0), 1e-2);
  EXPECT_LT(error(1), error(0));
  EXPECT_LT(error(2), 1e-2);
  EXPECT_EQ(table[0].at("runs"), "2");
  EXPECT_EQ(table[2].at("on_front"), "1") << "nothing is more accurate";
  EXPECT_LE(std::stod(table[0].at("wall_min_s")), std::stod(table[0].at("wall_s")));
  EXPECT_GT(std::stod(table[2].at("iterations")), std::stod(table[0].at("iterations")));
  for (const auto* name : {"study.svg", "study.png", "study.html", "study.md"})
    EXPECT_GT(std::filesystem::file_size(folder_ / "out" / name), 100U) << name;
  EXPECT_THAT(
      read_whole(folder_ / "out" / "study.html"),
      AllOf(HasSubstr("data:image/svg+xml"), HasSubstr("What an error costs"), HasSubstr("3 / (1 - 0.6)")));
}

TEST_F(StudyRun, RunsNothingTwiceAndOnlyWhatIsNew) {
  ASSERT_EQ(study(ladder).status, 0);
  const auto before = rows();
  const Finished again = study(ladder);
  EXPECT_THAT(again.output, HasSubstr("3 of 3 settings have been run before"));
  EXPECT_EQ(rows(), before) << "times included: nothing was run";
  auto longer = ladder;
  longer.replace(longer.find("1e-3]"), 5, "1e-3, 1e-4]");
  const Finished more = study(longer);
  EXPECT_THAT(more.output, AllOf(HasSubstr("3 of 4 settings"), HasSubstr("1/1 0.0001")));
  EXPECT_EQ(runs_kept(), 4U);
}

TEST_F(StudyRun, RetimedItRunsAgainAndKeepsItsErrors) {
  ASSERT_EQ(study(ladder).status, 0);
  const auto before = rows();
  const Finished again = study(ladder, {"--retime"});
  EXPECT_THAT(again.output, HasSubstr("3/3 0.001"));
  const auto after = rows();
  ASSERT_EQ(after.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(after[k].at("error"), before[k].at("error"));
    EXPECT_EQ(after[k].at("runs"), "1");
  }
  EXPECT_NE(after, before) << "times included";
  EXPECT_EQ(study("mode = \"stability\"\n" + ladder, {"--retime"}).status, 2);
}

TEST_F(StudyRun, KeepsTheOtherCellsWhenSomeFail) {
  const Finished finished = study(
      "[set]\ncoupling.recover = false\ncoupling.acceleration = \"none\"\n[[vary]]\nfluid.slope = [0.5, 2.0, "
      "\"steep\"]\n"
      "[[quantity]]\nname = \"tip.displacement\"\nexact = \"3 / (1 - fluid_slope)\"\n");
  EXPECT_EQ(finished.status, 0) << finished.errors;
  EXPECT_THAT(finished.errors, AllOf(HasSubstr("steep is refused and left out"), HasSubstr("slope")));
  const auto table = rows();
  ASSERT_EQ(table.size(), 3U);
  EXPECT_EQ(table[0].at("status"), "done");
  EXPECT_EQ(table[1].at("status"), "diverged or not converged");
  EXPECT_THAT(table[1].at("message"), HasSubstr("window 1"));
  EXPECT_EQ(table[2].at("status"), "refused");
}

TEST_F(StudyRun, RefusesWhatCannotBeStudiedBeforeLaunching) {
  EXPECT_EQ(study("[[vary]]\nfluid.slope = []\n").status, 2);
  const Finished unknown =
      study("[[vary]]\nfluid.slope = [0.5]\n[[quantity]]\nname = \"tipp.x\"\nreference = 1\n");
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.errors, HasSubstr("the scene has no watch 'tipp'"));
  const Finished refused =
      study("[[vary]]\nfluid.slop = [0.5, 0.6]\n[[quantity]]\nname = \"tip.x\"\nreference = 1\n");
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.errors, AllOf(HasSubstr("did you mean 'slope'"), HasSubstr("every setting")));
  EXPECT_EQ(study("[[vary]]\nfluid.slope = [0.5]\n").status, 2) << "no reference anywhere";
}

TEST_F(StudyRun, BisectsTheLimitOfTheUnrelaxedIteration) {
  const Finished finished = study(
      "mode = \"stability\"\n[set]\ncoupling.acceleration = \"none\"\ncoupling.recover = "
      "false\ncoupling.max_iterations = 2000\n"
      "[[vary]]\nsolid.stiffness = [1.0, 2.0]\n[bisect]\nkey = \"fluid.slope\"\nfrom = 0.1\nto = "
      "10.0\nresolution = 0.2\n"
      "[[quantity]]\nname = \"tip.displacement\"\nexact = \"3 / (solid_stiffness - fluid_slope)\"\ntolerance "
      "= 0.01\n");
  EXPECT_EQ(finished.status, 0) << finished.errors << finished.output;
  const auto limits = read_csv_rows(folder_ / "out" / "limits.csv");
  ASSERT_EQ(limits.size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) {
    const double exact = k == 0 ? 1.0 : 2.0;  // it contracts by slope / stiffness
    EXPECT_LE(std::stod(limits[k].at("holds")), exact);
    EXPECT_GE(std::stod(limits[k].at("fails")), exact * 0.8);
    EXPECT_LE(std::stod(limits[k].at("fails")), std::stod(limits[k].at("holds")) * 1.2);
    EXPECT_FALSE(limits[k].at("symptom").empty());
  }
  EXPECT_THAT(read_whole(folder_ / "out" / "study.html"),
              AllOf(HasSubstr("data:image/svg"), HasSubstr("None.")));
}

TEST_F(StudyRun, ListsARunThatIsWrongWithoutAWarning) {
  const Finished finished = study(
      "mode = \"stability\"\n[[vary]]\nfluid.slope = [0.1, 0.2]\n[[vary]]\nsolid.stiffness = [1.0, 2.0]\n"
      "[[quantity]]\nname = \"tip.displacement\"\nexact = \"fluid_slope < 0.15 ? 1000 : 3 / (solid_stiffness "
      "- "
      "fluid_slope)\"\ntolerance = 0.01\nlie = 0.5\n");
  EXPECT_EQ(finished.status, 1) << finished.errors;
  EXPECT_THAT(finished.output, HasSubstr("2 lies"));
  const auto table = rows();
  EXPECT_EQ(table[0].at("lie"), "1");
  EXPECT_EQ(table[1].at("class"), "stable");
}

TEST_F(StudyRun, TwoStudiesDoNotShareAFolder) {
  std::filesystem::create_directories(folder_ / "out");
  const FolderLock other(folder_ / "out", FolderLock::Kind::alone, "study");
  const Finished finished = study("[[vary]]\nsolid.stiffness = [1.0, 2.0]\n");
  EXPECT_NE(finished.status, 0);
  EXPECT_THAT(finished.errors, HasSubstr("another study writes into"));
}

TEST_F(StudyRun, InterruptedItKeepsItsCellsAndGoesOnLater) {
  std::ofstream(folder_ / "study.toml") << "scene = \"scene.toml\"\n[[vary]]\nsolid.seconds = [0.0, "
                                           "5.0]\n[[quantity]]\nname = \"tip.displacement\"\n"
                                           "reference = 7.5\n";
  {
    ChildProcess running(
        {COUPLER_PROGRAM, "study", (folder_ / "study.toml").string(), "--out", (folder_ / "out").string()},
        folder_ / "log");
    for (int k = 0; k < 1000 && read_whole(folder_ / "log").find("1/2") == std::string::npos; ++k)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    ::kill(running.process(), SIGINT);
    running.end(20);
    EXPECT_EQ(running.exit_status(), 130);
  }
  const auto table = rows();
  ASSERT_EQ(table.size(), 2U);
  EXPECT_EQ(table[0].at("status"), "done");
  EXPECT_EQ(table[1].at("status"), "not run");
  EXPECT_EQ(runs_kept(), 1U);
}

// sbatch that runs the tasks of an array at once, and job scripts as they come.
TEST_F(StudyRun, AsAJobArrayGivesTheSameTable) {
  const auto programs = folder_ / "programs";
  std::filesystem::create_directories(programs);
  std::ofstream(programs / "sbatch") << "#!/bin/bash\nscript=${@: -1}\n"
                                        "last=$(sed -n 's/^#SBATCH --array=0-\\([0-9]*\\).*/\\1/p' $script)\n"
                                        "for ((k = 0; k <= ${last:-0}; ++k)); do\n"
                                        "  SLURM_ARRAY_TASK_ID=$k bash $script >>"
                                     << (folder_ / "tasks.log").string() << " 2>&1\ndone\necho 4711\n";
  std::filesystem::permissions(programs / "sbatch", std::filesystem::perms::owner_all);
  const char* found = std::getenv("PATH");
  const std::string path = found == nullptr ? "" : found;
  ::setenv("PATH", (programs.string() + ":" + path).c_str(), 1);
  const Finished finished = study(ladder, {"--slurm"});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(finished.status, 0) << finished.errors << finished.output;
  EXPECT_THAT(finished.output, HasSubstr("job 4711: 3 tasks"));
  const auto table = rows();
  ASSERT_EQ(table.size(), 3U) << read_whole(folder_ / "tasks.log");
  for (const auto& row : table) EXPECT_EQ(row.at("status"), "done");
}

TEST_F(StudyRun, FailsWhenAnErrorGrew) {
  ASSERT_EQ(study(ladder).status, 0);
  const auto before = folder_ / "before.csv";
  std::filesystem::copy_file(folder_ / "out" / "study.csv", before);
  EXPECT_EQ(study(ladder, {"--against", before.string()}).status, 0);
  auto worse = ladder;
  worse.replace(worse.find("3 / (1"), 6, "4 / (1");
  const Finished finished = study(worse, {"--against", before.string()});
  EXPECT_EQ(finished.status, 1);
  EXPECT_THAT(finished.errors, HasSubstr("the error of tip.displacement was"));
}

}  // namespace
