#include "load_transfer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace estuary::coupler {

namespace {

// One sum after the other would wait for each addition: those of a node are made first.
template <std::size_t D>
LoadSums sum_load_in(const v1::WetSurface& surface, std::span<const double> displacement,
                     std::span<const double> velocity, std::span<const double> force) {
  const double* reference = surface.reference_positions().data();
  std::array<double, D> total{};
  LoadSums sums;
  for (std::size_t i = 0; i < force.size(); i += D) {
    double power = 0;
    for (std::size_t axis = 0; axis < D; ++axis) {
      total[axis] += force[i + axis];
      if (!velocity.empty()) power += force[i + axis] * velocity[i + axis];
    }
    sums.power += power;
    const double x = reference[i] + displacement[i];
    const double y = reference[i + 1] + displacement[i + 1];
    sums.moment += x * force[i + 1] - y * force[i];
  }
  std::copy(total.begin(), total.end(), sums.force.begin());
  return sums;
}

}  // namespace

v1::NodalForces consistent_nodal_forces(const v1::WetSurface& surface, std::span<const double> displacement,
                                        const v1::WetSurfacePressures& load) {
  if (surface.dimension() != 2) {
    throw std::invalid_argument("pressures become nodal forces in two dimensions only");
  }
  const auto& reference = surface.reference_positions();
  const auto& pressure = load.pressure();
  const auto& traction = load.viscous_traction();
  v1::NodalForces result;
  result.set_surface(surface.identity());
  auto& force = *result.mutable_force();
  force.Resize(reference.size(), 0.0);
  for (int facet = 0; facet < surface.connectivity_size(); facet += 2) {
    const auto a = static_cast<int>(surface.connectivity(facet));
    const auto b = static_cast<int>(surface.connectivity(facet + 1));
    const double tx = (reference[2 * b] + displacement[2 * b]) - (reference[2 * a] + displacement[2 * a]);
    const double ty =
        (reference[2 * b + 1] + displacement[2 * b + 1]) - (reference[2 * a + 1] + displacement[2 * a + 1]);
    // l n, with the normal to the left of the segment, into the fluid.
    const double nx = -ty;
    const double ny = tx;
    const double p_a = (2 * pressure[a] + pressure[b]) / 6;
    const double p_b = (pressure[a] + 2 * pressure[b]) / 6;
    force[2 * a] -= p_a * nx;
    force[2 * a + 1] -= p_a * ny;
    force[2 * b] -= p_b * nx;
    force[2 * b + 1] -= p_b * ny;
    if (!traction.empty()) {
      const double length = std::hypot(tx, ty);
      for (int axis = 0; axis < 2; ++axis) {
        const double t_a = traction[2 * a + axis];
        const double t_b = traction[2 * b + axis];
        force[2 * a + axis] += length * (2 * t_a + t_b) / 6;
        force[2 * b + axis] += length * (t_a + 2 * t_b) / 6;
      }
    }
  }
  return result;
}

LoadSums sum_load(const v1::WetSurface& surface, std::span<const double> displacement,
                  std::span<const double> velocity, std::span<const double> force) {
  return surface.dimension() == 3 ? sum_load_in<3>(surface, displacement, velocity, force)
                                  : sum_load_in<2>(surface, displacement, velocity, force);
}

}  // namespace estuary::coupler
