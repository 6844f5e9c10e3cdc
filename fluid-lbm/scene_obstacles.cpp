#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>

#include "image_file.hpp"
#include "scene_parts.hpp"

namespace estuary::fluid {
namespace {

constexpr double fewest_spacings = 4;

double signed_area(const std::vector<double>& points) {
  double twice = 0;
  const std::size_t count = points.size() / 2;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t m = (n + 1) % count;
    twice += points[2 * n] * points[2 * m + 1] - points[2 * m] * points[2 * n + 1];
  }
  return 0.5 * twice;
}

std::array<double, 3> centroid(const std::vector<double>& points, double area) {
  std::array<double, 3> sum{};
  const std::size_t count = points.size() / 2;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t m = (n + 1) % count;
    const double cross = points[2 * n] * points[2 * m + 1] - points[2 * m] * points[2 * n + 1];
    for (const std::size_t axis : {std::size_t{0}, std::size_t{1}})
      sum[axis] += (points[2 * n + axis] + points[2 * m + axis]) * cross / (6 * area);
  }
  return sum;
}

// Twice the area of the triangle of three points, positive when they run counter-clockwise.
double turn(const double* a, const double* b, const double* c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// The first two edges that cross each other, counted from 0.
std::optional<std::array<std::size_t, 2>> crossing_edges(const std::vector<double>& points) {
  const std::size_t count = points.size() / 2;
  constexpr std::size_t too_many = 4000;  // every edge is compared with every other
  if (count > too_many) return std::nullopt;
  for (std::size_t n = 0; n < count; ++n) {
    const double* a = &points[2 * n];
    const double* b = &points[2 * ((n + 1) % count)];
    for (std::size_t m = n + 2; m < count; ++m) {
      const double* c = &points[2 * m];
      const double* d = &points[2 * ((m + 1) % count)];
      if (turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0)
        return std::array<std::size_t, 2>{n, m};
    }
  }
  return std::nullopt;
}

struct Extent {
  std::array<double, 3> low{};
  std::array<double, 3> high{};
};

void warn_about_size(const Extent& extent, int number, const FluidScene& result, Plan& plan) {
  const Grid& grid = result.flow.grid;
  const int dimension = grid.dimension();
  if (grid.nx == 0) return;  // a problem was noted
  double smallest = extent.high[0] - extent.low[0];
  for (std::size_t axis = 1; axis < static_cast<std::size_t>(dimension); ++axis) {
    smallest = std::min(smallest, extent.high[axis] - extent.low[axis]);
  }
  smallest /= grid.spacing;
  if (smallest < fewest_spacings * (1 - 1e-9)) {
    plan.warnings.push_back(fmt::format(
        "obstacle {} is {:.3g} spacings across; below 4 its shape is hardly seen", number, smallest));
  }
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  const auto to_lattice = [&](std::size_t axis, double at) {
    return axis == 0 ? grid.to_lattice_x(at) : (axis == 1 ? grid.to_lattice_y(at) : grid.to_lattice_z(at));
  };
  for (int s = 0; s < side_count(dimension); ++s) {
    const auto axis = static_cast<std::size_t>(s / 2);
    const SideKind kind = result.flow.sides[static_cast<std::size_t>(s)].kind;
    const double other_end = to_lattice(axis, s % 2 == 0 ? extent.high[axis] : extent.low[axis]);
    const bool beyond = s % 2 == 0 ? other_end < -0.5 : other_end > counts[axis] - 0.5;
    if (kind != SideKind::periodic && beyond) {
      plan.warnings.push_back(fmt::format("obstacle {} lies wholly beyond the {} side and is not there",
                                          number, side_names[static_cast<std::size_t>(s)]));
      return;
    }
  }
  for (int s = 0; s < side_count(dimension); ++s) {
    const auto axis = static_cast<std::size_t>(s / 2);
    const double at = to_lattice(axis, s % 2 == 0 ? extent.low[axis] : extent.high[axis]);
    const double gap = s % 2 == 0 ? at + 0.5 : counts[axis] - 0.5 - at;
    if (result.flow.sides[static_cast<std::size_t>(s)].kind == SideKind::wall && gap > 0.01 &&
        gap < fewest_spacings) {
      plan.warnings.push_back(
          fmt::format("the gap between obstacle {} and the {} wall is {:.3g} spacings; below 4 the "
                      "flow through it is inaccurate",
                      number, side_names[static_cast<std::size_t>(s)], gap));
    }
  }
}

void read_polygon(SceneTable& table, std::string_view key, const std::vector<double>& points, int number,
                  FluidScene& result, Plan& plan) {
  const std::size_t count = points.size() / 2;
  if (count < 3) {
    if (!points.empty()) table.problem(key, "an outline needs at least three points");
    return;
  }
  if (const auto crossing = crossing_edges(points)) {
    table.problem(key,
                  fmt::format("the edges after the points {} and {} cross: an outline must not cut itself",
                              (*crossing)[0] + 1, (*crossing)[1] + 1));
    return;
  }
  const double area = signed_area(points);
  if (!(area < 0)) {
    table.problem(key, area > 0
                           ? "the points run counter-clockwise, which would put the fluid inside: list them "
                             "clockwise"
                           : "the outline encloses no area");
    return;
  }
  if (table.has("wall_rule")) result.outline_rule = read_wall_rule(table, WallRule::linear);
  const auto first = static_cast<std::uint32_t>(result.obstacle_positions.size() / 2);
  result.obstacle_positions.insert(result.obstacle_positions.end(), points.begin(), points.end());
  result.obstacle_of_point.insert(result.obstacle_of_point.end(), count,
                                  static_cast<std::uint32_t>(number - 1));
  result.fixed_obstacles.back().centre = centroid(points, area);
  Extent extent{{points[0], points[1], 0}, {points[0], points[1], 0}};
  for (std::uint32_t n = 0; n < count; ++n) {
    result.obstacle_connectivity.insert(result.obstacle_connectivity.end(),
                                        {first + n, first + (n + 1) % static_cast<std::uint32_t>(count)});
    for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
      extent.low[axis] = std::min(extent.low[axis], points[2 * n + axis]);
      extent.high[axis] = std::max(extent.high[axis], points[2 * n + axis]);
    }
  }
  warn_about_size(extent, number, result, plan);
}

