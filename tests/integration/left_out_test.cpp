// What a scene does not need is not there: no process, no field on the wire, no memory, no branch of the
// kernel.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "coupler_run.hpp"
#include "whole_file.hpp"

namespace {

using estuary::coupler::ChildProcess;
using estuary::coupler::Finished;
using estuary::coupler::read_whole;
using estuary::coupler::run_program;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

// Names of the processes that `process` has started.
std::set<std::string> children_of(pid_t process) {
  std::set<std::string> names;
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", gone)) {
    std::istringstream stat(read_whole(entry.path() / "stat"));
    std::string number;
    std::string name;
    std::string state;
    pid_t parent = 0;
    // A child still has the coupler's name until it becomes the program that it launches.
    if (stat >> number >> name >> state >> parent && parent == process && name != "(coupler)")
      names.insert(name);
  }
  return names;
}

class LeftOut : public estuary::test::CouplerRun {
protected:
  std::vector<std::string> command(const std::string& scene, const std::vector<std::string>& settings) const {
    auto words = run_words(std::string(SCENES) + "/" + scene, settings);
    words.emplace_back("--no-report");
    return words;
  }
  nlohmann::json summary_of(const std::string& scene, std::vector<std::string> settings) const {
    settings.insert(settings.end(), {"output.frames=false"});
    const Finished finished = run_program(command(scene, settings), "", 100);
    EXPECT_LE(finished.status, 1) << finished.errors;
    return summary();
  }
};

const std::vector<std::string> coarse_fin{"fluid.spacing=0.05", "solid.particles_across=2", "fluid.threads=1",
                                          "solid.threads=1", "coupling.tolerance=1e-2"};

TEST_F(LeftOut, AParticipantThatIsSwitchedOffIsNoProcess) {
  auto settings = coarse_fin;
  settings.insert(settings.end(), {"output.frames=false"});
  std::set<std::string> with;
  std::set<std::string> without;
  const auto watch = [&](std::set<std::string>& seen) {
    ChildProcess run(command("fsi/elastic-fin.toml", settings), folder_ / "log");
    const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!run.ended() && std::chrono::steady_clock::now() < patience) {
      seen.merge(children_of(run.process()));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return run.exit_status();
  };
  EXPECT_LE(watch(with), 1) << read_whole(folder_ / "log");
  EXPECT_THAT(with, ElementsAre("(fluid-lbm)", "(solid-sph)"));
  settings.emplace_back("fluid=off");
  EXPECT_LE(watch(without), 1) << read_whole(folder_ / "log");
  EXPECT_THAT(without, ElementsAre("(solid-sph)"));
  const auto json = summary();
  EXPECT_THAT(json["left_out"].get<std::vector<std::string>>(),
              Contains(HasSubstr("fluid: the scene has no [fluid]")));
  EXPECT_FALSE(json["participants"].contains("fluid"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "fluid"));
}

TEST_F(LeftOut, TractionsThatNobodyAskedForAreNotOnTheWire) {
  struct Bytes {
    double fluid, solid;
  };
  // What goes over the wire, message by message.
  const auto bytes = [&](const char* traction) {
    auto settings = coarse_fin;
    settings.insert(settings.end(), {std::string("fluid.viscous_traction=") + traction,
                                     "coupling.min_iterations=3", "coupling.max_iterations=3",
                                     "coupling.at_max_iterations=\"go-on\"", "output.record=true"});
    const auto summary = summary_of("fsi/elastic-fin.toml", settings);
    EXPECT_EQ(summary["iterations"]["total"], 3);
    const auto size = [&](const char* role) {
      return static_cast<double>(
          std::filesystem::file_size(folder_ / "out" / "record" / (std::string(role) + ".record")));
    };
    return Bytes{.fluid = size("fluid"), .solid = size("solid")};
  };
  const Bytes with = bytes("true");
  const Bytes without = bytes("false");
  constexpr double nodes = 42;  // of the fin's wet line, two particles across and twenty along
  constexpr double lengths =
      60;  // of the messages themselves, and times that are written with more or less digits
  EXPECT_NEAR(with.fluid - without.fluid, 3 * 2 * sizeof(double) * nodes, lengths);
  EXPECT_NEAR(with.solid - without.solid, 0, lengths) << "the solid gets nodal forces either way";
}

