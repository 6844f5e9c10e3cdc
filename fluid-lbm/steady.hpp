// How far a field still is from its limit, judged from how its changes shrink.
#pragma once

#include <deque>

namespace estuary::fluid {

/// Takes relative changes between equally spaced checks. When changes shrink by the factor r from check to
/// check, what is left after the last is change * r / (1 - r).
class RemainingChange {
public:
  void add(double relative_change);
  /// Infinite while there are too few checks to tell, or while changes do not shrink.
  [[nodiscard]] double estimate() const;
  void restart() { changes_.clear(); }

private:
  // The ratio is taken over several checks: sound waves make single ones swing.
  static constexpr std::size_t checks_for_ratio = 4;
  std::deque<double> changes_;
};

/// Steps between checks: about what sound needs along the longer side, and even, because a mode that
/// alternates from step to step should not look like a change.
[[nodiscard]] int steps_between_checks(int nx, int ny);

}  // namespace estuary::fluid
