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
#include <string_view>
#include <vector>

namespace estuary::solid {

/// Fields whose gradient is exact: linear ones, quadratic ones as well, or none by correction (the plain SPH
/// gradient; with `shepard` divided by the sum of the kernel). `mls_` are the derivatives of the shape
/// functions of moving least squares, whose weights are the kernel itself: full ones, or `_diffuse`.
enum class Order {
  linear,
  quadratic,
  none,
  shepard,
  mls_linear,
  mls_quadratic,
  mls_linear_diffuse,
  mls_quadratic_diffuse
};
/// As scenes call them, in the order above.
inline constexpr std::array<std::string_view, 8> kOrderNames{"linear",
                                                             "quadratic",
                                                             "none",
                                                             "shepard",
                                                             "mls_linear",
                                                             "mls_quadratic",
                                                             "mls_linear_diffuse",
                                                             "mls_quadratic_diffuse"};
/// Whether quadratic fields are meant to be exact.
constexpr bool quadratic_exact(Order order) {
  return order == Order::quadratic || order == Order::mls_quadratic || order == Order::mls_quadratic_diffuse;
}
constexpr bool is_diffuse(Order order) {
  return order == Order::mls_linear_diffuse || order == Order::mls_quadratic_diffuse;
}
constexpr bool is_moving_least_squares(Order order) {
  return order == Order::mls_linear || order == Order::mls_quadratic || is_diffuse(order);
}

/// One point of a neighbourhood, relative to the place of evaluation and divided by the spacing.
struct Offset {
  double x = 0;
  double y = 0;
};

/// Which quadratic terms values are asked to reproduce, beyond every linear field.
enum class Curvature {
  all,
  tangential,  // along `tangent` only
  none
};

/// Weights a_j with sum_j a_j f_j = f(0). Throws std::domain_error when the points do not span the plane.
std::vector<double> value_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                  Curvature curvature, Offset tangent = {});

/// The same for points on a line through or beside 0: reproduces linear fields along `tangent`.
std::vector<double> value_weights_on_line(std::span<const Offset> offsets, std::span<const double> weights,
                                          Offset tangent);

/// Weights g_j with sum_j (f_j - f(0)) g_j = grad f(0), per unit of the offsets. `complete` tells whether
/// every quadratic term was resolved.
struct GradientWeights {
  std::vector<std::array<double, 2>> weights;
  bool complete = true;
};
/// With `between`, of a place that has no value of its own: sum_j g_j = 0, and sum_j f_j g_j = grad f(0).
GradientWeights gradient_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                 Order order, bool between = false);

}  // namespace estuary::solid
