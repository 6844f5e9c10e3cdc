// Divides a run's time into windows. A window that fails may be tried with half the length where everybody
// allows it; after some successes it grows back, and the end time is met exactly.
#pragma once

#include <cstdint>

#include "partners.hpp"
#include "state_numbers.hpp"

namespace estuary::coupler {

/// Counts in ticks, whole parts of the scene's window, so that the ends of full windows are the same numbers
/// however the windows before were divided.
class WindowClock {
public:
  /// Windows of one length: `count` of `window` [s].
  WindowClock(double window, std::uint64_t count);
  /// Lets windows shrink to `smallest` [s] in multiples of `granularity` [s] (0: any length).
  void allow_shorter(double smallest, double granularity);

  [[nodiscard]] bool at_end() const { return now_ >= end_; }
  /// The window to compute now.
  [[nodiscard]] WindowSpan span() const;
  [[nodiscard]] double end_of_span() const { return time_of(now_ + length()); }
  /// False when it cannot get any shorter.
  bool shorten();
  /// Goes on to the next window. After a few windows in a row without trouble the length doubles, up to the
  /// scene's.
  void accept();

  /// Where it is, but not where it ends: a run may go on for longer than it was first meant to.
  void save(StateWriter& state) const;
  void load(StateReader& state);

private:
  [[nodiscard]] double time_of(std::uint64_t ticks) const;
  [[nodiscard]] std::uint64_t length() const;

  double window_;
  std::uint64_t full_ = 1;      // ticks of the scene's window
  std::uint64_t smallest_ = 1;  // ticks
  std::uint64_t length_ = 1;    // ticks wanted
  std::uint64_t now_ = 0;       // ticks
  std::uint64_t end_;           // ticks
  int successes_ = 0;           // since the length last changed
};

}  // namespace estuary::coupler
