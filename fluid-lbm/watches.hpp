// Values a scene asks to follow: at a point, along a line, or of the whole flow.
#pragma once

#include <vector>

#include "fields.hpp"
#include "fluid_scene.hpp"
#include "links.hpp"

namespace estuary::fluid {

/// point     velocity_x, velocity_y, speed [m/s], pressure [Pa]; bilinear between the fluid nodes around it
/// line      reversal: distance along the line [m] of the last place where velocity_x turns from negative to
/// positive (0
///           when it does nowhere); flow_rate: volume per second and metre of depth through the line, from
///           its left to its right as walked [m2/s]
/// integral  kinetic_energy [J/m], mass [kg/m], maximum_speed [m/s], force_x, force_y: on wet surface and
/// obstacles [N/m]
std::vector<WatchValues> evaluate_watches(const FluidScene& scene, const Fields& fields, const Cells& cells,
                                          const Force& force);

}  // namespace estuary::fluid
