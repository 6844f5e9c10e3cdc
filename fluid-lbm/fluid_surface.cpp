// Where the wet surface is inside a window, and the loads on it.
#include <fmt/format.h>

#include <cmath>

#include "fluid.hpp"
#include "stopwatch.hpp"
#include "wet_surface.hpp"

namespace estuary::fluid {
namespace {

// A step of the surface beyond this speed [lattice units] leaves the method's range.
constexpr double fastest_surface = 0.5;

}  // namespace

void Fluid::take_surface(const v1::Exchange& initial) {
  check_wet_surface(initial.wet_surface());
  surface_ = initial.wet_surface();
  if (surface_.dimension() != 2)
    throw BadInput("initial.wet_surface.dimension", "this fluid works in two dimensions");
  flow_->set_wet_surface(node_count(surface_),
                         {surface_.connectivity().begin(), surface_.connectivity().end()},
                         scene_.close_everywhere ? EdgeLinks::Extent::everywhere : EdgeLinks::Extent::edges);
  accepted_.displacement.assign(static_cast<std::size_t>(surface_.reference_positions_size()), 0.0);
  accepted_.velocity = accepted_.displacement;
  if (initial.has_displacements()) accepted_ = motion_of(initial);
  latest_ = accepted_;
  move_surface(accepted_);
}

Fluid::Motion Fluid::motion_of(const v1::Exchange& inputs) const {
  if (!flow_->wet_surface()) return {};
  if (!inputs.has_displacements()) {
    throw BadInput("inputs.displacements", "the motion of the wet surface is missing");
  }
  const auto& field = inputs.displacements();
  check_displacements(field, surface_);
  Motion motion{{field.displacement().begin(), field.displacement().end()},
                {field.velocity().begin(), field.velocity().end()}};
  if (scene_.mode == Mode::steady) motion.velocity.assign(motion.velocity.size(), 0.0);
  const double scale = scene_.units.velocity_to_lattice();
  for (std::size_t k = 0; k < motion.velocity.size(); ++k) {
    if (std::abs(motion.velocity[k]) * scale < fastest_surface) continue;
    throw Diverged(
        "inputs.displacements.velocity",
        fmt::format("node {} of the wet surface moves with {:g} m/s, {:.2g} spacings per time step", k / 2,
                    motion.velocity[k], motion.velocity[k] * scale),
        "relax the coupling more, shorten the window, or raise fluid.reference_velocity");
  }
  return motion;
}

void Fluid::move_surface(const Motion& motion) {
  const Stopwatch stopwatch(seconds_.wet_surface);
  const auto& reference = surface_.reference_positions();
  std::vector<double> positions(motion.displacement.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    positions[k] = reference[static_cast<int>(k)] + motion.displacement[k];
  }
  flow_->move_wet_surface(positions, motion.velocity, scene_.units.velocity_to_lattice());
  wet_load_stale_ = true;
}

// Position by cubic Hermite interpolation between the window's ends, so that it moves off and arrives with
// their velocities; the wall's velocity linearly between them. The cubic's own derivative overshoots when
// displacement and velocity of an iterate do not belong together, and feeds that back into the solid.
void Fluid::move_inside_window(const Motion& end, double s, double duration) {
  if (s >= 1) {
    move_surface(end);
    return;
  }
  const double h00 = (1 + 2 * s) * (1 - s) * (1 - s);
  const double h10 = s * (1 - s) * (1 - s) * duration;
  const double h01 = s * s * (3 - 2 * s);
  const double h11 = s * s * (s - 1) * duration;
  Motion now{std::vector<double>(end.displacement.size()), std::vector<double>(end.displacement.size())};
  for (std::size_t k = 0; k < end.displacement.size(); ++k) {
    const double d0 = accepted_.displacement[k];
    const double d1 = end.displacement[k];
    const double v0 = accepted_.velocity[k];
    const double v1 = end.velocity[k];
    now.displacement[k] = h00 * d0 + h10 * v0 + h01 * d1 + h11 * v1;
    now.velocity[k] = (1 - s) * v0 + s * v1;
  }
  move_surface(now);
}

void Fluid::give_back(const Flow::State& state) {
  std::vector<double> positions(accepted_.displacement.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    positions[k] = surface_.reference_positions(static_cast<int>(k)) + accepted_.displacement[k];
  }
  flow_->give_back(state, positions, accepted_.velocity, scene_.units.velocity_to_lattice());
  wet_load_stale_ = true;
}

void Fluid::restart_exchanged() {
  exchanged_.total = {};
  if (scene_.exchange_loads) exchanged_.nodes.assign(accepted_.displacement.size(), 0.0);
}

void Fluid::add_exchanged(double weight) {
  if (!flow_->wet_surface() || !(scene_.match_force || scene_.exchange_loads)) return;
  flow_->apply_boundaries();
  if (scene_.match_force) exchanged_.total = exchanged_.total + weight * flow_->wet_force();
  if (scene_.exchange_loads) flow_->add_wet_node_forces(weight, exchanged_.nodes);
}

void Fluid::evaluate_loads() {
  if (!flow_->wet_surface()) return;
  const Stopwatch stopwatch(seconds_.fields_and_loads);
  if (wet_load_stale_) {
    wet_load_.build(*flow_->wet_surface(), flow_->cells());
    wet_load_stale_ = false;
  }
  wet_load_.evaluate(flow_->populations(), scene_.flow.equilibrium, scene_.flow.rates, pressure_,
                     scene_.viscous_traction ? &traction_ : nullptr, ranks_);
  if (scene_.exchange_loads) match_nodes(*flow_->wet_surface(), exchanged_.nodes, pressure_, traction_);
  if (scene_.match_force) {
    const Grid& grid = flow_->grid();
    match_total(*flow_->wet_surface(), exchanged_.total, !grid.periodic_x && !grid.periodic_y, pressure_,
                traction_);
  }
}

}  // namespace estuary::fluid
