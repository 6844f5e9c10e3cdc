// Makes the gradient weights of a body with particles on its contour obey a discrete divergence theorem.
//
// Wanted for every particle j, besides exactness for linear fields (sum_j g_ij (X_j - X_i) = I):
//     sum_i V_i (d grad u_i / d u_j) = b_j,   b_j = half the outward normals (times length) of j's two
//     segments.
// Then a body under one stress is in equilibrium with the consistent loads of its traction, whatever the
// outline: the constant-stress patch test holds to round-off. The least change of the weights that does so,
// relative to the kernel weights, is the solution of one sparse system per component (a conservative
// mesh-free scheme: Chiu, Wang, Hu & Jameson 2012; variational consistency: Chen, Hillman & Rueter 2013).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "particles.hpp"

namespace estuary::solid {

/// One row of gradient weights: what particle i sees of its neighbours.
struct GradientRow {
  std::vector<std::uint32_t> neighbour;
  std::vector<std::array<double, 2>> offset;    // X_j - X_i [m]
  std::vector<std::array<double, 2>> gradient;  // g_ij [1/m]
  std::vector<double> weight;                   // of the kernel, any unit
  bool complete = true;                         // every quadratic term asked for was resolved
};

/// Changes `rows` in place; returns the largest mismatch left, relative to the spacing.
double make_consistent(const Body& body, std::vector<GradientRow>& rows);

}  // namespace estuary::solid
