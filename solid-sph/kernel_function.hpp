// The cubic B-spline of smoothed particle hydrodynamics in the plane, support 2h (Monaghan & Lattanzio 1985).
#pragma once

#include <numbers>

namespace estuary::solid {

/// W(r, h) [1/m2].
inline double cubic_spline(double r, double h) {
  const double scale = 15.0 / (7.0 * std::numbers::pi * h * h);
  const double s = r / h;
  if (s >= 2) return 0;
  if (s >= 1) return scale * (2 - s) * (2 - s) * (2 - s) / 6;
  return scale * (2.0 / 3.0 - s * s + 0.5 * s * s * s);
}

/// dW/dr [1/m3]; never positive.
inline double cubic_spline_slope(double r, double h) {
  const double scale = 15.0 / (7.0 * std::numbers::pi * h * h * h);
  const double s = r / h;
  if (s >= 2) return 0;
  if (s >= 1) return -0.5 * scale * (2 - s) * (2 - s);
  return scale * (-2 * s + 1.5 * s * s);
}

}  // namespace estuary::solid
