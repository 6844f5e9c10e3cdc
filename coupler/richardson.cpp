#include "richardson.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::coupler {
namespace {

constexpr double least_order = 0.3;  // below, the ladder has not begun to converge
constexpr double largest_order = 10;

/// (h1^p - h2^p) / (h2^p - h3^p), which grows with p.
double ratio_of_differences(const double* h, double p) {
  const double middle = std::pow(h[1], p);
  return (std::pow(h[0], p) - middle) / (middle - std::pow(h[2], p));
}

std::optional<double> order_of(const double* h, const double* f) {
  const double wanted = (f[0] - f[1]) / (f[1] - f[2]);
  if (!std::isfinite(wanted) || wanted <= 0) return std::nullopt;
  double low = least_order;
  double high = largest_order;
  if (wanted < ratio_of_differences(h, low) || wanted > ratio_of_differences(h, high)) return std::nullopt;
  for (int k = 0; k < 200 && high - low > 1e-12; ++k) {
    const double middle = 0.5 * (low + high);
    (ratio_of_differences(h, middle) < wanted ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

LadderLimit ladder_limit(const std::vector<double>& sizes, const std::vector<double>& values,
                         std::optional<double> order) {
  const std::size_t count = std::min(sizes.size(), values.size());
  if (count == 0) return {.value = std::numeric_limits<double>::quiet_NaN()};
  LadderLimit limit{.value = values[count - 1]};
  if (!order && count >= 3) order = order_of(&sizes[count - 3], &values[count - 3]);
  if (!order || count < 2) return limit;
  const double factor = std::pow(sizes[count - 2] / sizes[count - 1], *order) - 1;
  if (!(factor > 0)) return limit;
  limit.value += (values[count - 1] - values[count - 2]) / factor;
  limit.order = *order;
  limit.extrapolated = true;
  return limit;
}

std::optional<double> observed_order(const std::vector<double>& sizes, const std::vector<double>& errors) {
  std::vector<double> x;
  std::vector<double> y;
  for (std::size_t k = 0; k < std::min(sizes.size(), errors.size()); ++k) {
    if (!(sizes[k] > 0) || !(errors[k] > 0) || !std::isfinite(errors[k])) continue;
    x.push_back(std::log(sizes[k]));
    y.push_back(std::log(errors[k]));
  }
  if (x.size() < 2) return std::nullopt;
  double mean_x = 0;
  double mean_y = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    mean_x += x[k] / static_cast<double>(x.size());
    mean_y += y[k] / static_cast<double>(x.size());
  }
  double covariance = 0;
  double variance = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    covariance += (x[k] - mean_x) * (y[k] - mean_y);
    variance += (x[k] - mean_x) * (x[k] - mean_x);
  }
  return variance > 0 ? std::optional(covariance / variance) : std::nullopt;
}

}  // namespace estuary::coupler
