// Artificial viscosity of shells, and the filter of their fibres.
#include <algorithm>
#include <cmath>

#include "kernel_function.hpp"
#include "shell_row.hpp"

namespace estuary::solid {

// Maurel's (2008, ch. 2) is of each link: Monaghan's along it, and a force across it in proportion to the
// velocity across. The latter would brake a shell that turns as one, so here shear is braked by the rate of
// the shear strain, and bending by that of the curvature: with the strains' own conjugates the forces and
// moments are objective, keep the momenta and only take energy. In thin shells the thickness stands for the
// spacing, because the rotary inertia falls with its square.
std::array<double, 3> ShellRow::drag(std::size_t l, std::span<const double> velocity,
                                     const std::array<double, 2>& x, const std::array<double, 2>& mean,
                                     const std::array<double, 2>& slope) {
  const Link& link = links_[l];
  const ShellSection& section = sections_[link.member];
  const ShellViscosity& viscosity = section.viscosity;
  const std::size_t pa = particle_[link.a], pb = particle_[link.b];
  const std::array<double, 2>&na = fibre_[link.a], &nb = fibre_[link.b];
  const double ra = rate_[link.a], rb = rate_[link.b];
  // The fibres' rates are turned by a quarter.
  const double da[2] = {-ra * na[1], ra * na[0]}, db[2] = {-rb * nb[1], rb * nb[0]};
  double squared = 0, stretching = 0, shearing = 0, bending = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    const double dx = (velocity[2 * pb + c] - velocity[2 * pa + c]) / link.length;
    squared += x[c] * x[c];
    stretching += x[c] * dx;
    shearing += dx * mean[c] + x[c] * 0.5 * (da[c] + db[c]);
    bending += dx * slope[c] + x[c] * (db[c] - da[c]) / link.length;
  }
  const double h = section.thickness, speed = std::sqrt(section.young_modulus / section.density);
  const double wide = section.density * link.length * speed,
               thin = section.density * std::min(link.length, h) * speed;
  std::array<double, 3> force{0, viscosity.shear * thin * h * shearing,
                              viscosity.bending * thin * h * h * h / 12 * bending};
  const double rate = stretching / squared;  // of the logarithm of the stretch
  if (rate < 0)
    force[0] = h / std::sqrt(squared) *
               (viscosity.linear * wide * rate -
                viscosity.quadratic * section.density * link.length * link.length * rate * rate);
  at_[l].viscous_power = link.length * (force[0] * stretching + force[1] * shearing + force[2] * bending);
  return force;
}

double ShellRow::viscous_power() const {
  double sum = 0;
  for (const LinkState& link : at_) sum += link.viscous_power;
  return sum;
}

double ShellRow::filter_normals(std::span<double> history) {
  std::vector<double> change(size(), 0.0);
  double taken = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    const double share = sections_[body_.member[particle_[i]]].viscosity.normal_filter;
    if (!(share > 0) || !turns(i)) continue;
    // A support of two smoothing lengths reaches the next particle on both sides.
    double weight = 0, sum = 0;
    for (const std::uint32_t l : {before_[i], after_[i]}) {
      if (l == kNone || broken(history, l)) continue;
      const std::uint32_t j = links_[l].a == i ? links_[l].b : links_[l].a;
      const double h = 0.95 * links_[l].length;
      const double own = body_.mass[particle_[j]] * cubic_spline(links_[l].length, h) / cubic_spline(0, h);
      weight += own;
      sum += own * (history[2 * j] - history[2 * i]);
    }
    change[i] = share * sum / (weight + body_.mass[particle_[i]]);
    taken += moment_[i] * change[i];
  }
  for (std::size_t i = 0; i < size(); ++i) history[2 * i] += change[i];
  return taken;
}

}  // namespace estuary::solid
