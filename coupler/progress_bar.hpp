// One line that tells a person what the run is doing: redrawn in place on a terminal, repeated now and then
// in a file.
#pragma once

#include <chrono>
#include <string>

#include "coupling_scene.hpp"
#include "participants.hpp"

namespace estuary::coupler {

class ProgressBar {
public:
  explicit ProgressBar(const CouplingScene& scene);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void begin(const Position& position) { position_ = position; }
  /// The residual of the iteration just finished.
  void residual(double value);
  /// Somebody is being waited for; draws at most five times per second.
  void waiting(const RemoteParticipant& participant, const char* phase, double seconds);
  /// Removes the line from the terminal.
  void clear();

private:
  [[nodiscard]] double fraction_done(double inside) const;

  const CouplingScene& scene_;
  bool terminal_;
  Position position_;
  double first_residual_ = 0;
  double last_residual_ = 0;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point begin_;
  std::chrono::steady_clock::time_point last_drawn_;
};

}  // namespace estuary::coupler
