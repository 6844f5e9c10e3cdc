// Moving least squares at a particle that moves among others, without allocation: moving_least_squares.hpp's
// shape functions of degree 1 or 2 as coefficients, from which the gradient of any neighbour follows.
//
// The degree falls where the neighbours do not tell the monomials apart (Maurel 2008, ch. 2). Of the moment
// matrix A what the lower monomials leave of the higher ones counts (Schur complements), relative to that of
// the undisturbed lattice, whatever the directions are called:
//     degree 2 when det S / tr(S)^2 of x^2, sqrt(2) x y, y^2, about the smallest eigenvalue of S, is at least
//     kLeastCurved of it; degree 1 when the smaller eigenvalue of what 1 leaves of x, y is at least
//     kLeastLinear; else degree 0, Shepard's W_j / sum W.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace estuary::solid {

/// Shape functions' derivatives: full, or with the weights held (diffuse).
template <int Degree, bool Full>
class MovingFit {
  static_assert(Degree == 1 || Degree == 2);

public:
  static constexpr std::size_t terms = Degree == 2 ? 6 : 3;
  /// Of the coefficients of a particle: values', then those of either gradient.
  static constexpr std::size_t numbers = 3 * terms;
  static constexpr double kLeastLinear = 0.08, kLeastCurved = 0.07;

  /// A neighbour (or the particle itself, at 0) at (x, y), with its weight and -W' / r.
  void add(double weight, double slope, double x, double y) {
    const Terms p = monomials(x, y);
    slope_sum_[0] += slope * x;
    slope_sum_[1] += slope * y;
    for (std::size_t a = 0; a < terms; ++a)
      for (std::size_t b = 0; b <= a; ++b) {
        const double product = p[a] * p[b];
        moments_[a][b] += weight * product;
        if constexpr (Full) {
          slopes_[0][a][b] += slope * x * product;
          slopes_[1][a][b] += slope * y * product;
        }
      }
  }

  /// What the lower monomials leave of the higher ones, each as the degree that it decides on asks.
  struct Support {
    double linear = 0, curved = 0;
  };
  /// Once all neighbours are there.
  Support decompose() {
    Support support;
    for (std::size_t c = 0; c < terms; ++c) {
      if (c == 1) {
        const double mean = 0.5 * (moments_[1][1] + moments_[2][2]);
        support.linear = mean - std::hypot(0.5 * (moments_[1][1] - moments_[2][2]), moments_[2][1]);
      }
      if constexpr (Degree == 2)
        if (c == 3)
          support.curved = least_of({moments_[3][3], moments_[4][3], moments_[5][3]},
                                    {moments_[4][4], moments_[5][4], moments_[5][5]});
      Terms column{};
      for (std::size_t r = c + 1; r < terms; ++r) column[r] = moments_[r][c];
      for (std::size_t r = c + 1; r < terms; ++r) {
        const double factor = column[r] / moments_[c][c];
        for (std::size_t k = c + 1; k <= r; ++k) moments_[r][k] -= factor * column[k];
        moments_[r][c] = factor;
      }
    }
    return support;
  }

  /// The highest degree that the support allows; `lattice`: that of the undisturbed one of this size.
  [[nodiscard]] static int degree_of(const Support& support, const Support& lattice) {
    if (!(support.linear >= kLeastLinear * lattice.linear)) return 0;
    return Degree == 2 && support.curved >= kLeastCurved * lattice.curved ? 2 : 1;
  }

  /// The coefficients, `numbers` of them, after `decompose`.
  void solve(int degree, double* coefficients) const {
    for (std::size_t a = 0; a < numbers; ++a) coefficients[a] = 0;
    double *value = coefficients, *along[2] = {coefficients + terms, coefficients + 2 * terms};
    if (degree == 0) {
      value[0] = 1 / moments_[0][0];
      for (std::size_t c = 0; c < 2; ++c) along[c][0] = -slope_sum_[c] * value[0] * value[0];
      return;
    }
    const std::size_t known = degree == 2 ? terms : 3;
    if constexpr (!Full) {
      for (std::size_t c = 0; c < 2; ++c) {
        Terms right{};
        right[1 + c] = 1;
        back(known, right, along[c]);
      }
      return;
    }
    back(known, {1}, value);
    for (std::size_t c = 0; c < 2; ++c) {
      Terms right{};
      right[1 + c] = 1;
      for (std::size_t a = 0; a < known; ++a)
        for (std::size_t b = 0; b < known; ++b)
          right[a] -= slopes_[c][std::max(a, b)][std::min(a, b)] * value[b];
      back(known, right, along[c]);
    }
  }

  /// Gradient of the neighbour's shape function at the particle of the coefficients.
  static std::array<double, 2> gradient(const double* coefficients, double weight, double slope, double x,
                                        double y) {
    const Terms p = monomials(x, y);
    double value = 0, along[2] = {0, 0};
    for (std::size_t a = 0; a < terms; ++a) {
      value += coefficients[a] * p[a];
      along[0] += coefficients[terms + a] * p[a];
      along[1] += coefficients[2 * terms + a] * p[a];
    }
    return {weight * along[0] + slope * x * value, weight * along[1] + slope * y * value};
  }

private:
  using Terms = std::array<double, terms>;
  using Matrix = std::array<Terms, terms>;

  static Terms monomials(double x, double y) {
    if constexpr (Degree == 2)
      return {1, x, y, x * x, x * y, y * y};
    else
      return {1, x, y};
  }

  static double least_of(const std::array<double, 3>& first, const std::array<double, 3>& rest) {
    const double half = std::sqrt(0.5), xx = first[0], xm = first[1] / half, xy = first[2], mm = 2 * rest[0],
                 my = rest[1] / half, yy = rest[2], trace = xx + mm + yy;
    const double determinant = xx * (mm * yy - my * my) - xm * (xm * yy - my * xy) + xy * (xm * my - mm * xy);
    return trace > 0 ? determinant / (trace * trace) : 0;
  }

  void back(std::size_t known, Terms right, double* result) const {
    for (std::size_t r = 0; r < known; ++r)
      for (std::size_t k = 0; k < r; ++k) right[r] -= moments_[r][k] * right[k];
    for (std::size_t r = 0; r < known; ++r) right[r] /= moments_[r][r];
    for (std::size_t r = known; r-- > 0;)
      for (std::size_t k = r + 1; k < known; ++k) right[r] -= moments_[k][r] * right[k];
    for (std::size_t r = 0; r < known; ++r) result[r] = right[r];
  }

  Matrix moments_{};  // after `decompose` L and, on its diagonal, D of L D L^T
  std::array<Matrix, Full ? 2 : 0> slopes_{};
  std::array<double, 2> slope_sum_{};
};

}  // namespace estuary::solid
