#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scene_parts.hpp"

namespace estuary::fluid {

namespace {

// What the first of several ranks needs for a file beyond its slab: the whole lattice.
double bytes_for_files(const FluidScene& scene) {
  if (scene.ranks == 1) return 0.0;
  // `Flow::gather`: the slab's copy, the populations as they come in, and again without solid nodes.
  const double checkpoint = 2 * Populations::memory_bytes(scene.flow.grid) +
                            Populations::memory_bytes(scene.flow.grid) / scene.ranks;
  const double frame = static_cast<double>(scene.flow.grid.size() * (scene.dimension() + 2)) * sizeof(double);
  return std::max(scene.writes_checkpoints ? checkpoint : 0.0, scene.writes_frames ? frame : 0.0);
}

}  // namespace

void fill_plan(const FluidScene& result, Plan& plan) {
  const Units& units = result.units;
  const Grid& grid = result.flow.grid;
  const double tau = units.relaxation_time();
  const double mach = units.mach(result.reference_velocity);
  const double grid_reynolds = units.grid_reynolds(result.reference_velocity);
  const auto nodes = static_cast<double>(grid.size());
  const double height =
      (grid.nz > 0 ? std::min({grid.nx, grid.ny, grid.nz}) : std::min(grid.nx, grid.ny)) * grid.spacing;
  plan.derived.emplace_back("grid", grid.nz > 0 ? fmt::format("{} x {} x {} nodes", grid.nx, grid.ny, grid.nz)
                                                : fmt::format("{} x {} nodes", grid.nx, grid.ny));
  plan.derived.emplace_back("time step", fmt::format("{:.6g} s", units.time_step));
  plan.derived.emplace_back("relaxation time", fmt::format("{:.6g}", tau));
  plan.derived.emplace_back("Mach number of the reference velocity", fmt::format("{:.3g}", mach));
  plan.derived.emplace_back(
      "Reynolds number on the shorter side",
      fmt::format("{:.4g}", result.reference_velocity * height * units.density / units.viscosity));
  plan.derived.emplace_back("Reynolds number of a cell", fmt::format("{:.3g}", grid_reynolds));
  if (tau < 0.51 && result.flow.viscosity != ViscosityModel::smagorinsky) {
    plan.warnings.push_back(
        fmt::format("relaxation time {:.4g}: below 0.51 the flow is close to instability; use a finer "
                    "spacing or a larger lattice_velocity",
                    tau));
  }
  if (tau > 2) {
    plan.warnings.push_back(fmt::format(
        "relaxation time {:.4g}: above 2 errors at walls and in time grow; use a smaller lattice_velocity",
        tau));
  }
  if (mach > 0.1) {
    plan.warnings.push_back(fmt::format("Mach number {:.3g}: above 0.1 compressibility shows", mach));
  }
  if (grid_reynolds > 10) {
    plan.warnings.push_back(
        fmt::format("cell Reynolds number {:.3g}: above 10 boundary layers are not resolved", grid_reynolds));
  }
  constexpr double single_floor = 1e-5;  // what rounding leaves of changes, README
  if (result.flow.storage == Storage::single_precision && result.mode == Mode::steady &&
      result.steady_tolerance < single_floor) {
    plan.warnings.push_back(fmt::format(
        "steady.tolerance = {:.1g} with storage = \"float\": rounding may leave larger changes, and the "
        "flow then never counts as steady; 1e-4 is safe",
        result.steady_tolerance));
  }
  warn_of_narrow_gaps(result, plan);
  Grid slab = grid;  // the first rank's, which is none of the smaller ones
  slab.ranks = result.ranks;
  plan.memory_bytes =
      Populations::memory_bytes(slab, result.flow.storage) +
      (result.repeats_windows ? Populations::memory_bytes(slab) : 0.0) +
      nodes * (1 + 3 * 8 + (result.mode == Mode::steady ? 16 : 0) + (result.has_partner ? 8 : 0)) +
      bytes_for_files(result);
  if (result.mode == Mode::transient)
    plan.expected_updates = nodes * std::ceil(result.end_time / units.time_step);
  if (!result.has_solid) plan.left_out.emplace_back("moving wet surface: no solid in the scene");
  if (result.flow.force == ForceModel::none) plan.left_out.emplace_back("body force: none in the scene");
  if (result.obstacle_connectivity.empty() && result.round_obstacles.empty() && result.solid_nodes.empty())
    plan.left_out.emplace_back("obstacles: none in the scene");
  if (!result.viscous_traction) plan.left_out.emplace_back("viscous traction: the scene does not ask for it");
  if (!result.repeats_windows) {
    plan.left_out.emplace_back(result.mode == Mode::steady
                                   ? "copy of the window's start: a steady iteration goes on from where it is"
                                   : "copy of the window's start: no window is repeated");
  }
  plan.variant = variant_name(result.flow.step());
}

}  // namespace estuary::fluid
