#include "region.hpp"

#include <algorithm>
#include <numbers>

namespace estuary::grains {
namespace {

// Part of the way from x to x + way inside the box.
template <int D>
double inside_part(const Vector<D>& x, const Vector<D>& way, const Vector<D>& from, const Vector<D>& to) {
  double first = 0, last = 1;
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
    if (way[c] == 0) {
      if (x[c] < from[c] || x[c] > to[c]) return 0;
      continue;
    }
    const double a = (from[c] - x[c]) / way[c], b = (to[c] - x[c]) / way[c];
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  return std::max(0.0, last - first);
}

}  // namespace

double share_below(int dimension, double r, double h) {
  const double s = std::clamp(h / r, -1.0, 1.0);
  if (dimension == 2) return 1 - (std::acos(s) - s * std::sqrt(1 - s * s)) / std::numbers::pi;
  return 0.25 * (2 + 3 * s - s * s * s);
}

double surface_share_below(int dimension, double r, double h) {
  const double s = std::clamp(h / r, -1.0, 1.0);
  return dimension == 2 ? 1 - std::acos(s) / std::numbers::pi : 0.5 * (1 + s);
}

template <int D>
RegionMeasure<D> measure_region(const Dynamics<D>& dynamics, const Vector<D>& from_given,
                                const Vector<D>& to_given, double radius_margin,
                                std::span<const double> outer_force) {
  const State<D>& state = dynamics.state();
  const Domain<D>& domain = dynamics.settings().domain;
  RegionMeasure<D> result;
  result.volume = 1;
  Vector<D> from = from_given, to = to_given;
  std::array<bool, static_cast<std::size_t>(D)> whole{};
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
    whole[c] = domain.periodic[c] && from[c] <= domain.from[c] && to[c] >= domain.to[c];
    if (whole[c]) {
      // Across a whole period nothing is cut.
      result.volume *= domain.length(c);
      from[c] = -1e300;
      to[c] = 1e300;
    } else {
      result.volume *= to[c] - from[c];
    }
  }
  double mass = 0;
  const auto is_inside = [&](const Vector<D>& x) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
      if (x[c] < from[c] || x[c] > to[c]) return false;
    return true;
  };
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Vector<D> x = load<D>(state.position.data(), i);
    const double r = state.radius[i] - radius_margin;
    double share = 1, surface_share = 1;
    for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
      if (whole[c]) continue;
      share *= share_below(D, r, to[c] - x[c]) - share_below(D, r, from[c] - x[c]);
      surface_share *= surface_share_below(D, r, to[c] - x[c]) - surface_share_below(D, r, from[c] - x[c]);
    }
    result.solid += share * (D == 2 ? std::numbers::pi * r * r : 4.0 / 3 * std::numbers::pi * r * r * r);
    result.surface += surface_share * (D == 2 ? 2 * std::numbers::pi * r : 4 * std::numbers::pi * r * r);
    if (!outer_force.empty())
      result.outer_force =
          result.outer_force + (share / result.volume) * load<D>(outer_force.data(), state.identity[i]);
    if (!is_inside(x) || state.inverse_mass[i] == 0) continue;
    const double m = 1 / state.inverse_mass[i];
    mass += m;
    result.grains += 1;
    result.velocity = result.velocity + m * load<D>(state.velocity.data(), i);
  }
  if (mass > 0) {
    result.velocity = (1 / mass) * result.velocity;
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (state.inverse_mass[i] == 0 || !is_inside(load<D>(state.position.data(), i))) continue;
      const Vector<D> v = load<D>(state.velocity.data(), i) - result.velocity;
      result.temperature += dot(v, v) / (D * state.inverse_mass[i]);
    }
    result.temperature /= result.grains;
  }
  for (const auto& record : dynamics.contacts()) {
    const Vector<D> x = load<D>(state.position.data(), record.i);
    double part = inside_part<D>(x, record.branch, from, to);
    if (!record.with_wall) {
      // A branch across a periodic side also ends at j's own place.
      const Vector<D> other = load<D>(state.position.data(), record.j) - record.branch;
      bool image = false;
      for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
        image =
            image || (!whole[c] && std::abs(other[c] - x[c]) > 0.5 * domain.length(c) && domain.periodic[c]);
      if (image) part += inside_part<D>(other, record.branch, from, to);
    }
    if (part == 0) continue;
    const Vector<D> force = record.force.vector(record.kinematics.normal);
    for (std::size_t a = 0; a < static_cast<std::size_t>(D); ++a)
      for (std::size_t b = 0; b < static_cast<std::size_t>(D); ++b)
        result.stress[a][b] -= force[a] * record.branch[b] * part / result.volume;
  }
  return result;
}

template RegionMeasure<2> measure_region(const Dynamics<2>&, const Vector<2>&, const Vector<2>&, double,
                                         std::span<const double>);
template RegionMeasure<3> measure_region(const Dynamics<3>&, const Vector<3>&, const Vector<3>&, double,
                                         std::span<const double>);

}  // namespace estuary::grains
