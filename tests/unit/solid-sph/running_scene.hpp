// A scene of the solid run window by window, without a coupler.
#pragma once

#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <functional>
#include <string>

#include "participant_under_test.hpp"
#include "solid.hpp"

namespace estuary::solid::test {

class RunningScene {
public:
  RunningScene(const std::string& text, double window, const std::string& role = "solid",
               const v1::Exchange& initial = {})
      : window_(window) {
    Scene scene = Scene::parse(text, "scene.toml");
    solid_.configure(scene, role);
    for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
    static int number = 0;
    folder_ = std::filesystem::temp_directory_path() /
              ("solid-sph-" + std::to_string(::getpid()) + "-" + std::to_string(++number));
    solid_.start(initial, folder_);
  }
  RunningScene(const RunningScene&) = delete;
  RunningScene& operator=(const RunningScene&) = delete;
  ~RunningScene() { std::filesystem::remove_all(folder_); }

  /// What comes from the other participants in a window, by its number from 1 on; nothing without.
  std::function<v1::Exchange(std::uint64_t)> inputs;

  /// With `repeat` every window is computed twice; it counts once.
  void run(int windows, bool repeat = false) {
    for (int w = 0; w < windows; ++w) {
      ++count_;
      for (std::uint64_t iteration = 1; iteration <= (repeat ? 2U : 1U); ++iteration)
        result_ = solid_.advance({.number = count_,
                                  .iteration = iteration,
                                  .mode = Mode::transient,
                                  .time = window_ * static_cast<double>(count_ - 1),
                                  .duration = window_},
                                 inputs ? inputs(count_) : v1::Exchange(), board_);
      solid_.accept();
    }
  }
  /// Of the window last computed.
  double value(const std::string& watch, const std::string& quantity) const {
    return value_of(result_, watch, quantity);
  }
  [[nodiscard]] const AdvanceResult& result() const { return result_; }
  void save() { solid_.save(folder_ / "saved"); }
  /// Goes on from where another one, of the same scene, was saved.
  void go_on_from(const RunningScene& other) {
    solid_.load(other.folder_ / "saved");
    count_ = other.count_;
  }

private:
  Solid solid_;
  AdvanceResult result_;
  ProgressBoard board_;
  double window_;
  std::uint64_t count_ = 0;
  std::filesystem::path folder_;
};

}  // namespace estuary::solid::test
