#include "solid_fraction.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace estuary::fluid {
namespace {

// Area of the disc left of x, less half of it.
double half_lens(double x, double radius) {
  const double s = std::clamp(x / radius, -1.0, 1.0);
  return radius * radius * (s * std::sqrt(1 - s * s) + std::asin(s));
}

// Area of the disc left of x and below y.
double corner_area(double x, double y, double radius) {
  const double quarter = 0.25 * std::numbers::pi * radius * radius;
  x = std::clamp(x, -radius, radius);
  y = std::clamp(y, -radius, radius);
  if (x * x + y * y < radius * radius) {
    return x * y + 0.5 * (half_lens(x, radius) + half_lens(y, radius)) + quarter;
  }
  if (x < 0 && y < 0) return 0;
  if (x < 0) return half_lens(x, radius) + 2 * quarter;
  if (y < 0) return half_lens(y, radius) + 2 * quarter;
  return half_lens(x, radius) + half_lens(y, radius);
}

// Volume of the unit cube where m.x < alpha, for m >= 0 with sum 1, from the cube's nearest corner.
double volume_below(std::array<double, 3> m, double alpha) {
  if (alpha <= 0) return 0;
  if (alpha >= 1) return 1;
  if (alpha > 0.5) return 1 - volume_below(m, 1 - alpha);
  std::sort(m.begin(), m.end());
  const auto [m1, m2, m3] = m;
  const double m12 = m1 + m2;
  if (alpha < m1) return alpha * alpha * alpha / (6 * m1 * m2 * m3);
  if (alpha < m2) return (alpha * (alpha - m1) + m1 * m1 / 3) / (2 * m2 * m3);
  const double wedges = m1 * m1 * (m1 - 3 * alpha) + m2 * m2 * (m2 - 3 * alpha);
  if (alpha < std::min(m12, m3)) return (alpha * alpha * (3 * m12 - alpha) + wedges) / (6 * m1 * m2 * m3);
  if (m3 >= m12) return (2 * alpha - m12) / (2 * m3);
  return (alpha * alpha * (3 - 2 * alpha) + wedges + m3 * m3 * (m3 - 3 * alpha)) / (6 * m1 * m2 * m3);
}

}  // namespace

double disc_fraction(double x, double y, double radius) {
  x = std::abs(x);
  y = std::abs(y);
  const double near = std::hypot(std::max(x - 0.5, 0.0), std::max(y - 0.5, 0.0));
  if (near >= radius) return 0;
  if (std::hypot(x + 0.5, y + 0.5) <= radius) return 1;
  const double area = corner_area(x + 0.5, y + 0.5, radius) - corner_area(x - 0.5, y + 0.5, radius) -
                      corner_area(x + 0.5, y - 0.5, radius) + corner_area(x - 0.5, y - 0.5, radius);
  return std::clamp(area, 0.0, 1.0);
}

double sphere_fraction(double x, double y, double z, double radius) {
  const std::array<double, 3> at{std::abs(x), std::abs(y), std::abs(z)};
  const double distance = std::sqrt(x * x + y * y + z * z);
  constexpr double half_diagonal = 0.8660254037844387;
  if (distance >= radius + half_diagonal) return 0;
  if (distance <= radius - half_diagonal) return 1;
  if (distance < 1e-9) return std::min(1.0, 4.0 / 3.0 * std::numbers::pi * radius * radius * radius);
  const double sum = at[0] + at[1] + at[2];
  const std::array<double, 3> m{at[0] / sum, at[1] / sum, at[2] / sum};
  // The mean of t^2 / (2 radius) over a unit square of tangential positions t.
  const double inwards = 1.0 / (12.0 * radius);
  // n.x < radius - inwards, counted from the cube's corner nearest to the centre, in units of sum / distance.
  const double alpha = (radius - inwards - distance) * distance / sum + 0.5;
  return volume_below(m, alpha);
}

}  // namespace estuary::fluid
