#include "window_interpolation.hpp"

#include <algorithm>
#include <stdexcept>

namespace estuary {

InterpolationInTime interpolation_named(std::string_view name) {
  const auto found = std::find(interpolation_names.begin(), interpolation_names.end(), name);
  if (found == interpolation_names.end())
    throw std::invalid_argument("no interpolation in time of that name");
  return static_cast<InterpolationInTime>(found - interpolation_names.begin());
}

double hermite(double start, double start_rate, double end, double end_rate, double duration, double s) {
  const double rest = 1 - s;
  return rest * rest * (1 + 2 * s) * start + s * s * (3 - 2 * s) * end +
         s * rest * duration * (rest * start_rate - s * end_rate);
}

WindowInterpolation::WindowInterpolation(InterpolationInTime kind, std::vector<double> start)
    : kind_(kind), start_(std::move(start)), end_(start_) {}

void WindowInterpolation::set_end(std::span<const double> end, double duration) {
  if (end.size() != start_.size() || !(duration > 0))
    throw std::invalid_argument("a window's end needs as many values as its start and a positive duration");
  end_.assign(end.begin(), end.end());
  duration_ = duration;
}

double WindowInterpolation::at(std::size_t i, double s) const {
  if (kind_ == InterpolationInTime::constant) return end_[i];
  const double linear = start_[i] + s * (end_[i] - start_[i]);
  if (kind_ == InterpolationInTime::linear || before_.empty()) return linear;
  // Newton's form with the second divided difference, in units of this window.
  const double earlier = before_duration_ / duration_;
  const double slope_before = (start_[i] - before_[i]) / earlier;
  const double curvature = (end_[i] - start_[i] - slope_before) / (1 + earlier);
  return linear + curvature * s * (s - 1);
}

void WindowInterpolation::accept() {
  before_ = std::move(start_);
  before_duration_ = duration_;
  start_ = end_;
}

std::vector<double> WindowInterpolation::save() const {
  std::vector<double> values{before_duration_};
  values.insert(values.end(), start_.begin(), start_.end());
  values.insert(values.end(), before_.begin(), before_.end());
  return values;
}

void WindowInterpolation::restore(std::span<const double> values) {
  const std::size_t size = start_.size();
  if (values.size() != 1 + size && values.size() != 1 + 2 * size)
    throw std::invalid_argument("what was kept of the input has another length");
  before_duration_ = values[0];
  const auto middle = values.begin() + 1 + static_cast<std::ptrdiff_t>(size);
  start_.assign(values.begin() + 1, middle);
  before_.assign(middle, values.end());
  end_ = start_;
}

}  // namespace estuary
