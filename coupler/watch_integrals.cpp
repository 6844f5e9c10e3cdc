#include "watch_integrals.hpp"

#include <array>
#include <cmath>

#include "load_transfer.hpp"

namespace estuary::coupler {
namespace {

// Length of a segment or area of a triangle.
double measure_of(const std::array<std::array<double, 3>, 3>& corner, std::size_t count) {
  std::array<double, 3> u{}, v{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    u[axis] = corner[1][axis] - corner[0][axis];
    v[axis] = corner[2][axis] - corner[0][axis];
  }
  if (count == 2) return std::hypot(u[0], u[1]);
  return 0.5 * std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
}

}  // namespace

v1::WatchSample surface_integrals(const std::string& name, const v1::WetSurface& surface,
                                  const InterfaceState& state, std::uint64_t iterations) {
  const std::size_t dimension = surface.dimension();
  const auto& displacement = state.motion.displacement;
  double reference = 0;
  double deformed = 0;
  std::array<double, 3> mean{};
  for (int facet = 0; facet < surface.connectivity_size(); facet += static_cast<int>(dimension)) {
    std::array<std::array<double, 3>, 3> before{}, now{};
    std::array<double, 3> sum{};
    for (std::size_t corner = 0; corner < dimension; ++corner) {
      const std::size_t node = surface.connectivity(facet + static_cast<int>(corner));
      for (std::size_t axis = 0; axis < dimension; ++axis) {
        const double moved = displacement[node * dimension + axis];
        before[corner][axis] = surface.reference_positions(static_cast<int>(node * dimension + axis));
        now[corner][axis] = before[corner][axis] + moved;
        sum[axis] += moved;
      }
    }
    const double measure = measure_of(before, dimension);
    reference += measure;
    deformed += measure_of(now, dimension);
    for (std::size_t axis = 0; axis < dimension; ++axis)
      mean[axis] += measure * sum[axis] / static_cast<double>(dimension);
  }
  const LoadSums sums = sum_load(surface, displacement, state.motion.velocity, state.forces);
  v1::WatchSample sample;
  sample.set_name(name);
  const auto add = [&](const std::string& quantity, double value) {
    sample.add_quantity(quantity);
    sample.add_value(value);
  };
  constexpr std::array<const char*, 3> axes = {"x", "y", "z"};
  for (std::size_t axis = 0; axis < dimension; ++axis)
    add(std::string("force_") + axes[axis], sums.force[axis]);
  add("moment", sums.moment);
  add("power", sums.power);
  for (std::size_t axis = 0; axis < dimension; ++axis)
    add(std::string("mean_displacement_") + axes[axis], reference > 0 ? mean[axis] / reference : 0.0);
  add(dimension == 2 ? "length" : "area", deformed);
  add("iterations", static_cast<double>(iterations));
  return sample;
}

}  // namespace estuary::coupler