void add_solid(FluidScene& result, const std::function<bool(double, double, double)>& inside) {
  const Grid& grid = result.flow.grid;
  if (grid.nx == 0) return;  // a problem was noted
  result.solid_nodes.resize(grid.size(), 0);
  for (int z = 0; z < grid.layers(); ++z) {
    for (int y = 0; y < grid.ny; ++y) {
      for (int x = 0; x < grid.nx; ++x) {
        if (inside(grid.x(x), grid.y(y), grid.nz > 0 ? grid.z(z) : 0.0)) {
          result.solid_nodes[grid.index(x, y, z)] = static_cast<std::uint16_t>(result.fixed_obstacles.size());
        }
      }
    }
  }
}

void read_box(SceneTable& table, int number, FluidScene& result, Plan& plan) {
  const auto dimension = static_cast<std::size_t>(result.dimension());
  const auto corners = table.points("box", dimension);
  if (corners.size() != 2 * dimension) {
    if (!corners.empty()) table.problem("box", "a box has two opposite corners");
    return;
  }
  Extent extent;
  for (std::size_t axis = 0; axis < dimension; ++axis) {
    extent.low[axis] = std::min(corners[axis], corners[dimension + axis]);
    extent.high[axis] = std::max(corners[axis], corners[dimension + axis]);
  }
  if (dimension == 2) {
    read_polygon(table, "box",
                 {extent.low[0], extent.low[1], extent.low[0], extent.high[1], extent.high[0], extent.high[1],
                  extent.high[0], extent.low[1]},
                 number, result, plan);
    return;
  }
  for (std::size_t axis = 0; axis < dimension; ++axis)
    result.fixed_obstacles.back().centre[axis] = 0.5 * (extent.low[axis] + extent.high[axis]);
  warn_about_size(extent, number, result, plan);
  add_solid(result, [&](double x, double y, double z) {
    return x >= extent.low[0] && x <= extent.high[0] && y >= extent.low[1] && y <= extent.high[1] &&
           z >= extent.low[2] && z <= extent.high[2];
  });
}

void read_image(SceneTable& table, FluidScene& result) {
  static constexpr std::array<std::string_view, 2> solids{"dark", "bright"};
  const std::string file = table.file("image");
  const auto corner = table.numbers("corner", 2);
  const double pixel = table.number("pixel", Range::positive());
  const double threshold = table.number_or("threshold", 128, {0.0, 256.0, false});
  const bool dark = table.choice("solid", solids) == "dark";
  const bool flip_x = table.boolean_or("flip_x", false);
  const bool flip_y = table.boolean_or("flip_y", false);
  if (result.dimension() == 3) {
    table.problem("image", "an image makes an obstacle in two dimensions only");
    return;
  }
  if (file.empty() || corner.size() != 2 || !(pixel > 0)) return;
  try {
    const GreyImage image = read_grey_image(file);
    result.fixed_obstacles.back().centre = {corner[0] + 0.5 * pixel * static_cast<double>(image.width),
                                            corner[1] + 0.5 * pixel * static_cast<double>(image.height), 0.0};
    add_solid(result, [&](double x, double y, double) {
      auto column = static_cast<std::int64_t>(std::floor((x - corner[0]) / pixel));
      auto row = image.height - 1 - static_cast<std::int64_t>(std::floor((y - corner[1]) / pixel));
      if (column < 0 || column >= image.width || row < 0 || row >= image.height) return false;
      if (flip_x) column = image.width - 1 - column;
      if (flip_y) row = image.height - 1 - row;
      return (image.values[static_cast<std::size_t>(row * image.width + column)] < threshold) == dark;
    });
  } catch (const std::runtime_error& error) {
    table.problem("image", error.what());
  }
}

