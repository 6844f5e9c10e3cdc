// A dense flow of discs down a rough incline: the case grain codes are compared on (Silbert et al. 2001, in
// the plane). Units of disc diameter, mass and gravity: k_n = 2e5, k_t = 2/7 k_n, restitution 0.883, mu =
// 0.5, dt = 1e-4, 22 degrees.
#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "dynamics.hpp"

namespace estuary::grains::bench {

inline constexpr double kStep = 1e-4;
inline constexpr double kStiffness = 2e5;
inline constexpr double kRestitution = 0.883;

inline InitialGrains<2> incline_grains(std::size_t mobile, std::size_t base) {
  InitialGrains<2> grains;
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto add = [&](double x, double y, bool held) {
    const double r = 0.5 * (1 + (held ? 0 : 0.1 * unit(random)));
    const double mass = 4 * r * r;  // a disc of diameter 1 has mass 1
    grains.position.insert(grains.position.end(), {x, y});
    grains.velocity.insert(grains.velocity.end(), {held ? 0 : 0.1 * unit(random), 0});
    grains.spin.push_back(0);
    grains.radius.push_back(r);
    grains.mass.push_back(mass);
    grains.inertia.push_back(0.5 * mass * r * r);
    grains.held.push_back(held);
  };
  for (std::size_t i = 0; i < base; ++i) add(static_cast<double>(i) + 0.5, 0, true);
  const std::size_t per_row = base * 9 / 10;
  const double pitch = static_cast<double>(base) / static_cast<double>(per_row);
  for (std::size_t i = 0; i < mobile; ++i) {
    const std::size_t row = i / per_row, column = i % per_row;
    add((static_cast<double>(column) + 0.5 + 0.25 * static_cast<double>(row % 2)) * pitch,
        1.0 + 1.08 * static_cast<double>(row), false);
  }
  return grains;
}

inline DynamicsSettings<2> incline_settings(std::size_t base, RollingLaw rolling, double skin) {
  DynamicsSettings<2> settings;
  settings.domain.from = {0, -2};
  settings.domain.to = {static_cast<double>(base), 1000};
  settings.domain.periodic = {true, false};
  settings.law.rolling = rolling;
  settings.constants.normal_stiffness = kStiffness;
  settings.constants.damping = linear_damping_ratio(kRestitution) * std::sqrt(kStiffness);
  settings.constants.friction = 0.5;
  settings.constants.tangential_stiffness = 2.0 / 7 * kStiffness;
  settings.constants.inverse_tangential_stiffness = 1 / settings.constants.tangential_stiffness;
  settings.constants.tangential_damping = 0.5;
  settings.constants.rolling_friction = 0.05;
  settings.constants.rolling_stiffness = kStiffness;
  settings.constants.rolling_damping = 0.3;
  const double angle = 22 * std::numbers::pi / 180;
  settings.gravity = {std::sin(angle), -std::cos(angle)};
  settings.skin = skin;
  return settings;
}

}  // namespace estuary::grains::bench
