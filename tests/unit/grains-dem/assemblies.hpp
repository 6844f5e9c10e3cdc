// Small samples that several tests start from.
#pragma once

#include <cmath>
#include <numbers>
#include <random>

#include "dynamics.hpp"

namespace estuary::grains::test {

template <int D>
void add_grain(InitialGrains<D>& grains, Vector<D> x, Vector<D> v, double radius, double density = 1000,
               Spin<D> w = {}, bool held = false) {
  const double pi = std::numbers::pi;
  const double mass = density * (D == 2 ? pi * radius * radius : 4.0 / 3 * pi * radius * radius * radius);
  grains.position.insert(grains.position.end(), x.begin(), x.end());
  grains.velocity.insert(grains.velocity.end(), v.begin(), v.end());
  grains.spin.insert(grains.spin.end(), w.begin(), w.end());
  grains.radius.push_back(radius);
  grains.mass.push_back(mass);
  grains.inertia.push_back((D == 2 ? 0.5 : 0.4) * mass * radius * radius);
  grains.held.push_back(held);
}

template <int D>
DynamicsSettings<D> free_space(double stiffness, double restitution, double friction = 0) {
  DynamicsSettings<D> settings;
  settings.domain.to.fill(1);
  settings.law.friction = friction > 0 ? FrictionLaw::spring : FrictionLaw::none;
  settings.constants.normal_stiffness = stiffness;
  settings.constants.damping = linear_damping_ratio(restitution) * std::sqrt(stiffness);
  settings.constants.friction = friction;
  settings.constants.tangential_stiffness = 2.0 / 7 * stiffness;
  settings.constants.inverse_tangential_stiffness = 3.5 / stiffness;
  settings.constants.tangential_damping = 0.5;
  settings.skin = 0.002;
  return settings;
}

/// `count` grains shaken on a square (cubic) lattice in a periodic box, solid fraction about 0.5, moving at
/// random.
template <int D>
InitialGrains<D> gas(int per_side, double spread, DynamicsSettings<D>& settings, unsigned seed = 1) {
  InitialGrains<D> grains;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const double pitch = 0.022;
  settings.domain.from.fill(0);
  settings.domain.to.fill(pitch * per_side);
  settings.domain.periodic.fill(true);
  const int layers = D == 3 ? per_side : 1;
  for (int l = 0; l < layers; ++l)
    for (int r = 0; r < per_side; ++r)
      for (int c = 0; c < per_side; ++c) {
        Vector<D> x{}, v{};
        x[0] = pitch * (c + 0.5);
        x[1] = pitch * (r + 0.5);
        if constexpr (D == 3) x[2] = pitch * (l + 0.5);
        for (double& k : v) k = unit(random);
        Spin<D> w{};
        for (double& k : w) k = 50 * unit(random);
        add_grain<D>(grains, x, v, 0.01 * (1 - 0.5 * spread * (1 + unit(random))), 1000, w);
      }
  return grains;
}

template <int D>
struct Totals {
  Vector<D> momentum{};
  Spin<D> angular{};
};
/// Momentum, and angular momentum about the origin (free space only).
template <int D>
Totals<D> totals(const Dynamics<D>& dynamics) {
  const State<D>& s = dynamics.state();
  Totals<D> t;
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double m = 1 / s.inverse_mass[i];
    const Vector<D> v = load<D>(s.velocity.data(), i);
    t.momentum = t.momentum + m * v;
    t.angular = t.angular + m * arm_times_force(dynamics.unwrapped(i), v) +
                (1 / s.inverse_inertia[i]) * load<spin_components<D>>(s.spin.data(), i);
  }
  return t;
}

}  // namespace estuary::grains::test