// [centre, radius] of one disc or sphere.
void add_round(SceneTable& table, std::string_view key, std::span<const double> values, int number,
               const RoundObstacle& like, FluidScene& result, Plan& plan) {
  RoundObstacle obstacle;
  obstacle.name = like.name;
  obstacle.rule = like.rule;
  obstacle.surface_velocity = like.surface_velocity;
  obstacle.spin = like.spin;
  for (const Expression& expression : like.displacement)
    obstacle.displacement.emplace_back(expression.text());
  std::copy(values.begin(), values.end() - 1, obstacle.centre.begin());
  obstacle.radius = values.back();
  if (!(obstacle.radius > 0)) {
    table.problem(key, fmt::format("a radius of {:g} m is not positive", obstacle.radius));
    return;
  }
  Extent extent;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    extent.low[axis] = obstacle.centre[axis] - obstacle.radius;
    extent.high[axis] = obstacle.centre[axis] + obstacle.radius;
  }
  warn_about_size(extent, number, result, plan);
  result.round_obstacles.push_back(std::move(obstacle));
}

void read_round(SceneTable& table, int number, FluidScene& result, Plan& plan) {
  const int dimension = result.dimension();
  const auto components = static_cast<std::size_t>(dimension);
  const std::string single = dimension == 3 ? "sphere" : "disc";
  const std::string several = dimension == 3 ? "spheres" : "discs";
  RoundObstacle like;
  like.rule = read_wall_rule(table, WallRule::linear);
  if (table.has("displacement")) like.displacement = parse_expressions(table, "displacement", dimension);
  if (table.has("surface_velocity")) {
    const auto velocity = table.numbers("surface_velocity", components);
    std::copy(velocity.begin(), velocity.end(), like.surface_velocity.begin());
  }
  if (table.has("spin")) {
    if (dimension == 3) {
      const auto spin = table.numbers("spin", 3);
      std::copy(spin.begin(), spin.end(), like.spin.begin());
    } else {
      like.spin[2] = table.number("spin");
    }
  }
  like.name = table.text_or("name", "");
  if (table.has(single)) {
    const auto values = table.numbers(single, components + 1);
    if (values.size() == components + 1) add_round(table, single, values, number, like, result, plan);
    return;
  }
  const auto values = table.points(several, components + 1);
  for (std::size_t k = 0; k + components < values.size(); k += components + 1) {
    add_round(table, several, {&values[k], components + 1}, number, like, result, plan);
  }
}

}  // namespace

void read_obstacles(SceneTable& fluid, FluidScene& result, Plan& plan) {
  int number = 0;
  for (auto& table : fluid.tables("obstacle")) {
    ++number;
    result.fixed_obstacles.emplace_back();
    if (number > std::numeric_limits<std::uint16_t>::max()) {
      table.problem("", "too many obstacles; use `discs` or `spheres`");
      return;
    }
    std::vector<std::string_view> found;
    for (const std::string_view key : {"polygon", "box", "image", "disc", "discs", "sphere", "spheres"}) {
      if (table.has(key)) found.push_back(key);
    }
    if (found.size() != 1) {
      table.problem("",
                    "an obstacle has one of `polygon`, `box`, `image`, `disc`, `discs`, `sphere`, `spheres`");
      continue;
    }
    const std::string_view kind = found.front();
    if (!kind.starts_with("disc") && !kind.starts_with("sphere"))
      result.fixed_obstacles.back().name = table.text_or("name", "");
    const bool of_space = kind.starts_with("sphere");
    const bool of_plane = kind.starts_with("disc") || kind == "polygon";
    if (result.flow.grid.nx == 0) continue;  // its dimension is not known, and a problem was noted
    if ((of_space && result.dimension() == 2) || (of_plane && result.dimension() == 3)) {
      table.problem(kind, fmt::format("there is no {} in {} dimensions", kind, result.dimension()));
      continue;
    }
    if (kind == "polygon") {
      read_polygon(table, kind, table.points("polygon", 2), number, result, plan);
    } else if (kind == "box") {
      read_box(table, number, result, plan);
    } else if (kind == "image") {
      read_image(table, result);
    } else {
      read_round(table, number, result, plan);
    }
  }
  if (result.dimension() == 2 && !result.solid_nodes.empty() &&
      std::all_of(result.solid_nodes.begin(), result.solid_nodes.end(),
                  [](std::uint16_t s) { return s == 0; })) {
    plan.warnings.emplace_back("no node lies in the solid of the image: see `corner`, `pixel`, `threshold`");
  }
}

}  // namespace estuary::fluid
