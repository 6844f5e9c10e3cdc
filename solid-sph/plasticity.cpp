#include "plasticity.hpp"

namespace estuary::solid {

double Plasticity::dissipation(double from, double to) const {
  const auto density = [&](double alpha) {
    double slope = 0;
    return (1 - damage(alpha)) * at(alpha, slope);
  };
  double sum = 0;
  while (from < to) {
    double end = to;
    const auto stop_at = [&](double kink) {
      if (kink > from && kink < end) end = kink;
    };
    for (std::size_t k = 1; k + 1 < strain.size(); ++k) stop_at(strain[k]);
    if (damage_limit > 0) {
      stop_at(damage_from);
      stop_at(damage_to);
      // Simpson's rule, exact for the product of two linear functions.
      sum += (end - from) / 6 * (density(from) + 4 * density(0.5 * (from + end)) + density(end));
    } else {
      sum += 0.5 * (end - from) * (density(from) + density(end));
    }
    from = end;
  }
  return sum;
}

J2Plasticity::Returned J2Plasticity::return_map(std::array<double, 3> trial, double alpha) const {
  Returned r;
  const double mean = (trial[0] + trial[1] + trial[2]) / 3;
  const std::array<double, 3> deviator{trial[0] - mean, trial[1] - mean, trial[2] - mean};
  const double norm2 = deviator[0] * deviator[0] + deviator[1] * deviator[1] + deviator[2] * deviator[2];
  const double q = 2 * mu * std::sqrt(1.5 * norm2);
  r.strain = trial;
  r.equivalent = q;
  if (plasticity->yield.empty()) return r;
  double slope = 0;
  const double yield = plasticity->at(alpha, slope);
  r.yield = yield;
  if (q <= yield) return r;
  const bool rated = plasticity->reference_rate > 0 && time_step > 0;
  const auto excess = [&](double gamma, double& derivative) {
    double h = 0;
    const double base = plasticity->at(alpha + gamma, h);
    double factor = 1, factor_slope = 0;
    if (rated && gamma > 0) {
      const double exponent = 1 / plasticity->rate_exponent;
      const double power = std::pow(gamma / (time_step * plasticity->reference_rate), exponent);
      factor += power;
      factor_slope = exponent * power / gamma;
    }
    r.yield = base * factor;
    derivative = -3 * mu - h * factor - base * factor_slope;
    return q - 3 * mu * gamma - r.yield;
  };
  // The excess falls from positive at 0 to negative at q / 3 mu: Newton's method kept inside of the bracket.
  double low = 0, high = q / (3 * mu), gamma = rated ? 0.5 * high : 0, derivative = 0;
  for (int iteration = 0; iteration < 100; ++iteration) {
    const double value = excess(gamma, derivative);
    if (value > 0)
      low = gamma;
    else
      high = gamma;
    if (std::abs(value) <= 1e-13 * q) break;
    double next = gamma - value / derivative;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == gamma) break;
    gamma = next;
  }
  excess(gamma, derivative);
  r.gamma = gamma;
  const double share = 1 - 3 * mu * gamma / q;
  for (std::size_t k = 0; k < 3; ++k) r.strain[k] = mean + share * deviator[k];
  r.equivalent = share * q;
  return r;
}

