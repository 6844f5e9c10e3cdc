#include "watches.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

struct Sample {
  double velocity_x = 0;  // lattice units
  double velocity_y = 0;
  double excess = 0;
};

// Bilinear; nodes that are not fluid leave their weight to the others. Zero inside the solid.
Sample sample_at(const Fields& fields, const Cells& cells, double px, double py) {
  const Grid& grid = cells.grid();
  const int x0 = static_cast<int>(std::floor(px));
  const int y0 = static_cast<int>(std::floor(py));
  Sample sum;
  double total = 0;
  for (int y = y0; y <= y0 + 1; ++y) {
    for (int x = x0; x <= x0 + 1; ++x) {
      const Node node{grid.wrap_x(x), grid.wrap_y(y)};
      if (!grid.inside(node.x, node.y) || !cells.fluid(node.x, node.y)) continue;
      const double weight = (1 - std::abs(px - x)) * (1 - std::abs(py - y));
      const auto k = static_cast<std::size_t>(node.y) * static_cast<std::size_t>(grid.nx) +
                     static_cast<std::size_t>(node.x);
      total += weight;
      sum.velocity_x += weight * fields.velocity_x[k];
      sum.velocity_y += weight * fields.velocity_y[k];
      sum.excess += weight * fields.excess[k];
    }
  }
  if (total > 0) {
    sum.velocity_x /= total;
    sum.velocity_y /= total;
    sum.excess /= total;
  }
  return sum;
}

void evaluate_line(const FluidScene& scene, const WatchRequest& watch, const Fields& fields,
                   const Cells& cells, WatchValues& values) {
  const Grid& grid = cells.grid();
  const double tx = watch.points[2] - watch.points[0];
  const double ty = watch.points[3] - watch.points[1];
  const double length = std::hypot(tx, ty);
  double reversal = 0;
  double flow_rate = 0;
  double before = 0;         // velocity_x at the sample before
  double before_across = 0;  // velocity to the right of the line there
  for (int n = 0; n < watch.samples; ++n) {
    const double fraction = static_cast<double>(n) / (watch.samples - 1);
    const Sample sample = sample_at(fields, cells, grid.to_lattice_x(watch.points[0] + fraction * tx),
                                    grid.to_lattice_y(watch.points[1] + fraction * ty));
    const double across = length > 0 ? (sample.velocity_x * ty - sample.velocity_y * tx) / length : 0;
    if (n > 0) {
      const double step = length / (watch.samples - 1);
      flow_rate += 0.5 * (across + before_across) * step;
      if (before < 0 && sample.velocity_x >= 0) {
        reversal = length * fraction - step * sample.velocity_x / (sample.velocity_x - before);
      }
    }
    before = sample.velocity_x;
    before_across = across;
  }
  values.quantities = {{"reversal", reversal}, {"flow_rate", flow_rate / scene.units.velocity_to_lattice()}};
}

}  // namespace

std::vector<WatchValues> evaluate_watches(const FluidScene& scene, const Fields& fields, const Cells& cells,
                                          const Force& force) {
  const Units& units = scene.units;
  const double to_velocity = 1 / units.velocity_to_lattice();
  std::vector<WatchValues> result;
  for (const WatchRequest& watch : scene.watches) {
    WatchValues values{watch.name, {}};
    if (watch.kind == WatchRequest::Kind::point) {
      const Sample sample = sample_at(fields, cells, cells.grid().to_lattice_x(watch.points[0]),
                                      cells.grid().to_lattice_y(watch.points[1]));
      const double u = sample.velocity_x * to_velocity;
      const double v = sample.velocity_y * to_velocity;
      values.quantities = {{"velocity_x", u},
                           {"velocity_y", v},
                           {"speed", std::hypot(u, v)},
                           {"pressure", sample.excess * D2Q9::sound_speed_squared * units.stress()}};
    } else if (watch.kind == WatchRequest::Kind::line) {
      evaluate_line(scene, watch, fields, cells, values);
    } else {
      const FieldSums sums = sum_fields(fields, cells, scene.flow.sides);
      const double cell = units.spacing * units.spacing;
      values.quantities = {
          {"kinetic_energy", sums.kinetic_energy * units.density * to_velocity * to_velocity * cell},
          {"mass", (sums.area + sums.excess) * units.density * cell},
          {"maximum_speed", sums.maximum_speed * to_velocity},
          {"force_x", force.x * units.force()},
          {"force_y", force.y * units.force()}};
    }
    result.push_back(std::move(values));
  }
  return result;
}

}  // namespace estuary::fluid
