#include "watches.hpp"

#include <algorithm>
#include <cmath>

#include "sampling.hpp"

namespace estuary::fluid {
namespace {

std::array<double, 3> to_lattice(const Grid& grid, const double* point) {
  return {grid.to_lattice_x(point[0]), grid.to_lattice_y(point[1]),
          grid.nz > 0 ? grid.to_lattice_z(point[2]) : 0.0};
}

void evaluate_line(const FluidScene& scene, const WatchRequest& watch, const Fields& fields, const Flow& flow,
                   WatchValues& values) {
  const Cells& cells = flow.cells();
  const Grid& grid = cells.grid();
  const auto components = static_cast<std::size_t>(grid.dimension());
  const auto from = to_lattice(grid, watch.points.data());
  const auto to = to_lattice(grid, watch.points.data() + components);
  std::array<double, 3> along{};
  for (std::size_t axis = 0; axis < 3; ++axis) along[axis] = to[axis] - from[axis];
  const double length =
      std::sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2]) * grid.spacing;
  const double step = length / (watch.samples - 1);
  const double to_velocity = 1 / scene.units.velocity_to_lattice();
  double reversal = 0;
  double flow_rate = 0;
  double before = 0;         // velocity_x at the sample before
  double before_across = 0;  // velocity to the right of the line there
  struct Extreme {
    double value = 0;
    double at = 0;
  };
  std::array<Extreme, 4> extremes{};  // smallest and largest velocity_x, velocity_y
  for (int n = 0; n < watch.samples; ++n) {
    const double fraction = static_cast<double>(n) / (watch.samples - 1);
    std::array<double, 3> at{};
    for (std::size_t axis = 0; axis < 3; ++axis) at[axis] = from[axis] + fraction * along[axis];
    const auto velocity = sample_at(fields, cells, flow.settings().sides, at).velocity;
    const double across =
        length > 0 ? (velocity[0] * along[1] - velocity[1] * along[0]) * grid.spacing / length : 0;
    if (n > 0) {
      flow_rate += 0.5 * (across + before_across) * step;
      if (before < 0 && velocity[0] >= 0) {
        reversal = length * fraction - step * velocity[0] / (velocity[0] - before);
      }
    }
    for (std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
      if (n == 0 || velocity[axis] < extremes[2 * axis].value)
        extremes[2 * axis] = {velocity[axis], length * fraction};
      if (n == 0 || velocity[axis] > extremes[2 * axis + 1].value)
        extremes[2 * axis + 1] = {velocity[axis], length * fraction};
    }
    before = velocity[0];
    before_across = across;
  }
  values.quantities = {{"reversal", reversal}};
  if (components == 2) values.quantities.emplace_back("flow_rate", flow_rate * to_velocity);
  constexpr std::array names{"minimum_velocity_x", "maximum_velocity_x", "minimum_velocity_y",
                             "maximum_velocity_y"};
  for (std::size_t k = 0; k < names.size(); ++k) {
    values.quantities.emplace_back(names[k], extremes[k].value * to_velocity);
    values.quantities.emplace_back(std::string(names[k]) + "_at", extremes[k].at);
  }
}

// Vorticity (its z component) from central differences of samples one spacing away.
double vorticity_at(const Fields& fields, const Flow& flow, std::array<double, 3> at) {
  const auto shifted = [&](std::size_t axis, double by) {
    auto place = at;
    place[axis] += by;
    return sample_at(fields, flow.cells(), flow.settings().sides, place).velocity;
  };
  return 0.5 * (shifted(0, 1)[1] - shifted(0, -1)[1] - shifted(1, 1)[0] + shifted(1, -1)[0]);
}

void evaluate_point(const FluidScene& scene, const WatchRequest& watch, const Fields& fields,
                    const Flow& flow, WatchValues& values) {
  const Units& units = scene.units;
  const double to_velocity = 1 / units.velocity_to_lattice();
  const auto at = to_lattice(flow.grid(), watch.points.data());
  const Sample sample = sample_at(fields, flow.cells(), flow.settings().sides, at);
  const auto& v = sample.velocity;
  values.quantities = {{"velocity_x", v[0] * to_velocity}, {"velocity_y", v[1] * to_velocity}};
  if (flow.grid().nz > 0) values.quantities.emplace_back("velocity_z", v[2] * to_velocity);
  values.quantities.emplace_back("speed", std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * to_velocity);
  values.quantities.emplace_back("pressure", sample.excess * D2Q9::sound_speed_squared * units.stress());
  values.quantities.emplace_back("vorticity", vorticity_at(fields, flow, at) / units.time_step);
}

