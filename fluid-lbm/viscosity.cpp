#include "viscosity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::fluid {
namespace {

double unlimited(const ViscosityLaw& law, double rate) {
  switch (law.rheology) {
    case Rheology::power_law:
      return rate > 0 ? law.consistency * std::pow(rate, law.index - 1)
                      : (law.index < 1 ? law.largest : law.smallest);
    case Rheology::carreau_yasuda:
      return law.infinite_shear +
             (law.zero_shear - law.infinite_shear) *
                 std::pow(1 + std::pow(law.time_constant * rate, law.yasuda), (law.index - 1) / law.yasuda);
    case Rheology::bingham_papanastasiou: {
      const double x = law.time_constant * rate;
      const double plastic = x > 1e-12 ? -std::expm1(-x) / rate : law.time_constant;
      return law.infinite_shear + law.yield_stress * plastic;
    }
  }
  return law.smallest;
}

}  // namespace

double dynamic_viscosity(const ViscosityLaw& law, double rate) {
  return std::clamp(unlimited(law, rate), law.smallest, law.largest);
}

double viscosity_from_stress(const ViscosityLaw& law, double stress) {
  const auto viscosity = [&](double rate) {
    return dynamic_viscosity(law, rate * law.rate_scale) * law.viscosity_scale;
  };
  // What is too much at this rate; grows with it.
  const auto surplus = [&](double rate, double nu) { return rate * (0.5 + 3 * nu) - stress; };
  double low = stress / (0.5 + 3 * law.largest * law.viscosity_scale);
  double high = stress / (0.5 + 3 * law.smallest * law.viscosity_scale);
  double rate = low;
  double nu = viscosity(rate);
  double before_rate = high;
  double before = surplus(high, viscosity(high));
  constexpr int most_steps = 60;
  for (int step = 0; step < most_steps; ++step) {
    const double now = surplus(rate, nu);
    if (now == 0 || high - low <= 1e-14 * high) break;
    (now > 0 ? high : low) = rate;
    // Secant, or the middle when it leaves the bracket.
    double next = now != before ? rate - now * (rate - before_rate) / (now - before) : low;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - rate) <= 1e-13 * rate) break;
    before_rate = rate;
    before = now;
    rate = next;
    nu = viscosity(rate);
  }
  return nu;
}

ViscosityTable::ViscosityTable(const ViscosityLaw& law) : law_(law), coefficients_(pieces), at_rest_(0) {
  constexpr double tolerance = 1e-8;
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  const auto exact = [&](double stress) { return viscosity_from_stress(law, stress); };
  double start = exact(smallest_stress);
  at_rest_ = exact(0);
  if (!(std::abs(start - at_rest_) <= tolerance * start)) at_rest_ = unknown;
  for (std::uint64_t piece = 0; piece < pieces; ++piece) {
    const auto from = std::bit_cast<double>((first_piece + piece) << piece_bits);
    const auto to = std::bit_cast<double>((first_piece + piece + 1) << piece_bits);
    const auto at = [&](double t) { return from + t * (to - from); };
    // Through both ends and two places between: continuous, and the error is largest near the ends.
    const double end = exact(to);
    const double a = exact(at(1.0 / 3)) - start;
    const double b = exact(at(2.0 / 3)) - start;
    const double c = end - start;
    auto& k = coefficients_[piece];
    k = {start, 9 * a - 4.5 * b + c, -22.5 * a + 18 * b - 4.5 * c, 13.5 * a - 13.5 * b + 4.5 * c};
    for (const double t : {0.12, 0.5, 0.88}) {
      const double expected = exact(at(t));
      if (std::abs(k[0] + t * (k[1] + t * (k[2] + t * k[3])) - expected) > tolerance * expected) {
        k[0] = unknown;
        break;
      }
    }
    start = end;
  }
}

}  // namespace estuary::fluid
