#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <span>

#include "scene_parts.hpp"

namespace estuary::fluid {
namespace {

bool inside(const Grid& grid, std::span<const double> point) {
  constexpr double slack = 1e-9;
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  const std::array<double, 3> at{grid.to_lattice_x(point[0]), grid.to_lattice_y(point[1]),
                                 point.size() == 3 ? grid.to_lattice_z(point[2]) : 0.0};
  for (std::size_t axis = 0; axis < point.size(); ++axis) {
    if (!(at[axis] >= -0.5 - slack && at[axis] <= counts[axis] - 0.5 + slack)) return false;
  }
  return true;
}

void read_obstacle_watch(SceneTable& table, WatchRequest& watch, const FluidScene& result) {
  watch.kind = WatchRequest::Kind::obstacle;
  watch.obstacle = table.text("obstacle");
  watch.reference_length = table.number_or("reference_length", 0.0, Range::not_negative());
  watch.reference_velocity =
      table.number_or("reference_velocity", result.reference_velocity, Range::positive());
  const bool known =
      std::any_of(result.round_obstacles.begin(), result.round_obstacles.end(),
                  [&](const RoundObstacle& obstacle) { return obstacle.name == watch.obstacle; }) ||
      std::any_of(result.fixed_obstacles.begin(), result.fixed_obstacles.end(),
                  [&](const FixedObstacle& obstacle) { return obstacle.name == watch.obstacle; });
  if (!known) table.problem("obstacle", fmt::format("no obstacle is named '{}'", watch.obstacle));
}

}  // namespace

void read_watches(SceneTable& root, const std::string& role, int dimension, FluidScene& result) {
  const auto components = static_cast<std::size_t>(dimension);
  for (auto& table : root.tables("watch")) {
    if (table.text_or("participant", "") != role) continue;
    WatchRequest watch;
    watch.name = table.text("name");
    if (static_cast<int>(table.has("point")) + static_cast<int>(table.has("line")) +
            static_cast<int>(table.has("from")) + static_cast<int>(table.has("obstacle")) >
        1) {
      table.problem("line", "a watch has one of `point`, `line`, a box (`from`, `to`) and `obstacle`");
      continue;
    }
    if (table.has("point")) {
      watch.kind = WatchRequest::Kind::point;
      watch.points = table.numbers("point", components);
      if (watch.points.size() != components) continue;
    } else if (table.has("line")) {
      watch.kind = WatchRequest::Kind::line;
      watch.points = table.points("line", components);
      watch.samples = static_cast<int>(table.integer_or("samples", 1001, 2, 1'000'000));
      if (watch.points.size() != 2 * components) {
        if (!watch.points.empty()) table.problem("line", "a line has two points");
        continue;
      }
    } else if (table.has("from") || table.has("to")) {
      watch.kind = WatchRequest::Kind::box;
      watch.points = table.numbers("from", components);
      const std::vector<double> to = table.numbers("to", components);
      if (watch.points.size() != components || to.size() != components) continue;
      for (std::size_t axis = 0; axis < components; ++axis)
        if (!(to[axis] > watch.points[axis])) table.problem("to", "must lie beyond `from`");
      watch.points.insert(watch.points.end(), to.begin(), to.end());
    } else if (table.has("obstacle")) {
      read_obstacle_watch(table, watch, result);
    } else if (table.has("exact_velocity")) {
      watch.exact_velocity = parse_expressions(table, "exact_velocity", dimension);
    }
    const Grid& grid = result.flow.grid;
    for (std::size_t n = 0; n + components <= watch.points.size() && grid.nx > 0; n += components) {
      const std::span<const double> point(&watch.points[n], components);
      if (inside(grid, point)) continue;
      table.problem(watch.kind == WatchRequest::Kind::point ? "point"
                    : watch.kind == WatchRequest::Kind::box ? "from"
                                                            : "line",
                    fmt::format("({}) lies outside of the fluid's domain", fmt::join(point, ", ")));
      break;
    }
    result.watches.push_back(std::move(watch));
  }
}

}  // namespace estuary::fluid
