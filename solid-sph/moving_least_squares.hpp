// Shape functions of moving least squares over scattered points (Lancaster & Salkauskas 1981; as kernels of
// SPH: Dilts 1999):
//     Phi_j(x) = p(x)^T A(x)^-1 p(x_j) W(x - x_j),   A(x) = sum_j W(x - x_j) p(x_j) p(x_j)^T,
// with the monomials of degree 0, 1 or 2 as p. They reproduce these in value and, by either derivative, in
// gradient: the full one is that of Phi_j, the diffuse one (Nayroles, Touzot & Villon 1992) holds A and W as
// they are at x and moves p alone,
//     dPhi_j = dp(x)^T A(x)^-1 p(x_j) W(x - x_j),
// so that the gradient needs no slope of the kernel and is none of the values'.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "kernel_function.hpp"
#include "reproducing_weights.hpp"

namespace estuary::solid {

/// Of every point, at 0.
struct ShapeFunctions {
  std::vector<double> value;
  std::vector<std::array<double, 2>> gradient;  // per unit of the offsets
};

enum class Derivative { full, diffuse };

/// `degree` 0, 1 or 2; `h` in the unit of the offsets. Throws std::domain_error when the points do not tell
/// the monomials apart.
ShapeFunctions moving_least_squares(std::span<const Offset> offsets, Kernel kernel, double h, int degree,
                                    Derivative derivative = Derivative::full);

}  // namespace estuary::solid
