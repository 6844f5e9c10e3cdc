// Kernels of smoothed particle hydrodynamics in the plane: cubic B-spline, support 2h (Monaghan & Lattanzio
// 1985); quintic B-spline, support 3h (Morris, Fox & Zhu 1997); Wendland C2, support 2h (Wendland 1995).
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

/// W(r, h) [1/m2].
inline double quintic_spline(double r, double h) {
  const double scale = 7.0 / (478.0 * std::numbers::pi * h * h), s = r / h;
  const auto power = [](double x) { return x > 0 ? x * x * x * x * x : 0.0; };
  return scale * (power(3 - s) - 6 * power(2 - s) + 15 * power(1 - s));
}
inline double quintic_spline_slope(double r, double h) {
  const double scale = 7.0 / (478.0 * std::numbers::pi * h * h * h), s = r / h;
  const auto power = [](double x) { return x > 0 ? -5 * x * x * x * x : 0.0; };
  return scale * (power(3 - s) - 6 * power(2 - s) + 15 * power(1 - s));
}
inline double wendland(double r, double h) {
  const double scale = 7.0 / (4.0 * std::numbers::pi * h * h), s = r / h;
  if (s >= 2) return 0;
  const double a = 1 - 0.5 * s;
  return scale * a * a * a * a * (2 * s + 1);
}
inline double wendland_slope(double r, double h) {
  const double scale = 7.0 / (4.0 * std::numbers::pi * h * h * h), s = r / h;
  if (s >= 2) return 0;
  const double a = 1 - 0.5 * s;
  return -scale * 5 * s * a * a * a;
}

enum class Kernel { cubic_spline, quintic_spline, wendland };

/// Radius beyond which a kernel vanishes, in smoothing lengths.
inline double support_ratio(Kernel kernel) {
  return kernel == Kernel::quintic_spline ? 3.0 : 2.0;
}
inline double kernel_value(Kernel kernel, double r, double h) {
  switch (kernel) {
    case Kernel::quintic_spline:
      return quintic_spline(r, h);
    case Kernel::wendland:
      return wendland(r, h);
    case Kernel::cubic_spline:
      break;
  }
  return cubic_spline(r, h);
}
inline double kernel_slope(Kernel kernel, double r, double h) {
  switch (kernel) {
    case Kernel::quintic_spline:
      return quintic_spline_slope(r, h);
    case Kernel::wendland:
      return wendland_slope(r, h);
    case Kernel::cubic_spline:
      break;
  }
  return cubic_spline_slope(r, h);
}

}  // namespace estuary::solid
