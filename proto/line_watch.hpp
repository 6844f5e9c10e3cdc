// Waiting for the other end of direct lines: awake at first, then asleep.
#pragma once

#include <poll.h>

#include <chrono>
#include <optional>
#include <span>

#include "direct_line.hpp"

namespace estuary {

/// Waits awake at first: waking a thread takes longer than a message, and as long as a small window. It stays
/// awake when the last wait was short enough for it, and offers its processor to other threads between any
/// two looks. Where others want it again and again, or had it so long that a message was seen late, it sleeps
/// through some of the next waits: a sleeper is given a processor at once, and is in nobody's way. One thread
/// only.
class LineWatch {
public:
  /// Waits until something has come over one of `lines`, or a descriptor is ready, and fills in `revents` as
  /// poll(2) does. `watched` holds the descriptors of `lines`, among others. False when `timeout` passes
  /// (none: never) or a signal came.
  [[nodiscard]] bool wait(std::span<pollfd> watched, std::span<DirectLine* const> lines,
                          std::optional<std::chrono::milliseconds> timeout);

private:
  // How soon it gives way to other threads.
  struct Care {
    int may_be_wanted;      // times in a wait that another thread may want the processor
    unsigned first_sleeps;  // waits to sleep through for the first time; twice as many, and more, each time
    unsigned most_sleeps;
  };
  void sleep_through_some(const Care& care);
  [[nodiscard]] bool wait_awake(std::span<pollfd> watched, std::span<DirectLine* const> lines,
                                std::chrono::steady_clock::time_point begin);

  std::chrono::nanoseconds last_{0};            // length of the last wait
  unsigned sleeps_left_ = 0, sleeps_next_ = 0;  // waits to sleep through since a message was seen late
};

/// Says of all lines that their reader sleeps, for as long as this lives, so that it is rung. To be followed
/// by a last look at `has_arrived`.
class Asleep {
public:
  explicit Asleep(std::span<DirectLine* const> lines);
  ~Asleep();
  Asleep(const Asleep&) = delete;
  Asleep& operator=(const Asleep&) = delete;

private:
  std::span<DirectLine* const> lines_;
};

}  // namespace estuary
