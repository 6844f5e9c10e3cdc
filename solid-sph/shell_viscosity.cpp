// Artificial viscosity of shells, and the filter of their fibres.
#include <algorithm>
#include <cmath>

#include "kernel_function.hpp"
#include "shell_row.hpp"

namespace estuary::solid {
namespace {

// Of the filter, in links: a support of two smoothing lengths reaches the next particle on both sides, and
// not the one after it.
constexpr double kSmoothingLength = 0.95;

}  // namespace

// Maurel's (2008, ch. 2) is of each link: Monaghan's along it, and a force across it in proportion to the
// velocity across. The latter would brake a shell that turns as one, so here shear is braked by the rate of
// the shear strain, and bending by that of the curvature: with the strains' own conjugates the forces and
// moments are objective, keep the momenta and only take energy. In thin shells the thickness stands for the
// spacing, because the rotary inertia falls with its square.
SectionVector ShellRow::drag(std::size_t l, std::span<const double> velocity, const Strain& strain) {
  const Link& link = links_[l];
  const ShellSection& section = sections_[link.member];
  const ShellViscosity& viscosity = section.viscosity;
  const std::size_t pa = particle_[link.a], pb = particle_[link.b];
  const double ra = rate_[link.a], rb = rate_[link.b], turning = 0.5 * (ra + rb);
  double stretching = strain.shear * turning, shearing = -strain.along * turning;
  for (std::size_t c = 0; c < 2; ++c) {
    const double dx = (velocity[2 * pb + c] - velocity[2 * pa + c]) / link.length;
    stretching += dx * strain.tangent[c];
    shearing += dx * strain.normal[c];
  }
  const double bending = (ra - rb) / link.length;
  const double h = section.thickness, speed = std::sqrt(section.young_modulus / section.density);
  const double wide = section.density * link.length * speed,
               thin = section.density * std::min(link.length, h) * speed;
  SectionVector force{0, viscosity.shear * thin * h * shearing,
                      viscosity.bending * thin * h * h * h / 12 * bending};
  // Of the logarithm of the stretch, with the sign of what it brakes however a link has folded.
  const double rate = stretching / std::max(strain.along, kFolded);
  if (rate < 0)
    force.membrane = h * (viscosity.linear * wide * rate -
                          viscosity.quadratic * section.density * link.length * link.length * rate * rate);
  at_[l].viscous_couple = couple(link, strain, force);
  at_[l].viscous_power =
      link.length * (force.membrane * stretching + force.shear * shearing + force.bending * bending);
  return force;
}

double ShellRow::viscous_power() const {
  double sum = 0;
  for (const LinkState& link : at_) sum += link.viscous_power;
  return sum;
}

std::array<double, 2> ShellRow::filter_normals(std::span<double> history, const Loading& loading, double time,
                                               double fraction) {
  double taken = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    filtered_[i] = 0;
    const double share = sections_[body_.member[particle_[i]]].viscosity.normal_filter;
    if (!(share > 0) || !turns(i)) continue;
    double weight = 0, sum = 0, moment = moment_[i];
    for (const std::uint32_t l : {before_[i], after_[i]}) {
      if (l == kNone || broken(history, l)) continue;
      const std::uint32_t j = links_[l].a == i ? links_[l].b : links_[l].a;
      const double h = kSmoothingLength * links_[l].length;
      const double own = body_.mass[particle_[j]] * cubic_spline(links_[l].length, h) / cubic_spline(0, h);
      weight += own;
      sum += own * (history[2 * j] - history[2 * i]);
      // Viscosity stores nothing that could be taken.
      moment -= at_[l].viscous_couple[links_[l].a == i ? 0 : 1];
    }
    filtered_[i] = share * sum / (weight + body_.mass[particle_[i]]);
    taken += moment * filtered_[i];
  }
  const double work = turning_work(loading, time, fraction, filtered_);
  for (std::size_t i = 0; i < size(); ++i) history[2 * i] += filtered_[i];
  return {taken, work};
}

}  // namespace estuary::solid
