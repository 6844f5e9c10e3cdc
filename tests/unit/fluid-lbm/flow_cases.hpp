// Small flows that several tests start from.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "flow.hpp"

namespace estuary::fluid::cases {

inline FlowSettings box(int nx, int ny, double viscosity, std::array<SideKind, 4> kinds) {
  FlowSettings settings;
  settings.grid = {
      nx, ny, 1.0, 0.0, 0.0, kinds[left] == SideKind::periodic, kinds[bottom] == SideKind::periodic};
  for (std::size_t s = 0; s < 4; ++s) settings.sides[s].kind = kinds[s];
  settings.rates = relaxation_rates(viscosity, 3.0 / 16.0);
  return settings;
}

inline constexpr std::array<SideKind, 4> all_periodic{SideKind::periodic, SideKind::periodic,
                                                      SideKind::periodic, SideKind::periodic};
inline constexpr std::array<SideKind, 4> all_walls{SideKind::wall, SideKind::wall, SideKind::wall,
                                                   SideKind::wall};
inline constexpr std::array<SideKind, 4> walls_along_x{SideKind::periodic, SideKind::periodic, SideKind::wall,
                                                       SideKind::wall};
inline constexpr std::array<SideKind, 4> channel{SideKind::velocity, SideKind::pressure, SideKind::wall,
                                                 SideKind::wall};

/// Smooth, neither symmetric nor solenoidal.
inline Fields uneven_fields(int nx, int ny, double speed) {
  Fields fields;
  for (int y = 0; y < ny; ++y) {
    for (int x = 0; x < nx; ++x) {
      const double a = 2 * std::numbers::pi * x / nx;
      const double b = 2 * std::numbers::pi * y / ny;
      fields.velocity_x.push_back(speed * (std::sin(a + 0.3) * std::cos(2 * b) + 0.2));
      fields.velocity_y.push_back(speed * (std::cos(2 * a) * std::sin(b + 0.7) - 0.1));
      fields.excess.push_back(speed * 0.1 * std::sin(a) * std::cos(b + 0.2));
    }
  }
  return fields;
}

inline void start(Flow& flow, const Fields& fields) {
  set_equilibrium(flow.populations(), fields, flow.settings().equilibrium);
  flow.apply_boundaries();
}

inline Fields fields_of(Flow& flow) {
  flow.apply_boundaries();
  Fields fields;
  compute_fields(flow.populations(), flow.cells(), flow.settings().equilibrium, fields);
  return fields;
}

inline std::size_t at(const Flow& flow, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(flow.grid().nx) + static_cast<std::size_t>(x);
}

struct Outline {
  std::vector<double> positions;
  std::vector<std::uint32_t> connectivity;
  [[nodiscard]] std::size_t nodes() const { return positions.size() / 2; }
  [[nodiscard]] std::vector<double> at_rest() const { return std::vector<double>(positions.size(), 0.0); }
};

/// Points in the order given, one segment between each and the next.
inline Outline line(std::vector<double> points, bool closed) {
  Outline outline;
  outline.positions = std::move(points);
  const auto count = static_cast<std::uint32_t>(outline.nodes());
  for (std::uint32_t n = 0; n + 1 < count; ++n)
    outline.connectivity.insert(outline.connectivity.end(), {n, n + 1});
  if (closed) outline.connectivity.insert(outline.connectivity.end(), {count - 1, 0});
  return outline;
}

/// A disc walked clockwise, the fluid outside.
inline Outline disc(double x, double y, double radius, int count) {
  std::vector<double> points;
  for (int n = 0; n < count; ++n) {
    const double angle = -2 * std::numbers::pi * n / count;
    points.insert(points.end(), {x + radius * std::cos(angle), y + radius * std::sin(angle)});
  }
  return line(points, true);
}

/// A solid above the line y = height from one periodic side to the other; the fluid lies below.
inline Outline ceiling(double length, double height, int count) {
  std::vector<double> points;
  for (int n = 0; n <= count; ++n) points.insert(points.end(), {-0.5 + length * (count - n) / count, height});
  return line(points, false);
}

}  // namespace estuary::fluid::cases
