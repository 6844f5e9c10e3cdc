// The force of one contact, written once for discs and spheres and for every law; each choice is compiled
// apart.
#pragma once

#include <algorithm>
#include <cmath>

#include "contact_law.hpp"

namespace estuary::grains {

/// Force and moment on i. `history` is moved on by `dt`; with dt = 0 it is left as it is (to measure forces).
/// What is dissipated in dt is added to `ledger`.
template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
inline ContactForce<D> contact(const ContactConstants& c, const ContactKinematics<D>& k, double dt,
                               double* history, EnergyLedger& ledger) {
  const double closing = k.closing;
  double elastic = c.normal_stiffness * k.overlap;
  double damping = c.damping * k.root_mass;
  double tangential_stiffness = c.tangential_stiffness;
  double inverse_tangential_stiffness = c.inverse_tangential_stiffness;
  double tangential_damping = 0;
  if constexpr (N == NormalLaw::hertz) {
    const double contact_radius = std::sqrt(k.reduced_radius * k.overlap);
    elastic *= contact_radius;
    // Tangent stiffness S_n = 2 E* a = 3/2 (4/3 E*) a; S_t = 8 G* a.
    damping *= std::sqrt(1.5 * c.normal_stiffness * contact_radius);
    tangential_stiffness *= contact_radius;
    inverse_tangential_stiffness /= contact_radius;
    tangential_damping = c.tangential_damping * damping;
  } else {
    tangential_damping = c.tangential_damping * damping;
  }
  double attraction = 0;
  if constexpr (Cohesive) attraction = c.cohesion;
  const double normal_force = std::max(0.0, elastic + damping * closing);
  // Velocities are half a step older than positions; the work is that of the mean over the step.
  const double mean_closing = closing - (normal_force - attraction) * k.slowing;
  ledger.normal += (normal_force - elastic) * mean_closing * dt;

  ContactForce<D> result;
  result.friction = {};
  result.moment = {};
  result.along = -normal_force;
  if constexpr (Cohesive) result.along += c.cohesion;

  constexpr std::size_t spin = spin_components<D>;
  if constexpr (F == FrictionLaw::coulomb) {
    const double speed = norm(k.sliding);
    if (speed > 0) {
      const double friction = c.friction * normal_force;
      result.friction = (friction / speed) * k.sliding;
      ledger.tangential += friction * speed * dt;
    }
  } else if constexpr (F == FrictionLaw::spring && D == 2) {
    // In the plane the stretch is a number along the tangent, which turns with the contact by itself.
    const double speed = k.sliding[0];
    const double before = history[0];
    // Spring first, then spring and damping: a stretch rewound by what the damping exceeds the limit would
    // point against the sliding and store energy that nobody gave. Without branches: whether a contact slides
    // is hard to predict.
    const double limit = c.friction * normal_force;
    const double longest = limit * inverse_tangential_stiffness;
    const double stretch = std::max(-longest, std::min(longest, before + speed * dt));
    const double trial = tangential_stiffness * stretch + tangential_damping * speed;
    const double friction = std::max(-limit, std::min(limit, trial));
    history[0] = dt > 0 ? stretch : before;
    result.friction[0] = friction;
    ledger.tangential += friction * speed * dt - tangential_stiffness * stretch * (stretch - before);
  } else if constexpr (F == FrictionLaw::spring) {
    Vector<D> before = load<3>(history, 0);
    // Turned into the present tangent plane, keeping its length.
    const double length = norm(before);
    before = before - dot(before, k.normal) * k.normal;
    const double projected = norm(before);
    if (projected > 0) before = (length / projected) * before;
    if constexpr (N == NormalLaw::hertz) {
      // The spring stiffens with the overlap. Pressed deeper it keeps its force, released its stretch
      // (Thornton, Cummins & Cleary 2013): either way energy goes. A stretch kept while pressed would bring
      // some.
      const double overlap_before = std::max(0.0, k.overlap - closing * dt);
      const double softer = std::sqrt(overlap_before / k.overlap);  // former stiffness over the present one
      const double kept = std::min(1.0, softer);
      ledger.tangential += 0.5 * tangential_stiffness * (softer - kept * kept) * dot(before, before);
      before = kept * before;
    }
    const double limit = c.friction * normal_force;
    Vector<D> stretch = before + dt * k.sliding;
    const double longest = limit * inverse_tangential_stiffness, reached = norm(stretch);
    if (reached > longest) stretch = (longest / reached) * stretch;
    Vector<D> friction = tangential_stiffness * stretch + tangential_damping * k.sliding;
    const double size = norm(friction);
    if (size > limit) friction = (limit / size) * friction;
    if (dt > 0) store<3>(history, 0, stretch);
    result.friction = friction;
    ledger.tangential +=
        dot(friction, k.sliding) * dt - tangential_stiffness * dot(stretch, stretch - before);
  }

  if constexpr (R != RollingLaw::none) {
    double* angles = history + (F == FrictionLaw::spring ? spin : 0);
    const double roll_limit = c.rolling_friction * k.radius_sum * normal_force;
    // Moment on i against `rate` about fixed axes, at most `limit`; the spring-slider remembers `angle`.
    const auto resist = [&]<std::size_t K>(const std::array<double, K>& rate, double limit,
                                           [[maybe_unused]] double* angle) {
      std::array<double, K> moment{};
      if constexpr (R == RollingLaw::viscous) {
        const double speed = norm(rate);
        if (speed > 0) {
          const double size = std::min(limit, c.rolling_damping * speed);
          moment = (-size / speed) * rate;
          ledger.rolling += size * speed * dt;
        }
      } else {
        const double stiffness = c.rolling_stiffness * k.reduced_radius * k.reduced_radius;
        const double viscous = 2 * c.rolling_damping * std::sqrt(c.rolling_stiffness) * k.root_mass *
                               k.reduced_radius * k.reduced_radius;
        const std::array<double, K> before = load<K>(angle, 0);
        std::array<double, K> turned = before + dt * rate;
        const double reached = stiffness * norm(turned);
        if (reached > limit) turned = (limit / reached) * turned;
        moment = (-stiffness) * turned - viscous * rate;
        const double size = norm(moment);
        if (size > limit) moment = (limit / size) * moment;
        if (dt > 0) store<K>(angle, 0, turned);
        ledger.rolling += -dot(moment, rate) * dt - stiffness * dot(turned, turned - before);
      }
      return moment;
    };
    if constexpr (D == 2) {
      result.moment = resist(k.spin, roll_limit, angles);
    } else {
      const double about_normal = dot(k.spin, k.normal);
      const Spin<3> rolling = k.spin - about_normal * k.normal;
      if constexpr (R == RollingLaw::spring) {
        // The remembered rolling angle turns with the contact, like the stretch.
        Spin<3> angle = load<3>(angles, 0);
        angle = angle - dot(angle, k.normal) * k.normal;
        store<3>(angles, 0, angle);
      }
      result.moment = resist(rolling, roll_limit, angles);
      const double pivot_limit = c.pivoting_friction * k.radius_sum * normal_force;
      const auto pivoting = resist(std::array<double, 1>{about_normal}, pivot_limit, angles + 3);
      result.moment = result.moment + pivoting[0] * k.normal;
    }
  }
  return result;
}

/// Energy stored in a contact [J; J/m in the plane].
template <int D, NormalLaw N, FrictionLaw F, RollingLaw R, bool Cohesive>
inline double stored_energy(const ContactConstants& c, const ContactKinematics<D>& k, const double* history) {
  double energy = 0;
  double tangential_stiffness = c.tangential_stiffness;
  if constexpr (N == NormalLaw::hertz) {
    const double contact_radius = std::sqrt(k.reduced_radius * k.overlap);
    energy = 0.4 * c.normal_stiffness * contact_radius * k.overlap * k.overlap;
    tangential_stiffness *= contact_radius;
  } else {
    energy = 0.5 * c.normal_stiffness * k.overlap * k.overlap;
  }
  if constexpr (Cohesive) energy -= c.cohesion * k.overlap;
  std::size_t next = 0;
  const auto add_springs = [&](double stiffness, std::size_t count) {
    for (std::size_t h = 0; h < count; ++h, ++next) energy += 0.5 * stiffness * history[next] * history[next];
  };
  if constexpr (F == FrictionLaw::spring) add_springs(tangential_stiffness, spin_components<D>);
  if constexpr (R == RollingLaw::spring)
    add_springs(c.rolling_stiffness * k.reduced_radius * k.reduced_radius, D == 2 ? 1 : 4);
  return energy;
}

}  // namespace estuary::grains
