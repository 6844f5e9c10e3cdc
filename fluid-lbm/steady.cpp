#include "steady.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::fluid {

void RemainingChange::add(double relative_change) {
  changes_.push_back(relative_change);
  if (changes_.size() > checks_for_ratio + 2) changes_.pop_front();
}

double RemainingChange::estimate() const {
  // What rounding alone changes; no ratio can be told from it.
  constexpr double rounding = 1e-13;
  if (changes_.size() < 2) return std::numeric_limits<double>::infinity();
  const double last = std::max(changes_.back(), changes_[changes_.size() - 2]);
  if (last < rounding) return last;
  if (changes_.size() < checks_for_ratio + 2) return std::numeric_limits<double>::infinity();
  const double before = std::max(changes_[0], changes_[1]);
  if (!(last < before)) return std::numeric_limits<double>::infinity();
  const double ratio = std::pow(last / before, 1.0 / static_cast<double>(checks_for_ratio));
  return last * ratio / (1 - ratio);
}

int steps_between_checks(int nx, int ny) {
  return std::max(50, 2 * (std::max(nx, ny) / 2));
}

}  // namespace estuary::fluid
