// Hourglass control of particles that have flowed: viscous in place of the springs they have lost (the two
// forms of Ganzenmueller 2015).
//
// It takes sum 1/2 T s_ij k_ij |v_j - v_i - F'_i X_ij|^2 per time, with the springs' stiffness k_ij, a
// relaxation time T and the share s_ij of it that plasticity has released: no rate of an affine motion is
// resisted, momentum and angular momentum are kept, and the power is never positive.
#pragma once

#include <vector>

#include "internal_force.hpp"

namespace estuary::solid {

class HourglassViscosity {
public:
  /// `time` is T of each body [s].
  HourglassViscosity(const Body& body, const Neighbourhood& pairs, std::vector<double> time);
  /// Adds to `fields.force`, for the `fields.spring_share` of the last sweep; returns the power taken [W/m].
  double add_to(const std::vector<double>& velocity, Fields& fields);

private:
  const Body& body_;
  const Neighbourhood& pairs_;
  std::vector<double> time_;
  std::vector<double> rate_, moment_, power_;  // F' and its conjugate, 4 per particle
};

}  // namespace estuary::solid
