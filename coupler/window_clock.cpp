#include "window_clock.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace estuary::coupler {
namespace {

// Windows in a row that must succeed before a longer one is tried.
constexpr int successes_before_growth = 4;
// Parts of a window that any length can be divided into: 2^16.
constexpr std::uint64_t finest_division = 65536;

}  // namespace

WindowClock::WindowClock(double window, std::uint64_t count) : window_(window), end_(count) {}

void WindowClock::allow_shorter(double smallest, double granularity) {
  const std::uint64_t count = end_ / full_;
  full_ = granularity > 0
              ? std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(window_ / granularity)))
              : finest_division;
  smallest_ = std::clamp<std::uint64_t>(
      static_cast<std::uint64_t>(std::ceil(smallest / window_ * static_cast<double>(full_) * (1 - 1e-12))), 1,
      full_);
  length_ = full_;
  end_ = count * full_;
}

std::uint64_t WindowClock::length() const {
  return std::min(length_, end_ - now_);
}

double WindowClock::time_of(std::uint64_t ticks) const {
  const std::uint64_t part = ticks % full_;
  const std::uint64_t windows = ticks / full_;
  const double whole = static_cast<double>(windows) * window_;
  return part == 0 ? whole : whole + window_ * (static_cast<double>(part) / static_cast<double>(full_));
}

WindowSpan WindowClock::span() const {
  const std::uint64_t ticks = length();
  return {time_of(now_),
          ticks == full_ ? window_ : window_ * (static_cast<double>(ticks) / static_cast<double>(full_))};
}

bool WindowClock::shorten() {
  const std::uint64_t now = length();
  if (now <= smallest_) return false;
  length_ = std::max(smallest_, now / 2);
  successes_ = 0;
  return true;
}

void WindowClock::save(StateWriter& state) const {
  state.count(full_);
  state.count(now_);
  state.count(length_);
  state.count(static_cast<std::size_t>(successes_));
}

void WindowClock::load(StateReader& state) {
  if (state.count() != full_) throw std::runtime_error("its windows are divided in another way");
  now_ = state.count();
  length_ = std::clamp<std::uint64_t>(state.count(), 1, full_);
  successes_ = static_cast<int>(state.count());
}

void WindowClock::accept() {
  now_ += length();
  if (length_ == full_ || ++successes_ < successes_before_growth) return;
  length_ = std::min(full_, 2 * length_);
  successes_ = 0;
}

}  // namespace estuary::coupler
