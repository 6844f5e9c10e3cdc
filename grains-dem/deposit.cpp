#include "deposit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "medium.hpp"
#include "region.hpp"
#include "sample.hpp"

namespace estuary::grains {

template <int D>
InitialGrains<D> initial_grains(const GrainsScene& scene) {
  InitialGrains<D> grains;
  for (const GroupScene& group : scene.groups) {
    const GroupGrains<D> part = place_group<D>(group);
    const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
      to.insert(to.end(), from.begin(), from.end());
    };
    append(grains.position, part.position);
    append(grains.velocity, part.velocity);
    append(grains.spin, part.spin);
    for (const double r : part.radius) {
      const double mass = group.density * grain_volume(D, r);
      grains.radius.push_back(r + scene.contact_margin);
      grains.mass.push_back(mass);
      grains.inertia.push_back(grain_inertia(D, mass, r));
      grains.held.push_back(group.held);
    }
  }
  return grains;
}

template <int D>
DynamicsSettings<D> dynamics_settings(const GrainsScene& scene, const InitialGrains<D>& grains) {
  DynamicsSettings<D> settings;
  settings.domain.to.fill(1);
  for (std::size_t c = 0; c < scene.from.size(); ++c) {
    settings.domain.from[c] = scene.from[c];
    settings.domain.to[c] = scene.to[c];
    settings.domain.periodic[c] = scene.periodic[c];
  }
  settings.law = scene.law;
  settings.constants = scene.constants;
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) settings.gravity[c] = scene.gravity[c];
  const double mean = std::accumulate(grains.radius.begin(), grains.radius.end(), 0.0) /
                      static_cast<double>(std::max<std::size_t>(1, grains.size()));
  settings.skin = scene.skin.value_or(0.2 * mean);
  settings.integrator = scene.integrator;
  settings.gear_terms = scene.gear_terms;
  settings.gear_corrections = scene.gear_corrections;
  settings.lubrication = scene.lubrication;
  settings.bond_law = scene.bond;
  return settings;
}

template <int D>
std::vector<Wall<D>> scene_walls(const GrainsScene& scene) {
  std::vector<Wall<D>> walls;
  for (const WallScene& given : scene.walls) {
    Wall<D> wall;
    wall.name = given.name;
    wall.constants = given.constants;
    if (!given.polyline.empty()) {
      wall.node = given.polyline;
      const auto nodes = static_cast<std::uint32_t>(given.polyline.size() / 2);
      for (std::uint32_t k = 0; k + 1 < nodes; ++k) wall.facet.insert(wall.facet.end(), {k, k + 1});
      if (given.closed) wall.facet.insert(wall.facet.end(), {nodes - 1, 0});
    } else if (!given.mesh.triangle.empty()) {
      wall.node = given.mesh.node;
      wall.facet = given.mesh.triangle;
    } else {
      for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
        wall.point[c] = given.point[c];
        wall.normal[c] = given.normal[c];
      }
    }
    for (std::size_t c = 0; c < given.pivot.size(); ++c) wall.pivot[c] = given.pivot[c];
    walls.push_back(std::move(wall));
  }
  return walls;
}

template <int D>
double middle_porosity(const Dynamics<D>& dynamics, const std::vector<double>& gravity,
                       double radius_margin) {
  std::size_t up = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
    if (std::abs(gravity[c]) > std::abs(gravity[up])) up = c;
  const State<D>& state = dynamics.state();
  const Domain<D>& domain = dynamics.settings().domain;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t i = 0; i < state.size(); ++i) {
    low = std::min(low, state.position[D * i + up]);
    high = std::max(high, state.position[D * i + up]);
  }
  Vector<D> from = domain.from, to = domain.to;
  from[up] = low + 0.15 * (high - low);
  to[up] = low + 0.75 * (high - low);
  const auto measure = measure_region(dynamics, from, to, radius_margin);
  return 1 - measure.solid / measure.volume;
}