// The nodes that `sample_at` may look at around the points of a watch, and one spacing beside them.
std::vector<Node> nodes_around(const Grid& grid, const WatchRequest& watch) {
  const auto components = static_cast<std::size_t>(grid.dimension());
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  const std::array<bool, 3> periodic{grid.periodic_x, grid.periodic_y, grid.periodic_z};
  const auto from = to_lattice(grid, watch.points.data());
  const bool line = watch.kind == WatchRequest::Kind::line;
  const auto to = line ? to_lattice(grid, watch.points.data() + components) : from;
  const int samples = line ? watch.samples : 1;
  std::vector<std::size_t> found;
  std::array<int, 3> cell_before{};
  for (int n = 0; n < samples; ++n) {
    const double fraction = samples > 1 ? static_cast<double>(n) / (samples - 1) : 0.0;
    std::array<int, 3> cell{};
    for (std::size_t axis = 0; axis < components; ++axis)
      cell[axis] = static_cast<int>(std::floor(from[axis] + fraction * (to[axis] - from[axis])));
    if (n > 0 && cell == cell_before) continue;
    cell_before = cell;
    constexpr int reach = 4;  // a polynomial's four nodes, one-sided, and one spacing
    std::array<std::vector<int>, 3> along{{{0}, {0}, {0}}};
    for (std::size_t axis = 0; axis < components; ++axis) {
      along[axis].clear();
      for (int k = cell[axis] - reach; k <= cell[axis] + reach + 1; ++k) {
        const int inside = periodic[axis] ? (k % counts[axis] + counts[axis]) % counts[axis] : k;
        if (inside >= 0 && inside < counts[axis]) along[axis].push_back(inside);
      }
    }
    for (const int z : along[2])
      for (const int y : along[1])
        for (const int x : along[0]) found.push_back(grid.index(x, y, z));
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  std::vector<Node> nodes;
  nodes.reserve(found.size());
  const auto nx = static_cast<std::size_t>(grid.nx);
  const auto ny = static_cast<std::size_t>(grid.ny);
  for (const std::size_t k : found)
    nodes.push_back({static_cast<int>(k % nx), static_cast<int>(k / nx % ny), static_cast<int>(k / nx / ny)});
  return nodes;
}

struct Comparison {
  double change = 0;
  double norm = 0;
  double largest = 0;
  double largest_exact = 0;
};

void compare_own_rows(const FluidScene& scene, const WatchRequest& watch, const Fields& fields,
                      const Cells& cells, double time, Comparison& sums) {
  const Grid& grid = cells.grid();
  const double to_velocity = 1 / scene.units.velocity_to_lattice();
  for (int row = grid.first_row(); row < grid.past_row(); ++row) {
    const int y = row % grid.ny;
    const int z = row / grid.ny;
    for (const Span span : cells.row(row)) {
      for (int x = span.begin; x < span.end; ++x) {
        const std::size_t k = grid.index(x, y, z);
        const std::array<double, 3> computed{fields.velocity_x[k], fields.velocity_y[k],
                                             grid.nz > 0 ? fields.velocity_z[k] : 0.0};
        double square = 0;
        double exact_square = 0;
        for (std::size_t axis = 0; axis < watch.exact_velocity.size(); ++axis) {
          const double exact =
              watch.exact_velocity[axis](grid.x(x), grid.y(y), grid.nz > 0 ? grid.z(z) : 0.0, time);
          square += (computed[axis] * to_velocity - exact) * (computed[axis] * to_velocity - exact);
          exact_square += exact * exact;
        }
        sums.change += square;
        sums.norm += exact_square;
        sums.largest = std::max(sums.largest, square);
        sums.largest_exact = std::max(sums.largest_exact, exact_square);
      }
    }
  }
}

// Relative L2 and largest difference to the velocity a scene gives.
void compare(const FluidScene& scene, const WatchRequest& watch, const Fields& fields, const Cells& cells,
             double time, Ranks* ranks, WatchValues& values) {
  Comparison sums;
  in_turn(ranks, sums,
          [&](Comparison& so_far) { compare_own_rows(scene, watch, fields, cells, time, so_far); });
  const auto& [change, norm, largest, largest_exact] = sums;
  values.quantities.emplace_back("velocity_error", norm > 0 ? std::sqrt(change / norm) : std::sqrt(change));
  values.quantities.emplace_back("largest_velocity_error",
                                 largest_exact > 0 ? std::sqrt(largest / largest_exact) : std::sqrt(largest));
}

// Means over the fluid nodes of a box, and the permeability by Darcy's law of the medium in it.
void evaluate_box(const FluidScene& scene, const WatchRequest& watch, const Fields& fields,
                  const Cells& cells, double time, Ranks* ranks, WatchValues& values) {
  const Units& units = scene.units;
  const Grid& grid = cells.grid();
  const auto components = static_cast<std::size_t>(grid.dimension());
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  const auto from = to_lattice(grid, watch.points.data());
  const auto to = to_lattice(grid, watch.points.data() + components);
  std::array<int, 3> low{}, high{};
  for (std::size_t axis = 0; axis < components; ++axis) {
    low[axis] = std::max(0, static_cast<int>(std::ceil(from[axis] - 1e-9)));
    high[axis] = std::min(counts[axis] - 1, static_cast<int>(std::floor(to[axis] + 1e-9)));
  }
  const BoxMeans means = box_means(fields, cells, low, high, ranks);
  const double to_velocity = 1 / units.velocity_to_lattice();
  const double to_pressure = D2Q9::sound_speed_squared * units.stress();
  const auto drive = evaluate_body_force(scene, time);
  values.quantities = {{"pressure", means.excess * to_pressure}, {"porosity", means.porosity}};
  constexpr std::array<const char*, 3> names{"x", "y", "z"};
  for (std::size_t axis = 0; axis < components; ++axis) {
    const double mean = means.velocity[axis] * to_velocity;
    const double gradient = means.excess_gradient[axis] * to_pressure / grid.spacing;
    const double push = units.density * drive[axis] / units.acceleration_to_lattice() - gradient;
    values.quantities.emplace_back(std::string("mean_velocity_") + names[axis], mean);
    values.quantities.emplace_back(std::string("pressure_gradient_") + names[axis], gradient);
    values.quantities.emplace_back(std::string("permeability_") + names[axis],
                                   push != 0 ? units.viscosity * mean / push : 0);
  }
}

void evaluate_integral(const FluidScene& scene, const Fields& fields, const Cells& cells,
                       const BodyLoad& force, Ranks* ranks, WatchValues& values) {
  const Units& units = scene.units;
  const Grid& grid = cells.grid();
  const double to_velocity = 1 / units.velocity_to_lattice();
  const FieldSums sums = sum_fields(fields, cells, scene.flow.sides, ranks);
  const double cell = std::pow(units.spacing, grid.dimension());
  // Of the whole domain, solid included.
  double volume = 1;
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  for (std::size_t axis = 0; axis < static_cast<std::size_t>(grid.dimension()); ++axis) {
    const auto& sides = scene.flow.sides;
    volume *= counts[axis] - 0.5 * (is_open(sides[2 * axis].kind) ? 1 : 0) -
              0.5 * (is_open(sides[2 * axis + 1].kind) ? 1 : 0);
  }
  values.quantities = {
      {"kinetic_energy", sums.kinetic_energy * units.density * to_velocity * to_velocity * cell},
      {"mass", (sums.area + sums.excess) * units.density * cell},
      {"maximum_speed", sums.maximum_speed * to_velocity},
      {"porosity", sums.area / volume},
      {"mean_velocity_x", sums.momentum_x / volume * to_velocity},
      {"mean_velocity_y", sums.momentum_y / volume * to_velocity}};
  if (grid.nz > 0) values.quantities.emplace_back("mean_velocity_z", sums.momentum_z / volume * to_velocity);
  const double scale = units.force(grid.dimension());
  values.quantities.emplace_back("force_x", force.force[0] * scale);
  values.quantities.emplace_back("force_y", force.force[1] * scale);
  if (grid.nz > 0) values.quantities.emplace_back("force_z", force.force[2] * scale);
}

void evaluate_obstacle(const FluidScene& scene, const WatchRequest& watch, const Flow& flow,
                       WatchValues& values) {
  const int dimension = flow.grid().dimension();
  BodyLoad sum;
  for (std::size_t body = 0; body < scene.round_obstacles.size(); ++body) {
    if (scene.round_obstacles[body].name != watch.obstacle) continue;
    sum += flow.body_load(body);
  }
  for (std::uint32_t body = 0; body < scene.fixed_obstacles.size(); ++body) {
    if (scene.fixed_obstacles[body].name != watch.obstacle) continue;
    BodyLoad load = flow.obstacle_load(body);
    const auto centre = to_lattice(flow.grid(), scene.fixed_obstacles[body].centre.data());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t next = (axis + 1) % 3;
      const std::size_t last = (axis + 2) % 3;
      load.torque[axis] -= centre[next] * load.force[last] - centre[last] * load.force[next];
    }
    sum += load;
  }
  const double force = scene.units.force(dimension);
  const double torque = force * scene.units.spacing;
  const double area = dimension == 3 ? watch.reference_length * watch.reference_length * 0.78539816339744831
                                     : watch.reference_length;
  const double dynamic =
      0.5 * scene.units.density * watch.reference_velocity * watch.reference_velocity * area;
  values.quantities = {{"force_x", sum.force[0] * force}, {"force_y", sum.force[1] * force}};
  if (dimension == 3) {
    values.quantities.emplace_back("force_z", sum.force[2] * force);
    values.quantities.emplace_back("torque_x", sum.torque[0] * torque);
    values.quantities.emplace_back("torque_y", sum.torque[1] * torque);
    values.quantities.emplace_back("torque_z", sum.torque[2] * torque);
  } else {
    values.quantities.emplace_back("torque", sum.torque[2] * torque);
  }
  if (dynamic > 0) {
    values.quantities.emplace_back("drag_coefficient", sum.force[0] * force / dynamic);
    values.quantities.emplace_back("lift_coefficient", sum.force[1] * force / dynamic);
  }
}

}  // namespace

