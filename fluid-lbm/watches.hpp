// Values a scene asks to follow: at a point, along a line, on an obstacle, or of the whole flow.
#pragma once

#include <array>
#include <vector>

#include "fields.hpp"
#include "flow.hpp"
#include "fluid_scene.hpp"

namespace estuary::fluid {

/// point     velocity_x, velocity_y, (velocity_z,) speed [m/s], pressure [Pa], vorticity [1/s]; linear
/// between
///           the fluid nodes around it
/// line      reversal: distance along the line [m] of the last place where velocity_x turns from negative to
///           positive (0 when it does nowhere); minimum_velocity_x, maximum_velocity_x, ..._y and with _at
///           their distance along the line; in two dimensions flow_rate: volume per second and metre of
///           depth through the line, from its left to its right as walked [m2/s]
/// box       over the fluid nodes in it: pressure (mean), porosity (share of fluid nodes), mean_velocity_x,
///           ... (over fluid and solid), pressure_gradient_x, ... (between the box's two end planes of each
///           axis, see `box_means`) [Pa/m], permeability_x, ... = viscosity times mean velocity over
///           (body force - pressure gradient) [m2] (Darcy)
/// obstacle  force_x, force_y, (force_z) [N, in two dimensions N/m], torque about the centre [N m, N]; with a
///           reference length L drag_coefficient and lift_coefficient: force_x and force_y over
///           rho U^2 L / 2, in three dimensions over rho U^2 / 2 times pi L^2 / 4
/// integral  kinetic_energy [J, J/m], mass [kg, kg/m], maximum_speed, porosity, mean_velocity_x, ... (over
/// fluid
///           and solid) [m/s], force_x, ...: on all that is fixed and the wet surface [N, N/m]; with an exact
///           velocity velocity_error (relative L2) and largest_velocity_error (over the largest exact one)
/// `fields` are looked at only when `watches_need_fields`. Where ranks share the grid all call this; `fields`
/// then learn of nodes of other ranks that a watch looks at: `looked_at` as `nodes_of_watches` gives them.
std::vector<WatchValues> evaluate_watches(const FluidScene& scene, Fields& fields, const Flow& flow,
                                          double time, const BodyLoad& force, Ranks* ranks = nullptr,
                                          const std::vector<std::vector<Node>>& looked_at = {});
/// Of each watch the nodes that it may look at, in order; none for those that are no point and no line.
[[nodiscard]] std::vector<std::vector<Node>> nodes_of_watches(const FluidScene& scene, const Grid& grid);
[[nodiscard]] bool watches_need_fields(const FluidScene& scene);

/// Over the nodes low <= x, y, z <= high (z = 0 in two dimensions), lattice units; called by all ranks. The
/// gradient along an axis is the difference of the mean pressures (over fluid nodes) of the box's last and
/// first plane over their distance: Darcy's, whatever lies between them. A line through all nodes would hang
/// on where in the box the solid lies. Zero for one plane, for an end plane that is all solid, and for a box
/// that goes once around a period, where both ends are the same plane.
struct BoxMeans {
  double excess = 0;                        // over the fluid
  double porosity = 0;                      // share of fluid nodes
  std::array<double, 3> velocity{};         // over fluid and solid: what flows through the cross-section
  std::array<double, 3> excess_gradient{};  // per spacing
};
[[nodiscard]] BoxMeans box_means(const Fields& fields, const Cells& cells, const std::array<int, 3>& low,
                                 const std::array<int, 3>& high, Ranks* ranks = nullptr);

}  // namespace estuary::fluid
