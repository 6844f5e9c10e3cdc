#include "moving_least_squares.hpp"

#include <cmath>
#include <stdexcept>

namespace estuary::solid {
namespace {

constexpr std::size_t kQuadraticTerms = 6;
using Terms = std::array<double, kQuadraticTerms>;
using MomentMatrix = std::array<Terms, kQuadraticTerms>;

// A pivot below this share of its diagonal element means that the points cannot tell.
constexpr double kTold = 1e-8;

Terms monomials(const Offset& o) {
  return {1, o.x, o.y, o.x * o.x, o.x * o.y, o.y * o.y};
}

// Cholesky's decomposition in place, lower triangle.
void decompose(MomentMatrix& a, std::size_t terms) {
  for (std::size_t r = 0; r < terms; ++r)
    for (std::size_t c = 0; c <= r; ++c) {
      double rest = a[r][c];
      for (std::size_t k = 0; k < c; ++k) rest -= a[r][k] * a[c][k];
      if (r != c) {
        a[r][c] = rest / a[c][c];
        continue;
      }
      if (!(rest > kTold * a[r][r])) throw std::domain_error("neighbouring particles do not span the plane");
      a[r][r] = std::sqrt(rest);
    }
}

Terms solved(const MomentMatrix& lower, Terms b, std::size_t terms) {
  for (std::size_t r = 0; r < terms; ++r) {
    for (std::size_t k = 0; k < r; ++k) b[r] -= lower[r][k] * b[k];
    b[r] /= lower[r][r];
  }
  for (std::size_t r = terms; r-- > 0;) {
    for (std::size_t k = r + 1; k < terms; ++k) b[r] -= lower[k][r] * b[k];
    b[r] /= lower[r][r];
  }
  return b;
}

}  // namespace

ShapeFunctions moving_least_squares(std::span<const Offset> offsets, Kernel kernel, double h, int degree,
                                    Derivative derivative) {
  const std::size_t terms = degree == 0 ? 1 : degree == 1 ? 3 : kQuadraticTerms;
  MomentMatrix moments{};
  std::array<MomentMatrix, 2> slope_moments{};
  std::vector<double> weight;
  std::vector<std::array<double, 2>> slope;
  for (const Offset& o : offsets) {
    const double r = std::hypot(o.x, o.y), w = kernel_value(kernel, r, h);
    // Over the place of evaluation: W falls away from the point.
    const bool moves = derivative == Derivative::full && r > 0;
    const double factor = moves ? -kernel_slope(kernel, r, h) / r : 0;
    weight.push_back(w);
    slope.push_back({factor * o.x, factor * o.y});
    const Terms p = monomials(o);
    for (std::size_t a = 0; a < terms; ++a)
      for (std::size_t b = 0; b < terms; ++b) {
        moments[a][b] += w * p[a] * p[b];
        for (std::size_t c = 0; c < 2; ++c) slope_moments[c][a][b] += slope.back()[c] * p[a] * p[b];
      }
  }
  decompose(moments, terms);
  // p(0) is the first unit vector, its derivatives the second and the third.
  const Terms first = solved(moments, {1}, terms);
  std::array<Terms, 2> moved{};
  for (std::size_t c = 0; c < 2; ++c) {
    Terms right{};
    if (terms > 1) right[1 + c] = 1;
    for (std::size_t a = 0; a < terms; ++a)
      for (std::size_t b = 0; b < terms; ++b) right[a] -= slope_moments[c][a][b] * first[b];
    moved[c] = solved(moments, right, terms);
  }
  ShapeFunctions result;
  for (std::size_t j = 0; j < offsets.size(); ++j) {
    const Terms p = monomials(offsets[j]);
    double value = 0;
    std::array<double, 2> change{};
    for (std::size_t a = 0; a < terms; ++a) {
      value += first[a] * p[a];
      for (std::size_t c = 0; c < 2; ++c) change[c] += moved[c][a] * p[a];
    }
    result.value.push_back(weight[j] * value);
    result.gradient.push_back(
        {weight[j] * change[0] + slope[j][0] * value, weight[j] * change[1] + slope[j][1] * value});
  }
  return result;
}

}  // namespace estuary::solid
