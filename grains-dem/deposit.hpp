// From a scene to grains that can move: placing, and depositing under gravity (pluviation) until they rest.
#pragma once

#include "dynamics.hpp"
#include "grains_scene.hpp"
#include "medium.hpp"

namespace estuary::grains {

template <int D>
InitialGrains<D> initial_grains(const GrainsScene& scene);

template <int D>
DynamicsSettings<D> dynamics_settings(const GrainsScene& scene, const InitialGrains<D>& grains);

template <int D>
std::vector<Wall<D>> scene_walls(const GrainsScene& scene);

/// Lets `grains` fall under the deposit's gravity until their mean speed is below its tolerance; positions
/// are replaced, velocities set to zero. With a target porosity the friction of the deposit is sought by
/// bisection, starting each time from the same grains. Throws NotConverged when they do not come to rest in
/// time, or the porosity cannot be reached. Returns the friction the grains were deposited with.
template <int D>
double deposit(const GrainsScene& scene, const DynamicsSettings<D>& settings,
               const std::vector<Wall<D>>& walls, InitialGrains<D>& grains,
               const DepositMonitor& monitor = {});

/// Porosity of the middle of a deposit: between 15 % and 75 % of its height against gravity.
template <int D>
double middle_porosity(const Dynamics<D>& dynamics, const std::vector<double>& gravity, double radius_margin);

}  // namespace estuary::grains
