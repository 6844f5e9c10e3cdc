// The coupler run as a person runs it, in a folder of the test's own.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "child_process.hpp"
#include "temporary_folder.hpp"

namespace estuary::test {

/// The participant that was built as `program`, or the one of its name in the folder that
/// ESTUARY_TEST_PARTICIPANTS names: participants built with a sanitizer are tested with the coupler and the
/// test of the release build.
inline std::string participant_program(const std::filesystem::path& program) {
  const char* folder = std::getenv("ESTUARY_TEST_PARTICIPANTS");
  if (folder == nullptr) return program.string();
  const std::filesystem::path watched = folder / program.filename();
  if (!std::filesystem::exists(watched)) throw std::runtime_error(watched.string() + " is not there");
  return watched.string();
}

class CouplerRun : public testing::Test {
protected:
  /// Words of `coupler run SCENE --out FOLDER/<out>`, with a --set for each of `settings` ("key=value").
  [[nodiscard]] std::vector<std::string> run_words(const std::filesystem::path& scene,
                                                   const std::vector<std::string>& settings,
                                                   const std::string& out = "out") const {
    std::vector<std::string> words = {COUPLER_PROGRAM, "run", scene.string(), "--out",
                                      (folder_ / out).string()};
    for (const auto& setting : settings) words.insert(words.end(), {"--set", setting});
    return words;
  }
  /// Waits at most a minute.
  [[nodiscard]] coupler::Finished run_scene(const std::filesystem::path& scene,
                                            const std::vector<std::string>& settings,
                                            const std::string& out = "out") const {
    return coupler::run_program(run_words(scene, settings, out), "", 60);
  }
  [[nodiscard]] nlohmann::json summary(const std::string& out = "out") const {
    std::ifstream file(folder_ / out / "summary.json");
    return nlohmann::json::parse(file);
  }
#ifdef LINEAR_PARTICIPANT
  /// A scene of two linear participants (linear_participant.cpp), whose fixed point is known: keys of the
  /// tables of the coupler, the fluid and the solid, and what comes after them. It watches "tip".
  [[nodiscard]] std::filesystem::path write_two_springs(const std::string& fluid, const std::string& solid,
                                                        const std::string& coupling,
                                                        const std::string& rest = {}) const {
    const std::string solver = "solver = \"" + participant_program(LINEAR_PARTICIPANT) + "\"\n";
    const auto path = folder_ / "scene.toml";
    std::ofstream(path) << "title = \"two springs\"\ndimension = 2\n[coupling]\n"
                        << coupling << "\n[fluid]\n"
                        << solver << fluid << "\n[solid]\n"
                        << solver << solid << "\n[[watch]]\nname = \"tip\"\nparticipant = \"solid\"\n"
                        << rest;
    return path;
  }
#endif

  TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

}  // namespace estuary::test
