#include "contact_law.hpp"

#include <cmath>
#include <numbers>

namespace estuary::grains {

double linear_damping_ratio(double restitution) {
  if (restitution <= 0) return 2;
  const double log_e = std::log(restitution);
  return -2 * log_e / std::sqrt(std::numbers::pi * std::numbers::pi + log_e * log_e);
}

double cut_restitution(double restitution) {
  const double zeta = 0.5 * linear_damping_ratio(restitution);
  if (zeta <= 0) return 1;
  if (zeta >= 1) return 0;
  // The force vanishes when tan(omega t) = 2 zeta sqrt(1 - zeta^2) / (2 zeta^2 - 1).
  const double root = std::sqrt(1 - zeta * zeta);
  const double phase = std::atan2(2 * zeta * root, 2 * zeta * zeta - 1);
  return std::exp(-zeta * phase / root);
}

double linear_contact_time(double normal_stiffness, double restitution, double effective_mass) {
  const double zeta = 0.5 * linear_damping_ratio(restitution);
  return std::numbers::pi / std::sqrt(normal_stiffness / effective_mass * (1 - zeta * zeta));
}

double hertz_contact_time(double effective_modulus, double effective_mass, double effective_radius,
                          double speed) {
  return 2.87 * std::pow(effective_mass * effective_mass /
                             (effective_radius * effective_modulus * effective_modulus * speed),
                         0.2);
}

template <int D>
std::size_t history_size_of(const LawChoice& law) {
  const std::size_t tangential = law.friction == FrictionLaw::spring ? spin_components<D> : 0;
  const std::size_t rolling = law.rolling == RollingLaw::spring ? (D == 2 ? 1 : 4) : 0;
  return tangential + rolling;
}
template std::size_t history_size_of<2>(const LawChoice&);
template std::size_t history_size_of<3>(const LawChoice&);

}  // namespace estuary::grains