BoxMeans box_means(const Fields& fields, const Cells& cells, const std::array<int, 3>& low,
                   const std::array<int, 3>& high, Ranks* ranks) {
  const Grid& grid = cells.grid();
  struct Plane {
    double fluid = 0, excess = 0;
  };
  struct Sums {
    double fluid = 0, excess = 0;
    std::array<double, 3> velocity{};
    std::array<Plane, 3> first{}, last{};  // of each axis
  } sums;
  in_turn(ranks, sums, [&](Sums& all) {
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y) {
        if (!grid.owns(y, z)) continue;
        for (int x = low[0]; x <= high[0]; ++x) {
          if (!cells.fluid(x, y, z)) continue;
          const std::size_t k = grid.index(x, y, z);
          const double excess = fields.excess[k];
          all.fluid += 1;
          all.excess += excess;
          all.velocity[0] += fields.velocity_x[k];
          all.velocity[1] += fields.velocity_y[k];
          if (grid.nz > 0) all.velocity[2] += fields.velocity_z[k];
          const std::array<int, 3> at{x, y, z};
          const auto add = [excess](Plane& plane) {
            plane.fluid += 1;
            plane.excess += excess;
          };
          for (std::size_t axis = 0; axis < 3; ++axis) {
            if (at[axis] == low[axis]) add(all.first[axis]);
            if (at[axis] == high[axis]) add(all.last[axis]);
          }
        }
      }
  });
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  const std::array<bool, 3> periodic{grid.periodic_x, grid.periodic_y, grid.periodic_z};
  BoxMeans means;
  double nodes = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) nodes *= std::max(0, high[axis] - low[axis] + 1);
  if (sums.fluid == 0) return means;
  means.excess = sums.excess / sums.fluid;
  means.porosity = sums.fluid / nodes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    means.velocity[axis] = sums.velocity[axis] / nodes;
    const Plane &first = sums.first[axis], &last = sums.last[axis];
    const int length = high[axis] - low[axis];
    // Once around a period both ends are the same plane: what drives the flow is a body force.
    const bool around = periodic[axis] && length + 1 == counts[axis];
    if (length > 0 && !around && first.fluid > 0 && last.fluid > 0)
      means.excess_gradient[axis] = (last.excess / last.fluid - first.excess / first.fluid) / length;
  }
  return means;
}