TEST_F(LeftOut, MemoryIsThatOfThePlan) {
  struct Memory {
    double planned, used;
  };
  const auto memory = [&](const char* spacing) {
    const std::vector<std::string> settings{std::string("fluid.spacing=") + spacing, "fluid.threads=1",
                                            "coupling.window=1e-3", "coupling.end_time=1e-3",
                                            "fluid.lattice_velocity=0.1"};
    Memory result{};
    const auto summary = summary_of("fluid/taylor-green.toml", settings);
    result.used = summary["participants"]["fluid"]["peak_rss_bytes"];
    auto words = command("fluid/taylor-green.toml", settings);
    words[1] = "check";
    words.erase(words.begin() + 3, words.begin() + 5);  // --out FOLDER
    words.pop_back();                                   // --no-report
    const auto plan = run_program(words, "", 60).output;
    const auto at = plan.find("  memory ");
    EXPECT_NE(at, std::string::npos) << plan;
    std::istringstream line(plan.substr(at + 9));
    std::string unit;
    line >> result.planned >> unit;
    EXPECT_EQ(unit, "MB");
    result.planned *= 1e6;
    return result;
  };
  const Memory coarse = memory("0.0078125");
  const Memory fine = memory("0.001953125");
  // The difference of two grids is free of what every process needs.
  EXPECT_NEAR((fine.used - coarse.used) / (fine.planned - coarse.planned), 1, 0.2);
  EXPECT_LT(fine.planned / (512.0 * 512), 2 * 9 * sizeof(double))
      << "one copy of nine populations: the step works in place";
}

TEST_F(LeftOut, TheCompiledVariantSaysWhatItHolds) {
  const auto variant = [&](const std::string& scene, const char* role, std::vector<std::string> settings) {
    return summary_of(scene, std::move(settings))["participants"][role]["variant"].get<std::string>();
  };
  const auto fluid = [&](std::vector<std::string> settings) {
    settings.insert(settings.end(),
                    {"fluid.spacing=0.0625", "fluid.threads=1", "fluid.steady.tolerance=1e-2"});
    return variant("fluid/cavity-100.toml", "fluid", settings);
  };
  EXPECT_EQ(fluid({}), "d2q9-trt-incompressible") << "no force, no varying viscosity";
  EXPECT_EQ(fluid({"fluid.body_force=[1e-6, 0.0]"}), "d2q9-trt-incompressible-guo");
  EXPECT_EQ(fluid({"fluid.collision=central-moment", "fluid.smagorinsky=0.1"}),
            "d2q9-central-moment-compressible-smagorinsky");
  const auto solid = [&](const char* stabilisation) {
    return variant("solid/cook.toml", "solid",
                   {"solid.spacing=8.0", std::string("solid.stabilisation=") + stabilisation});
  };
  EXPECT_THAT(solid("0.02"), HasSubstr("-stabilised"));
  EXPECT_THAT(solid("0.0"), testing::Not(HasSubstr("-stabilised")));
}

TEST_F(LeftOut, CheckAndSummaryListTheSame) {
  auto settings = coarse_fin;
  settings.insert(settings.end(), {"coupling.max_iterations=1", "coupling.at_max_iterations=\"go-on\""});
  const auto listed =
      summary_of("fsi/elastic-fin.toml", settings)["left_out"].get<std::vector<std::string>>();
  EXPECT_THAT(listed, testing::IsSupersetOf({HasSubstr("grains: the scene has no [grains]"),
                                             HasSubstr("fluid: body force"), HasSubstr("solid: gravity")}));
  settings.emplace_back("output.frames=false");
  auto words = run_words(std::string(SCENES) + "/fsi/elastic-fin.toml", settings);
  words[1] = "check";
  words.erase(words.begin() + 3, words.begin() + 5);  // --out FOLDER
  const auto plan = run_program(words, "", 60).output;
  for (const auto& entry : listed) EXPECT_THAT(plan, HasSubstr(entry));
}

}  // namespace