namespace {

template <int D>
double settle(const GrainsScene& scene, DynamicsSettings<D> settings, std::vector<Wall<D>> walls,
              double friction, const InitialGrains<D>& start, const DepositMonitor& monitor,
              InitialGrains<D>& rest) {
  const double restitution = scene.deposit.restitution.value_or(scene.restitution);
  settings.integrator = Integrator::verlet;
  settings.lubrication = {};
  settings.bond_law = {};
  settings.constants = with_material(scene, friction, restitution);
  if (friction > 0 && settings.law.friction == FrictionLaw::none) settings.law.friction = FrictionLaw::spring;
  for (Wall<D>& wall : walls) wall.constants = settings.constants;
  double gravity = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
    settings.gravity[c] = scene.deposit.gravity[c];
    gravity += settings.gravity[c] * settings.gravity[c];
  }
  gravity = std::sqrt(gravity);
  const double mean =
      std::accumulate(start.radius.begin(), start.radius.end(), 0.0) / static_cast<double>(start.size());
  GrainsScene limits = scene;
  limits.restitution = restitution;
  const StepLimit limit =
      step_limit_of(limits, *std::min_element(start.mass.begin(), start.mass.end()),
                    *std::min_element(start.radius.begin(), start.radius.end()) - scene.contact_margin);
  Dynamics<D> dynamics(settings, start, std::move(walls));
  // Asked a hundred times: grains that just bounce stand still for a moment, but not all of them.
  constexpr int kParts = 100;
  const double part = scene.deposit.end_time / kParts;
  const auto steps = static_cast<std::uint64_t>(part / limit.step) + 1;
  const std::uint64_t every = std::max<std::uint64_t>(1, 200'000 / (start.size() + 1));
  const double rest_speed = scene.deposit.tolerance * std::sqrt(gravity * 2 * mean);
  for (int k = 1;; ++k) {
    // Reported by steps: a hundredth of a large deposit may take minutes.
    dynamics.advance(part, steps, [&](std::uint64_t step) {
      if (monitor && step % every == 0)
        monitor((k - 1 + static_cast<double>(step) / static_cast<double>(steps)) / kParts);
    });
    double sum = 0;
    const State<D>& state = dynamics.state();
    for (std::size_t i = 0; i < state.size(); ++i) sum += norm(load<D>(state.velocity.data(), i));
    const double speed = sum / static_cast<double>(state.size());
    if (speed < rest_speed && k >= 5) break;
    if (k == kParts)
      throw NotConverged(
          fmt::format("the deposit is not at rest after {} s: mean speed {:.3g} m/s, wanted {:.3g}",
                      scene.deposit.end_time, speed, rest_speed),
          "raise [grains.deposit] end_time or tolerance, or lower its restitution");
  }
  rest = start;
  const State<D>& state = dynamics.state();
  for (std::size_t i = 0; i < state.size(); ++i)
    store<D>(rest.position.data(), state.identity[i], load<D>(state.position.data(), i));
  for (double& v : rest.velocity) v = 0;
  for (double& w : rest.spin) w = 0;
  if (scene.deposit.hold) rest.held.assign(rest.held.size(), true);
  return middle_porosity(dynamics, scene.deposit.gravity, scene.contact_margin);
}

}  // namespace

template <int D>
double deposit(const GrainsScene& scene, const DynamicsSettings<D>& settings,
               const std::vector<Wall<D>>& walls, InitialGrains<D>& grains, const DepositMonitor& monitor) {
  const InitialGrains<D> start = grains;
  if (!scene.deposit.target_porosity) {
    const double friction = scene.deposit.friction.value_or(scene.constants.friction);
    settle(scene, settings, walls, friction, start, monitor, grains);
    return friction;
  }
  const double target = *scene.deposit.target_porosity, tolerance = scene.deposit.porosity_tolerance;
  double low = 0, high = 1;
  InitialGrains<D> rest;
  const double densest = settle(scene, settings, walls, low, start, monitor, rest);
  if (densest > target - tolerance) {
    grains = rest;
    if (std::abs(densest - target) <= tolerance) return low;
    throw NotConverged(
        fmt::format("even without friction the deposit has porosity {:.4f}, above {:.4f}", densest, target),
        "a wider grading packs more densely");
  }
  for (int attempt = 0; attempt < 12; ++attempt) {
    const double friction = attempt == 0 ? high : 0.5 * (low + high);
    const double porosity = settle(scene, settings, walls, friction, start, monitor, rest);
    if (std::abs(porosity - target) <= tolerance) {
      grains = rest;
      return friction;
    }
    if (porosity < target && attempt == 0)
      throw NotConverged(
          fmt::format("with friction 1 the deposit has porosity {:.4f}, below {:.4f}", porosity, target),
          "rolling resistance makes looser deposits");
    (porosity < target ? low : high) = friction;
  }
  throw NotConverged(
      fmt::format("no friction gives a deposit of porosity {:.4f} within {:g}", target, tolerance),
      "raise porosity_tolerance: a small sample has its own scatter");
}

template InitialGrains<2> initial_grains<2>(const GrainsScene&);
template DynamicsSettings<2> dynamics_settings<2>(const GrainsScene&, const InitialGrains<2>&);
template std::vector<Wall<2>> scene_walls<2>(const GrainsScene&);
template double deposit<2>(const GrainsScene&, const DynamicsSettings<2>&, const std::vector<Wall<2>>&,
                           InitialGrains<2>&, const DepositMonitor&);
template double middle_porosity<2>(const Dynamics<2>&, const std::vector<double>&, double);
template InitialGrains<3> initial_grains<3>(const GrainsScene&);
template DynamicsSettings<3> dynamics_settings<3>(const GrainsScene&, const InitialGrains<3>&);
template std::vector<Wall<3>> scene_walls<3>(const GrainsScene&);
template double deposit<3>(const GrainsScene&, const DynamicsSettings<3>&, const std::vector<Wall<3>>&,
                           InitialGrains<3>&, const DepositMonitor&);
template double middle_porosity<3>(const Dynamics<3>&, const std::vector<double>&, double);

}  // namespace estuary::grains
