#include "window_swing.hpp"

#include <cmath>

namespace estuary::coupler {
namespace {

constexpr int windows_looked_at = 10;
constexpr double kept = 1 - 1.0 / windows_looked_at;

}  // namespace

void WindowSwing::accept(std::span<const double> forces) {
  if (last_.size() != forces.size()) {
    *this = {};
    last_.assign(forces.begin(), forces.end());
    last_change_.assign(forces.size(), 0.0);
    return;
  }
  double size = 0, square = 0, back = 0;
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const double change = forces[i] - last_[i];
    size += forces[i] * forces[i];
    square += change * change;
    back += change * last_change_[i];
    last_change_[i] = change;
    last_[i] = forces[i];
  }
  forces_ = kept * forces_ + size;
  changes_ = kept * changes_ + square;
  returns_ = kept * returns_ + back;
  if (windows_ < windows_looked_at) ++windows_;
}

double WindowSwing::share() const {
  // What swings with n windows a period returns by -cos(2 pi / n): from four on it is resolved.
  if (windows_ < windows_looked_at || !(forces_ > 0) || !(returns_ < 0)) return 0;
  const double share = std::sqrt(changes_ / forces_);
  return share > 0.5 ? share : 0;
}

}  // namespace estuary::coupler
