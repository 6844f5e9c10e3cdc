#include "fluid_material.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

constexpr double kTaitExponent = 7;

}  // namespace

double FluidMaterial::elastic_pressure(double rho) const {
  const double modulus = density * sound_speed * sound_speed;
  switch (equation_of_state) {
    case EquationOfState::linear_density:
      return sound_speed * sound_speed * (rho - density);
    case EquationOfState::tait:
      return modulus / kTaitExponent * (std::pow(rho / density, kTaitExponent) - 1);
    case EquationOfState::acoustic:
      break;
  }
  return modulus * (1 - density / rho);
}

double FluidMaterial::elastic_energy(double rho) const {
  const double modulus = density * sound_speed * sound_speed, ratio = rho / density;
  switch (equation_of_state) {
    case EquationOfState::linear_density:
      return sound_speed * sound_speed * (std::log(ratio) + 1 / ratio - 1);
    case EquationOfState::tait: {
      const double g = kTaitExponent;
      return modulus / (g * density) * ((std::pow(ratio, g - 1) - 1) / (g - 1) + 1 / ratio - 1);
    }
    case EquationOfState::acoustic:
      break;
  }
  return 0.5 * modulus / density * (1 - 1 / ratio) * (1 - 1 / ratio);
}

double FluidMaterial::cavitation_density() const {
  const double modulus = density * sound_speed * sound_speed, share = tension_limit / modulus;
  switch (equation_of_state) {
    case EquationOfState::linear_density:
      return density * (1 - share);
    case EquationOfState::tait:
      return share * kTaitExponent < 1 ? density * std::pow(1 - kTaitExponent * share, 1 / kTaitExponent) : 0;
    case EquationOfState::acoustic:
      break;
  }
  return density / (1 + share);
}

double FluidMaterial::pressure(double rho) const {
  return std::max(elastic_pressure(rho), -tension_limit);
}

double FluidMaterial::energy(double rho) const {
  if (!std::isfinite(tension_limit) || elastic_pressure(rho) >= -tension_limit) return elastic_energy(rho);
  // Beyond it the fluid opens against a constant tension.
  const double limit = cavitation_density();
  return elastic_energy(limit) + tension_limit * (1 / rho - 1 / limit);
}

double FluidMaterial::sound_speed_at(double rho) const {
  const double ratio = rho / density;
  switch (equation_of_state) {
    case EquationOfState::linear_density:
      return sound_speed;
    case EquationOfState::tait:
      return sound_speed * ratio * ratio * ratio;
    case EquationOfState::acoustic:
      break;
  }
  return sound_speed / ratio;
}

}  // namespace estuary::solid