J2Plasticity::Result J2Plasticity::update(const Tensor<double>& f, const double* history,
                                          double* next) const {
  // b = F C_p^-1 F^T, in plane symmetric.
  const double cxx = history[0], cxy = history[1], cyy = history[2];
  const double ax = f.xx * cxx + f.xy * cxy, ay = f.xx * cxy + f.xy * cyy;
  const double bx = f.yx * cxx + f.yy * cxy, by = f.yx * cxy + f.yy * cyy;
  const double b11 = ax * f.xx + ay * f.xy, b12 = ax * f.yx + ay * f.yy, b22 = bx * f.yx + by * f.yy;
  const double middle = 0.5 * (b11 + b22), half = 0.5 * (b11 - b22), radius = std::hypot(half, b12);
  const double large = middle + radius;
  // The smaller one from the determinant: no cancellation.
  const double small = (b11 * b22 - b12 * b12) / large;
  // Dyads of the first principal direction (c, s); any one when both are equal.
  double cc = 1, cs = 0;
  if (radius > 0) {
    cc = 0.5 * (1 + half / radius);
    cs = 0.5 * b12 / radius;
  }
  const double ss = 1 - cc;
  std::array<double, 3> trial{0.5 * std::log(large), 0.5 * std::log(small), 0.5 * std::log(history[3])};
  const double alpha = history[4];
  Returned r;
  const auto across = [&](const Returned& state) {
    const double trace = state.strain[0] + state.strain[1] + state.strain[2];
    return bulk * trace + 2 * mu * (state.strain[2] - trace / 3);
  };
  if (plane == Plane::strain) {
    r = return_map(trial, alpha);
  } else {
    // Stretch across the plane for no stress there: elastic guess, then secants.
    const double lambda = bulk - 2 * mu / 3;
    double a = -lambda * (trial[0] + trial[1]) / (lambda + 2 * mu);
    trial[2] = a;
    r = return_map(trial, alpha);
    double fa = across(r);
    const double size = bulk + 2 * mu;
    double b = a - fa / size;
    for (int iteration = 0; iteration < 60 && std::abs(fa) > 1e-12 * mu; ++iteration) {
      trial[2] = b;
      r = return_map(trial, alpha);
      const double fb = across(r);
      if (fb == fa) break;
      const double step = fb * (b - a) / (fb - fa);
      a = b;
      fa = fb;
      b -= step;
    }
  }
  const double trace = r.strain[0] + r.strain[1] + r.strain[2], mean = trace / 3;
  const double alpha_now = alpha + r.gamma;
  const double damage = std::max(history[5], plasticity->damage(alpha_now));
  const double whole = 1 - damage;
  std::array<double, 3> tau{};
  double deviator2 = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    tau[k] = whole * (bulk * trace + 2 * mu * (r.strain[k] - mean));
    deviator2 += (r.strain[k] - mean) * (r.strain[k] - mean);
  }
  Result result;
  const double undamaged = 0.5 * bulk * trace * trace + mu * deviator2;
  result.stored = whole * undamaged;
  // Plastic work, at the increment's one rate, and the energy damage sets free.
  if (r.gamma > 0) {
    double slope = 0;
    const double rate_factor = r.yield / plasticity->at(alpha_now, slope);
    result.dissipated =
        rate_factor * plasticity->dissipation(alpha, alpha_now) + (damage - history[5]) * undamaged;
  }
  result.plastic = r.gamma > 0;
  const double j2d = determinant(f);
  result.across = plane == Plane::strain ? tau[2] / j2d : 0;
  // The trial's strain across is that of the total stretch and of the plastic strain so far.
  if (plane == Plane::stress) result.stretch = std::exp(trial[2] - 0.5 * std::log(history[3]));
  const double txx = tau[0] * cc + tau[1] * ss, tyy = tau[0] * ss + tau[1] * cc, txy = (tau[0] - tau[1]) * cs;
  const Tensor<double> inverse_transposed = scaled(cofactor(f), 1 / j2d);
  result.stress = product(Tensor<double>{txx, txy, txy, tyy}, inverse_transposed);
  if (next != nullptr) {
    const double e0 = std::exp(2 * r.strain[0]), e1 = std::exp(2 * r.strain[1]);
    const Tensor<double> b_new{e0 * cc + e1 * ss, (e0 - e1) * cs, (e0 - e1) * cs, e0 * ss + e1 * cc};
    const Tensor<double> inverse = transposed(inverse_transposed);
    const Tensor<double> cp = product(product(inverse, b_new), inverse_transposed);
    // Without flow the history stays as it is, to the last bit.
    if (r.gamma > 0) {
      next[0] = cp.xx;
      next[1] = 0.5 * (cp.xy + cp.yx);
      next[2] = cp.yy;
      // In plane stress the total stretch across is not carried: its plastic part follows from no change of
      // volume.
      next[3] = plane == Plane::strain ? std::exp(2 * r.strain[2]) : 1 / (cp.xx * cp.yy - next[1] * next[1]);
      next[4] = alpha_now;
    } else if (next != history) {
      for (std::size_t k = 0; k < 5; ++k) next[k] = history[k];
    }
    next[5] = damage;
    next[6] = history[6] + result.dissipated;
  }
  return result;
}

std::array<double, 16> tangent(const J2Plasticity& law, const Tensor<double>& f, const double* history) {
  constexpr double kStep = 1e-6;
  std::array<double, 16> a{};
  for (std::size_t component = 0; component < 4; ++component) {
    const auto at = [&](double shift) {
      Tensor<double> moved = f;
      (component == 0 ? moved.xx : component == 1 ? moved.xy : component == 2 ? moved.yx : moved.yy) += shift;
      return law.first_piola_kirchhoff(moved, history);
    };
    const Tensor<double> d = scaled(at(kStep) - at(-kStep), 0.5 / kStep);
    a[component] = d.xx;
    a[4 + component] = d.xy;
    a[8 + component] = d.yx;
    a[12 + component] = d.yy;
  }
  return a;
}

}  // namespace estuary::solid
