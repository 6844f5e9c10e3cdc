// What a participant knows of an input inside a window: values come at the ends of windows only, and a solver
// that takes several steps in a window needs them in between.
//
//   constant   the value at the window's end throughout            first order in the window
//   linear     between the values at its start and its end         second order
//   quadratic  through the start of the window before as well      third order; linear in the first window
//
// Where the rate is given too (displacement with velocity), the cubic Hermite polynomial of both ends is of
// fourth order and needs no window before: `hermite`.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

namespace estuary {

enum class InterpolationInTime { constant, linear, quadratic };

/// In this order for SceneTable::choice.
inline constexpr std::array<std::string_view, 3> interpolation_names = {"constant", "linear", "quadratic"};
/// Of one of these names.
InterpolationInTime interpolation_named(std::string_view name);

/// Cubic Hermite polynomial at s in 0..1 of a window of `duration` [s].
double hermite(double start, double start_rate, double end, double end_rate, double duration, double s);

class WindowInterpolation {
public:
  /// `start`: the values at the start of the first window.
  WindowInterpolation(InterpolationInTime kind, std::vector<double> start);

  /// The values at the end of the window, which lasts `duration` [s]. May be called again for each iteration.
  void set_end(std::span<const double> end, double duration);
  /// Value `i` at the share s in 0..1 of the window.
  [[nodiscard]] double at(std::size_t i, double s) const;
  /// The window's end becomes the start of the next.
  void accept();

  /// What is kept after `accept`, for a checkpoint; `restore` takes it back. Throws std::invalid_argument for
  /// values of another input.
  [[nodiscard]] std::vector<double> save() const;
  void restore(std::span<const double> values);

private:
  InterpolationInTime kind_;
  std::vector<double> before_;  // at the start of the window before; empty in the first
  std::vector<double> start_;
  std::vector<double> end_;
  double before_duration_ = 0;  // of the window before [s]
  double duration_ = 0;
};

}  // namespace estuary