bool watches_need_fields(const FluidScene& scene) {
  return std::any_of(scene.watches.begin(), scene.watches.end(),
                     [](const WatchRequest& watch) { return watch.kind != WatchRequest::Kind::obstacle; });
}

std::vector<std::vector<Node>> nodes_of_watches(const FluidScene& scene, const Grid& grid) {
  std::vector<std::vector<Node>> nodes(scene.watches.size());
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const WatchRequest& watch = scene.watches[n];
    if (watch.kind == WatchRequest::Kind::point || watch.kind == WatchRequest::Kind::line)
      nodes[n] = nodes_around(grid, watch);
  }
  return nodes;
}

std::vector<WatchValues> evaluate_watches(const FluidScene& scene, Fields& fields, const Flow& flow,
                                          double time, const BodyLoad& force, Ranks* ranks,
                                          const std::vector<std::vector<Node>>& looked_at) {
  std::vector<WatchValues> result;
  for (std::size_t n = 0; n < scene.watches.size(); ++n) {
    const WatchRequest& watch = scene.watches[n];
    WatchValues values{watch.name, {}};
    if (ranks != nullptr && !looked_at[n].empty()) share_fields(ranks, flow.grid(), looked_at[n], fields);
    switch (watch.kind) {
      case WatchRequest::Kind::point:
        evaluate_point(scene, watch, fields, flow, values);
        break;
      case WatchRequest::Kind::line:
        evaluate_line(scene, watch, fields, flow, values);
        break;
      case WatchRequest::Kind::box:
        evaluate_box(scene, watch, fields, flow.cells(), time, ranks, values);
        break;
      case WatchRequest::Kind::obstacle:
        evaluate_obstacle(scene, watch, flow, values);
        break;
      case WatchRequest::Kind::integral:
        evaluate_integral(scene, fields, flow.cells(), force, ranks, values);
        if (!watch.exact_velocity.empty()) compare(scene, watch, fields, flow.cells(), time, ranks, values);
        break;
    }
    result.push_back(std::move(values));
  }
  return result;
}

}  // namespace estuary::fluid
