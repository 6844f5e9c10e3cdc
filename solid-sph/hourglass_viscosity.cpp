#include "hourglass_viscosity.hpp"

#include <algorithm>
#include <utility>

#include "on_team.hpp"

namespace estuary::solid {

HourglassViscosity::HourglassViscosity(const Body& body, const Neighbourhood& pairs, std::vector<double> time)
    : body_(body),
      pairs_(pairs),
      time_(std::move(time)),
      rate_(4 * body.size()),
      moment_(4 * body.size()),
      power_(body.size()) {}

double HourglassViscosity::add_to(const std::vector<double>& velocity, Fields& fields) {
  const std::size_t n = body_.size();
  const double* v = velocity.data();
  const double* share = fields.spring_share.data();
  if (std::all_of(share, share + n, [](double s) { return s == 1.0; })) return 0;
  // First F' = sum (v_j - v_i) (x) g_ij and the moment of the deviations from it, zero where nothing has
  // flowed.
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      double f[4] = {}, m[4] = {};
      power_[i] = 0;
      const double released = (1 - share[i]) * time_[body_.member[i]];
      if (released > 0) {
        for (std::size_t k = pairs_.first[i]; k < pairs_.first[i + 1]; ++k) {
          const std::size_t j = pairs_.neighbour[k];
          for (std::size_t c = 0; c < 2; ++c) {
            const double d = v[2 * j + c] - v[2 * i + c];
            f[2 * c] += d * pairs_.gradient[2 * k];
            f[2 * c + 1] += d * pairs_.gradient[2 * k + 1];
          }
        }
        for (std::size_t k = pairs_.first[i]; k < pairs_.first[i + 1]; ++k) {
          const std::size_t j = pairs_.neighbour[k];
          const double ox = pairs_.offset[2 * k], oy = pairs_.offset[2 * k + 1];
          for (std::size_t c = 0; c < 2; ++c) {
            const double d = v[2 * j + c] - v[2 * i + c] - f[2 * c] * ox - f[2 * c + 1] * oy;
            const double push = released * pairs_.spring[k] * d;
            m[2 * c] += push * ox;
            m[2 * c + 1] += push * oy;
            power_[i] += push * d;
          }
        }
      }
      for (std::size_t c = 0; c < 4; ++c) {
        rate_[4 * i + c] = f[c];
        moment_[4 * i + c] = m[c];
      }
    }
  });
  // Then minus the derivative of half the power with respect to the velocity of every particle: its own
  // deviations, those of its neighbours towards it, and through F' of both.
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      const double own = (1 - share[i]) * time_[body_.member[i]];
      for (std::size_t c = 0; c < 2; ++c) {
        double force = 0;
        for (std::size_t k = pairs_.first[i]; k < pairs_.first[i + 1]; ++k) {
          const std::size_t j = pairs_.neighbour[k];
          const double others = (1 - share[j]) * time_[body_.member[j]];
          if (own == 0 && others == 0) continue;
          const double ox = pairs_.offset[2 * k], oy = pairs_.offset[2 * k + 1];
          const double d = v[2 * j + c] - v[2 * i + c];
          const double from_i = d - rate_[4 * i + 2 * c] * ox - rate_[4 * i + 2 * c + 1] * oy;
          const double from_j = d - rate_[4 * j + 2 * c] * ox - rate_[4 * j + 2 * c + 1] * oy;
          force += pairs_.spring[k] * (own * from_i + others * from_j);
          force -= moment_[4 * i + 2 * c] * pairs_.gradient[2 * k] +
                   moment_[4 * i + 2 * c + 1] * pairs_.gradient[2 * k + 1];
          force += moment_[4 * j + 2 * c] * pairs_.reverse_gradient[2 * k] +
                   moment_[4 * j + 2 * c + 1] * pairs_.reverse_gradient[2 * k + 1];
        }
        fields.force[2 * i + c] += force;
      }
    }
  });
  return ordered_sum(n, [&](std::size_t i) { return power_[i]; });
}

}  // namespace estuary::solid
