#include "grain_coupling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace estuary::fluid {
namespace {

// A grain faster than this [lattice units] leaves the method's range.
constexpr double fastest_grain = 0.5;

bool all_zero(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return v == 0; });
}

}  // namespace

void GrainCoupling::start(const v1::Exchange& initial, const Grid& grid, const Units& units) {
  grid_ = grid;
  units_ = units;
  if (!initial.has_grain_states() || initial.grain_states().radius_size() == 0) return;
  start_ = read_grains(initial.grain_states(), grid.dimension());
  end_ = start_;
  active_ = true;
}

void GrainCoupling::take(const v1::Exchange& inputs, double duration, bool steady) {
  if (!active_) return;
  if (!inputs.has_grain_states()) {
    throw BadInput("inputs.grain_states", "the motion of the grains is missing");
  }
  end_ = read_grains(inputs.grain_states(), start_.dimension);
  if (end_.count() != start_.count()) {
    throw BadInput("inputs.grain_states",
                   fmt::format("{} grains where there were {}", end_.count(), start_.count()));
  }
  go_on_across_periodic_sides();
  duration_ = duration;
  if (steady) {
    std::fill(end_.velocity.begin(), end_.velocity.end(), 0.0);
    std::fill(end_.spin.begin(), end_.spin.end(), 0.0);
  }
  const auto components = static_cast<std::size_t>(end_.dimension);
  for (std::size_t k = 0; k < end_.velocity.size(); ++k) {
    const double speed = std::abs(end_.velocity[k]) * units_.velocity_to_lattice();
    if (speed < fastest_grain) continue;
    throw Diverged("inputs.grain_states.velocity",
                   fmt::format("grain {} moves with {:g} m/s, {:.2g} spacings per time step", k / components,
                               end_.velocity[k], speed),
                   "shorten the window, or raise fluid.reference_velocity");
  }
}

void GrainCoupling::go_on_across_periodic_sides() {
  const auto components = static_cast<std::size_t>(end_.dimension);
  const std::array<bool, 3> periodic{grid_.periodic_x, grid_.periodic_y, grid_.periodic_z};
  const std::array<int, 3> nodes{grid_.nx, grid_.ny, grid_.nz};
  for (std::size_t k = 0; k < end_.centre.size(); ++k) {
    const std::size_t axis = k % components;
    if (!periodic[axis]) continue;
    const double length = nodes[axis] * grid_.spacing;
    end_.centre[k] -= length * std::round((end_.centre[k] - start_.centre[k]) / length);
  }
}

bool GrainCoupling::resting() const {
  return !active_ || (start_.centre == end_.centre && all_zero(start_.velocity) && all_zero(end_.velocity) &&
                      all_zero(start_.spin) && all_zero(end_.spin));
}

double GrainCoupling::later(double fraction, double steps) const {
  return duration_ > 0 ? std::min(1.0, fraction + steps * units_.time_step / duration_) : fraction;
}

Grains GrainCoupling::in_step(double fraction) const {
  return to_lattice(between(start_, end_, fraction, later(fraction, 0.5), duration_), grid_, units_);
}

Grains GrainCoupling::after_step(double fraction) const {
  const double after = later(fraction, 1);
  return to_lattice(between(start_, end_, after, after, duration_), grid_, units_);
}

void GrainCoupling::write(const GrainLoads& loads, bool filled, v1::Exchange& outputs) const {
  if (!active_) return;
  v1::GrainForces& message = *outputs.mutable_grain_forces();
  write_loads(loads, start_.dimension, units_, message);
  if (!filled || !(duration_ > 0)) return;
  // Inertia of the fluid inside.
  const auto components = static_cast<std::size_t>(start_.dimension);
  const std::size_t turns = components == 3 ? 3 : 1;
  for (std::size_t n = 0; n < start_.count(); ++n) {
    const double r = end_.radius[n];
    const double volume =
        components == 3 ? 4.0 / 3.0 * std::numbers::pi * r * r * r : std::numbers::pi * r * r;
    const double mass = units_.density * volume;
    const double inertia = (components == 3 ? 0.4 : 0.5) * mass * r * r;
    for (std::size_t axis = 0; axis < components; ++axis) {
      const std::size_t k = components * n + axis;
      const double change = (end_.velocity[k] - start_.velocity[k]) / duration_;
      message.set_force(static_cast<int>(k), message.force(static_cast<int>(k)) + mass * change);
    }
    for (std::size_t axis = 0; axis < turns; ++axis) {
      const std::size_t k = turns * n + axis;
      const double change = (end_.spin[k] - start_.spin[k]) / duration_;
      message.set_torque(static_cast<int>(k), message.torque(static_cast<int>(k)) + inertia * change);
    }
  }
}

void GrainCoupling::save(CheckpointWriter& writer) const {
  if (!active_) return;
  writer.add("grain centre", start_.centre);
  writer.add("grain radius", start_.radius);
  writer.add("grain velocity", start_.velocity);
  writer.add("grain spin", start_.spin);
}

void GrainCoupling::load(const std::function<void(const char*, std::span<double>)>& read) {
  if (!active_) return;
  read("grain centre", start_.centre);
  read("grain radius", start_.radius);
  read("grain velocity", start_.velocity);
  read("grain spin", start_.spin);
  end_ = start_;
}

}  // namespace estuary::fluid
