// Weights over scattered points that reproduce polynomials: for values and for gradients.
//
// Both minimise sum_j a_j^2 / w_j under moment conditions, which is moving least squares with weights w_j
// (Lancaster & Salkauskas 1981). Linear fields are reproduced exactly, always; quadratic terms as far as the
// points can tell them apart (truncated singular values), so that an edge or a two-particle beam loses only
// what it must.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace estuary::solid {

enum class Order { linear, quadratic };

/// One point of a neighbourhood, relative to the place of evaluation and divided by the spacing.
struct Offset {
  double x = 0;
  double y = 0;
};

/// Weights a_j with sum_j a_j f_j = f(0). Throws std::domain_error when the points do not span the plane.
/// With `along_line`, linear fields along the line the points lie on are reproduced instead.
std::vector<double> value_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                  Order order, bool along_line = false);

/// Weights g_j with sum_j (f_j - f(0)) g_j = grad f(0), per unit of the offsets. `complete` tells whether
/// every quadratic term was resolved.
struct GradientWeights {
  std::vector<std::array<double, 2>> weights;
  bool complete = true;
};
GradientWeights gradient_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                 Order order);

}  // namespace estuary::solid
