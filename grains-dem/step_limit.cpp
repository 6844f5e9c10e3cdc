// How long a step may be, from the stiffest thing in the scene.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "medium.hpp"

namespace estuary::grains {

double grain_volume(int dimension, double r) {
  return dimension == 2 ? std::numbers::pi * r * r : 4.0 / 3 * std::numbers::pi * r * r * r;
}
double grain_inertia(int dimension, double mass, double r) {
  return (dimension == 2 ? 0.5 : 0.4) * mass * r * r;
}

StepLimit step_limit_of(const GrainsScene& scene, double mass, double radius) {
  StepLimit limit;
  const double pair_mass = 0.5 * mass;
  const bool hertz = scene.law.normal == NormalLaw::hertz;
  const double modulus = 0.75 * scene.constants.normal_stiffness;
  limit.contact_time =
      hertz ? hertz_contact_time(modulus, pair_mass, 0.5 * radius, scene.impact_speed)
            : linear_contact_time(scene.constants.normal_stiffness, scene.restitution, pair_mass);
  limit.step = limit.contact_time / scene.steps_per_contact;
  limit.by = "contact time";
  const auto lower = [&](double step, const char* by) {
    if (step >= limit.step) return;
    limit.step = step;
    limit.by = by;
  };
  constexpr double pi = std::numbers::pi;
  if (!hertz && scene.law.friction == FrictionLaw::spring) {
    const double lever = scene.dimension == 2 ? 3 : 3.5;  // 1 + m r^2 / I
    lower(pi / std::sqrt(lever * scene.constants.tangential_stiffness / pair_mass) / scene.steps_per_contact,
          "tangential stiffness");
  }
  if (scene.bond.active) {
    const double r = scene.bond.radius_ratio * radius;
    const double area = scene.dimension == 2 ? 2 * r : pi * r * r;
    const double stiffness = std::max(scene.bond.normal_stiffness, scene.bond.shear_stiffness) * area;
    // A grain in the middle of a bonded body hangs on several bonds.
    lower(pi / std::sqrt(6 * stiffness / mass) / scene.steps_per_contact, "bond stiffness");
  }
  if (scene.law.rolling == RollingLaw::viscous)
    lower(0.2 * grain_inertia(scene.dimension, mass, radius) / scene.constants.rolling_damping,
          "rolling damping");
  if (scene.lubrication.active()) {
    const auto resistance = [&](double reduced_radius) {
      const double gap = scene.lubrication.minimum_gap;
      return scene.dimension == 2 ? film_resistance<2>(scene.lubrication, reduced_radius, gap)
                                  : film_resistance<3>(scene.lubrication, reduced_radius, gap);
    };
    lower(0.2 * pair_mass / resistance(0.5 * radius), "lubrication at the smallest gap");
    const bool planes = std::any_of(scene.walls.begin(), scene.walls.end(),
                                    [](const WallScene& wall) { return wall.is_plane(); });
    if (planes) lower(0.2 * mass / resistance(radius), "lubrication at the smallest gap to a plane");
  }
  if (scene.time_step) lower(*scene.time_step, "time_step of the scene");
  return limit;
}

}  // namespace estuary::grains
