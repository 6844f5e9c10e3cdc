#include "velocity_smoothing.hpp"

#include <cmath>

#include "internal_force.hpp"
#include "on_team.hpp"

namespace estuary::solid {

VelocitySmoothing::VelocitySmoothing(const Body& body, const Neighbourhood& pairs, Kernel kernel,
                                     double strength)
    : body_(body), pairs_(pairs), weight_(pairs.pairs()), smoothed_(2 * body.size()) {
  const auto value = [&](std::size_t k) {
    return kernel_value(kernel, std::hypot(pairs.offset[2 * k], pairs.offset[2 * k + 1]),
                        body.smoothing_length);
  };
  std::vector<double> sum(body.size(), 0.0);
  for (std::size_t i = 0; i < body.size(); ++i)
    for (std::size_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k)
      sum[i] += body.volume[pairs.neighbour[k]] * value(k);
  for (std::size_t i = 0; i < body.size(); ++i)
    for (std::size_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k) {
      const std::size_t j = pairs.neighbour[k];
      const double w = value(k);
      if (w > 0)
        weight_[k] = 0.5 * strength * w *
                     (body.mass[i] * body.volume[j] / sum[i] + body.mass[j] * body.volume[i] / sum[j]);
    }
}

double VelocitySmoothing::apply(std::vector<double>& velocity) {
  const std::size_t n = body_.size();
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t c = 0; c < 2; ++c) {
        double change = 0;
        for (std::size_t k = pairs_.first[i]; k < pairs_.first[i + 1]; ++k)
          change += weight_[k] * (velocity[2 * pairs_.neighbour[k] + c] - velocity[2 * i + c]);
        smoothed_[2 * i + c] =
            body_.holds(i, c) ? velocity[2 * i + c] : velocity[2 * i + c] + change / body_.mass[i];
      }
  });
  const double taken = ordered_sum(n, [&](std::size_t i) {
    double energy = 0;
    for (std::size_t c = 2 * i; c < 2 * i + 2; ++c)
      energy += velocity[c] * velocity[c] - smoothed_[c] * smoothed_[c];
    return 0.5 * body_.mass[i] * energy;
  });
  velocity.swap(smoothed_);
  return taken;
}

}  // namespace estuary::solid
