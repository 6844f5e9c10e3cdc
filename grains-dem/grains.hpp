// The granular medium as a participant: discs or spheres, transient, alone or around them a fluid or beside
// them a solid.
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "medium.hpp"

namespace estuary::grains {

/// A watch asks for a grain beyond the last one.
class UnknownGrain : public std::invalid_argument {
public:
  UnknownGrain(const WatchScene& watch, std::size_t count);
  const std::string& watch() const { return watch_; }

private:
  std::string watch_;
};

/// Derived numbers, warnings, what is left out, memory and variant of a scene without problems. Throws
/// UnknownGrain, and std::invalid_argument for grains that cannot be placed.
Plan plan_of(const GrainsScene& scene);

class Grains final : public Participant {
public:
  void report_to(ProgressBoard& board) override { board_ = &board; }
  [[nodiscard]] Identity identity() const override;
  Plan configure(Scene& scene, const std::string& role) override;
  /// Gives the grains' states when a fluid takes part; takes the wet surface of a solid when one does.
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) override;
  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override;
  [[nodiscard]] std::optional<double> window_step() const override { return 0.0; }
  void accept() override;
  void save(const std::filesystem::path& file) override;
  void load(const std::filesystem::path& file) override;
  std::vector<std::string> frame(std::uint64_t number, double time) override;
  void stop() override;

private:
  void take_inputs(const v1::Exchange& inputs, double middle);  // of the window, in time
  /// Steps through the window.
  void move(const Window& window, ProgressBoard& progress);

  ProgressBoard* board_ = nullptr;  // for the deposit
  GrainsScene scene_;
  std::filesystem::path folder_;
  std::unique_ptr<Medium> medium_;
  v1::WetSurface surface_;
  std::unique_ptr<FieldSeries> series_;
  Work work_;
  double step_seconds_ = 0, transfer_seconds_ = 0;
  std::uint64_t current_window_ = 0, next_audit_ = 0;
};

}  // namespace estuary::grains
