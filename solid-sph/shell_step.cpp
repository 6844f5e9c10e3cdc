// Steps that are stable for rows of shells, from the stiffness and viscosity of single links.
#include <algorithm>
#include <cmath>

#include "shell_row.hpp"

namespace estuary::solid {
namespace {

// Symmetric, over x' along the frame, x' across it, and the rotation of the frame.
struct Matrix {
  double xx, yy, rr, xr, yr;  // xy is 0

  // Largest eigenvalue, by the roots of the cubic.
  [[nodiscard]] double largest() const {
    const double mean = (xx + yy + rr) / 3, x = xx - mean, y = yy - mean, r = rr - mean;
    const double size = std::sqrt((x * x + y * y + r * r + 2 * (xr * xr + yr * yr)) / 6);
    if (!(size > 0)) return mean;
    const double third = (x * y * r - x * yr * yr - y * xr * xr) / (2 * size * size * size);
    return mean + 2 * size * std::cos(std::acos(std::clamp(third, -1.0, 1.0)) / 3);
  }
};

// Of stiffness `axial` in s = x'.t and `across` in g = x'.n. A rotation r of the frame changes s by g r and
// g by -s r, to second order by x'.n r - s r^2 / 2 and -x'.t r - g r^2 / 2, on which the forces do work.
// `place`, `turn`: what squares of x' and of r are divided by.
Matrix stiffness(double axial, double across, double s, double g, double normal, double shear, double place,
                 double turn) {
  const double mixed = std::sqrt(place * turn);
  return {axial * place, across * place, (axial * g * g + across * s * s - normal * s - shear * g) * turn,
          (axial * g - shear) * mixed, (normal - across * s) * mixed};
}

}  // namespace

ShellRow::Tangent ShellRow::tangent(std::size_t l) const {
  const Link& link = links_[l];
  const LinkState& now = at_[l];
  if (!now.whole) return {link.membrane, link.shear, 0, 0, 1, 0};
  const double s = std::max(now.along, kFolded);
  // The logarithm's second derivative, and that of (s^2 - 1)^2 / 8. Flow only softens.
  const double axial = sections_[link.member].plastic() ? (link.membrane / s - now.normal_force) / s
                                                        : 0.5 * link.membrane * (3 * s * s - 1);
  return {std::max(axial, link.membrane),
          link.shear,
          now.normal_force,
          now.shear_force,
          now.along,
          now.shear_strain};
}

// The masses of a link's halves at its ends: rho h L / 2 and rotary rho h^3 L / 24.
double ShellRow::squared_frequency(const Link& link, const Tangent& t, double closing) const {
  const ShellSection& section = sections_[link.member];
  const double h = section.thickness, density = section.density * h, place = 4 / (link.length * link.length),
               turn = 12 / (h * h);
  const double rest = std::max(link.membrane * place, link.shear * (place + turn)) / density;
  const Matrix still = stiffness(t.axial / density, t.across / density, t.along, t.shear_strain,
                                 t.normal_force / density, t.shear_force / density, place, turn);
  const double squared = std::max(rest, still.largest());
  const ShellViscosity& viscosity = section.viscosity;
  if (!viscosity.any()) return squared;
  // Velocities are foreseen by the acceleration before: with a mode's squared frequency k and damping d a
  // step 2 / y is stable when y^2 >= k + 2 y d. Of single modes first.
  const auto damped = [](double k, double d) { return d + std::sqrt(k + d * d); };
  const double speed = std::sqrt(section.young_modulus / section.density),
               thin = std::min(link.length, h) * speed;
  // A force in proportion to the square of a rate has twice its share in small changes of the rate.
  const double axial = (viscosity.linear * speed + 2 * viscosity.quadratic * closing) * link.length /
                       std::clamp(t.along, kFolded, 1.0),
               across = viscosity.shear * thin;
  const double s2 = t.along * t.along, g2 = t.shear_strain * t.shear_strain;
  double y =
      std::max({std::sqrt(squared),
                damped(section.young_modulus / section.density * place, viscosity.bending * thin * place),
                damped(t.axial / density * (place + g2 * turn), axial * (place + g2 * turn)),
                damped(t.across / density * (place + s2 * turn), across * (place + s2 * turn))});
  // A link that is sheared has no modes that are either axial or across.
  for (int iteration = 0; iteration < 30; ++iteration) {
    const Matrix both =
        stiffness(t.axial / density + 2 * y * axial, t.across / density + 2 * y * across, t.along,
                  t.shear_strain, t.normal_force / density, t.shear_force / density, place, turn);
    const double next = std::sqrt(std::max(both.largest(), 0.0));
    if (!(next > 1.001 * y)) return y * y * (next > y ? 1.004 : 1.0);
    y = next;
  }
  return y * y;
}

double ShellRow::squared_frequency() const {
  double squared = 0;
  for (const Link& link : links_)
    squared = std::max(squared, squared_frequency(link, {link.membrane, link.shear, 0, 0, 1, 0}, 0));
  return squared;
}

double ShellRow::squared_frequency(std::span<const double> velocity, std::span<const double> history) const {
  double fastest = 0, squared = 0;
  for (std::size_t i = 0; quadratic_ && i < velocity.size() / 2; ++i)
    fastest = std::max(fastest, std::hypot(velocity[2 * i], velocity[2 * i + 1]));
  for (std::size_t l = 0; l < links_.size(); ++l) {
    if (broken(history, l)) continue;
    const Link& link = links_[l];
    const Tangent t = tangent(l);
    double closing = 0;
    if (quadratic_) {
      const std::size_t pa = particle_[link.a], pb = particle_[link.b];
      const double apart =
          std::hypot(velocity[2 * pb] - velocity[2 * pa], velocity[2 * pb + 1] - velocity[2 * pa + 1]);
      const double turning =
          0.5 * link.length * t.shear_strain * (history[2 * link.a + 1] + history[2 * link.b + 1]);
      closing = (std::max(apart, fastest) + std::abs(turning)) / std::clamp(t.along, kFolded, 1.0);
    }
    squared = std::max(squared, squared_frequency(link, t, closing));
  }
  return squared > 0 ? squared : squared_frequency();
}

double ShellRow::largest_stiffening() const {
  double value = 1;
  for (std::size_t l = 0; l < links_.size(); ++l) {
    if (!at_[l].whole) continue;
    const Link& link = links_[l];
    const Tangent t = tangent(l);
    // A link's share in relaxation_masses, whose squared frequencies are at most 4 at rest.
    const double place = 8 / (2 * link.membrane + 3 * link.shear),
                 turn = 4 / (3 * link.shear + 4 * link.bending / (link.length * link.length));
    value = std::max(value, 0.25 * stiffness(t.axial, t.across, t.along, t.shear_strain, t.normal_force,
                                             t.shear_force, place, turn)
                                       .largest());
  }
  return value;
}

}  // namespace estuary::solid
