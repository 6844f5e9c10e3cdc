#include "least_norm.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace estuary::solid {
namespace {

// Turns rows a and b of a matrix by the angle of cosine c and sine s.
void turn(std::vector<double>& a, std::vector<double>& b, double c, double s) {
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double x = a[k], y = b[k];
    a[k] = c * x - s * y;
    b[k] = s * x + c * y;
  }
}

void add(std::vector<double>& to, double factor, std::span<const double> from) {
  for (std::size_t k = 0; k < to.size(); ++k) to[k] += factor * from[k];
}

}  // namespace

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

LeastNorm::LeastNorm(Rows conditions) : conditions_(std::move(conditions)), rotated_(conditions_) {
  constexpr int kSweeps = 40;  // far more than a handful of rows ever take
  constexpr double kOrthogonal = 1e-15;
  const std::size_t count = conditions_.size();
  unknowns_ = count > 0 ? conditions_.front().size() : 0;
  rotation_.assign(count, std::vector<double>(count, 0.0));
  for (std::size_t k = 0; k < count; ++k) rotation_[k][k] = 1;
  bool turned = true;
  for (int sweep = 0; sweep < kSweeps && turned; ++sweep) {
    turned = false;
    for (std::size_t p = 0; p + 1 < count; ++p)
      for (std::size_t q = p + 1; q < count; ++q) {
        const double alpha = dot(rotated_[p], rotated_[p]), beta = dot(rotated_[q], rotated_[q]),
                     gamma = dot(rotated_[p], rotated_[q]);
        if (!(std::abs(gamma) > kOrthogonal * std::sqrt(alpha * beta))) continue;
        turned = true;
        const double zeta = (beta - alpha) / (2 * gamma);
        const double t = (zeta < 0 ? -1.0 : 1.0) / (std::abs(zeta) + std::hypot(1.0, zeta));
        const double c = 1 / std::hypot(1.0, t);
        turn(rotated_[p], rotated_[q], c, c * t);
        turn(rotation_[p], rotation_[q], c, c * t);
      }
  }
  for (const auto& row : rotated_) singular_value_.push_back(std::sqrt(dot(row, row)));
}

std::size_t LeastNorm::rank(double smallest) const {
  return static_cast<std::size_t>(std::count_if(singular_value_.begin(), singular_value_.end(),
                                                [&](double value) { return value > smallest; }));
}

double LeastNorm::largest() const {
  return singular_value_.empty() ? 0 : *std::max_element(singular_value_.begin(), singular_value_.end());
}

std::vector<double> LeastNorm::solve(std::span<const double> target, double smallest) const {
  std::vector<double> x(unknowns_, 0.0), gap(target.begin(), target.end());
  // Twice: the second round removes the rounding of the first.
  for (int round = 0; round < 2; ++round) {
    for (std::size_t k = 0; k < rotated_.size(); ++k)
      if (singular_value_[k] > smallest)
        add(x, dot(rotation_[k], gap) / (singular_value_[k] * singular_value_[k]), rotated_[k]);
    for (std::size_t k = 0; k < gap.size(); ++k) gap[k] = target[k] - dot(conditions_[k], x);
  }
  return x;
}

void LeastNorm::project_out(std::vector<double>& x) const {
  for (int round = 0; round < 2; ++round)
    for (std::size_t k = 0; k < rotated_.size(); ++k)
      if (singular_value_[k] > 0)
        add(x, -dot(rotated_[k], x) / (singular_value_[k] * singular_value_[k]), rotated_[k]);
}

}  // namespace estuary::solid
