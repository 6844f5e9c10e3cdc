// A fixed-point iteration with known factors, for tests of the acceleration.
#pragma once

#include <cmath>
#include <vector>

#include "acceleration.hpp"

namespace estuary::coupler {

// Iterates x = a + b x for a vector of independent factors b and returns the number of updates until the
// residual is below 1e-10. Component i is scaled by unit[i], as fields of other units are.
inline int updates_until_converged(Acceleration& acceleration, const std::vector<double>& b, int most = 500,
                                   double a = 1.0, const std::vector<double>& unit = {}) {
  std::vector<double> x(b.size(), 0.0);
  std::vector<double> residual(b.size());
  for (int k = 0; k < most; ++k) {
    double norm = 0;
    for (std::size_t i = 0; i < b.size(); ++i) {
      const double scale = unit.empty() ? 1.0 : unit[i];
      residual[i] = a * scale + b[i] * x[i] - x[i];
      norm += residual[i] * residual[i] / (scale * scale);
    }
    if (std::sqrt(norm) < 1e-10) return k;
    acceleration.update(residual, x);
  }
  return most;
}

}  // namespace estuary::coupler
